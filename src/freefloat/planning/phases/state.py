"""The state that one phase of a manoeuvre hands on to the next."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from freefloat.dynamics.capture import Capture, capture
from freefloat.dynamics.momentum import end_effector_jacobian, momentum_map
from freefloat.dynamics.summary import frames_at
from freefloat.motion.margin import Margin
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.paths.timing import TimedPath
from freefloat.paths.transfer import transfer
from freefloat.planning.phases.phases import CapturePhase, PathPhase, PoseGoal
from freefloat.planning.phases.prescribed_path import (
    moved_to_begin_at,
    prescribed_path,
    require_continuous,
)
from freefloat.scene.scene import Scene
from freefloat.so3 import Array, Pose, frozen, rotation_matrix


@dataclass(frozen=True, eq=False)
class Handover:
    """The system at the end of a phase.

    Attributes:
        problem: That of the first path, with the robot, momentum and scene that there are now; the
            scene is the one at the beginning of the manoeuvre's first path, in its frame.
        time: From the beginning of the first path [s].
        attitude: Of the spacecraft, unit quaternion x, y, z, w.
        joints: Shape (n,).
        joint_rates: [rad/s or m/s], shape (n,).
        base_rate: Angular velocity of the spacecraft, its axes [rad/s], shape (3,).
        centre: Of mass in the frame of the manoeuvre [m], shape (3,).
    """

    problem: Problem = field(repr=False)
    time: float
    attitude: Array
    joints: Array
    joint_rates: Array
    base_rate: Array
    centre: Array

    def __post_init__(self) -> None:
        for name in ("attitude", "joints", "joint_rates", "base_rate", "centre"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @classmethod
    def at_start(cls, motion: Motion) -> Handover:
        """The state at the beginning of a motion along the first path."""
        problem, start = replace(motion.problem, start_joints=None), motion.initial
        rates = motion.law.rates(0.0, start.attitude, start.joints)
        return cls(
            problem, 0.0, start.attitude, start.joints, rates.joints, rates.base, np.zeros(3)
        )

    @property
    def pose(self) -> Pose:
        """Of the end-effector from the centre of mass, inertial axes."""
        return self.problem.model.end_effector_pose(self.attitude, self.joints)

    @property
    def twist(self) -> Array:
        """Of the end-effector in the frame of the manoeuvre [m/s; rad/s], shape (6,)."""
        model, drift = self.problem.model, self.problem.path.drift
        A = momentum_map(model, self.joints, self.attitude)
        rates = np.concatenate([self.base_rate, self.joint_rates])
        linear = np.linalg.solve(A[:3, :3], model.total_mass * drift - A[:3, 3:] @ rates)
        J = end_effector_jacobian(model, self.joints, self.attitude)
        return np.asarray(J @ np.concatenate([linear, rates]))

    def after(self, motion: Motion) -> Handover:
        """The state at the end of a motion that begins with this one."""
        law, final = motion.law, motion.final
        duration = law.duration
        rates = law.rates(duration, final.attitude, final.joints)
        return replace(
            self, time=self.time + duration, attitude=final.attitude, joints=final.joints,
            joint_rates=rates.joints, base_rate=rates.base,
            centre=self.centre + duration * self.problem.path.drift,
        )  # fmt: skip

    def problem_of(self, phase: PathPhase) -> Problem:
        """The problem of a phase that begins now, from the present centre of mass.

        Raises:
            InputError: If the end-effector would jump, or change its twist at once.
        """
        return self.problem.replace(
            path=self.path_of(phase), margin=Margin(self.problem.margin.measure, phase.margin),
            redundancy=phase.redundancy, scene=self.scene, start_joints=None,
        )  # fmt: skip

    @property
    def scene(self) -> Scene:
        """The scene now, from the present centre of mass."""
        return self.problem.scene.later(self.time, -self.centre)

    def path_of(self, phase: PathPhase) -> TimedPath:
        """The path of a phase that begins now, from the present centre of mass.

        Raises:
            InputError: If the end-effector would jump, or change its twist at once.
        """
        drift, task = self.problem.path.drift, self.problem.task
        if isinstance(phase.path, PoseGoal):
            return transfer(self.pose, self.twist, self._goal(phase.path), phase.path.duration,
                            drift)  # fmt: skip
        path = prescribed_path(phase.path, self.scene.bodies, self.centre, drift)
        require_continuous(path, self.pose, self.twist, task)
        return moved_to_begin_at(path, self.pose, task)

    def _goal(self, goal: PoseGoal) -> Pose:
        """The pose from the present centre of mass, inertial axes."""
        if goal.frame == "inertial":
            return Pose(goal.pose.position - self.centre, goal.pose.rotation)
        if goal.frame == "end_effector":
            return self.pose @ goal.pose
        return frames_at(self.problem.model, self.attitude, self.joints)[goal.frame] @ goal.pose

    def captured(self, phase: CapturePhase) -> tuple[Handover, Capture]:
        """The state after a body is fixed to the end-effector, and the capture."""
        body = next(body for body in self.scene.bodies if body.name == phase.body)
        grapple = body.pose.inverse() @ self.pose
        problem, axes = self.problem, rotation_matrix(self.attitude)
        result = capture(
            problem.model, phase.client(body, grapple), self.attitude, self.joints,
            self.joint_rates, problem.momentum, problem.path.drift, problem.wheel_momentum,
        )  # fmt: skip
        before, links = problem.model.description.links_by_name, result.model.description.links
        payload = next(link.name for link in links if link.name not in before)
        held = replace(
            body, position=grapple.inverse().position, orientation=grapple.inverse().rotation,
            motion="target", touch_links=(*body.touch_links, problem.model.end_effector),
            payload=payload,
        )  # fmt: skip
        others = (b for b in problem.scene.bodies if b.name != phase.body)
        corridor = problem.scene.corridor
        if corridor is not None and corridor.body == phase.body:
            corridor = None  # the end-effector does not move in it any more
        scene = Scene((*others, held), corridor)
        following = problem.replace(
            model=result.model, momentum=result.momentum, scene=scene,
            path=replace(problem.path, drift=result.velocity),
        )  # fmt: skip
        state = replace(
            self, problem=following, joint_rates=result.joint_rates,
            base_rate=axes.T @ result.base_rate, centre=self.centre + result.centre_of_mass,
        )  # fmt: skip
        return state, result
