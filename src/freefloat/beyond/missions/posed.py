"""What scenarios ask for beyond a path: a motion to a goal, or a manoeuvre."""

from __future__ import annotations

from functools import cached_property
from typing import Any, cast

from freefloat.beyond.missions.goals.goal import Goal
from freefloat.beyond.missions.goals.goal_motion import GoalMotion, goal_setting
from freefloat.beyond.missions.manoeuvre import Manoeuvre, Phase, checked_phases
from freefloat.beyond.missions.state import keys_within
from freefloat.concurrency import Progress
from freefloat.io.scenario.scenario import Scenario
from freefloat.motion.motion import Motion
from freefloat.motion.setting import JointSetting


class PosedGoal:
    """The motion to a goal that a scenario asks for.

    Attributes:
        goal: The goal.
        present: Attitude of the spacecraft, unit quaternion x, y, z, w, and joints (n,) at the
            start.
    """

    def __init__(self, scenario: Scenario) -> None:
        """Read a scenario with a goal.

        Raises:
            InputError: If a value is invalid, or the present state is missing.
        """
        self.goal: Goal = cast(Goal, scenario.goal())
        self._scenario, self._search = scenario, scenario.search()
        with scenario.error_context():
            self.present = self._search.present_state(scenario.model())

    @cached_property
    def setting(self) -> JointSetting:
        """Robot, momentum and scene.

        Raises:
            InputError: If the goal does not suit them.
        """
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
        from freefloat.beyond.missions.goals.mover import sketch  # compiled kernels

        return sketch(*self._arguments(), seed=self._search.seed)

    def _arguments(self) -> tuple[Any, ...]:
        scenario = self._scenario
        return scenario.system(), self.present, self.goal, scenario.limits(), scenario.scene()


class PosedManoeuvre:
    """The manoeuvre that a scenario asks for: phases follow its path, or a reorientation leads."""

    def __init__(self, scenario: Scenario) -> None:
        """Keep the scenario."""
        self._scenario = scenario

    @cached_property
    def phases(self) -> tuple[Phase, ...]:
        """What follows the path, see :meth:`.Scenario.phases`."""
        scenario, content = self._scenario, self._scenario.content
        problem, folder = scenario.problem(), scenario.source.parent
        keys, phases = list[str](), list[Phase]()
        with scenario.error_context():
            resting = problem.at_rest(problem.path.duration)
            posed = resting, folder, scenario.samples, content.search.seed
            for number, section in enumerate(content.phases):
                keys.append(f"phases.{number}.capture" if section.capture else f"phases.{number}")
                with keys_within(keys[-1]):
                    phases.append(section.to_phase(*posed))
            return checked_phases(resting, phases, keys)

    def plan(self, *, threads: int | None = None, progress: Progress | None = None) -> Manoeuvre:
        """The manoeuvre, see :func:`freefloat.plan_manoeuvre`."""
        from freefloat.beyond.missions.manoeuvre_planner import plan_manoeuvre

        scenario = self._scenario
        problem, search, phases = scenario.problem(), scenario.search(), scenario.phases()
        reorient = scenario.content.search.reorient
        with scenario.error_context():
            return plan_manoeuvre(
                problem, phases, search, reorient=reorient, threads=threads, progress=progress
            )
