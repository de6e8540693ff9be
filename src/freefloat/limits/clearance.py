"""The smallest distance between bodies along a motion, found by branch and bound.

Between two configurations the distance of a pair changes by at most the path lengths of its joints
times their levers. Intervals in which the distance may fall below the smallest one known are
bisected until none is left, so that no contact between samples is missed.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from numpy.polynomial import chebyshev
from scipy.optimize import minimize_scalar

from freefloat.errors import ModelError
from freefloat.limits.collision import CollisionShape, collision_shapes
from freefloat.motion.motion import Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray, low_discrepancy

TOLERANCE = 1e-4
"""Bound of the error before the final refinement [m]."""
_PARTS = 16
"""Parts of a panel in each of which the joint speeds are bounded."""
_ROUNDING = 1e-9
"""Rounding error of distances [m]."""
_STARTS = 2
"""Initial intervals of a panel."""
_CONFIGURATIONS = 1024
"""Sampled configurations; pairs that are too near in all of them are left out."""
_BASE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


class CollisionPairs:
    """Pairs of shapes on different bodies, and their distances.

    Links that a moving joint connects are left out. So are pairs at most the clearance apart in
    each of 1024 sampled configurations; they are not checked and are named in :attr:`left_out`.

    Attributes:
        pairs: Indices of two shapes each, the first on the body nearer to the spacecraft, (P, 2).
        left_out: Pairs of links that are always too near, ``"a - b: why"``, and links with mass
            but without shape, ``"a: why"``.
        links_left_out: Links of these pairs.
    """

    def __init__(
        self, model: FreeFloatingModel, clearance: float = 0.0, hulls: Collection[str] = ()
    ) -> None:
        """Choose the pairs of a robot that can be farther apart than a clearance [m].

        Args:
            model: The robot.
            clearance: The clearance [m].
            hulls: Links whose meshes are not divided into convex parts.

        Raises:
            ModelError: If a shape cannot be read, or there is no pair.
        """
        self._model, self._shapes = model, collision_shapes(model, hulls)
        connected = {frozenset((joint.parent, joint.child)) for joint in model.moving_joints}
        candidates = np.array([
            (i, j) if a.body < b.body else (j, i)
            for (i, a), (j, b) in itertools.combinations(enumerate(self._shapes), 2)
            if a.body != b.body and frozenset((a.link, b.link)) not in connected
        ], dtype=np.int64).reshape(-1, 2)  # fmt: skip
        self._geometry = self._geometry_model(candidates)
        near = self._always_near(len(candidates), clearance)
        self.pairs: IntArray = candidates[~near]
        self._numbers = np.flatnonzero(~near)
        names = set(map(self._links, self.pairs))
        self.links_left_out = {self._shapes[index].link for index in candidates[near].ravel()}
        shaped = {shape.link for shape in self._shapes}
        self.left_out = tuple(sorted({
            f"{name}: {'parts are ' if name in names else ''}always too near"
            for name in map(self._links, candidates[near])
        })) + tuple(
            f"{link.name}: without shape"
            for link in model.description.links if link.mass > 0.0 and link.name not in shaped
        )  # fmt: skip
        if not len(self.pairs):
            problem = "the robot has no two shapes that could collide"
            accepted = "a URDF with <collision> or <visual> shapes"
            if near.any():
                problem = f"no two shapes of the robot are ever farther than {clearance:g} m apart"
                accepted = "a smaller distance"
            source = model.description.source
            raise ModelError("limits.clearance", problem, accepted, source)

    def name(self, pair: int) -> str:
        """Links of a pair, ``"a - b"``."""
        return self._links(self.pairs[pair])

    def _links(self, pair: Sequence[int] | IntArray) -> str:
        return " - ".join(self._shapes[index].link for index in pair)

    def distances(self, joints: npt.ArrayLike, pairs: IntArray) -> Array:
        """Distances of pairs in a configuration.

        Args:
            joints: Joint values [rad or m], shape (n,).
            pairs: Indices into :attr:`pairs`, shape (K,).

        Returns:
            [m], shape (K,); of shapes that overlap, minus the penetration depth.
        """
        return self._distances(joints, self._numbers[pairs])

    def _distances(self, joints: npt.ArrayLike, candidates: IntArray) -> Array:
        """Distances of candidate pairs [m], shape (K,)."""
        model, (shapes, data) = self._model, self._geometry
        q = np.concatenate([_BASE, np.asarray(joints)])
        pin.updateGeometryPlacements(model.pin_model, model.scratch, shapes, data, q)
        pairs = candidates.tolist()
        return np.array([pin.computeDistance(shapes, data, pair).min_distance for pair in pairs])

    def _geometry_model(self, pairs: IntArray) -> tuple[Any, Any]:
        """Pinocchio's geometry model with collision pairs, and its data."""
        geometry = pin.GeometryModel()
        for number, shape in enumerate(self._shapes):
            pose = pin.SE3(shape.placement.rotation, shape.placement.position)
            geometry.addGeometryObject(
                pin.GeometryObject(f"{number}", shape.body + 1, pose, shape.geometry)
            )
        for first, second in pairs.tolist():
            geometry.addCollisionPair(pin.CollisionPair(first, second))
        return geometry, geometry.createData()

    def _always_near(self, count: int, clearance: float) -> npt.NDArray[np.bool_]:
        """Which candidates are at most the clearance apart in all sampled configurations."""
        near = np.arange(count)
        lower, upper = self._model.joint_ranges
        low = np.where(np.isfinite(lower), lower, -np.pi)
        high = np.where(np.isfinite(upper), upper, np.pi)
        for fraction in low_discrepancy(_CONFIGURATIONS, self._model.dof):
            if not len(near):
                break
            near = near[self._distances(low + fraction * (high - low), near) <= clearance]
        return np.isin(np.arange(count), near)

    def levers(self, strokes: Array) -> Array:
        """Bounds of the derivatives of the distances by the joint values.

        A revolute joint moves the nearest points by no more than their distance from its axis; of
        the two shapes the nearer one counts, because only their relative motion matters.

        Args:
            strokes: Largest magnitudes of the prismatic joints' values [m], shape (n,).

        Returns:
            [m/rad or m/m], shape (P, n).
        """
        reach = np.array([self._reach(shape, strokes) for shape in self._shapes])
        first, second = self.pairs.T
        bodies = np.array([shape.body for shape in self._shapes])
        joints = np.arange(1, self._model.dof + 1)
        between = (joints > bodies[first][:, None]) & (joints <= bodies[second][:, None])
        revolute = np.minimum(reach[first], reach[second])
        return np.where(between, np.where(self._model.prismatic, 1.0, revolute), 0.0)

    def _reach(self, shape: CollisionShape, strokes: Array) -> Array:
        """Bounds of the distances of a shape's points from every joint axis [m], shape (n,)."""
        arm = self._model.bodies[1:]
        steps = np.array([np.linalg.norm(body.placement.position) for body in arm])
        lengths = steps + np.where(self._model.prismatic, strokes, 0.0)
        radius = np.linalg.norm(shape.points, axis=1).max()
        reach = np.empty(len(arm))
        for k, body in enumerate(arm, start=1):
            if k == shape.body:
                reach[k - 1] = _from_axis(shape.points, body.axis)
            elif k == shape.body + 1:
                pose = body.placement
                points = shape.points - pose.position
                reach[k - 1] = _from_axis(points, pose.rotation @ body.axis)
            else:
                reach[k - 1] = radius + lengths[min(k, shape.body) : max(k, shape.body)].sum()
        return reach


