"""Many robots with the joints of one model, whose masses, inertias or mounts differ."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce

import numpy as np

from freefloat.dynamics.arm_factor import ArmPlane
from freefloat.dynamics.denavit_hartenberg import (
    LinkFrames,
    frames_at_zero,
    in_frame,
    inertial_row,
    joints_at_zero,
    link_frames,
    robot_properties,
)
from freefloat.dynamics.plane import Plane
from freefloat.ik.chain import dot
from freefloat.motion.problem import Problem
from freefloat.robot.description import IDENTITY
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import rotation_matrix
from freefloat.so3 import UPRIGHT, Array, BoolArray, IntArray, Pose

_PLANAR = 1e-9
"""Asymmetry relative to the whole inertia that counts as none."""


@dataclass(frozen=True, eq=False)
class Robots:
    """K robots with the joints of one model.

    Attributes:
        nominal: The model.
        frames: Link frames of the model.
        base: Link frame 0 of each robot in its spacecraft frame, rows as in
            :class:`.LinkFrames`, shape (K, 4, 3).
        bodies: Mass, first moment and inertia of the bodies in their link frames, (K, 1 + n, 10).
        numbers: Numbers of the robots, shape (K,).
        model_of: Builds the model of the robot with a number.
        offsets: How far from the nominal model's path the robots' paths begin [m], inertial axes,
            shape (K, 3); None where all have the same path.
    """

    nominal: FreeFloatingModel
    frames: LinkFrames
    base: Array = field(repr=False)
    bodies: Array = field(repr=False)
    numbers: IntArray = field(repr=False)
    model_of: Callable[[int], FreeFloatingModel]
    offsets: Array | None = field(default=None, repr=False)

    @classmethod
    def of(
        cls,
        nominal: FreeFloatingModel,
        numbers: IntArray,
        model_of: Callable[[int], FreeFloatingModel],
        *,
        factors: Mapping[str, Array],
        rows: Mapping[str, Array] | None = None,
        mounts: tuple[Pose, Array, Array] | None = None,
    ) -> Robots:
        """The robots that differ from a model in the masses and inertias of links, or in the mount.

        Args:
            nominal: The model.
            numbers: Numbers of the robots, shape (K,).
            model_of: Builds the model of the robot with a number.
            factors: Factors on mass and inertia of links, shape (K,), by name.
            rows: Rows of links in their frames, as :func:`.inertial_row` returns them, shape
                (K, 10), by name; the model's where left out.
            mounts: Where all but the root link is mounted on it: the model's pose, and the
                positions (K, 3) [m] and rotations (K, 3, 3) of the robots.
        """
        count, frames, rows = len(numbers), link_frames(nominal), rows or {}
        root = nominal.description.roots[0]
        base = np.broadcast_to(frames.base, (count, 4, 3))
        if mounts is not None:
            base = _moved(frames.base, *mounts)
        bodies = np.tile(frames.bodies, (count, 1, 1))
        moved = () if mounts is None else (root,)
        for name in dict.fromkeys([*factors, *rows, *moved]):  # in the same order in each process
            body, rotation, position = _link_in_frame(nominal, frames, name)
            row = _link_row(nominal, name)
            bodies[:, body] -= in_frame(row, rotation, position)
            if name == root and mounts is not None:
                rotation = base[:, :3]
                position = -(rotation @ base[:, 3, :, None])[..., 0]
            varied = in_frame(rows.get(name, row), rotation, position)
            bodies[:, body] += factors.get(name, np.ones(1))[:, None] * varied
        return cls(nominal, frames, base, bodies, numbers, model_of)

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, chosen: BoolArray | IntArray | slice) -> Robots:
        """Some of the robots."""
        offsets = None if self.offsets is None else self.offsets[chosen]
        return replace(self, base=self.base[chosen], bodies=self.bodies[chosen],
                       numbers=self.numbers[chosen], offsets=offsets)  # fmt: skip

    def model(self, k: int) -> FreeFloatingModel:
        """The model of robot k."""
        return self.model_of(int(self.numbers[k]))

    def problem(self, problem: Problem, k: int) -> Problem:
        """The nominal model's problem with robot k."""
        path = problem.path if self.offsets is None else problem.path.displaced(self.offsets[k])
        return problem.replace(model=self.model(k), path=path)

    def with_paths_from(self, attitude: Array, joints: Array) -> Robots:
        """The robots with paths that are stated in their spacecraft frames in a configuration.

        Args:
            attitude: Unit quaternion x, y, z, w.
            joints: Joint values, shape (n,).
        """
        model, R = self.nominal, rotation_matrix(attitude)
        centre = R.T @ model.base_position(attitude, joints)
        moments = self._moments(self._frames_at(joints))
        from_end = reduce(np.add, moments.swapaxes(0, 1)) / self.total_masses  # in link frame 0
        axes = self.base[:, :3].swapaxes(1, 2)
        moved = -(axes @ from_end.T[..., None])[..., 0] - self.base[:, 3] - centre
        offsets = (R @ moved[..., None])[..., 0]  # each by itself
        if model.on_table:
            offsets[..., 2] = 0.0
        return replace(self, offsets=offsets)

    def properties(self, problem: Problem) -> Array:
        """What the kernels read of robots for a problem's task and measure, shape (K, C)."""
        coefficients = np.zeros((len(self), 0, 2))
        if problem.margin.measure.name == "arm":
            coefficients = ArmPlane.of(self.frames).coefficients(self.bodies)
        base = problem.plane.seen(self.base) if problem.task.planar else self.base
        normal = problem.plane.normal if problem.task.planar and problem.model.on_table else None
        return robot_properties(base[:, None], self.bodies, self.reaches(normal), coefficients)

    def suit(self, problem: Problem) -> BoolArray:
        """Which robots suit the task and the measure of the model's problem, shape (K,)."""
        suited = np.ones(len(self), dtype=bool)
        if problem.task.planar and not self.nominal.on_table:
            suited &= self._are_planar(problem.plane)
        if problem.margin.measure.name == "arm":
            suited &= ArmPlane.of(self.frames).is_symmetric(self.bodies)
        return suited

    def _are_planar(self, plane: Plane) -> BoolArray:
        """Which robots have masses symmetric about the plane of planar joints, shape (K,)."""
        frames, _ = self._at_zero
        axes = plane.axes.T @ self.frames.base[:3].T  # of frame 0 along the plane's axes
        rows = in_frame(self.bodies, axes @ frames[:, :3].swapaxes(1, 2), frames[:, 3] @ axes.T)
        height = (rows[..., 3].sum(axis=1) / rows[..., 0].sum(axis=1))[:, None]
        size = rows[..., 4:7].sum(axis=(1, 2))
        lever = np.sqrt(size / rows[..., 0].sum(axis=1))[:, None]
        defects = (
            lever * (rows[..., 3] - rows[..., 0] * height),
            rows[..., 7] + height * rows[..., 2],
            rows[..., 8] + height * rows[..., 1],
        )
        return np.asarray(np.abs(defects).max(axis=(0, 2)) <= _PLANAR * size)

    def reaches(self, normal: Array | None = None) -> Array:
        """Upper bounds of the distances from the centre of mass to the end-effector [m], (K,).

        As :attr:`.VirtualManipulator.reach`, or in the plane with a normal, shape (3,).
        """
        links, strokes = self._barycentric
        if normal is not None:
            normals = (self.base[:, :3] @ normal).T  # in link frame 0
            links = links - normals[:, None] * np.einsum("ik,ijk->jk", normals, links)
        largest = np.abs(self.nominal.joint_ranges).max(axis=0)
        lengths = [*np.sqrt(dot(links, links))]
        lengths += [strokes[k] * largest[k] for k in np.flatnonzero(self.nominal.prismatic)]
        return reduce(np.add, lengths)

    @property
    def mean_inertias(self) -> Array:
        """Means of the principal moments about the centre of mass at zero joints [kg m²], (K,)."""
        frames, _ = self._at_zero
        origins = frames[:, 3].T[..., None]
        masses, moments = self.bodies[..., 0].T, self._moments(frames)
        about_frames = np.moveaxis(self.bodies[..., 4:7], -1, 0).swapaxes(1, 2)
        shifted = 4.0 * dot(origins, moments) - 2.0 * masses * dot(origins, origins)
        traces = reduce(np.add, [*about_frames, shifted])
        whole = reduce(np.add, moments.swapaxes(0, 1))
        trace = reduce(np.add, traces) - 2.0 * dot(whole, whole) / self.total_masses
        return np.asarray(trace / 3.0)

    @property
    def total_masses(self) -> Array:
        """[kg], shape (K,)."""
        return reduce(np.add, self.bodies[..., 0].T)

    @cached_property
    def _at_zero(self) -> tuple[Array, Array]:
        """Link frames (1 + n, 4, 3) and points (n + 2, 3), at joint values zero in frame 0.

        The points are the origins of frame 0, the joints' and the end-effector's.
        """
        axes, origin = self.frames.base[:3], self.frames.base[3]
        frames = self._frames_at(np.zeros(self.nominal.dof))
        _, points, _ = joints_at_zero(self.nominal)
        tip = frames[-1, 3] + self.frames.tool @ frames[-1, :3]
        return frames, np.vstack([np.zeros(3), (points - origin) @ axes.T, tip])

    def _frames_at(self, joints: Array) -> Array:
        """Link frames in frame 0 at joint values (n,), rows x, y, z and origin, (1 + n, 4, 3)."""
        zero, now = (self.nominal.body_poses(UPRIGHT, q) for q in (0.0 * joints, joints))
        frames = frames_at_zero(self.frames)
        for frame, before, after in zip(frames, zero, now, strict=True):
            turn = after.rotation @ before.rotation.T
            lever = frame[3] + zero[0].position - before.position
            frame[:3] = frame[:3] @ turn.T
            frame[3] = after.position - now[0].position + turn @ lever
        frames[:, 3] -= self.frames.base[3]
        return np.asarray(frames @ self.frames.base[:3].T)

    def _moments(self, frames: Array) -> Array:
        """First moments of the bodies about the origin of frame 0, shape (3, 1 + n, K).

        Args:
            frames: The link frames in frame 0, shape (1 + n, 4, 3).
        """
        masses, moments = self.bodies[..., 0].T, self.bodies[..., 1:4].T
        turned = (frames[:, i].T[..., None] * moments[i] for i in range(3))
        return reduce(np.add, turned, frames[:, 3].T[..., None] * masses)

    @cached_property
    def _barycentric(self) -> tuple[Array, Array]:
        """Barycentric vectors (17) at zero joints in frame 0, (3, 1 + n, K), and strokes (n, K)."""
        frames, points = self._at_zero
        fractions = self.bodies[..., 0].T / self.total_masses
        inward = np.cumsum(fractions, axis=0)
        centres = self._moments(frames) / self.total_masses - points[:-1].T[..., None] * fractions
        return np.diff(points, axis=0).T[..., None] * inward - centres, inward[:-1]


