"""Pairs of shapes that may collide: of two bodies of a robot, or of a robot and a scene."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from freefloat.errors import ModelError
from freefloat.limits.collision_shapes import (
    CollisionShape,
    all_shapes,
    shapes_of_bodies,
    shapes_of_links,
)
from freefloat.limits.held_pairs import (
    HeldPairs,
    always_near,
    held_pairs,
    sampled_configurations,
    uncompared_links,
)
from freefloat.robot.joint_values import INERTIAL
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.rigid_bodies import se3_of
from freefloat.scene.scene import Scene
from freefloat.so3 import UPRIGHT, Array, IntArray, Pose

_NO_SCENE = Scene()
_TOUCHING = 1e-9
"""Distance of nearest points below which they have no direction [m]."""


class CollisionPairs:
    """Pairs of shapes on different bodies, and their distances.

    Links that a joint connects are left out, moving or held, and links of SRDF's
    ``disable_collisions``. So are pairs of links at most the clearance apart in each of 1024
    sampled configurations; they are not checked and are named in :attr:`left_out`. Of the pairs
    whose distance is constant, because only held joints separate them, the nearest stands for all.
    Pairs of a link and a body of the scene are left out where they may touch.

    Attributes:
        model: The robot.
        scene: The scene; without bodies the distances depend on the joints alone.
        shapes: The shapes of the robot, then the shapes of the scene.
        pairs: Indices of two shapes each, the first on the body nearer to the spacecraft, the
            second one perhaps on a body of the scene, (P, 2).
        clearance: The clearance [m].
        left_out: Pairs of links that are always too near, and of a body that is held with another
            body of the scene, ``"a - b: why"``, and links with mass but without shape, which no
            body is the shape of, or whose shapes cannot be used, ``"a: why"``.
    """

    def __init__(
        self,
        model: FreeFloatingModel,
        clearance: float = 0.0,
        scene: Scene = _NO_SCENE,
        *,
        stated: bool = True,
    ) -> None:
        """Choose the pairs of a robot and a scene that can be farther apart than a clearance [m].

        Args:
            model: The robot.
            clearance: The clearance [m].
            scene: The scene.
            stated: Whether the clearance was asked for. Otherwise only ``<collision>`` shapes count
                and shapes that cannot be used are left out; there may be no pair.

        Raises:
            ModelError: If a shape cannot be read, or there is no pair.
        """
        self.model, self.scene, self.clearance = model, scene, clearance
        links = shapes_of_links(model, visuals=stated)
        owners = (*links, *shapes_of_bodies(scene, len(model.bodies)))
        if stated:
            all_shapes(owners)  # or the error of one
        robot = [shape for owner in links for shape in owner.shapes]
        self.shapes = tuple(shape for owner in owners for shape in owner.shapes)
        self._scene_shapes = [
            (number, shape.body - len(model.bodies), se3_of(shape.placement))
            for number, shape in enumerate(self.shapes)
            if shape.body > model.dof
        ]
        own, held = _pairs_of_links(model, robot), held_pairs(model, robot, clearance)
        listed = [*own, *held.compared[:1], *self._pairs_with_scene(robot)]
        candidates = np.array(listed, dtype=np.int64).reshape(-1, 2)
        self._geometry = self._geometry_model(candidates)
        near = self._always_near(own, len(candidates), clearance)
        self.pairs: IntArray = candidates[~near]
        self._numbers = np.flatnonzero(~near)
        too_near = [*candidates[near].tolist(), *held.always_near]
        reasons = {owner.name: owner.error.problem for owner in owners if owner.error is not None}
        for name in _without_shape(model, robot, scene):
            reasons.setdefault(name, "without shape" if stated else "without collision shape")
        unusable = [f"{name}: {reason}" for name, reason in reasons.items()]
        self.left_out = (*self._too_near(too_near, held), *unusable, *_not_compared(scene))
        if stated and not len(self.pairs):
            problem = "the robot has no two shapes that could collide"
            accepted = "a URDF with <collision> or <visual> shapes"
            if near.any():
                problem = f"no two shapes of the robot are ever farther than {clearance:g} m apart"
                accepted = "a smaller distance"
            raise ModelError("limits.clearance", problem, accepted, model.description.source)

    def name(self, pair: int) -> str:
        """Links of a pair, ``"a - b"``."""
        return self._name(self.pairs[pair])

    def links(self, pair: int) -> tuple[str, str]:
        """The two links of a pair, or a link and a body of the scene."""
        first, second = (self.shapes[index].link for index in self.pairs[pair])
        return first, second

    def _name(self, pair: Sequence[int] | IntArray) -> str:
        return " - ".join(self.shapes[index].link for index in pair)

    def distances(
        self,
        joints: npt.ArrayLike,
        pairs: IntArray,
        attitude: npt.ArrayLike = UPRIGHT,
        poses: Sequence[Pose] = (),
    ) -> Array:
        """Distances of pairs in a configuration.

        Args:
            joints: Joint values [rad or m], shape (n,).
            pairs: Indices into :attr:`pairs`, shape (K,).
            attitude: Attitude of the spacecraft, x, y, z, w; used for a scene with bodies only.
            poses: Frames of the bodies of the scene in the inertial frame.

        Returns:
            [m], shape (K,); of shapes that overlap, minus the penetration depth.
        """
        q = np.concatenate([INERTIAL, np.asarray(joints)])
        if poses:
            q = self.model.configuration(attitude, joints)
            self._move_scene(list(map(se3_of, poses)))
        return self._distances(q, self._numbers[pairs])

    def nearest(
        self,
        joints: Array,
        rows: IntArray,
        pairs: IntArray,
        placed: tuple[Array, Array],
        below: Array,
    ) -> tuple[Array, Array, Array]:
        """Distances of pairs in some configurations, with the directions between nearest points.

        Args:
            joints: Joint values [rad or m], shape (E, n).
            rows: Configuration of each distance, in ascending order, shape (K,).
            pairs: Index into :attr:`pairs` of each distance, shape (K,).
            placed: The S bodies of the scene in the spacecraft frame: rotations (E, S, 3, 3) and
                positions (E, S, 3) [m].
            below: Distances [m] from which directions and points are left out, shape (K,): they are
                zero.

        Returns:
            Distances as :meth:`distances` has, shape (K,); unit vectors from the first shapes to
            the second ones, spacecraft frame, shape (K, 3), along which the distances grow; the
            nearest points [m], shape (K, 2, 3).
        """
        model, (shapes, data) = self.model, self._geometry
        configurations = np.hstack([np.tile(INERTIAL, (len(joints), 1)), joints])
        distances = np.empty(len(pairs))
        normals, points = np.zeros((len(pairs), 3)), np.zeros((len(pairs), 2, 3))
        last, each = -1, zip(rows.tolist(), self._numbers[pairs].tolist(), below, strict=True)
        for number, (row, candidate, least) in enumerate(each):
            if row != last:
                last = row
                self._move_scene(list(map(pin.SE3, placed[0][row], placed[1][row])))
                q = configurations[row]
                pin.updateGeometryPlacements(model.pin_model, model.scratch, shapes, data, q)
            found = pin.computeDistance(shapes, data, candidate)
            distances[number] = found.min_distance
            if distances[number] < least:
                points[number] = found.getNearestPoint1(), found.getNearestPoint2()
                normals[number] = found.normal
        between = points[:, 1] - points[:, 0]
        lengths = np.linalg.norm(between, axis=1)
        far = lengths > _TOUCHING
        normals[far] = between[far] / np.copysign(lengths, distances)[far, None]
        return distances, normals, points

    @property
    def bodies(self) -> IntArray:
        """Numbers of the bodies of both shapes, bodies of a scene after the robot's, (P, 2)."""
        return np.array([shape.body for shape in self.shapes])[self.pairs]

    @property
    def spheres(self) -> tuple[Array, Array]:
        """Spheres around both shapes in the bodies' frames: centres (P, 2, 3), radii (P, 2) [m]."""
        points = [shape.points for shape in self.shapes]
        middles = [(p.min(axis=0) + p.max(axis=0)) / 2.0 for p in points]
        radii = [np.linalg.norm(p - c, axis=1).max() for p, c in zip(points, middles, strict=True)]
        return np.array(middles)[self.pairs], np.array(radii)[self.pairs]

    def _pairs_with_scene(self, robot: Sequence[CollisionShape]) -> list[tuple[int, int]]:
        """Pairs of a shape of the robot and a shape of the scene, but pairs that may touch."""
        bodies = self.scene.bodies
        may_touch = {(link, body.name) for body in bodies for link in body.touch_links}
        return [
            (i, j)
            for i, shape in enumerate(robot)
            for j, _, _ in self._scene_shapes
            if (shape.link, self.shapes[j].link) not in may_touch
        ]

    def _too_near(self, pairs: Sequence[Sequence[int]], held: HeldPairs) -> list[str]:
        """What is said of pairs of links that are always too near, and of pairs held so."""
        compared = {self._name(pair) for pair in (*self.pairs, *held.compared)}
        near = {
            f"{name}: {'parts are ' if name in compared else ''}always too near"
            for name in map(self._name, pairs)
        }
        unnamed = {
            f"{self._name(pair)}: too near with joints at zero that robot.held does not name"
            for pair in held.unnamed
        }
        return sorted(near | unnamed)

    def _move_scene(self, frames: Sequence[pin.SE3]) -> None:
        objects = self._geometry[0].geometryObjects
        for number, body, placement in self._scene_shapes if frames else ():
            objects[number].placement = frames[body] * placement

    def _distances(self, q: Array, candidates: IntArray) -> Array:
        """Distances of candidate pairs in a configuration of Pinocchio [m], shape (K,)."""
        model, (shapes, data) = self.model, self._geometry
        pin.updateGeometryPlacements(model.pin_model, model.scratch, shapes, data, q)
        pairs = candidates.tolist()
        return np.array([pin.computeDistance(shapes, data, pair).min_distance for pair in pairs])

    def _geometry_model(self, pairs: IntArray) -> tuple[Any, Any]:
        """Pinocchio's geometry model with collision pairs, and its data."""
        geometry = pin.GeometryModel()
        for number, shape in enumerate(self.shapes):
            parent = 0 if shape.body > self.model.dof else shape.body + 1
            at, name = se3_of(shape.placement), f"{number}"
            geometry.addGeometryObject(pin.GeometryObject(name, parent, at, shape.geometry))
        for first, second in pairs.tolist():
            geometry.addCollisionPair(pin.CollisionPair(first, second))
        data = geometry.createData()
        for number in range(len(pairs)):  # requests of Pinocchio begin where the last ended
            data.distanceRequests[number] = coal.DistanceRequest()
        return geometry, data

    def _always_near(
        self, own: Sequence[tuple[int, int]], count: int, clearance: float
    ) -> npt.NDArray[np.bool_]:
        """Which of the first candidates, pairs of links, are always too near."""
        near = np.arange(len(own))
        for q in sampled_configurations(*self.model.joint_ranges):
            if not len(near):
                break
            near = near[self._distances(q, near) <= clearance]
        pairs = [own[number] for number in near.tolist()]
        robot = [shape for shape in self.shapes if shape.body <= self.model.dof]
        always = always_near(self.model, robot, pairs, clearance)
        return np.isin(np.arange(count), near[always])


def _pairs_of_links(
    model: FreeFloatingModel, robot: Sequence[CollisionShape]
) -> list[tuple[int, int]]:
    """Pairs of shapes on different bodies of a robot, but of links that are not compared."""
    uncompared = uncompared_links(model.description)
    return [
        (i, j) if a.body < b.body else (j, i)
        for (i, a), (j, b) in itertools.combinations(enumerate(robot), 2)
        if a.body != b.body and frozenset((a.link, b.link)) not in uncompared
    ]


def _without_shape(
    model: FreeFloatingModel, robot: Sequence[CollisionShape], scene: Scene
) -> list[str]:
    """Links with mass that neither have a shape nor are a body of the scene."""
    shaped = {shape.link for shape in robot} | {body.payload for body in scene.bodies}
    links = [link for link in model.description.links if link.mass > 0.0]
    return [link.name for link in links if link.name not in shaped]


def _not_compared(scene: Scene) -> list[str]:
    """What is said of a body that is held and another body."""
    return [
        f"{body.name} - {other.name}: a held body and another body are not compared"
        for body, other in itertools.product(scene.bodies, repeat=2)
        if body.payload is not None and other.payload is None
    ]