def _from_axis(points: Array, axis: Array) -> float:
    """Distance of the farthest point from an axis through the origin [m]."""
    across = points - np.outer(points @ axis, axis)
    return float(np.linalg.norm(across, axis=1).max())


@dataclass(frozen=True)
class Clearance:
    """The smallest distance between two bodies.

    Attributes:
        distance: [m]; negative where they overlap.
        pair: Index of the pair.
        time: Time of the smallest distance [s].
    """

    distance: float
    pair: int
    time: float


def clearance(
    motion: Motion, pairs: CollisionPairs, below: float = np.inf, *, decide_only: bool = False
) -> Clearance:
    """The smallest distance of any pair along a motion.

    Args:
        motion: The motion.
        pairs: Pairs of its robot.
        below: Distances of interest [m]; a larger result need not be the smallest.
        decide_only: End the search at the first distance below that.
    """
    edges, lengths = _path_lengths(motion)
    levers = pairs.levers(np.abs(motion.joints).max(axis=0))
    every, panels = np.arange(len(pairs.pairs)), float(motion.panels)
    places = np.linspace(0.0, panels, _STARTS * motion.panels + 1)
    middle, pair = np.repeat(places, len(every)), np.tile(every, len(places))
    distance = _distances(motion, pairs, middle, pair)
    best = distance.argmin()
    low, high = np.clip(middle[best] + np.array([-1.0, 1.0]) / _STARTS, 0.0, panels)
    nearest = (distance[best], pair[best], middle[best], low, high)
    low, high = (np.repeat(ends, len(every)) for ends in (places[:-1], places[1:]))
    before, after = distance[: -len(every)], distance[len(every) :]
    pair = pair[len(every) :]
    while len(pair) and not (decide_only and nearest[0] < below):
        change = np.zeros(len(pair))
        for k, path in enumerate(lengths.T):
            change += levers[pair, k] * (np.interp(high, edges, path) - np.interp(low, edges, path))
        kept = (before + after - change) / 2.0 < min(nearest[0] - TOLERANCE, below)
        if not kept.any():
            break
        pair, low, high, before, after = (x[kept] for x in (pair, low, high, before, after))
        middle = (low + high) / 2.0
        distance = _distances(motion, pairs, middle, pair)
        best = distance.argmin()
        if distance[best] < nearest[0]:
            nearest = (distance[best], pair[best], middle[best], low[best], high[best])
        pair = np.tile(pair, 2)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        before, after = np.concatenate([before, distance]), np.concatenate([distance, after])
    smallest, number, place, start, end = nearest
    if nearest[0] < below and not decide_only and start < end:
        only = np.array([number])
        refined = minimize_scalar(
            lambda u: _distances(motion, pairs, np.array([u]), only)[0],
            bounds=(start, end), method="bounded", options={"xatol": 1e-9},
        )  # fmt: skip
        if refined.fun < smallest - _ROUNDING:
            smallest, place = refined.fun, refined.x
    return Clearance(float(smallest), int(number), motion.time_at(place))


