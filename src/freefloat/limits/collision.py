"""Collision shapes of a robot, the pairs of them that may collide, and their distances."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from freefloat.errors import ModelError
from freefloat.limits.convex_decomposition import convex_parts
from freefloat.motion.extrema import joint_ranges
from freefloat.robot.meshes import read_mesh
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import MeshFileError, find_mesh
from freefloat.robot.urdf import Box, Cylinder, LinkShape, MeshFile, Sphere
from freefloat.so3 import Array, IntArray, Pose, low_discrepancy

_CONFIGURATIONS = 1024
"""Sampled configurations; pairs that are too near in all of them are left out."""
_BASE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
_CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))

_Solid = tuple[Any, Array]
"""A coal geometry, and the vertices of a polytope around it, shape (V, 3)."""


@dataclass(frozen=True, eq=False)
class CollisionShape:
    """A convex shape of a link, or a convex part of one.

    Attributes:
        link: Name of the link.
        body: The rigid body that it is part of: 0 is the spacecraft, k is moved by joint k.
        placement: Its frame in the body's joint frame.
        geometry: The coal geometry.
        points: Vertices of a polytope around it, in the body's joint frame [m], shape (V, 3).
    """

    link: str
    body: int
    placement: Pose
    geometry: Any
    points: Array


def collision_shapes(model: FreeFloatingModel) -> tuple[CollisionShape, ...]:
    """Collision shapes of all links; visuals of links that have none.

    Raises:
        ModelError: If a shape cannot be read.
    """
    return tuple(_shapes(model))


def _shapes(model: FreeFloatingModel) -> Iterator[CollisionShape]:
    source = model.description.source
    for link in model.description.links:
        body, pose = model.link_places[link.name]
        for shape in link.collisions or link.visuals:
            try:
                solids = _solids(shape, source)
            except MeshFileError as error:
                accepted = "a box, cylinder or sphere of positive size, or a readable mesh file"
                key, problem = f"link {link.name}: <{shape.kind}>", f"no collision shape: {error}"
                raise ModelError(key, problem, accepted, source) from None
            at = pose @ shape.origin
            for geometry, points in solids:
                vertices = points @ at.rotation.T + at.position
                yield CollisionShape(link.name, body, at, geometry, vertices)


def _solids(shape: LinkShape, source: str) -> tuple[_Solid, ...]:
    match shape.geometry:
        case Box(size=size):
            return ((coal.Box(*size), _CORNERS * size / 2.0),)
        case Cylinder(radius=radius, length=length):
            half = np.array([radius, radius, length / 2.0])
            return ((coal.Cylinder(radius, length), _CORNERS * half),)
        case Sphere(radius=radius):
            return ((coal.Sphere(radius), _CORNERS * radius),)
        case MeshFile(filename=name, scale=scale):
            file = find_mesh(name, source)
            return _mesh_solids(file, file.stat().st_mtime_ns, *scale)
    raise MeshFileError("its <geometry> is unknown or has no size")


@lru_cache(maxsize=256)
def _mesh_solids(file: Path, _: int, *scale: float) -> tuple[_Solid, ...]:
    """The convex parts of a mesh file, cached until it changes."""
    meshes = [part.mesh for part in read_mesh(file, scale)]
    triangles = np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes])
    solids = []
    for part in convex_parts(triangles):
        points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        points.extend(list(part.points))
        faces.extend([coal.Triangle(*corners) for corners in part.faces.tolist()])
        solids.append((coal.Convex(points, faces), part.points))
    return tuple(solids)


class CollisionPairs:
    """Pairs of shapes on different bodies, and their distances.

    Links that a moving joint connects are left out, and pairs that are nearer than the clearance
    in every configuration.

    Attributes:
        shapes: The collision shapes.
        pairs: Indices of two shapes each, the first on the body nearer to the spacecraft, (P, 2).
        left_out: Pairs of links that are always too near, ``"a - b: why"``.
    """

    def __init__(self, model: FreeFloatingModel, clearance: float = 0.0) -> None:
        """Choose the pairs of a robot.

        Args:
            model: The robot.
            clearance: Required distance [m].

        Raises:
            ModelError: If a shape cannot be read, or there is no pair.
        """
        self._model = model
        self.shapes = collision_shapes(model)
        connected = {frozenset((joint.parent, joint.child)) for joint in model.moving_joints}
        candidates = [
            (i, j) if a.body < b.body else (j, i)
            for (i, a), (j, b) in itertools.combinations(enumerate(self.shapes), 2)
            if a.body != b.body and frozenset((a.link, b.link)) not in connected
        ]
        near = self._always_near(candidates, clearance)
        kept = [pair for pair in candidates if pair not in near]
        names = set(map(self._links, kept))
        self.left_out = tuple(sorted({
            f"{name}: {'parts are ' if name in names else ''}always too near"
            for name in map(self._links, near)
        }))  # fmt: skip
        if not kept:
            problem = "the robot has no two shapes that could collide"
            accepted = "a URDF with <collision> or <visual> shapes"
            if near:
                problem = f"no two shapes of the robot are ever farther than {clearance:g} m apart"
                accepted = "a smaller distance"
            source = model.description.source
            raise ModelError("limits.clearance", problem, accepted, source)
        self.pairs: IntArray = np.array(kept, dtype=np.int64)
        self._geometry = self._geometry_model(kept)

    def name(self, pair: int) -> str:
        """Links of a pair, ``"a - b"``."""
        return self._links(self.pairs[pair].tolist())

    def _links(self, pair: Sequence[int]) -> str:
        return " - ".join(self.shapes[index].link for index in pair)

    def distances(self, joints: npt.ArrayLike, pairs: npt.ArrayLike) -> Array:
        """Distances of pairs in a configuration.

        Args:
            joints: Joint values [rad or m], shape (n,).
            pairs: Indices into :attr:`pairs`, shape (K,).

        Returns:
            [m], shape (K,); of shapes that overlap, minus the penetration depth.
        """
        return self._measure(self._geometry, joints, pairs)

    def _measure(
        self, geometry: tuple[Any, Any], joints: npt.ArrayLike, pairs: npt.ArrayLike
    ) -> Array:
        model, (shapes, data) = self._model, geometry
        q = np.concatenate([_BASE, np.asarray(joints)])
        pin.updateGeometryPlacements(model.pin_model, model.scratch, shapes, data, q)
        return np.array([
            pin.computeDistance(shapes, data, pair).min_distance
            for pair in np.asarray(pairs).tolist()
        ])  # fmt: skip

    def _geometry_model(self, pairs: Sequence[tuple[int, int]]) -> tuple[Any, Any]:
        """Pinocchio's geometry model of some pairs, and its data."""
        geometry = pin.GeometryModel()
        for number, shape in enumerate(self.shapes):
            pose = pin.SE3(shape.placement.rotation, shape.placement.position)
            geometry.addGeometryObject(
                pin.GeometryObject(f"{number}", shape.body + 1, pose, shape.geometry)
            )
        for first, second in pairs:
            geometry.addCollisionPair(pin.CollisionPair(first, second))
        return geometry, geometry.createData()

    def _always_near(
        self, pairs: Sequence[tuple[int, int]], clearance: float
    ) -> set[tuple[int, int]]:
        """Pairs that are at most the clearance apart in all sampled configurations."""
        geometry, near = self._geometry_model(pairs), np.arange(len(pairs))
        lower, upper = joint_ranges(self._model)
        low = np.where(np.isfinite(lower), lower, -np.pi)
        high = np.where(np.isfinite(upper), upper, np.pi)
        for fraction in low_discrepancy(_CONFIGURATIONS, self._model.dof):
            if not len(near):
                break
            near = near[self._measure(geometry, low + fraction * (high - low), near) <= clearance]
        return {pairs[int(index)] for index in near}

    @cached_property
    def _radii(self) -> Array:
        """Distance of each shape's farthest point from its body's joint frame [m], (S,)."""
        return np.array([np.linalg.norm(shape.points, axis=1).max() for shape in self.shapes])

    def levers(self, strokes: Array) -> Array:
        """Bounds of the derivatives of the distances by the joint values.

        A revolute joint moves the nearest points by no more than their distance from its axis; of
        the two shapes the nearer one counts, because only their relative motion matters.

        Args:
            strokes: Largest magnitudes of the prismatic joints' values [m], shape (n,).

        Returns:
            [m/rad or m/m], shape (P, n).
        """
        reach = np.array([self._reach(shape, i, strokes) for i, shape in enumerate(self.shapes)])
        first, second = self.pairs.T
        bodies = np.array([shape.body for shape in self.shapes])
        joints = np.arange(1, self._model.dof + 1)
        between = (joints > bodies[first][:, None]) & (joints <= bodies[second][:, None])
        prismatic = np.array([body.prismatic for body in self._model.bodies[1:]])
        revolute = np.minimum(reach[first], reach[second])
        return np.where(between, np.where(prismatic, 1.0, revolute), 0.0)

    def _reach(self, shape: CollisionShape, index: int, strokes: Array) -> Array:
        """Bounds of the distances of a shape's points from every joint axis [m], shape (n,)."""
        bodies = self._model.bodies
        steps = np.array([np.linalg.norm(body.placement.position) for body in bodies[1:]])
        lengths = steps + np.where([body.prismatic for body in bodies[1:]], strokes, 0.0)
        reach = np.empty(len(lengths))
        for k in range(1, len(bodies)):
            if k == shape.body:
                reach[k - 1] = _from_axis(shape.points, bodies[k].axis)
            elif k == shape.body + 1:
                pose = bodies[k].placement
                reach[k - 1] = _from_axis(
                    shape.points - pose.position, pose.rotation @ bodies[k].axis
                )
            else:
                between = lengths[min(k, shape.body) : max(k, shape.body)]
                reach[k - 1] = self._radii[index] + between.sum()
        return reach


def _from_axis(points: Array, axis: Array) -> float:
    """Distance of the farthest point from an axis through the origin [m]."""
    across = points - np.outer(points @ axis, axis)
    return float(np.linalg.norm(across, axis=1).max())
