"""The state that one phase of a manoeuvre hands on to the next."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from freefloat.dynamics.capture import Capture, Client, capture
from freefloat.dynamics.momentum import end_effector_jacobian, momentum_map
from freefloat.dynamics.summary import frames_at, roll_pitch_yaw
from freefloat.errors import InputError
from freefloat.motion.margin import Margin
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.paths.curves import Curve
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.relative_path import RelativePath
from freefloat.paths.scene import Scene
from freefloat.paths.scene_body import SceneBody
from freefloat.paths.timing import TimedPath
from freefloat.paths.transfer import transfer
from freefloat.paths.tumbling import Tumbling
from freefloat.planning.phases import CapturePhase, PathPhase, PoseGoal
from freefloat.robot.parts import Mount
from freefloat.so3 import Array, Pose, frozen, rotation_matrix, rotation_vector_between

_JUMP = 1e-6
"""Largest jump of the end-effector between phases [m, rad], and of its twist [m/s, rad/s]."""


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

    def stated(self, path: TimedPath, margin: float, phase: PathPhase | None = None) -> Problem:
        """The problem of a phase that begins now, with a path from the present centre of mass."""
        measure = self.problem.margin.measure
        redundancy = self.problem.redundancy if phase is None else phase.redundancy
        return self.problem.replace(
            path=path, margin=Margin(measure, margin), redundancy=redundancy,
            scene=self.scene, start_joints=None,
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
        drift = self.problem.path.drift
        if isinstance(phase.path, PoseGoal):
            return transfer(self.pose, self.twist, self._goal(phase.path), phase.path.duration,
                            drift)  # fmt: skip
        if isinstance(phase.path, RelativePath):
            body = _body(self.scene, phase.path.body.name, f"phases.{phase.name}")
            path: TimedPath = replace(phase.path, body=body).timed(drift)
        else:
            given = phase.path.path
            curve = _Shifted(given.curve, -self.centre)
            moved = EndEffectorPath(curve, given.orientation)
            path = TimedPath(moved, phase.path.timing, drift)
        self._require_continuous(path, phase.name)
        return path

    def _goal(self, goal: PoseGoal) -> Pose:
        """The pose from the present centre of mass, inertial axes."""
        if goal.frame == "inertial":
            return Pose(goal.pose.position - self.centre, goal.pose.rotation)
        if goal.frame == "end_effector":
            return self.pose @ goal.pose
        return frames_at(self.problem.model, self.attitude, self.joints)[goal.frame] @ goal.pose

    def _require_continuous(self, path: TimedPath, name: str) -> None:
        start, here = path.pose(0.0), self.pose
        rows = np.array(self.problem.task.rows)
        jumps = np.concatenate([
            start.position - here.position,
            rotation_vector_between(here.rotation, start.rotation),
        ])[rows]  # fmt: skip
        if np.abs(jumps).max() > _JUMP:
            size = float(np.abs(jumps).max())
            accepted = "the pose at which the phase before ends, or a path to a pose"
            raise InputError(f"phases.{name}.path", f"it begins {size:.3g} m or rad away", accepted)
        twist = path.twist(0.0) + path.drift_twist
        change = float(np.abs((twist - self.twist)[rows]).max())
        if change > _JUMP:
            accepted = "the twist at which the phase before ends, or a path to a pose"
            problem = f"the end-effector's twist would change by {change:.3g} m/s or rad/s"
            raise InputError(f"phases.{name}.path", problem, accepted)

    def captured(self, phase: CapturePhase) -> tuple[Handover, Capture]:
        """The state after a body is fixed to the end-effector, and the capture.

        Raises:
            InputError: If there is no such body, it is held already, or nothing states its inertia.
        """
        key = f"phases.{phase.name}"
        body = _body(self.scene, phase.body, key)
        if body.motion == "target":
            held_already = f"{body.name} moves with the end-effector already"
            raise InputError(f"{key}.body", held_already, "another body of the scene")
        tumbling = body.motion if isinstance(body.motion, Tumbling) else None
        inertia, com, rate = phase.inertia, phase.com, np.zeros(3)
        if tumbling is not None:
            inertia = tumbling.inertia if inertia is None else inertia
            com, rate = tumbling.com if com is None else com, tumbling.rate
        if inertia is None:
            accepted = "an inertia here, or in the body's tumbling"
            raise InputError(f"{key}.inertia", "it is missing", accepted)
        grapple = body.pose.inverse() @ self.pose
        mount = Mount(grapple.position, roll_pitch_yaw(grapple.rotation))
        com = np.zeros(3) if com is None else com
        client = Client(phase.mass, inertia, mount, rate, com=com)
        problem, axes = self.problem, rotation_matrix(self.attitude)
        wheels = axes @ problem.wheel_momentum
        result = capture(
            problem.model, client, self.attitude, self.joints, self.joint_rates,
            problem.momentum - wheels, problem.path.drift,
        )  # fmt: skip
        held = replace(
            body, position=grapple.inverse().position, orientation=grapple.inverse().rotation,
            motion="target", touch_links=(*body.touch_links, problem.model.end_effector),
        )  # fmt: skip
        others = (b for b in problem.scene.bodies if b.name != phase.body)
        following = problem.replace(
            model=result.model, momentum=result.momentum + wheels, scene=Scene((*others, held)),
            path=replace(problem.path, drift=result.velocity),
        )  # fmt: skip
        state = replace(
            self, problem=following, joint_rates=result.joint_rates,
            base_rate=axes.T @ result.base_rate, centre=self.centre + result.centre_of_mass,
        )  # fmt: skip
        return state, result


class _Shifted(Curve):
    """A curve moved by an offset [m], (3,)."""

    def __init__(self, curve: Curve, offset: Array) -> None:
        self._curve, self._offset, self.breaks = curve, offset, curve.breaks

    def __call__(self, s: float, order: int = 0) -> Array:
        """See :class:`~freefloat.paths.curves.Curve`."""
        value = self._curve(s, order)
        return value if order else value + self._offset

    def within(self, low: float, high: float) -> _Shifted:
        """See :class:`~freefloat.paths.curves.Segmented`."""
        return _Shifted(self._curve.within(low, high), self._offset)


def _body(scene: Scene, name: str, key: str) -> SceneBody:
    if name not in scene.names:
        accepted = ", ".join(scene.names) or "none, the scene has no bodies"
        raise InputError(f"{key}.body", f"there is no {name!r}", accepted)
    return scene.bodies[scene.names.index(name)]
