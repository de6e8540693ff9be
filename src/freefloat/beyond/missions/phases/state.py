"""The state of the system between two phases of a manoeuvre."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from freefloat.dynamics.momentum import end_effector_jacobian
from freefloat.limits.limits import Limits
from freefloat.motion.motion import Motion
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem import Problem
from freefloat.motion.setting import JointSetting
from freefloat.paths.timed_path import TimedPath
from freefloat.scene.scene import Scene
from freefloat.so3 import Array, Pose, frozen


@dataclass(frozen=True, eq=False)
class SystemState:
    """The system at the end of a phase.

    Arms that moved along joint curves during the first path rest where these end.

    Attributes:
        problem: Problem of the first path, with the robot, momentum and scene that there are now;
            the scene is the one at the beginning of the manoeuvre's first path, in its frame.
        time: Time from the beginning of the first path [s].
        attitude: Attitude of the spacecraft, unit quaternion x, y, z, w.
        joints: Joint values [rad or m], shape (n,).
        joint_rates: Joint rates [rad/s or m/s], shape (n,).
        centre: Centre of mass in the frame of the manoeuvre [m], shape (3,).
    """

    problem: Problem = field(repr=False)
    time: float
    attitude: Array
    joints: Array
    joint_rates: Array
    centre: Array

    def __post_init__(self) -> None:
        for name in ("attitude", "joints", "joint_rates", "centre"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @classmethod
    def at_start(cls, motion: Motion) -> SystemState:
        """The state at the beginning of a motion along the first path."""
        problem, start = motion.problem, motion.initial
        rates, arm = motion.law.rates(0.0, start.attitude, start.joints), problem.arm_joints
        return cls(
            _resting(problem, 0.0), 0.0, start.attitude, start.joints[arm], rates.joints[arm],
            np.zeros(3),
        )  # fmt: skip

    @property
    def pose(self) -> Pose:
        """Pose of the end-effector from the centre of mass, inertial axes."""
        return self.problem.model.end_effector_pose(self.attitude, self.joints)

    @property
    def twist(self) -> Array:
        """Twist of the end-effector in the frame of the manoeuvre [m/s; rad/s], shape (6,)."""
        system, state = self.problem.system, (self.attitude, self.joints)
        base = system.base_twist(*state, self.joint_rates)
        J = end_effector_jacobian(system.model, self.joints, self.attitude)
        return np.asarray(J @ np.concatenate([base, self.joint_rates]))

    def after(self, motion: Motion) -> SystemState:
        """The state at the end of a motion that begins with this one."""
        law, final = motion.law, motion.final
        duration, arm = law.timing.duration, motion.setting.arm_joints
        rates = law.rates(duration, final.attitude, final.joints)
        problem = _resting(motion.problem, duration) if motion.setting.arms else self.problem
        return replace(
            self, problem=problem, time=self.time + duration, attitude=final.attitude,
            joints=final.joints[arm], joint_rates=rates.joints[arm],
            centre=self.centre + duration * self.problem.drift,
        )  # fmt: skip

    def problem_for(self, path: TimedPath, **changes: Any) -> Problem:
        """The problem of a motion that begins now, from the present centre of mass.

        Args:
            path: Path in the frame of the motion, whose origin is the present centre of mass.
            **changes: Other attributes of the problem.
        """
        return self.problem.replace(path=path, scene=self.scene, limits=self._limits, **changes)

    @property
    def setting(self) -> JointSetting:
        """The setting of a motion of the joints that begins now, from the centre of mass."""
        problem = self.problem
        return JointSetting.of(
            problem.system, self.scene, self._limits, problem.task, problem.margin.measure
        )

    @property
    def _limits(self) -> AttitudeLimits | None:
        limits = self.problem.limits
        return limits and limits.seen_from(self.centre)

    @property
    def scene(self) -> Scene:
        """The scene now, from the present centre of mass."""
        return self.problem.scene.later(self.time, -self.centre)

    def limits(self, limits: Limits) -> Limits:
        """Limits from the present centre of mass, of the joints that move now."""
        return limits.of_joints(self.problem.model.dof).seen_from(self.centre)


def _resting(problem: Problem, t: float) -> Problem:
    """A problem without its start, arms on joint curves resting as at a time [s]."""
    return replace(problem.with_arms_resting(t), start_joints=None)
