"""What is known about one scenario: its problem, maps of its attitudes, the motion shown."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from freefloat.concurrency import Progress
from freefloat.dynamics.joint_space import largest_measure
from freefloat.io.records.results import save
from freefloat.io.scenario.scenario import Scenario, parse_scenario
from freefloat.limits.check import check_limits
from freefloat.motion.problem import Problem
from freefloat.planning.evaluator import evaluator_for
from freefloat.planning.objectives.objectives import Nearest
from freefloat.planning.planar_planner import plan_in_plane
from freefloat.planning.plane.heading_map import HeadingMap
from freefloat.planning.plane.heading_search import sample_headings
from freefloat.planning.planner import plan
from freefloat.planning.reasons import reach_message
from freefloat.planning.simulation import SimulatedBranch
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.mapping import sample_attitudes
from freefloat.robot.model import FreeFloatingModel
from freefloat.studio.attitudes import ball, best_sample, dial
from freefloat.studio.messages import Answer, State
from freefloat.studio.motions import (
    best_motion,
    limits_answer,
    motion_answer,
    motion_within_limits,
    place,
    playback_of,
)
from freefloat.studio.outline import outline
from freefloat.visualization.page.playback import Playback

_ATTITUDES, _HEADINGS = (128, 1024, 8192), (120, 360)
"""Sizes of the maps of a scenario, one after another."""
_KNOWN = 8
"""Robots that are kept."""

Attitude = tuple[float, ...] | None


class Robots:
    """Models of robots, and the largest magnitudes of measures, which edits do not change."""

    def __init__(self) -> None:
        self._models: dict[str, FreeFloatingModel] = {}
        self._largest: dict[tuple[str, ...], float] = {}

    def problem(self, scenario: Scenario) -> tuple[Scenario, Problem, float]:
        """A scenario with its robot, its problem, and the largest magnitude of its measure."""
        content = scenario.content
        robot = f"{content.robot.model_dump_json()} {scenario.source}"
        if robot not in self._models:
            self._models = dict([*self._models.items()][1 - _KNOWN :])
            self._models[robot] = scenario.model()
        scenario = replace(scenario, robot=self._models[robot])
        key = robot, str(content.task), content.margin.measure
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


class Analysis:
    """Answers about one scenario.

    Attributes:
        level: Number of maps that were made.
        limits_wanted: Whether the limits of the motion shown were not checked yet.
    """

    def __init__(self, state: State, robots: Robots) -> None:
        """Read the scenario.

        Raises:
            InputError: If it is invalid.
        """
        self.level, self.limits_wanted = 0, False
        self._text, self._source = state.text, state.source
        scenario = parse_scenario(state.text, state.source)
        self._scenario, problem, self._largest = robots.problem(scenario)
        self._search, self._limits = self._scenario.search(), self._scenario.limits()
        self._problem = self._search.applied_to(problem)
        self._evaluator = evaluator_for(self._problem, limits=self._limits)
        self._map: AttitudeMap | HeadingMap | None = None
        self._motion: SimulatedBranch | None = None
        self._playback: Playback | None = None
        self._shown: tuple[Attitude, int] | None = None

    def poses(self, state: State) -> bool:
        """Whether a state has the same scenario."""
        return (state.text, state.source) == (self._text, self._source)

    @property
    def levels(self) -> tuple[int, ...]:
        """Sizes of its maps."""
        return _HEADINGS if self._problem.task.planar else _ATTITUDES

    def outline(self) -> Answer:
        """The path, its handles and the values of the sliders."""
        return Answer("outline", outline(self._scenario, self._problem, self._largest))

    def next_map(self, progress: Progress) -> Answer:
        """The next, finer map; with the last one of a planar task the exact ranges.

        Args:
            progress: Called during the computation; may raise an exception to abandon it.
        """
        samples, last = self.levels[self.level], self.level + 1 == len(self.levels)
        if self._problem.task.planar:
            headings = sample_headings(self._evaluator, samples, self._search, progress)
            ranges = plan_in_plane(self._evaluator, self._search).ranges if last else None
            self._map, (content, reasons) = headings, dial(headings, ranges)
        else:
            attitudes = sample_attitudes(self._evaluator, samples, self._search, progress)
            self._map, (content, reasons) = attitudes, ball(attitudes)
        self.level += 1
        reached = self._map.results.exist.any()
        remark = None if reached else reach_message(self._problem)
        return Answer("attitudes", {**content, "remark": remark, "finest": last}, reasons)

    def motion_wanted(self, state: State) -> bool:
        """Whether a state has another attitude than that of the motion shown."""
        return self._shown != (state.attitude, state.choice)

    def motion(self, state: State, progress: Progress) -> Answer:
        """The motion from the attitude of a state.

        Without one it is that of the largest margin in the map that keeps the limits; where none
        was found, the one that gets farthest.

        Args:
            state: The state.
            progress: Called during the computation; may raise an exception to abandon it.
        """
        samples, found = self._map, None
        chosen = np.array(state.attitude or (0.0, 0.0, 0.0, 1.0))
        if state.attitude is None and samples is not None:
            found = motion_within_limits(self._evaluator, samples, self._limits, progress)
            chosen = samples.attitudes[best_sample(samples.results)]
        self._motion = found or best_motion(self._evaluator, chosen)
        self._shown, self.limits_wanted = (state.attitude, state.choice), False
        if self._motion is None:
            self._playback = None
            content = {
                "outcome": "no arm configuration reaches the start of the path from this attitude",
                **place(self._problem, chosen),
            }
        else:
            self._playback = playback_of(self._motion, self._limits)
            self.limits_wanted = True
            content = motion_answer(self._motion, self._playback)
        return Answer("motion", {**content, "choice": state.choice})

    def limits(self) -> Answer:
        """The limits along the motion shown."""
        self.limits_wanted = False
        results = () if self._motion is None else check_limits(self._motion.motion, self._limits)
        return Answer("limits", {"results": limits_answer(results)})

    def save(self, file: Path, attitude: Attitude) -> Answer:
        """Plan from the attitude, or from the nearest feasible one, and save the plan.

        Without an attitude the objective of the scenario decides. Phases that follow the path are
        left out.
        """
        search, problem = self._search, self._scenario.problem()
        if attitude is not None:
            search = replace(
                search, objective=Nearest(), from_attitude=np.array(attitude),
                within=None, spare=0.0,
            )  # fmt: skip
        result = plan(problem, search, self._limits)
        if not result.feasible:
            return Answer("saved", {"refused": f"not saved: {result.reason}"})
        file = _free(file)
        save(result, file, None if self._scenario.has_phases else self._scenario)
        contact = None if result.contact is None else str(result.contact)
        return Answer("saved", {"file": str(file), "reason": result.reason, "contact": contact})

    def page(self) -> Answer:
        """The page that plays the motion shown."""
        if self._playback is None:
            return Answer("page", {"refused": "there is no motion"})
        return Answer("page", {"html": self._playback.html()})


def _free(file: Path) -> Path:
    """The file, or if it exists one with the next number."""
    name, number = file.stem, 1
    while file.exists():
        number += 1
        file = file.with_name(f"{name}-{number}{file.suffix}")
    return file
