"""The analysis of a scenario, by what it states: a path or a goal."""

from __future__ import annotations

from freefloat.beyond.studio.analysis import Analysis, RobotCache
from freefloat.beyond.studio.goal_analysis import GoalAnalysis
from freefloat.beyond.studio.messages import WorkerState
from freefloat.beyond.studio.path_analysis import PathAnalysis
from freefloat.io.scenario.scenario import parse_scenario


def analysis_of(state: WorkerState, robots: RobotCache) -> Analysis:
    """The analysis of the scenario of a state.

    Raises:
        InputError: If the scenario is invalid.
    """
    scenario = parse_scenario(state.text, state.source)
    kind = PathAnalysis if scenario.content.goal is None else GoalAnalysis
    return kind(state, scenario, robots)
