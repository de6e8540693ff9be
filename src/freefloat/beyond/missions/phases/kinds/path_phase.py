"""Phases in which the end-effector follows a further path, without a search."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, cast

import numpy as np

from freefloat.beyond.missions.goals.goal import Goal
from freefloat.beyond.missions.phases.expected_state import ExpectedState
from freefloat.beyond.missions.phases.phase import Phase
from freefloat.beyond.missions.phases.prescribed_path import (
    JUMP,
    moved_to_begin_at,
    prescribed_path,
    require_continuous,
)
from freefloat.beyond.missions.phases.state import SystemState
from freefloat.certificate.certificate import certify
from freefloat.dynamics.redundancy import Redundancy
from freefloat.errors import InputError, finite_number, require_type
from freefloat.limits.check import LimitChecker, deepest_contact
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.margin import Margin
from freefloat.motion.problem import Problem
from freefloat.paths.relative_path import RelativePath
from freefloat.paths.timed_path import TimedPath
from freefloat.paths.transfer import transfer
from freefloat.planning.motions import SimulatedBranch, branch_at
from freefloat.planning.plan import Plan
from freefloat.planning.reasons import PRECEDED, Cause, Verdict
from freefloat.planning.settings import Search
from freefloat.scene.scene import FRAMES
from freefloat.so3 import Pose


@dataclass(frozen=True, eq=False)
class PathPhase(Phase):
    """A further path of the end-effector, from the state at which the phase before ends.

    Attributes:
        path: Path in the frame of the manoeuvre or in that of a body of the scene, or a goal with a
            pose in the frame of no body and a duration, to which the shortest way leads. It begins
            with the pose and the twist of the end-effector at the end of the phase before.
        name: Its name; by default ``"to"`` for a pose, else ``"path"``, with a number where another
            phase has that name.
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
        """See :class:`~freefloat.beyond.missions.phases.phase.Phase`."""
        given, drift = self.path, state.problem.drift
        if isinstance(given, Goal):
            duration = cast(float, given.duration)
            end = given.pose if given.frame == "inertial" else None
            if end is not None and state.pose is not None and state.twist is not None:
                path = transfer(state.pose, state.twist, end, duration, drift)
                return state.after_path(path, self.redundancy, end, np.zeros(6))
            if self.redundancy is not None:
                self.redundancy.require_applicable(state.problem.model, state.problem.task)
            return state.after(duration, end, np.zeros(6))
        if isinstance(given, RelativePath):
            state.body(given.body.name, "path.frame", FRAMES[:1])
        path = prescribed_path(given, state.bodies_now, np.zeros(3), drift)
        if state.pose is not None:
            require_continuous(path, state.pose, state.twist, state.problem)
        end, twist = path.path.pose(1.0), path.twist(path.duration) + path.drift_twist
        return state.after_path(path, self.redundancy, end, twist)

    def setting_at(self, state: SystemState) -> Problem:
        """See :class:`~freefloat.beyond.missions.phases.phase.Phase`.

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
        """See :class:`~freefloat.beyond.missions.phases.phase.Phase`."""
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
