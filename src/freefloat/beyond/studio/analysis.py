"""What is known about one scenario that the studio shows: answers, the motion, its robot."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from freefloat.beyond.studio.answers import place, playback_of
from freefloat.beyond.studio.messages import WorkerAnswer, WorkerState
from freefloat.concurrency import Progress
from freefloat.dynamics.joint_space import largest_measure
from freefloat.io.results import save
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.motion.setting import Setting
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

Attitude = tuple[float, ...] | None
_KNOWN = 8
"""Robots that are kept."""


class Analysis(ABC):
    """Answers about one scenario."""

    def __init__(self, state: WorkerState, scenario: Scenario) -> None:
        """Keep the scenario of a state; raises an InputError if its search or limits are wrong."""
        self._scenario, self._text, self._source = scenario, state.text, state.source
        self._search, self._limits = scenario.search(), scenario.limits()
        self._motion_shown: Motion | None = None
        self._results: Sequence[LimitResult] = ()
        self._shown: tuple[Attitude, int] | None = None

    def poses(self, state: WorkerState) -> bool:
        """Whether a state has the same scenario."""
        return (state.text, state.source) == (self._text, self._source)

    @abstractmethod
    def outline(self) -> WorkerAnswer:
        """What is edited: handles and the values of the sliders."""

    @abstractmethod
    def urgent(self, state: WorkerState, progress: Progress) -> WorkerAnswer | None:
        """The next answer that a state lacks and that comes before what the user asks for.

        While the state is dragged there are only coarse answers. The progress may raise an
        exception to abandon a computation.
        """

    @abstractmethod
    def further(self, progress: Progress) -> WorkerAnswer | None:
        """The next answer that can wait."""

    @abstractmethod
    def save(self, file: Path, attitude: Attitude) -> WorkerAnswer:
        """Plan, from the attitude that is chosen, and save the result."""

    def page(self) -> WorkerAnswer:
        """The page that plays the motion shown."""
        if self._motion_shown is None:
            return WorkerAnswer("page", {"refused": "there is no motion"})
        playback = playback_of(self._motion_shown, self._limits, self._source.stem, self._results)
        return WorkerAnswer("page", {"html": playback.html()})

    def _show(
        self, state: WorkerState, motion: Motion | None, setting: Setting, attitude: Array,
        title: str, outcome: str,
    ) -> WorkerAnswer:  # fmt: skip
        """Show a motion with a title and its outcome; without one the attitude and why."""
        self._shown = state.attitude, state.choice
        self._motion_shown, self._results = motion, ()
        if motion is None:
            content = {"outcome": outcome, **place(setting, attitude)}
        else:
            playback = playback_of(motion, self._limits, self._source.stem)
            shown = place(motion.setting, motion.initial.attitude)
            content = {**playback.parts(), **shown, "title": title, "outcome": outcome}
        return WorkerAnswer("motion", {**content, "choice": state.choice})

    def _show_limits(self, results: Sequence[LimitResult]) -> WorkerAnswer:
        """Show the limits along the motion shown, a line each."""
        self._results = results
        lines = [
            {"limit": result.label, "kept": result.kept, "time": result.time,
             "text": f"{result.sentence}, {result.where}, t = {result.time:.4g} s"}
            for result in results
        ]  # fmt: skip
        return WorkerAnswer("limits", {"results": lines})

    def _saved(self, result: Any, file: Path) -> WorkerAnswer:
        """Save a result, unless it is infeasible, to a file that does not exist yet."""
        if not result.feasible:
            return WorkerAnswer("saved", {"refused": f"not saved: {result.reason}"})
        file = _free(file)
        save(result, file)
        contact = None if result.contact is None else str(result.contact)
        return WorkerAnswer(
            "saved", {"file": str(file), "reason": result.reason, "contact": contact}
        )

    def _wants_motion(self, state: WorkerState) -> bool:
        """Whether a state has another attitude, or choice of it, than the motion shown."""
        return self._shown != (state.attitude, state.choice)


def _free(file: Path) -> Path:
    """The file, or if it exists one with the next number."""
    name, number = file.stem, 1
    while file.exists():
        number += 1
        file = file.with_name(f"{name}-{number}{file.suffix}")
    return file


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
