"""Phases in which the end-effector follows a further path, without a search.

The path is stated in the frame of the manoeuvre or of a body; it begins where the end-effector is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, cast

import numpy as np

from freefloat.beyond.missions.goals.goal import Goal
from freefloat.beyond.missions.manoeuvre import Phase
from freefloat.beyond.missions.state import ExpectedState, SystemState
from freefloat.certificate.certificate import certify
from freefloat.dynamics.redundancy import Redundancy
from freefloat.dynamics.tasks import Task
from freefloat.errors import InputError, finite_number, require_type
from freefloat.limits.limits import LimitChecker, Limits, deepest_contact
from freefloat.limits.result import LimitResult
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.margin import Margin
from freefloat.motion.problem import Problem
from freefloat.paths.orientation import RotatedOrientation
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.relative_path import RelativePath
from freefloat.paths.timed_path import TimedPath
from freefloat.paths.transfer import transfer
from freefloat.planning.motions import SimulatedBranch, branch_at
from freefloat.planning.plan import Plan
from freefloat.planning.reasons import PRECEDED, Cause, Verdict
from freefloat.planning.settings import Search
from freefloat.rotations import Rotation
from freefloat.scene.scene import FRAMES
from freefloat.scene.scene_body import SceneBody
from freefloat.so3 import Array, Pose, rotation_vector_between

JUMP = 1e-6
"""Largest jump of the end-effector between phases [m, rad], of its twist [m/s, rad/s] and of joint
rates [rad/s, m/s]."""
_AS_BEFORE = "as the phase before ends, or a path to a pose"


@dataclass(frozen=True, eq=False)
class PathPhase(Phase):
    """A further path of the end-effector, from the state at which the phase before ends.

    Attributes:
        path: Path in the frame of the manoeuvre or of a body of the scene, or a goal with a
            pose in the frame of no body and a duration, to which the shortest way leads. It begins
            with the pose and the twist of the end-effector at the end of the phase before.
        name: Name of the phase; by default ``"to"`` for a pose, else ``"path"``, with a number
            where another phase has that name.
        margin: Required magnitude of the first path's measure.
        redundancy: Null-space motion of redundant arms.

    Example:
        >>> back = ff.so3.Pose([0.0, 0.0, -0.02], np.eye(3))
        >>> ff.PathPhase(ff.Goal(back, frame="end_effector", duration=15.0), "stop").name
        'stop'
    """

    kind: ClassVar[str] = "path"

    path: TimedPath | RelativePath | Goal = field(repr=False)
    name: str = ""
    margin: float = 0.0
    redundancy: Redundancy | None = None

    def __post_init__(self) -> None:
        accepted = "a TimedPath, a RelativePath or a Goal"
        require_type("path", self.path, TimedPath | RelativePath | Goal, accepted)
        if isinstance(self.path, Goal):
            _require_pose_alone(self.path)
        elif self.path.timing.is_sought:
            accepted = "another law, or optimal with speeds: the first path alone is made faster"
            raise InputError("timing.law", "optimal was given, without speeds", accepted)
        require_type("name", self.name, str, "a name")
        finite_number("margin", self.margin, "a magnitude of at least zero", 0.0)
        accepted = "Redundancy, such as Redundancy(metric='energy')"
        require_type("redundancy", self.redundancy, Redundancy | None, accepted)

    @property
    def default_name(self) -> str:
        """``to`` for a pose, else ``path``."""
        return "to" if isinstance(self.path, Goal) else "path"

    def expected_after(self, state: ExpectedState) -> ExpectedState:
        """See :class:`~freefloat.beyond.missions.manoeuvre.Phase`."""
        stated, drift = self.path, state.problem.drift
        if isinstance(stated, Goal):
            duration = cast(float, stated.duration)
            end = stated.pose if stated.frame == "inertial" else None
            if end is not None and state.pose is not None and state.twist is not None:
                path = transfer(state.pose, state.twist, end, duration, drift)
                return state.after_path(path, self.redundancy, end, np.zeros(6))
            if self.redundancy is not None:
                self.redundancy.require_applicable(state.problem.model, state.problem.task)
            return state.after(duration, end, np.zeros(6))
        if isinstance(stated, RelativePath):
            state.body(stated.body.name, "path.frame", FRAMES[:1])
        path = prescribed_path(stated, state.bodies_now, np.zeros(3), drift)
        if state.pose is not None:
            require_continuous(path, state.pose, state.twist, state.problem)
        end, twist = path.path.pose(1.0), path.twist(path.duration) + path.drift_twist
        return state.after_path(path, self.redundancy, end, twist)

    def setting_at(self, state: SystemState) -> Problem:
        """See :class:`~freefloat.beyond.missions.manoeuvre.Phase`.

        Raises:
            InputError: If the end-effector would jump, or change its twist at once.
        """
        margin = Margin(state.problem.margin.measure, self.margin)
        return state.problem_for(self._path_at(state), margin=margin, redundancy=self.redundancy)

    def _path_at(self, state: SystemState) -> TimedPath:
        """The path from the present centre of mass."""
        drift = state.problem.drift
        if isinstance(self.path, Goal):
            goal = self.path.seen_from(state.centre)
            end = cast(Pose, goal.pose_in(state.problem.model, state.attitude, state.joints))
            return transfer(state.pose, state.twist, end, cast(float, goal.duration), drift)
        path = prescribed_path(self.path, state.scene.bodies, state.centre, drift)
        require_continuous(path, state.pose, state.twist, state.problem)
        return moved_to_begin_at(path, state.pose, state.problem)

    def to_dict(self) -> dict[str, Any]:
        """See :class:`~freefloat.beyond.missions.manoeuvre.Phase`."""
        if self.redundancy is not None:
            problem = "scenario files cannot describe that of a phase"
            raise InputError("redundancy", problem, "no redundancy: the smallest joint rates")
        content: dict[str, Any] = {"margin": float(self.margin)}
        if isinstance(self.path, Goal):
            content |= {"to": self.path.to_dict()["pose"], "duration": self.path.duration}
        return content

    def run(self, state: SystemState, limits: Limits) -> Plan:
        """The motion along the path from a state, exactly as it is."""
        problem = self.setting_at(state)
        motion = integrate_motion(problem, state.attitude, state.joints)
        approach = closest_approach(motion, problem.margin.measure)
        branch = branch_at(problem, state.attitude, state.joints)
        chosen = SimulatedBranch(branch, motion, approach)
        results = LimitChecker(problem, limits).results(motion)
        verdict = _verdict(state, chosen, results)
        reason = PRECEDED if verdict.feasible else str(verdict)
        return Plan(
            problem, Search(), verdict.feasible, reason, chosen=chosen, limits=limits,
            limit_results=results, certificate=certify(motion),
            contact=deepest_contact(motion, results),
        )  # fmt: skip


def _require_pose_alone(goal: Goal) -> None:
    """Raise an InputError unless a straight way can lead to a goal."""
    if goal.pose is None or goal.attitude is not None:
        raise InputError("path.pose", "the goal has none or an attitude, too", "nothing but a pose")
    if goal.duration is None:
        raise InputError("path.duration", "it is missing", "the duration [s] of the straight way")
    if goal.frame not in FRAMES:
        raise InputError("path.frame", f"{goal.frame!r} was given", ", ".join(FRAMES))


def _verdict(
    state: SystemState, chosen: SimulatedBranch, results: tuple[LimitResult, ...]
) -> Verdict:
    """The verdict on a motion that begins with a state, whose joint rates must not jump."""
    motion = chosen.motion
    if not motion.completed:
        return chosen.verdict()
    change = float(np.abs(SystemState.at_start(motion).joint_rates - state.joint_rates).max())
    return Verdict(Cause.JUMP, value=change) if change > JUMP else chosen.verdict(results)


def prescribed_path(
    given: TimedPath | RelativePath, bodies: Sequence[SceneBody], centre: Array, drift: Array
) -> TimedPath:
    """A path in the frame of a manoeuvre or of a body, from the present centre of mass.

    Args:
        given: The path.
        bodies: Bodies of the scene now, from the present centre of mass.
        centre: Centre of mass in the frame of the manoeuvre [m], shape (3,).
        drift: Velocity of the centre of mass [m/s], shape (3,).
    """
    if isinstance(given, RelativePath):
        body = next(body for body in bodies if body.name == given.body.name)
        return replace(given, body=body).timed(drift)
    curve = given.path.curve.moved(Pose(-centre, np.eye(3)))
    return TimedPath(EndEffectorPath(curve, given.path.orientation), given.timing, drift)


def require_continuous(path: TimedPath, pose: Pose, twist: Array | None, problem: Problem) -> None:
    """Raise an InputError unless a path begins with a pose and a twist of the end-effector.

    Args:
        path: The path.
        pose: Pose of the end-effector, in the frame of the path.
        twist: Twist in that frame [m/s; rad/s], shape (6,); None where it is not known.
        problem: Problem whose task is the part of both that counts.
    """
    jump = float(np.abs(_offset(path, pose, problem)).max())
    if jump > JUMP:
        raise InputError("path", f"it begins {jump:.3g} m or rad away", _AS_BEFORE)
    if twist is None:
        return
    difference = path.twist(0.0) + path.drift_twist - twist
    change = float(np.abs(_prescribed(difference, pose, problem)).max())
    if change > JUMP:
        given = f"the end-effector's twist would change by {change:.3g} m/s or rad/s"
        raise InputError("path", given, _AS_BEFORE)


def moved_to_begin_at(path: TimedPath, pose: Pose, problem: Problem) -> TimedPath:
    """The path, moved and turned by the little by which it does not begin at a pose.

    Joints need no correction then, and errors of paths before are not errors of this one.
    """
    offset = -_offset(path, pose, problem)
    curve, orientation = path.path.curve, path.path.orientation
    moved = curve.moved(Pose(offset[:3], np.eye(3)))
    if problem.task.prescribes_orientation:
        turn = Rotation.from_rotvec(offset[3:]).as_matrix()
        orientation = RotatedOrientation(orientation, turn)
    return replace(path, path=EndEffectorPath(moved, orientation))


def _offset(path: TimedPath, pose: Pose, problem: Problem) -> Array:
    """From a pose to the first one of a path [m; rad], inertial axes; zero what is free, (6,)."""
    start = path.pose(0.0)
    turn = rotation_vector_between(pose.rotation, start.rotation)
    if problem.task is Task.POINTING:
        turn = _between(pose.rotation[:, 2], start.rotation[:, 2], pose.rotation[:, 0])
    return _prescribed(np.concatenate([start.position - pose.position, turn]), pose, problem)


def _between(first: Array, second: Array, across: Array) -> Array:
    """The shortest rotation vector between unit vectors; ``across`` the axis of opposite ones."""
    normal = np.cross(first, second)
    sine = float(np.linalg.norm(normal))
    axis = normal / sine if sine else across
    return np.asarray(np.arctan2(sine, first @ second) * axis)


def _prescribed(vector: Array, pose: Pose, problem: Problem) -> Array:
    """The part of a pair of vectors (6,) in inertial axes that the task prescribes at a pose."""
    task, axes = problem.task, np.eye(3)
    if task is Task.POINTING:
        axes = pose.rotation
    elif task.planar:
        axes = problem.plane.axes
    kept = np.zeros(6)
    kept[task.rows] = (vector.reshape(2, 3) @ axes).ravel()[task.rows]
    return np.asarray((kept.reshape(2, 3) @ axes.T).ravel())
