"""What the command ``plan`` finds for a scenario: a plan, a manoeuvre, or a motion to a goal.

Functions raise an InputError for values that planning does not accept; it names the file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from freefloat.concurrency import Progress
from freefloat.io.scenario.scenario import Scenario

if TYPE_CHECKING:  # compiled kernels are slow to import
    from freefloat.planning.answer import Answer
    from freefloat.planning.balance import Balance
    from freefloat.planning.balance_settings import BalanceSettings
    from freefloat.planning.goals.goal import Goal
    from freefloat.planning.goals.goal_motion import GoalMotion
    from freefloat.planning.phases.manoeuvre import Manoeuvre
    from freefloat.planning.plan import Plan


def answer_of(scenario: Scenario, threads: int | None = None) -> Answer:
    """The answer to whatever the scenario asks."""
    goal, settings = scenario.goal(), scenario.balance()
    if goal is not None:
        return goal_motion_of(scenario, goal)
    if scenario.has_phases:
        return manoeuvre_of(scenario, threads)
    if settings is not None:
        return balanced_plan_of(scenario, settings, threads)[0]
    return plan_of(scenario, threads)


def goal_motion_of(scenario: Scenario, goal: Goal, progress: Progress | None = None) -> GoalMotion:
    """The motion of the joints to the goal of a scenario."""
    from freefloat.planning.goals.mover import move

    search, limits = scenario.search(), scenario.limits()
    with scenario.error_context():
        state = search.present_state(scenario.model())
        return move(
            scenario.system(), state, goal, limits, scenario.scene(), seed=search.seed,
            progress=progress,
        )  # fmt: skip


def manoeuvre_of(
    scenario: Scenario, threads: int | None = None, progress: Progress | None = None
) -> Manoeuvre:
    """The manoeuvre of a scenario with phases."""
    from freefloat.planning.phases.manoeuvre_planner import plan_manoeuvre

    phases, limits = scenario.phases(), scenario.limits()
    with scenario.error_context():
        return plan_manoeuvre(
            scenario.problem(), phases, scenario.search(), limits,
            reorient=scenario.content.search.reorient, threads=threads, progress=progress,
        )  # fmt: skip


def plan_of(
    scenario: Scenario,
    threads: int | None = None,
    progress: Progress | None = None,
    *,
    stretch: bool = False,
) -> Plan:
    """The plan of a scenario's path."""
    from freefloat.planning.planner import plan

    problem, limits = scenario.problem(), scenario.limits()
    with scenario.error_context():
        return plan(
            problem, scenario.search(), limits, stretch=stretch, threads=threads, progress=progress
        )


def balanced_plan_of(
    scenario: Scenario,
    settings: BalanceSettings,
    threads: int | None = None,
    progress: Progress | None = None,
) -> tuple[Plan, Balance | None]:
    """The plan of a scenario's path while an arm balances, and what this arm achieves."""
    from freefloat.planning.balance import plan_balanced

    problem, limits = scenario.problem_at_rest(), scenario.limits()
    with scenario.error_context():
        return plan_balanced(
            problem, settings, scenario.search(), limits, threads=threads, progress=progress
        )
