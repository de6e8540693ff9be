"""What one scenario is asked and answers: a document, as the commands tell it, and its file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.errors import InputError
from freefloat.io.map_file import save_map
from freefloat.io.plan_file import save_motion, save_plan
from freefloat.io.scenario import Scenario
from freefloat.limits.check import LimitChecker
from freefloat.motion.problem import Problem
from freefloat.motion.simulation import simulate
from freefloat.planning.documents import simulation_document
from freefloat.so3 import heading_quaternion
from freefloat.studies.schema import Case


@dataclass(frozen=True, eq=False)
class Asked:
    """One scenario, and how its file is to name where it came from.

    Attributes:
        scenario: To be answered.
        told: The same under the names of the files it was read from.
        told_problem: A problem under those names.
        file: Where the result goes; None for no file.
    """

    scenario: Scenario
    told: Scenario
    told_problem: Callable[[Problem], Problem]
    file: Path | None

    def answer(self, task: Case, start: Mapping[str, Any]) -> dict[str, Any]:
        """Answer it on one core, and write the file.

        Args:
            task: What is asked.
            start: Of a simulation: attitude or heading_deg, and branch where one is wanted.

        Raises:
            InputError: If the scenario cannot be asked that.
        """
        problem = self.scenario.problem()
        if task is Case.SIMULATE:
            return self._simulated(problem, start)
        if task is Case.PLAN:
            return self._planned(problem)
        return self._mapped(problem)

    def _simulated(self, problem: Problem, start: Mapping[str, Any]) -> dict[str, Any]:
        with self.scenario.error_context():
            checker = LimitChecker(problem, self.scenario.limits(problem.model))
        attitude = _start_attitude(problem, start)
        followed = simulate(problem, attitude, branch=start.get("branch"))
        motion = followed.chosen.motion
        document = simulation_document(followed, checker.findings(motion))
        if self.file is not None:
            told = replace(motion, problem=self.told_problem(problem))
            save_motion(self.file, told, self.told, document)
        return document

    def _planned(self, problem: Problem) -> dict[str, Any]:
        from freefloat.planning.planner import plan

        with self.scenario.error_context():
            limits = self.scenario.limits(problem.model)
            found = plan(problem, self.scenario.search(), limits, threads=1)
        document = found.to_dict()
        if self.file is not None:
            told = replace(found, problem=self.told_problem(problem))
            save_plan(self.file, told, self.told, document)
        return document

    def _mapped(self, problem: Problem) -> dict[str, Any]:
        from freefloat.planning.mapping import attitude_map

        search = self.scenario.search()
        with self.scenario.error_context():
            found = attitude_map(problem, search.samples, seed=search.seed, threads=1)
        if self.file is not None:
            save_map(self.file, replace(found, problem=self.told_problem(problem)), self.told)
        return found.to_dict()


def _start_attitude(problem: Problem, start: Mapping[str, Any]) -> Any:
    heading = start.get("heading_deg")
    if heading is None:
        return start["attitude"]
    if not problem.task.planar:
        raise InputError("heading_deg", f"task {problem.task} is not planar", "attitude")
    if not isinstance(heading, int | float) or not np.isfinite(heading):
        raise InputError("heading_deg", f"{heading} was given", "a finite number of degrees")
    return heading_quaternion(np.radians(heading))
