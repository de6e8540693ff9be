"""Laws of motion: what moves the arm, a path of the end-effector or prescribed joints.

The conservation of momentum adds the motion of the spacecraft. Limits, forces, states between
phases, exports and checks use the law of a motion. A law is for one thread.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self, TypeAlias

import numpy as np

from freefloat.dynamics.inverse_dynamics import Forces, InverseDynamics
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.dynamics.tasks import Task
from freefloat.errors import InputError
from freefloat.motion.joint_curves import ArmCurves, JointSpline
from freefloat.motion.problem import Problem
from freefloat.motion.setting import JointSetting, Setting
from freefloat.paths.timing import TimeLaw, Timing
from freefloat.robot.model import FreeFloatingModel
from freefloat.scene.scene_body import EndEffectorPoses
from freefloat.so3 import Array, IntArray, Pose, rotated_in_body

_DIFFERENCES = np.array([1.0, 2.0, -1.0, -2.0])
_WEIGHTS = np.array([8.0, -1.0, -8.0, 1.0]) / 12.0
"""Weights of central differences of fourth order."""
_EXCURSION = 4e-4
"""Displacement of attitude and joints in a step of the differences [rad, m]."""

Times: TypeAlias = float | Array
Segments: TypeAlias = int | IntArray | None


class Rates(NamedTuple):
    """Rates of a state, or of K states."""

    base: Array  # angular velocity of the spacecraft in its own frame [rad/s], (..., 3)
    joints: Array  # joint rates [rad/s or m/s], (..., n)


@dataclass(frozen=True, eq=False)
class PathLaw:
    """The end-effector follows the path of a problem: rates solve equation (4).

    Accelerations solve its time derivative. The joint rates of a redundant arm, and joint rates for
    the task ``pointing``, are differentiated along the motion by central differences of fourth
    order, which holds for every redundancy resolution.

    Functions of a state take its time [s], the attitude of the spacecraft, a unit quaternion x, y,
    z, w, the joints (n,), and the segment of the time law, see
    :meth:`freefloat.paths.timing.Timing.s`; or K of each.

    Attributes:
        problem: Robot, path and momentum.
        follows_path: Whether the end-effector follows a path, and joints are not prescribed.
        followed: Sentence on a motion that was completed.
    """

    follows_path: ClassVar[bool] = True
    followed: ClassVar[str] = "The whole path was followed."

    problem: Problem = field(repr=False)

    @property
    def setting(self) -> Setting:
        """Robot, momentum and scene: the problem."""
        return self.problem

    @property
    def timing(self) -> Timing:
        """The path parameter s by time."""
        return self.problem.path.timing

    @cached_property
    def _solver(self) -> ResolvedRateSolver:
        return self.problem.resolved_rate_solver()

    def rates(self, t: Times, attitude: Array, joints: Array, segment: Segments = None) -> Rates:
        """The rates at a state; infinite where the arm is exactly singular."""
        prescribed = self.problem.prescribed(t, segment)
        return Rates(*self._solver.rates(attitude, joints, *prescribed))

    def effort(self, t: Times, attitude: Array, joints: Array, segment: Segments = None) -> Forces:
        """Rates, accelerations and forces at a state; all NaN where the arm is exactly singular."""
        path = self.problem.path
        prescribed = path.twist_and_speed(t, segment)
        change = path.twist_rate(t, segment), path.timing.s(t, 2, segment)
        further = self.problem.arms.at(t, 1), self.problem.arms.at(t, 2)
        return self.effort_of(attitude, joints, prescribed, change, further)

    def target(self, t: Times, attitude: Array, joints: Array) -> Pose:
        """Prescribed pose of the end-effector from the centre of mass, inertial axes.

        Bodies of the scene may move with it.
        """
        return self.problem.path.pose(t)

    def ways(self, actual: Pose) -> dict[str, Pose]:
        """K poses along the way of each end-effector, by arm, as many as actual ones are given."""
        return self.problem.path.poses_at(np.linspace(0.0, 1.0, len(actual.position)))

    def with_arms_at_rest(self, model: FreeFloatingModel, joints: Mapping[str, Array]) -> Self:
        """The law of a robot whose further arms rest at joints (m,), by their names."""
        arms = ArmCurves.at_rest(joints, self.problem.path.duration)
        return replace(self, problem=self.problem.replace(model=model, arms=arms))

    def effort_of(
        self,
        attitude: Array,
        joints: Array,
        prescribed: tuple[Array, Any],
        change: tuple[Array, Any],
        further: tuple[Array, Array] | None = None,
    ) -> Forces:
        """Rates, accelerations and forces for an end-effector twist, ds/dt and their derivatives.

        Further arms that move have given joint rates and accelerations.
        """
        twist, speed = prescribed
        arm_rates, arm_accelerations = further or (None, joints[..., :0])
        solved = self._solver.rates(attitude, joints, twist, speed, arm_rates)
        problem, rates = self.problem, np.concatenate(solved, axis=-1)
        if not problem.redundant and problem.task is not Task.POINTING:
            return self._dynamics.of_end_effector(
                attitude, joints, rates, change[0], problem.task, arm_accelerations
            )
        speeds, speed_rates = (np.asarray(value)[..., None] for value in (speed, change[1]))
        values = np.concatenate([twist, speeds, rates[..., 3 + problem.dof :]], -1)
        changes = np.concatenate([change[0], speed_rates, arm_accelerations], -1)
        accelerations = self._differentiated(attitude, joints, rates, values, changes)
        return self._dynamics.of_joints(attitude, joints, rates, accelerations)

    @cached_property
    def _dynamics(self) -> InverseDynamics:
        return InverseDynamics(self.problem.system)

    def _differentiated(
        self, attitude: Array, joints: Array, rates: Array, prescribed: Array, change: Array
    ) -> Array:
        """Joint accelerations: joint rates differentiated along the tangent of the motion.

        Rates (..., 3 + n) are the angular velocity of the base and joint rates. Prescribed are the
        twist of the end-effector, or twists of several, ds/dt, and joint rates of further arms on
        joint curves, with their change by time.
        """
        still = _EXCURSION / self.problem.path.duration
        step = _EXCURSION / np.maximum(np.abs(rates).max(axis=-1, keepdims=True), still)
        end = 6 * len(self.problem.path.by_arm)
        states = joints + np.multiply.outer(_DIFFERENCES, step * rates[..., 3:])
        turns = np.multiply.outer(_DIFFERENCES, step * rates[..., :3]).reshape(-1, 3)
        attitudes = np.broadcast_to(attitude, (*states.shape[:-1], 4)).reshape(-1, 4)
        later = prescribed + np.multiply.outer(_DIFFERENCES, step * change)
        later = later.reshape(-1, later.shape[-1])
        at = rotated_in_body(attitudes, turns), states.reshape(-1, states.shape[-1])
        _, solved = self._solver.rates(*at, later[:, :end], later[:, end], later[:, end + 1 :])
        return np.asarray(np.tensordot(_WEIGHTS, solved.reshape(states.shape), 1) / step)


@dataclass(frozen=True, eq=False)
class JointLaw:
    """The joints are prescribed, and no path of the end-effector.

    The curve gives the joints of a state at its time.

    Attributes:
        setting: Robot, momentum and scene.
        curve: The joints by s, which is proportional to time.
        duration: Duration of the motion [s].
    """

    follows_path: ClassVar[bool] = False
    followed: ClassVar[str] = "The whole joint curve was followed."

    setting: JointSetting = field(repr=False)
    curve: JointSpline = field(repr=False)
    duration: float

    @property
    def problem(self) -> Problem:
        """See :class:`PathLaw`."""
        raise InputError("motion", "its joints are prescribed", "a motion along a path")

    @cached_property
    def timing(self) -> Timing:
        """See :class:`PathLaw`."""
        return Timing(self.duration, TimeLaw.UNIFORM)

    def rates(self, t: Times, attitude: Array, joints: Array, segment: Segments = None) -> Rates:
        """See :class:`PathLaw`."""
        s, speed = (self.timing.s(t, order, segment) for order in range(2))
        rates = self.curve.at(s, 1) * speed[..., None]
        return Rates(self.setting.system.base_rate(attitude, self.curve.at(s), rates), rates)

    def effort(self, t: Times, attitude: Array, joints: Array, segment: Segments = None) -> Forces:
        """See :class:`PathLaw`."""
        s, speed, change = (self.timing.s(t, order, segment) for order in range(3))
        q, slope, bend = (self.curve.at(s, order) for order in range(3))
        accelerations = bend * speed[..., None] ** 2 + slope * change[..., None]
        rates = np.concatenate(self.rates(t, attitude, joints, segment), axis=-1)
        return self._dynamics.of_joints(attitude, q, rates, accelerations)

    def target(self, t: Times, attitude: Array, joints: Array) -> Pose:
        """See :class:`PathLaw`."""
        return self.setting.model.end_effector_pose(attitude, joints)

    def ways(self, actual: Pose) -> dict[str, Pose]:
        """See :class:`PathLaw`."""
        return {"": actual}

    def with_arms_at_rest(self, model: FreeFloatingModel, joints: Mapping[str, Array]) -> Self:
        """See :class:`PathLaw`."""
        setting = self.setting.replace(model=model, arms=ArmCurves.at_rest(joints, self.duration))
        points = self.curve.control_points
        resting = np.tile(np.concatenate([*joints.values()]), (len(points), 1))
        return replace(self, setting=setting, curve=JointSpline(np.hstack([points, resting])))

    @cached_property
    def _dynamics(self) -> InverseDynamics:
        return InverseDynamics(self.setting.system)


def scene_poses(
    law: PathLaw | JointLaw, t: Times, attitude: Array, joints: Array
) -> tuple[Pose, ...]:
    """Frames of the bodies of the scene in a state, from the centre of mass, inertial axes.

    In K states each body has K poses.
    """
    poses = _end_effector_poses(law, t, attitude, joints)
    return law.setting.scene.poses(t, law.setting, poses)


def corridor_pose(law: PathLaw | JointLaw, t: Times, attitude: Array, joints: Array) -> Pose:
    """The frame of the corridor in a state, as of :func:`scene_poses`."""
    poses = _end_effector_poses(law, t, attitude, joints)
    return law.setting.scene.corridor_pose(t, law.setting, poses)


def _end_effector_poses(
    law: PathLaw | JointLaw, t: Times, attitude: Array, joints: Array
) -> EndEffectorPoses | None:
    """Poses of the end-effector, where bodies move with it."""
    if not law.setting.scene.follows:
        return None
    actual = law.setting.model.end_effector_pose(attitude, joints)
    return EndEffectorPoses(law.target(t, attitude, joints), actual)
