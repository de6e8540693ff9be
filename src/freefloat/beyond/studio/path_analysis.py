"""What is known about a scenario with a path: maps of its attitudes, the motion, its limits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from freefloat.beyond.studio.analysis import Analysis, Attitude, RobotCache
from freefloat.beyond.studio.attitudes import ball, best_sample, dial
from freefloat.beyond.studio.messages import WorkerAnswer, WorkerState
from freefloat.beyond.studio.motions import best_motion, limits_answer, motion_within_limits, place
from freefloat.beyond.studio.outline import outline
from freefloat.concurrency import Progress
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.check import check_limits
from freefloat.planning.margin_map import HeadingMap
from freefloat.planning.motions import SimulatedBranch, evaluator_for
from freefloat.planning.objectives import Nearest
from freefloat.planning.path_planner import plan_attitude
from freefloat.planning.planner import plan
from freefloat.planning.reasons import reach_message
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.mapping import sample_attitudes, sample_headings

_ATTITUDES, _HEADINGS = (128, 1024, 8192), (120, 360)
"""Sizes of the maps of a scenario, one after another."""
_WHILE_DRAGGING = 2
"""Most maps that are made while an edit is under way; the finest one never is."""


class PathAnalysis(Analysis):
    """Answers about a scenario with a path.

    Attributes:
        level: Number of maps that were made.
    """

    def __init__(self, state: WorkerState, scenario: Scenario, robots: RobotCache) -> None:
        """Pose the problem of a scenario.

        Raises:
            InputError: If it is invalid.
        """
        scenario, problem, self._largest = robots.problem(scenario)
        super().__init__(state, scenario)
        self.level, self._unchecked = 0, False
        self._problem = self._search.applied_to(problem)
        self._evaluator = evaluator_for(self._problem, limits=self._limits)
        self._map: AttitudeMap | HeadingMap | None = None
        self._motion: SimulatedBranch | None = None

    @property
    def levels(self) -> tuple[int, ...]:
        """Sizes of its maps."""
        return _HEADINGS if self._problem.has_headings else _ATTITUDES

    def outline(self) -> WorkerAnswer:
        """The path, its handles and the values of the sliders."""
        return WorkerAnswer("outline", outline(self._scenario, self._problem, self._largest))

    def urgent(self, state: WorkerState, progress: Progress) -> WorkerAnswer | None:
        """Coarse maps, then the motion and its limits."""
        if self.level < min(_WHILE_DRAGGING, len(self.levels) - 1):
            return self.next_map(progress)
        if state.dragging:
            return None
        if self._wants_motion(state):
            return self.motion(state, progress)
        return self.limits() if self._unchecked else None

    def further(self, progress: Progress) -> WorkerAnswer | None:
        """The finest map."""
        return self.next_map(progress) if self.level < len(self.levels) else None

    def next_map(self, progress: Progress) -> WorkerAnswer:
        """The next, finer map; with the last one of a planar task the exact ranges.

        Args:
            progress: Called during the computation; may raise an exception to abandon it.
        """
        samples, last = self.levels[self.level], self.level + 1 == len(self.levels)
        if self._problem.has_headings:
            headings = sample_headings(self._evaluator, samples, self._search, progress)
            ranges = plan_attitude(self._evaluator, self._search).ranges if last else None
            self._map, (content, reasons) = headings, dial(headings, ranges)
        else:
            attitudes = sample_attitudes(self._evaluator, samples, self._search, progress)
            self._map, (content, reasons) = attitudes, ball(attitudes)
        self.level += 1
        reached = self._map.results.exist.any()
        remark = None if reached else reach_message(self._problem)
        present = self._search.from_attitude
        content["present"] = None if present is None else place(self._problem, present)
        return WorkerAnswer("attitudes", {**content, "remark": remark, "finest": last}, reasons)

    def motion(self, state: WorkerState, progress: Progress) -> WorkerAnswer:
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
        self._unchecked = self._motion is not None
        if self._motion is None:
            outcome = "no arm configuration reaches the start of the path from this attitude"
            return self._show(state, None, self._problem, chosen, "", outcome)
        motion, title = self._motion.motion, self._motion.title
        return self._show(state, motion, self._problem, chosen, title, None)

    def limits(self) -> WorkerAnswer:
        """The limits along the motion shown."""
        self._unchecked = False
        results = () if self._motion is None else check_limits(self._motion.motion, self._limits)
        return WorkerAnswer("limits", {"results": limits_answer(results)})

    def save(self, file: Path, attitude: Attitude) -> WorkerAnswer:
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
        return self._saved(result, file)
