"""Which bodies of a robot may touch, and how far apart they are."""

from __future__ import annotations

import itertools
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from freefloat.errors import ModelError
from freefloat.limits.collision_shapes import CollisionShape, collision_shapes
from freefloat.motion.joint_extents import joint_ranges
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray, low_discrepancy

_CONFIGURATIONS = 1024
"""In how many a pair must come too near, whatever the joints do, to be left out."""
_BASE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


class CollisionPairs:
    """Pairs of shapes of a robot that move against each other and should not touch.

    Shapes of one body never move against each other. Links joined by one joint are left out: they
    meet there. So are pairs that come nearer than the clearance in every configuration: they tell
    nothing of a motion.

    Attributes:
        shapes: All of them.
        pairs: Indices of two shapes each, the first on the body nearer to the spacecraft, (P, 2).
        left_out: Links that are not looked at although no joint joins them, ``"a - b: why"``.
    """

    def __init__(self, model: FreeFloatingModel, clearance: float = 0.0) -> None:
        """Read the shapes and choose the pairs.

        Args:
            model: Robot.
            clearance: Distance that is asked for [m].

        Raises:
            ModelError: If a shape cannot be read, or there is nothing that could touch.
        """
        self._model = model
        self.shapes = collision_shapes(model)
        joined = _joined_links(model)
        pairs = [
            (i, j) if a.body < b.body else (j, i)
            for (i, a), (j, b) in itertools.combinations(enumerate(self.shapes), 2)
            if a.body != b.body and frozenset((a.link, b.link)) not in joined
        ]
        near = self._always_near(pairs, clearance)
        apart = {self._told(pair) for pair in pairs if pair not in near}
        self.left_out = tuple(sorted({
            f"{name}: {'parts are ' if name in apart else ''}always too near"
            for name in map(self._told, near)
        }))  # fmt: skip
        self.pairs: IntArray = np.array(
            [pair for pair in pairs if pair not in near], dtype=np.int64
        ).reshape(-1, 2)
        if not len(self.pairs):
            told, way_out = "that could touch", "a URDF with <collision> or <visual> shapes"
            if near:
                told = f"that ever are farther than {clearance:g} m apart"
                way_out = "a smaller distance"
            raise ModelError(
                "limits.clearance", f"the robot has no two shapes {told}", way_out,
                model.description.source,
            )  # fmt: skip
        self._prepared = self._geometry(self.pairs.tolist())

    def name(self, pair: int) -> str:
        """Links of a pair, ``"a - b"``."""
        return self._told(self.pairs[pair].tolist())

    def _told(self, pair: list[int] | tuple[int, int]) -> str:
        return " - ".join(self.shapes[index].link for index in pair)

    def distances(self, joints: npt.ArrayLike, pairs: npt.ArrayLike) -> Array:
        """Distances of some pairs in a configuration.

        Args:
            joints: Joint values, shape (n,).
            pairs: Indices into :attr:`pairs`, shape (K,).

        Returns:
            [m], shape (K,); of shapes that overlap, minus the least shift that parts them.
        """
        return self._measured(self._prepared, joints, pairs)

    def _measured(self, prepared: Any, joints: npt.ArrayLike, pairs: npt.ArrayLike) -> Array:
        geometry, data = prepared
        model = self._model
        q = np.concatenate([_BASE, np.asarray(joints)])
        pin.updateGeometryPlacements(model.pin_model, model.scratch, geometry, data, q)
        return np.array([
            pin.computeDistance(geometry, data, int(pair)).min_distance
            for pair in np.asarray(pairs).tolist()
        ])  # fmt: skip

    def _geometry(self, pairs: list[Any]) -> tuple[Any, Any]:
        """Pinocchio's geometry of the reduced free-flyer model, and scratch memory for it."""
        geometry = pin.GeometryModel()
        for number, shape in enumerate(self.shapes):
            place = pin.SE3(shape.placement.rotation, shape.placement.position)
            geometry.addGeometryObject(
                pin.GeometryObject(f"{number}", shape.body + 1, place, shape.geometry)
            )
        for first, second in pairs:
            geometry.addCollisionPair(pin.CollisionPair(first, second))
        return geometry, geometry.createData()

    def _always_near(self, pairs: list[tuple[int, int]], clearance: float) -> set[tuple[int, int]]:
        prepared, left = self._geometry(pairs), np.arange(len(pairs))
        lower, upper = joint_ranges(self._model)
        low, high = (np.where(np.isfinite(end), end, side * np.pi)
                     for end, side in ((lower, -1.0), (upper, 1.0)))  # fmt: skip
        for share in low_discrepancy(_CONFIGURATIONS, self._model.dof):
            if not len(left):
                break
            near = self._measured(prepared, low + share * (high - low), left) <= clearance
            left = left[near]
        return {pairs[index] for index in left}

    @cached_property
    def _radii(self) -> Array:
        """Distance of every shape's farthest point from its body's joint frame [m], (S,)."""
        return np.array([np.linalg.norm(shape.points, axis=1).max() for shape in self.shapes])

    def levers(self, strokes: Array) -> Array:
        """How much a pair's distance changes at most when a joint moves by a unit.

        A turning joint moves the witness points by no more than their distance from its axis; the
        nearer of the two counts, because only the change of their distance does.

        Args:
            strokes: Largest magnitudes of the sliding joints' values along a motion [m], (n,).

        Returns:
            [m/rad or m/m], shape (P, n).
        """
        reach = np.array([self._reach(shape, i, strokes) for i, shape in enumerate(self.shapes)])
        first, second = self.pairs.T
        bodies = np.array([shape.body for shape in self.shapes])
        joints = np.arange(1, self._model.dof + 1)
        between = (joints > bodies[first][:, None]) & (joints <= bodies[second][:, None])
        sliding = np.array([body.prismatic for body in self._model.bodies[1:]])
        turned = np.minimum(reach[first], reach[second])
        return np.where(between, np.where(sliding, 1.0, turned), 0.0)

    def _reach(self, shape: CollisionShape, index: int, strokes: Array) -> Array:
        """Bounds of the distance of a shape's points from every joint's axis [m], shape (n,)."""
        bodies, radius = self._model.bodies, self._radii[index]
        steps = [float(np.linalg.norm(b.placement.position)) for b in bodies[1:]]
        lengths = np.array(steps) + np.where([b.prismatic for b in bodies[1:]], strokes, 0.0)
        reach = np.empty(len(lengths))
        for k in range(1, len(bodies)):
            if k == shape.body:
                reach[k - 1] = _from_axis(shape.points, bodies[k].axis)
            elif k == shape.body + 1:
                place = bodies[k].placement
                axis = place.rotation @ bodies[k].axis
                reach[k - 1] = _from_axis(shape.points - place.position, axis)
            else:
                reach[k - 1] = radius + lengths[min(k, shape.body) : max(k, shape.body)].sum()
        return reach


def _from_axis(points: Array, axis: Array) -> float:
    across = points - np.outer(points @ axis, axis)
    return float(np.linalg.norm(across, axis=1).max())


def _joined_links(model: FreeFloatingModel) -> set[frozenset[str]]:
    """Pairs of links that a moving joint connects."""
    return {frozenset((joint.parent, joint.child)) for joint in model.moving_joints}
