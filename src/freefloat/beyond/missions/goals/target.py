"""What a path must reach: residuals of its last state, with their derivatives."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from freefloat.dynamics.generalized_jacobian import system_matrix
from freefloat.dynamics.momentum import conserved_inertias
from freefloat.dynamics.tasks import Task
from freefloat.motion.setting import Setting
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import Rotation
from freefloat.scene.scene_body import SceneBody
from freefloat.so3 import UPRIGHT, Array, Pose, rotation_vector_between

if TYPE_CHECKING:  # goals of scenarios are read without compiled kernels
    from freefloat.beyond.missions.goals.attitude_kernel import JointCourse
    from freefloat.beyond.missions.goals.joint_paths import JointPaths

_STEP = 1e-6
"""Step of the differences [rad, m, rad/s, m/s, s]."""
_SMALL = 1e-4
"""Half an angle below which a series is exact [rad]."""
_LATER = 1e-4
"""Half the difference of times in the twist of a body [s]."""


@dataclass(frozen=True, eq=False)
class EndState:
    """The last state of a path."""

    time: float  # [s]
    attitude: Array  # of the spacecraft, (3, 3)
    joints: Array  # [rad or m], (n,)
    joint_rates: Array  # [rad/s or m/s], (n,)


@dataclass(frozen=True, eq=False)
class Target:
    """Attitude of the spacecraft and pose of the end-effector where a path ends."""

    setting: Setting  # robot, momentum and drift
    attitude: Array | None = None  # of the spacecraft, (3, 3); None where it is free
    pose: Pose | None = None  # of the end-effector, in the frame of motion or body; None if free
    body: SceneBody | None = None  # of the scene, with which the end-effector moves

    @property
    def task(self) -> Task | None:
        """What inverse kinematics solves for the pose; None where the arm has too few joints."""
        task = self.setting.task if self.setting.task.planar else Task.POSE
        return task if len(task.rows) <= self.setting.model.dof else None

    @property
    def size(self) -> int:
        """Number of residuals."""
        moving = 1 + (self.body is not None)
        return 3 * (self.attitude is not None) + 6 * moving * (self.pose is not None)

    def pose_at(self, t: float) -> Pose:
        """The pose of the end-effector at time t [s] from the centre of mass, inertial axes.

        A target without pose has the pose of the frame of the motion.
        """
        origin = self.setting.origin(t)
        if self.pose is None:
            return Pose(origin, np.eye(3))
        if self.body is not None:
            return self.body.pose_at(t, self.setting) @ self.pose
        return Pose(self.pose.position + origin, self.pose.rotation)

    def residuals(self, end: EndState) -> Array:
        """Errors [rad], [m; rad], and of twists [m/s; rad/s], shape (size,)."""
        parts = list[Array]()
        if self.attitude is not None:
            parts.append(rotation_vector_between(self.attitude, end.attitude))
        if self.pose is not None:
            goal, twist = self._goal(end.time)
            pose = self._pose(end)
            turn = rotation_vector_between(goal.rotation, pose.rotation)
            parts.append(np.concatenate([pose.position - goal.position, turn]))
            if self.body is not None:
                parts.append(self._twist(end) - twist)
        return np.concatenate(parts) if parts else np.zeros(0)

    def distance_text(self, residuals: Array) -> str:
        """How far away an end with some residuals is."""
        parts, rest = list[str](), residuals
        if self.attitude is not None:
            turn, rest = np.degrees(np.linalg.norm(rest[:3])), rest[3:]
            parts.append(f"the attitude {turn:.3g} deg")
        if self.pose is not None:
            parts.append(f"the end-effector {np.linalg.norm(rest[:3]):.3g} m")
            parts.append(f"its orientation {np.degrees(np.linalg.norm(rest[3:6])):.3g} deg")
        return ", ".join(parts)

    def _pose(self, end: EndState) -> Pose:
        """Pose of the end-effector from the centre of mass, inertial axes."""
        pose = self.setting.model.end_effector_pose(UPRIGHT, end.joints)
        return Pose(end.attitude @ pose.position, end.attitude @ pose.rotation)

    def _twist(self, end: EndState) -> Array:
        """Twist of the end-effector relative to the centre of mass, inertial axes, shape (6,)."""
        system = self.setting.system
        D, Dq = conserved_inertias(system.model, end.joints)
        h = end.attitude.T @ system.momentum - system.wheels
        omega = np.linalg.solve(D, h - Dq @ end.joint_rates)  # (3)
        J = _pose_jacobian(system.model, end.joints)
        return _rotated(end.attitude, J @ np.concatenate([omega, end.joint_rates]))

    @cached_property
    def _goal(self) -> Callable[[float], tuple[Pose, Array]]:
        """The pose at a time [s], and the twist of the body (6,), inertial axes."""

        def goal(t: float) -> tuple[Pose, Array]:
            if self.body is None:
                return self.pose_at(t), np.zeros(6)
            before, after = (self.pose_at(t + side) for side in (-_LATER, _LATER))
            turn = rotation_vector_between(before.rotation, after.rotation)
            change = np.concatenate([after.position - before.position, turn])
            return self.pose_at(t), change / (2.0 * _LATER)

        return lru_cache(maxsize=2)(goal)

    def error(self, paths: JointPaths, course: JointCourse) -> Array:
        """Residuals of the end of a course."""
        return self.residuals(_end(paths, course))

    def linearized(self, paths: JointPaths, course: JointCourse) -> tuple[Array, Array]:
        """Residuals of the end of a course, and their derivatives by the unknowns."""
        end = _end(paths, course)
        here = self.residuals(end)
        if not len(here):
            return here, np.zeros((0, paths.size))
        by_turn, by_joints, by_rates = self._slopes(end)
        J = by_turn @ course.turns[-1]
        if paths.ends.end is None:
            J[:, :-1] += _spread(by_joints, paths.edge_basis[-1])
        if self.body is not None:
            points = paths.control_points(course.unknowns)
            slope = 3.0 * paths.all_spans / course.duration
            J[:, :-1] += slope * _spread(by_rates, paths.spread[-1] - paths.spread[-2])
            J[:, -1] -= by_rates @ (slope * (points[-1] - points[-2])) / course.duration
        if self.body is not None or self.setting.drifts:
            J[:, -1] += (self.residuals(replace(end, time=end.time + _STEP)) - here) / _STEP
        return here, J

    def _slopes(self, end: EndState) -> tuple[Array, ...]:
        """Derivatives by turns of the spacecraft, its axes, by joints and by joint rates."""
        n, R = len(end.joints), end.attitude
        parts = list[Array]()
        if self.attitude is not None:
            turned = _vector_rates(rotation_vector_between(self.attitude, R)) @ R
            parts.append(np.column_stack([turned, np.zeros((3, 2 * n))]))
        if self.pose is not None:
            J = _rotated(R, _pose_jacobian(self.setting.model, end.joints))
            goal, _ = self._goal(end.time)
            turn = rotation_vector_between(goal.rotation, self._pose(end).rotation)
            J[3:] = _vector_rates(turn) @ J[3:]
            parts.append(np.column_stack([J, np.zeros((6, n))]))
            if self.body is not None:
                parts.append(self._twist_slopes(end))
        return tuple(np.hsplit(np.concatenate(parts), [3, 3 + n]))

    def _twist_slopes(self, end: EndState) -> Array:
        """The derivatives of the twist, shape (6, 3 + 2 n)."""
        here, n = self._twist(end), len(end.joints)
        ends = (
            EndState(
                end.time, end.attitude @ Rotation.from_rotvec(step[:3]).as_matrix(),
                end.joints + step[3 : 3 + n], end.joint_rates + step[3 + n :],
            )
            for step in _STEP * np.eye(3 + 2 * n)
        )  # fmt: skip
        return np.array([(self._twist(changed) - here) / _STEP for changed in ends]).T


def _pose_jacobian(model: FreeFloatingModel, joints: Array) -> Array:
    """The end-effector's twist by the spacecraft's angular velocity and joint rates, (6, 3 + n)."""
    rows = system_matrix(model, joints)[-6:]
    return np.column_stack([np.zeros((6, 3 + model.dof - rows.shape[1])), rows])


def _rotated(R: Array, twist: Array) -> Array:
    """Twists (6,), or the columns of a matrix (6, ...), in other axes."""
    return np.concatenate([R @ twist[:3], R @ twist[3:]])


def _vector_rates(vector: Array) -> Array:
    """Derivatives of a rotation vector (3,) by small rotations about its axes, (3, 3)."""
    x, y, z = vector.tolist()
    X, half = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), math.hypot(x, y, z) / 2.0
    factor = (1.0 - half / math.tan(half)) / (4.0 * half**2) if half > _SMALL else 1.0 / 12.0
    return np.asarray(np.eye(3) - X / 2.0 + factor * X @ X)


def _spread(by_joints: Array, basis: Array) -> Array:
    """Derivatives by the rows of unknowns, of which a basis (K,) has the joints, (size, K n)."""
    rows = np.einsum("k,ej->ekj", basis, by_joints)
    return np.asarray(rows.reshape(len(by_joints), -1))


def _end(paths: JointPaths, course: JointCourse) -> EndState:
    points = paths.control_points(course.unknowns)
    rates = 3.0 * paths.all_spans * (points[-1] - points[-2]) / course.duration
    return EndState(course.duration, course.attitudes[-1], points[-1], rates)
