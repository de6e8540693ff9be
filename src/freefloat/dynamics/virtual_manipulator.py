"""The virtual manipulator: in the spacecraft frame a free-floating arm is a fixed-base arm.

Its base is at the system's centre of mass, its joints move with the real ones, its links are the
barycentric vectors (17). At a given attitude the kinematics of fixed-base arms therefore apply.

On a table the spacecraft keeps its height: z coordinates are the arm's own, from the root
link's origin.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from freefloat.errors import InputError
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import Rotation
from freefloat.so3 import Array, Pose, frozen

_TOLERANCE = 1e-9
"""Largest distance of intersecting lines, relative to the reach, and sine of the angle between
parallel directions."""


@dataclass(frozen=True, eq=False)
class VirtualManipulator:
    """A chain of barycentric vectors, in the spacecraft frame.

    Attributes:
        links: Barycentric vectors [m], shape (n + 1, 3): the first fixed to the spacecraft, from
            the centre of mass to the first joint, the others fixed to the body behind each joint.
            Their lengths are the paper's a, b, c, d.
        rotations: Constant rotation from each joint's frame at zero into the previous body's frame,
            shape (n, 3, 3).
        axes: Joint axes in the joint frames, shape (n, 3).
        prismatic: Which joints are prismatic, shape (n,).
        strokes: Displacement of the virtual arm per metre of a prismatic joint, shape (n,).
        tool: Rotation from the end-effector frame into the last body's frame, shape (3, 3).
        reach: Upper bound of the distance from the centre of mass to the end-effector [m]; on a
            table, as if the base were free.
        upright: On a table, the arm on its spacecraft, whose z coordinates count; otherwise None.
    """

    links: Array
    rotations: Array
    axes: Array
    prismatic: npt.NDArray[np.bool_]
    strokes: Array
    tool: Array
    reach: float
    upright: VirtualManipulator | None = None

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, model: FreeFloatingModel) -> VirtualManipulator:
        """The virtual manipulator of a robot with one moving arm."""
        model.require_supported("reach and regions")
        bodies = model.bodies
        arm = bodies[1:]
        fractions = np.array([body.mass for body in bodies]) / model.total_mass
        outward = np.append(np.cumsum(fractions[::-1])[::-1][1:], 0.0)
        steps = [body.placement.position for body in arm] + [model.tool.position]
        links = np.array([
            (1.0 - outer) * step - fraction * body.centre
            for body, fraction, outer, step in zip(bodies, fractions, outward, steps, strict=True)
        ])  # fmt: skip
        strokes = 1.0 - outward[:-1]
        moved = [(body, s) for body, s in zip(arm, strokes, strict=True) if body.prismatic]
        extension = sum(s * max(abs(body.lower), abs(body.upper)) for body, s in moved)
        virtual = cls(
            links=frozen(links),
            rotations=frozen([body.placement.rotation for body in arm]),
            axes=frozen([body.axis for body in arm]),
            prismatic=model.prismatic,
            strokes=frozen(strokes),
            tool=frozen(model.tool.rotation),
            reach=float(np.linalg.norm(links, axis=1).sum() + extension),
        )
        if not model.on_table:
            return virtual
        whole = frozen(np.ones(len(arm)))
        return replace(virtual, upright=replace(virtual, links=frozen(steps), strokes=whole))

    def lengths(self, normal: Array | None = None) -> Array:
        """Lengths of the barycentric vectors [m], shape (n + 1,).

        Args:
            normal: Normal of the arm's plane, in which lengths count, spacecraft frame, shape (3,).
        """
        links = self.links
        if normal is not None:
            normals = [normal]
            for rotation in self.rotations:
                normals.append(rotation.T @ normals[-1])
            links = links - (links * normals).sum(axis=1, keepdims=True) * normals
        return np.asarray(np.linalg.norm(links, axis=1))

    @property
    def last_link(self) -> Array:
        """The last barycentric vector in the end-effector frame [m], shape (3,)."""
        return np.asarray(self.tool.T @ self.links[-1])

    def kinematics(self, joints: npt.ArrayLike) -> tuple[Array, Array, Array, Array]:
        """Forward kinematics for K joint vectors.

        Args:
            joints: Joint values [rad or m], shape (K, n).

        Returns:
            In the spacecraft frame, end-effector positions from the centre of mass (K, 3) and
            rotations (K, 3, 3); joint positions (n, K, 3) and joint axes (n, K, 3).

        Raises:
            InputError: If the shape of the joints is another one.
        """
        q = np.atleast_2d(np.asarray(joints, dtype=float))
        if q.ndim != 2 or q.shape[1] != len(self.axes):
            problem = f"shape {np.shape(joints)} was given"
            raise InputError("joints", problem, f"shape (K, {len(self.axes)})")
        R = np.broadcast_to(np.eye(3), (len(q), 3, 3))
        p = np.broadcast_to(self.links[0], (len(q), 3))
        points, axes = [], []
        for i, rotation in enumerate(self.rotations):
            R = R @ rotation
            axis = R @ self.axes[i]
            points.append(p)
            axes.append(axis)
            if self.prismatic[i]:
                p = p + self.strokes[i] * q[:, i, None] * axis
            else:
                R = R @ Rotation.from_rotvec(q[:, i, None] * self.axes[i]).as_matrix()
            p = p + R @ self.links[i + 1]
        if self.upright:
            p = np.column_stack([p[:, :2], self.upright.kinematics(q)[0][:, 2]])
        return p, R @ self.tool, np.array(points), np.array(axes)

    def velocities(self, joints: Array, placed: tuple[Array, ...]) -> tuple[Array, Array]:
        """Velocities of the end-effector and of its rotation per joint rate, spacecraft frame.

        Args:
            joints: Joint values [rad or m], shape (K, n).
            placed: Result of :meth:`kinematics` at the joint values.

        Returns:
            Shape (n, K, 3) each.
        """
        p, _, points, axes = placed
        if self.upright:
            p = replace(self, upright=None).kinematics(joints)[0]
        prismatic, strokes = (values[:, None, None] for values in (self.prismatic, self.strokes))
        linear = np.where(prismatic, strokes * axes, np.cross(axes, p - points))
        if self.upright:
            upright = self.upright.velocities(joints, self.upright.kinematics(joints))
            linear[..., 2] = upright[0][..., 2]
        return linear, np.where(prismatic, 0.0, axes)

    def pose(self, joints: npt.ArrayLike) -> Pose:
        """End-effector pose from the centre of mass, spacecraft frame, at joints (n,)."""
        p, R, _, _ = self.kinematics(joints)
        return Pose(p[0], R[0])

    def axes_at(self, joints: npt.ArrayLike) -> Array:
        """Directions of the joint axes in the spacecraft frame, shape (n, 3)."""
        return self.kinematics(joints)[3][:, 0]

    @cached_property
    def wrist_centre(self) -> Array | None:
        """Intersection of the last three axes at zero joints, spacecraft frame (3,), or None."""
        if len(self.axes) != 6 or self.prismatic.any():
            return None
        _, _, points, axes = self.kinematics(np.zeros(6))
        centre = meeting_point(points[3:, 0], axes[3:, 0], _TOLERANCE * self.reach)
        return None if centre is None else frozen(centre)

    @cached_property
    def has_elbow_and_spherical_wrist(self) -> bool:
        """Whether axes 2 and 3 are parallel and the last three meet in a point."""
        if self.wrist_centre is None:
            return False
        _, h2, h3 = self.axes_at(np.zeros(6))[:3]
        return bool(np.linalg.norm(np.cross(h2, h3)) < _TOLERANCE)

    @cached_property
    def has_three_parallel_axes(self) -> bool:
        """Whether all of six joints are revolute and the second to fourth axes are parallel."""
        if len(self.axes) != 6 or self.prismatic.any():
            return False
        _, h2, h3, h4 = self.axes_at(np.zeros(6))[:4]
        return bool(np.linalg.norm(np.cross(h2, [h3, h4]), axis=1).max() < _TOLERANCE)


def first_moment(model: FreeFloatingModel) -> VirtualManipulator:
    """The chain at whose end is the first moment of a single arm over the total mass.

    The moment is about the origin of the spacecraft frame, up to a constant. This chain and
    the virtual manipulator add up to the arm on a fixed base. Axes and reach are as in the
    virtual manipulator.
    """
    virtual = VirtualManipulator.of(model)
    steps = [*(body.placement.position for body in model.bodies[1:]), model.tool.position]
    links, strokes = np.array(steps) - virtual.links, 1.0 - virtual.strokes
    return replace(virtual, links=frozen(links), strokes=frozen(strokes), upright=None)


def reach_bound(model: FreeFloatingModel) -> float:
    """Upper bound of the distance from the centre of mass to the end-effector [m].

    The first arm's bound, where several follow paths. Others may displace the centre of mass. On a
    table the distance is from a point below or above, see :meth:`.FreeFloatingModel.configuration`.
    """
    first, *further = model.single_arms
    virtual = VirtualManipulator.of(first)
    reach = virtual.reach
    if virtual.upright:
        strokes = np.abs(first.joint_ranges).max(axis=0)[first.prismatic].sum()
        height = float(np.linalg.norm(virtual.upright.links, axis=1).sum() + strokes)
        reach = float(np.hypot(reach, height))
    for arm in further:
        moment, ranges = first_moment(arm), np.abs(arm.joint_ranges).max(axis=0)
        strokes = (moment.strokes * ranges)[arm.prismatic].sum()
        reach += float(2.0 * np.linalg.norm(moment.links[1:], axis=1).sum() + strokes)
    return reach


def meeting_point(points: Array, axes: Array, tolerance: float) -> Array | None:
    """Intersection point of three lines.

    Args:
        points: A point on each line, shape (3, 3).
        axes: Unit directions, shape (3, 3).
        tolerance: Largest distance from the lines [m].

    Returns:
        The point, shape (3,), or None if the lines do not intersect or successive ones are
        parallel.
    """
    normal = np.cross(axes[0], axes[1])
    if (
        np.linalg.norm(normal) < _TOLERANCE
        or np.linalg.norm(np.cross(axes[1], axes[2])) < _TOLERANCE
    ):
        return None
    along = np.cross(points[1] - points[0], axes[1]) @ normal / (normal @ normal)
    centre = points[0] + along * axes[0]
    misses = np.cross(centre - points[1:], axes[1:])
    return np.asarray(centre) if np.abs(misses).max() < tolerance else None
