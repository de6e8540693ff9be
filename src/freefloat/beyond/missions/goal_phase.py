"""Goals of scenarios, and phases in which the joints move to a goal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np

from freefloat.beyond.missions.goals.goal import Goal
from freefloat.beyond.missions.goals.goal_motion import GoalMotion, goal_setting
from freefloat.beyond.missions.manoeuvre import Phase
from freefloat.beyond.missions.state import ExpectedState, SystemState
from freefloat.concurrency import Progress
from freefloat.errors import InputError, require_type, seed_number
from freefloat.limits.limits import Limits
from freefloat.motion.motion import Motion
from freefloat.motion.setting import JointSetting
from freefloat.scene.scene import FRAMES

if TYPE_CHECKING:  # pydantic imports slowly
    from freefloat.io.scenario.scenario import Scenario


@dataclass(frozen=True, eq=False)
class GoalPhase(Phase):
    """A motion of the joints to a goal, from the state at which the phase before ends.

    Attributes:
        goal: What shall hold at the end; an inertial pose is in the frame of the manoeuvre.
        name: Name of the phase; by default ``"goal"``, with a number where another has that name.
        seed: Seed of the random paths of the search.

    Example:
        >>> ff.GoalPhase(ff.Goal(joints=[0.2, -0.4]), name="berth").name
        'berth'
    """

    kind: ClassVar[str] = "goal"

    goal: Goal
    name: str = ""
    seed: int = 0

    def __post_init__(self) -> None:
        require_type("goal", self.goal, Goal, "a Goal, such as Goal(joints=joints)")
        require_type("name", self.name, str, "a name")
        seed_number("seed", self.seed)

    def expected_after(self, state: ExpectedState) -> ExpectedState:
        """See :class:`~freefloat.beyond.missions.manoeuvre.Phase`."""
        goal = self.goal
        goal.require_applicable(state.problem)
        if goal.frame not in FRAMES:
            state.body(goal.frame, "goal.pose.frame", FRAMES)
        if goal.duration is None:
            return replace(state, pose=None, twist=None)
        known = goal.frame == "inertial"
        twist = np.zeros(6) if goal.pose is not None and known else None
        return state.after(goal.duration, goal.pose if known else None, twist)

    def setting_at(self, state: SystemState) -> JointSetting:
        """See :class:`~freefloat.beyond.missions.manoeuvre.Phase`."""
        return state.setting

    def to_dict(self) -> dict[str, Any]:
        """See :class:`~freefloat.beyond.missions.manoeuvre.Phase`."""
        if self.goal.joint_rates is not None:
            problem = "scenario files cannot describe them"
            raise InputError("goal.joint_rates", problem, "a goal at rest")
        return {"goal": self.goal.to_dict()}

    def run(self, state: SystemState, limits: Limits) -> GoalMotion:
        """The motion to the goal from a state."""
        from freefloat.beyond.missions.goals.mover import move_from  # compiled kernels
        from freefloat.beyond.missions.goals.query import GoalStart, Query

        start = GoalStart(state.attitude, state.joints, state.joint_rates)
        query = Query(
            state.setting.replace(limits=limits.without_turn), start,
            self.goal.seen_from(state.centre), first_duration=state.problem.path.duration,
        )  # fmt: skip
        return move_from(query, seed=self.seed)


class PosedGoal:
    """The motion to a goal that a scenario asks for.

    Attributes:
        goal: The goal.
        present: Attitude of the spacecraft, unit quaternion x, y, z, w, and joints (n,) at the
            start.
    """

    def __init__(self, scenario: Scenario) -> None:
        """Read a scenario; raises an InputError if it is invalid or has no present state."""
        self.goal: Goal = cast(Goal, scenario.goal())
        self._scenario, self._search = scenario, scenario.search()
        with scenario.error_context():
            self.present = self._search.present_state(scenario.model())

    @cached_property
    def setting(self) -> JointSetting:
        """Robot, momentum and scene; raises an InputError if the goal does not suit them."""
        system, scene = self._scenario.system(), self._scenario.scene()
        with self._scenario.error_context():
            setting = goal_setting(system, self.present[0], self.goal, scene)
            self.goal.require_applicable(setting)
        return setting

    def plan(self, *, threads: int | None = None, progress: Progress | None = None) -> GoalMotion:
        """The motion, see :func:`freefloat.move`; on one core."""
        from freefloat.beyond.missions.goals.mover import move  # compiled kernels

        arguments = self._arguments()
        with self._scenario.error_context():
            return move(*arguments, seed=self._search.seed, progress=progress)

    def sketch(self) -> Motion | None:
        """See :func:`~freefloat.beyond.missions.goals.mover.sketch`."""
        from freefloat.beyond.missions.goals.mover import posed, sketch  # compiled kernels

        return sketch(posed(*self._arguments()), self._search.seed)

    def _arguments(self) -> tuple[Any, ...]:
        scenario = self._scenario
        return scenario.system(), self.present, self.goal, scenario.limits(), scenario.scene()