def _distances(motion: Motion, pairs: CollisionPairs, places: Array, pair: IntArray) -> Array:
    """Distances of pairs at panel coordinates, shape (K,) each; every place is evaluated once."""
    distances = np.empty(len(pair))
    unique, number = np.unique(places, return_inverse=True)
    order = np.argsort(number, kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(number, minlength=len(unique)))[:-1])
    for joints, group in zip(motion.evaluate(unique)[2], groups, strict=True):
        distances[group] = pairs.distances(joints, pair[group])
    return distances


def _path_lengths(motion: Motion) -> tuple[Array, Array]:
    """Bounds of the joints' path lengths: places (K,) and lengths from the start [rad or m] (K, n).

    In each part of a panel a joint's speed is at most that at the faster end plus its largest
    acceleration times half the part.
    """
    edges = np.linspace(0.0, motion.panels, _PARTS * motion.panels + 1)
    x = np.linspace(-1.0, 1.0, _PARTS + 1)
    c = np.moveaxis(motion.coefficients[:, :, 5:], 1, 0)
    speeds = np.abs(np.moveaxis(chebyshev.chebval(x, chebyshev.chebder(c)), -1, 1))
    accelerations = np.abs(chebyshev.chebval(x, chebyshev.chebder(c, 2))).max(axis=-1)
    fastest = np.maximum(speeds[:, :-1], speeds[:, 1:]) + accelerations[:, None] / _PARTS
    steps = (fastest * 2.0 / _PARTS).reshape(-1, c.shape[-1])
    return edges, np.vstack([np.zeros(c.shape[-1]), np.cumsum(steps, axis=0)])
