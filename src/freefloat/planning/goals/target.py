"""What a path must reach: residuals of its last state, with their derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.dynamics.momentum import Task, end_effector_jacobian
from freefloat.dynamics.system import System
from freefloat.motion.problem import Problem
from freefloat.scene.scene_body import SceneBody
from freefloat.so3 import Array, Pose, rotation_vector_between

if TYPE_CHECKING:  # goals of scenarios are read without compiled kernels
    from freefloat.planning.goals.joint_paths import Course, JointPaths

_STEP = 1e-6
"""Step of the differences [rad, m]; of the duration over that."""
_LATER = 1e-4
"""Half the difference of times in the twist of a body [s]."""


@dataclass(frozen=True, eq=False)
class EndState:
    """The last state of a path.

    Attributes:
        time: Time [s].
        attitude: Attitude of the spacecraft, shape (3, 3).
        joints: Joint values [rad or m], shape (n,).
        joint_rates: Joint rates [rad/s or m/s], shape (n,).
    """

    time: float
    attitude: Array
    joints: Array
    joint_rates: Array


@dataclass(frozen=True, eq=False)
class Target:
    """Attitude of the spacecraft and pose of the end-effector where a path ends.

    Attributes:
        problem: Robot, momentum and drift.
        attitude: Attitude of the spacecraft, shape (3, 3); None where it is free.
        pose: Pose of the end-effector in the frame of the motion, or of the body; None where it is
            free.
        body: A body of the scene whose frame the pose is in: the end-effector moves with it.
        oriented: Whether the orientation of the pose counts.
    """

    problem: Problem
    attitude: Array | None = None
    pose: Pose | None = None
    body: SceneBody | None = None
    oriented: bool = True

    @property
    def task(self) -> Task | None:
        """What inverse kinematics solves for the pose; None where the arm has too few joints."""
        task = self.problem.task
        if not task.planar:
            task = Task.POSE if self.oriented else Task.POSITION
        return task if len(task.rows) <= self.problem.model.dof else None

    @property
    def size(self) -> int:
        """Number of residuals."""
        rows = 6 if self.oriented else 3
        moving = 1 + (self.body is not None)
        return 3 * (self.attitude is not None) + rows * moving * (self.pose is not None)

    def pose_at(self, t: float) -> Pose:
        """The pose of the end-effector at time t [s] from the centre of mass, inertial axes.

        Of a target without pose that of the frame of the motion.
        """
        origin = self.problem.path.origin(t)
        if self.pose is None:
            return Pose(origin, np.eye(3))
        if self.body is not None:
            return self.body.pose_at(t, self.problem.path) @ self.pose
        return Pose(self.pose.position + origin, self.pose.rotation)

    def residuals(self, end: EndState) -> Array:
        """Errors [rad], [m; rad], and of twists [m/s; rad/s], shape (size,)."""
        rows, parts = slice(None) if self.oriented else slice(3), list[Array]()
        if self.attitude is not None:
            parts.append(rotation_vector_between(self.attitude, end.attitude))
        if self.pose is not None:
            quaternion = Rotation.from_matrix(end.attitude).as_quat()
            goal, twist = self._goal(end.time)
            pose = self.problem.model.end_effector_pose(quaternion, end.joints)
            turn = rotation_vector_between(goal.rotation, pose.rotation)
            parts.append(np.concatenate([pose.position - goal.position, turn])[rows])
            if self.body is not None:
                parts.append((self._twist(end, quaternion) - twist)[rows])
        return np.concatenate(parts) if parts else np.zeros(0)

    def distance_text(self, residuals: Array) -> str:
        """How far away an end with some residuals is."""
        parts, rest = list[str](), residuals
        if self.attitude is not None:
            turn, rest = np.degrees(np.linalg.norm(rest[:3])), rest[3:]
            parts.append(f"the attitude {turn:.3g} deg")
        if self.pose is not None:
            parts.append(f"the end-effector {np.linalg.norm(rest[:3]):.3g} m")
            if self.oriented:
                parts.append(f"its orientation {np.degrees(np.linalg.norm(rest[3:6])):.3g} deg")
        return ", ".join(parts)

    def _twist(self, end: EndState, quaternion: Array) -> Array:
        """Twist of the end-effector relative to the centre of mass, inertial axes, shape (6,)."""
        system, joints, rates = self._still, end.joints, end.joint_rates
        base = system.base_twist(quaternion, joints, rates)
        J = end_effector_jacobian(system.model, joints, quaternion)
        return np.asarray(J @ np.concatenate([base, rates]))

    @cached_property
    def _still(self) -> System:
        """The system in the frame of its centre of mass."""
        return replace(self.problem.system, drift=np.zeros(3))

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

    def error(self, paths: JointPaths, course: Course) -> Array:
        """Residuals of the end of a course."""
        return self.residuals(_end(paths, course))

    def derivative(self, paths: JointPaths, course: Course) -> Array:
        """Derivatives of the residuals by the unknowns, shape (size, unknowns)."""
        end, n, T = _end(paths, course), paths.joint_count, course.duration
        here = self.residuals(end)
        if not len(here):
            return np.zeros((0, paths.size))

        def by(turn: Array, joints: Array, rates: Array, time: float = 0.0) -> Array:
            turned = end.attitude @ Rotation.from_rotvec(turn).as_matrix()
            state = EndState(
                end.time + time, turned, end.joints + joints, end.joint_rates + rates
            )  # fmt: skip
            return (self.residuals(state) - here) / _STEP

        still, none, eye = np.zeros(n), np.zeros(3), np.eye(n)
        by_turn = np.array([by(_STEP * axis, still, still) for axis in np.eye(3)]).T
        J = by_turn @ course.turns[-1]
        points = paths.control_points(course.unknowns)
        if paths.ends.end is None:
            by_joints = np.array([by(none, _STEP * axis, still) for axis in eye]).T
            J[:, :-1] += _spread(by_joints, paths.edge_basis[-1])
        if self.body is not None:
            by_rates = np.array([by(none, still, _STEP * axis) for axis in eye]).T
            slope = 3.0 * paths.all_spans / T
            J[:, :-1] += slope * _spread(by_rates, paths.spread[-1] - paths.spread[-2])
            J[:, -1] -= by_rates @ (slope * (points[-1] - points[-2])) / T
        if self.body is not None or self.problem.path.drifts:
            J[:, -1] += by(none, still, still, _STEP)
        return np.asarray(J)


def _spread(by_joints: Array, basis: Array) -> Array:
    """Derivatives by the rows of unknowns, of which a basis (K,) has the joints, (size, K n)."""
    rows = np.einsum("k,ej->ekj", basis, by_joints)
    return np.asarray(rows.reshape(len(by_joints), -1))


def _end(paths: JointPaths, course: Course) -> EndState:
    points = paths.control_points(course.unknowns)
    rates = 3.0 * paths.all_spans * (points[-1] - points[-2]) / course.duration
    return EndState(course.duration, course.attitudes[-1], points[-1], rates)