def _link_in_frame(
    model: FreeFloatingModel, frames: LinkFrames, name: str
) -> tuple[int, Array, Array]:
    """The body of a link, and rotation and position of the link in the body's link frame."""
    body, place = model.link_places[name]
    frame, (_, points, rotations) = frames_at_zero(frames)[body], joints_at_zero(model)
    joint = Pose(points[body - 1], rotations[body - 1]) if body else IDENTITY
    link = joint @ place
    return body, frame[:3] @ link.rotation, frame[:3] @ (link.position - frame[3])


def _link_row(model: FreeFloatingModel, name: str) -> Array:
    """Mass, first moment and inertia of a link in its frame."""
    inertial = model.description.links_by_name[name].inertial
    if inertial is None:
        return np.zeros(10)
    R = inertial.origin.rotation
    return inertial_row(inertial.mass, inertial.origin.position, R @ inertial.inertia @ R.T)


def _moved(base: Array, mount: Pose, positions: Array, rotations: Array) -> Array:
    """Link frame 0 in the spacecraft frames where the mount is at other poses, (K, 4, 3)."""
    local = mount.rotation.T @ np.column_stack([*base[:3], base[3] - mount.position])
    columns = rotations @ local
    columns[..., 3] += positions
    return np.ascontiguousarray(columns.swapaxes(1, 2))
