"""The state of the system between two phases of a manoeuvre, and what is known of it before."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from freefloat.dynamics.momentum import end_effector_jacobian
from freefloat.dynamics.redundancy import Redundancy
from freefloat.errors import InputError
from freefloat.limits.limits import Limits
from freefloat.motion.motion import Motion
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem import Problem
from freefloat.motion.problem_inputs import require_few_revolutions
from freefloat.motion.setting import JointSetting
from freefloat.paths.timed_path import TimedPath
from freefloat.scene.scene import Scene
from freefloat.scene.scene_body import SceneBody
from freefloat.so3 import Array, Pose, frozen

_STILL = np.zeros(3)


@dataclass(frozen=True, eq=False)
class SystemState:
    """The system at the end of a phase.

    Arms that moved along joint curves during the first path rest where these end. The problem is
    the first path's, with the robot and the momentum that there are now; its scene is the
    one at the beginning of this path, in its frame.
    """

    problem: Problem = field(repr=False)
    time: float  # from the beginning of the first path [s]
    attitude: Array  # of the spacecraft, unit quaternion x, y, z, w
    joints: Array  # [rad or m], (n,)
    joint_rates: Array  # [rad/s or m/s], (n,)
    centre: Array  # of mass in the frame of the manoeuvre [m], (3,)

    def __post_init__(self) -> None:
        for name in ("attitude", "joints", "joint_rates", "centre"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @classmethod
    def at_start(cls, motion: Motion) -> SystemState:
        """The state at the beginning of a motion along the first path."""
        problem, start = motion.problem, motion.initial
        rates = motion.law.rates(0.0, start.attitude, start.joints)
        joints, joint_rates = map(problem.solved_joints, (start.joints, rates.joints))
        still = _resting(problem, 0.0)
        return cls(still, 0.0, start.attitude, joints, joint_rates, np.zeros(3))

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
        law, final, solved = motion.law, motion.final, motion.setting.solved_joints
        duration = law.timing.duration
        rates = law.rates(duration, final.attitude, final.joints)
        varies = motion.setting.robot_varies
        problem = _resting(motion.problem, duration) if varies else self.problem
        return replace(
            self, problem=problem, time=self.time + duration, attitude=final.attitude,
            joints=solved(final.joints), joint_rates=solved(rates.joints),
            centre=self.centre + duration * self.problem.drift,
        )  # fmt: skip

    def problem_for(self, path: TimedPath, **changes: Any) -> Problem:
        """The problem of a motion along a path that begins now, from the present centre of mass."""
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
    return replace(problem.at_rest(t), start_joints=None)


@dataclass(frozen=True, eq=False)
class ExpectedState:
    """What is known of the state between two phases."""

    problem: Problem = field(repr=False)  # after a capture without momentum, which is not known
    bodies: tuple[SceneBody, ...]  # of the scene, free ones, at time zero
    time: float  # from the beginning of the first path [s]
    pose: Pose | None  # of the end-effector, frame of the manoeuvre; None where it is not known
    twist: Array | None  # in that frame [m/s; rad/s], (6,); None where it is not known

    @classmethod
    def after_first(cls, problem: Problem) -> ExpectedState:
        """The state at the end of the first path, whose problem is given.

        Raises an InputError if further arms follow paths.
        """
        problem = problem.at_rest(problem.path.duration)
        problem.model.require_supported("phases")
        path = problem.path
        pose, twist = path.path.pose(1.0), path.twist(path.duration) + path.drift_twist
        return cls(problem, problem.scene.bodies, path.duration, pose, twist)

    @property
    def bodies_now(self) -> tuple[SceneBody, ...]:
        """The free bodies at this time, in the frame of the manoeuvre."""
        return tuple(body.later(self.time, _STILL) for body in self.bodies)

    def body(self, name: str, key: str, others: Sequence[str] = ()) -> SceneBody:
        """The free body with a name, at time zero.

        Args:
            name: Name of the body.
            key: Key of the name, for errors.
            others: What else the key accepts.

        Raises:
            InputError: If it is not in the scene, or moves with the end-effector.
        """
        free = {body.name: body for body in self.bodies if body.motion != "target"}
        if name in free:
            return free[name]
        problem = f"there is no {name!r}"
        if name in self.problem.scene.names:
            problem = f"{name} moves with the end-effector already"
        accepted = ", ".join([*others, *free]) or "none, the scene has no free bodies"
        raise InputError(key, problem, accepted)

    def after(self, duration: float, pose: Pose | None, twist: Array | None) -> ExpectedState:
        """The state after a duration [s], at which the end-effector has a pose and a twist.

        Raises an InputError if system or bodies would rotate too often.
        """
        time = self.time + duration
        Scene(self.bodies).require_applicable(self.problem.model, time)
        require_few_revolutions(self.problem.system, duration)
        return replace(self, time=time, pose=pose, twist=twist)

    def after_path(
        self, path: TimedPath, redundancy: Redundancy | None, pose: Pose | None, twist: Array
    ) -> ExpectedState:
        """The state after a path of the robot; raises as :class:`.Problem`, too."""
        self.problem.replace(path=path, redundancy=redundancy, scene=Scene())
        return self.after(path.duration, pose, twist)

    def without(self, body: SceneBody) -> ExpectedState:
        """The state after the capture of a body."""
        bodies = tuple(entry for entry in self.bodies if entry is not body)
        problem = self.problem.replace(momentum=_STILL, wheel_momentum=_STILL)
        return replace(self, problem=problem, bodies=bodies, twist=None)


@contextmanager
def keys_within(key: str) -> Iterator[None]:
    """Context in which the keys of errors are those below another key, unless they name a file."""
    try:
        yield
    except InputError as error:
        if error.source is not None:
            raise
        raise error.with_key(f"{key}.{error.key}") from None
