"""What one scenario is asked and answers: a document, as the commands tell it, and its file."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from freefloat.answers.map_report import attitude_map_document, map_document
from freefloat.answers.report import plan_document, simulation_document
from freefloat.errors import InputError
from freefloat.io.map_file import map_file, save_map
from freefloat.io.plan_file import save_motion, save_plan
from freefloat.io.scenario import Scenario
from freefloat.limits.check import LimitChecker
from freefloat.motion.problem import Problem
from freefloat.motion.simulation import simulate
from freefloat.so3 import heading_quaternion
from freefloat.studies.schema import Case

if TYPE_CHECKING:  # kernels take half a second to import: not before they are needed
    from freefloat.ensemble.feasibility import BranchOutcomes, FeasibilityEvaluator

HEADINGS, ATTITUDES = 360, 36_864
"""How many a map follows where the scenario does not say."""


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
        with self.scenario.told():
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

        with self.scenario.told():
            limits = self.scenario.limits(problem.model)
            found = plan(problem, self.scenario.search(), threads=1, limits=limits)
        document = plan_document(found)
        if self.file is not None:
            told = replace(found, problem=self.told_problem(problem))
            save_plan(self.file, told, self.told, document)
        return document

    def _mapped(self, problem: Problem) -> dict[str, Any]:
        from freefloat.planning.heading_map import heading_map

        begin, search = time.perf_counter(), self.scenario.search()
        with self.scenario.told():
            if not problem.task.planar:
                samples = search.samples or ATTITUDES
                return self._mapped_in_space(problem, samples, search.seed, begin)
            found = heading_map(problem, search.samples or HEADINGS, threads=1)
        document = map_document(found, time.perf_counter() - begin)
        if self.file is not None:
            save_map(self.file, found, self.told, self.told_problem(problem), document)
        return document

    def _mapped_in_space(
        self, problem: Problem, samples: int, seed: int, begin: float
    ) -> dict[str, Any]:
        from freefloat.ensemble.feasibility import FeasibilityEvaluator

        outlook = FeasibilityEvaluator(problem, threads=1)
        if self.file is None:
            return _map_in_space(outlook, samples, seed, begin)
        told = self.told_problem(problem)
        with map_file(self.file, self.told, told, samples, seed) as writer:
            document = _map_in_space(outlook, samples, seed, begin, writer.write)
            writer.conclude(document)
        return document


def _map_in_space(
    outlook: FeasibilityEvaluator,
    samples: int,
    seed: int,
    begin: float,
    sink: Callable[[BranchOutcomes], None] | None = None,
) -> dict[str, Any]:
    from freefloat.motion.problem import is_kept
    from freefloat.planning.attitude_map import map_attitudes, regions
    from freefloat.planning.robust_radius import deepest
    from freefloat.planning.search import largest_margins

    found = map_attitudes(outlook, samples, seed, sink=sink)
    highest = largest_margins(outlook, found)
    margin = outlook.problem.margin.threshold
    best = next((one for one in highest if is_kept(np.array(one.merit), margin)), None)
    robust = deepest(outlook, found, [])
    seconds = time.perf_counter() - begin
    return attitude_map_document(found, regions(found), best, robust, seconds)


def _start_attitude(problem: Problem, start: Mapping[str, Any]) -> Any:
    heading = start.get("heading_deg")
    if heading is None:
        return start["attitude"]
    if not problem.task.planar:
        raise InputError("heading_deg", f"task {problem.task} is not planar", "attitude")
    if not isinstance(heading, int | float) or not np.isfinite(heading):
        raise InputError("heading_deg", f"{heading} was given", "a finite number of degrees")
    return heading_quaternion(np.radians(heading))
