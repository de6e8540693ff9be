"""Robots of scenarios that are edited, and what edits of the path do not change."""

from __future__ import annotations

from dataclasses import replace

from freefloat.dynamics.joint_space import largest_measure
from freefloat.io.scenario.scenario import Scenario
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel

_KNOWN = 8
"""Robots that are kept."""


class RobotCache:
    """Models of robots, and the largest magnitudes of measures, which edits do not change."""

    def __init__(self) -> None:
        self._models: dict[str, FreeFloatingModel] = {}
        self._largest: dict[tuple[str, ...], float] = {}

    def with_model(self, scenario: Scenario) -> Scenario:
        """A scenario with its robot, which is read once."""
        robot = self._key(scenario)
        if robot not in self._models:
            self._models = dict([*self._models.items()][1 - _KNOWN :])
            self._models[robot] = scenario.model()
        return replace(scenario, robot=self._models[robot])

    def problem(self, scenario: Scenario) -> tuple[Scenario, Problem, float]:
        """A scenario with its robot, its problem, and the largest magnitude of its measure."""
        scenario, content = self.with_model(scenario), scenario.content
        key = self._key(scenario), str(content.task), content.margin.measure
        fraction = content.margin.fraction
        if fraction is None or key not in self._largest:
            problem = scenario.problem()
            if key not in self._largest:
                measure = problem.margin.measure
                known = problem.margin.threshold / fraction if fraction else None
                self._largest[key] = known or largest_measure(problem.model, measure)
            return scenario, problem, self._largest[key]
        largest = self._largest[key]
        margin = content.margin.model_copy(update={"value": fraction * largest, "fraction": None})
        stated = replace(scenario, content=content.model_copy(update={"margin": margin}))
        return scenario, stated.problem(), largest

    @staticmethod
    def _key(scenario: Scenario) -> str:
        without_paths = {"arms": {"__all__": {"law": {"path"}}}}
        return f"{scenario.content.robot.model_dump_json(exclude=without_paths)} {scenario.source}"
