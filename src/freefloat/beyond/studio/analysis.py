"""What is known about one scenario that the studio shows: answers, the motion, its robot."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from pathlib import Path
from typing import Any

from freefloat.beyond.studio.answers import motion_answer, place, playback_of
from freefloat.beyond.studio.messages import WorkerAnswer, WorkerState
from freefloat.concurrency import Progress
from freefloat.dynamics.joint_space import largest_measure
from freefloat.io.results import save
from freefloat.io.scenario.scenario import Scenario
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.motion.setting import Setting
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array
from freefloat.visualization.page.playback import Playback

Attitude = tuple[float, ...] | None
_KNOWN = 8
"""Robots that are kept."""


class Analysis(ABC):
    """Answers about one scenario."""

    def __init__(self, state: WorkerState, scenario: Scenario) -> None:
        """Keep the scenario of a state, with its robot.

        Raises:
            InputError: If its search or its limits are invalid.
        """
        self._scenario, self._text, self._source = scenario, state.text, state.source
        self._search, self._limits = scenario.search(), scenario.limits()
        self._playback: Playback | None = None
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

        Args:
            state: The state; while it is dragged there are only coarse answers.
            progress: Called during the computation; may raise an exception to abandon it.
        """

    @abstractmethod
    def further(self, progress: Progress) -> WorkerAnswer | None:
        """The next answer that can wait."""

    @abstractmethod
    def save(self, file: Path, attitude: Attitude) -> WorkerAnswer:
        """Plan, from the attitude that is chosen, and save the result."""

    def page(self) -> WorkerAnswer:
        """The page that plays the motion shown."""
        if self._playback is None:
            return WorkerAnswer("page", {"refused": "there is no motion"})
        return WorkerAnswer("page", {"html": self._playback.html()})

    def _show(
        self, state: WorkerState, motion: Motion | None, setting: Setting, attitude: Array,
        title: str, outcome: str | None,
    ) -> WorkerAnswer:  # fmt: skip
        """Show a motion with a title and its outcome; without one the attitude and why."""
        self._shown = state.attitude, state.choice
        if motion is None:
            self._playback = None
            content = {"outcome": outcome, **place(setting, attitude)}
        else:
            self._playback = playback_of(motion, self._limits)
            content = motion_answer(motion, self._playback, title, outcome)
        return WorkerAnswer("motion", {**content, "choice": state.choice})

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
