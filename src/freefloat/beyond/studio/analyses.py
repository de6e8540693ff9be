"""What is known about a scenario: with a path maps, motion and limits; with a goal its motion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.beyond.studio.analysis import Analysis, Attitude, RobotCache
from freefloat.beyond.studio.answers import (
    ball,
    best_motion,
    best_sample,
    dial,
    motion_within_limits,
    place,
)
from freefloat.beyond.studio.messages import WorkerAnswer, WorkerState
from freefloat.beyond.studio.outline import outline, rounded_rpy
from freefloat.concurrency import Progress
from freefloat.errors import InputError
from freefloat.io.scenario.loading import parse_scenario
from freefloat.io.scenario.scenario import Scenario
from freefloat.kinds import SECTIONS, named
from freefloat.limits.limits import check_limits
from freefloat.motion.motion import Motion
from freefloat.motion.setting import JointSetting
from freefloat.planning.margin_map import HeadingMap
from freefloat.planning.motions import SimulatedBranch, evaluator_for
from freefloat.planning.objectives import Nearest
from freefloat.planning.path_planner import plan_attitude
from freefloat.planning.planner import plan
from freefloat.planning.reasons import reach_message
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.map_sampling import sample_attitudes, sample_headings
from freefloat.visualization.scenes.overlays import thickness

_ATTITUDES, _HEADINGS = (128, 1024, 8192), (120, 360)
"""Sizes of the maps of a scenario, one after another."""
_WHILE_DRAGGING = 2
"""Most maps that are made while an edit is under way; the finest one never is."""


class PathAnalysis(Analysis):
    """Answers about a scenario with a path; ``level`` is the number of its maps that were made."""

    def __init__(self, state: WorkerState, scenario: Scenario, robots: RobotCache) -> None:
        """Pose the problem of a scenario; raises an InputError if it is invalid."""
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

        The progress may raise an exception to abandon the map.
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
        """The motion from the attitude of a state; the progress may raise an exception.

        Without an attitude it is the motion of the largest margin in the map that keeps the limits;
        where none was found, the motion that gets farthest.
        """
        samples, best = self._map, None
        chosen = np.array(state.attitude or (0.0, 0.0, 0.0, 1.0))
        if state.attitude is None and samples is not None:
            best = motion_within_limits(self._evaluator, samples, self._limits, progress)
            chosen = samples.attitudes[best_sample(samples.results)]
        self._motion = best or best_motion(self._evaluator, chosen)
        self._unchecked = self._motion is not None
        if self._motion is None:
            outcome = "no arm configuration reaches the start of the path from this attitude"
            return self._show(state, None, self._problem, chosen, "", outcome)
        motion, verdict = self._motion.motion, self._motion.verdict()
        outcome = motion.outcome
        if motion.completed and not verdict.feasible:
            outcome = f"{outcome.rstrip('.')} below the margin: {verdict}."
        return self._show(state, motion, self._problem, chosen, self._motion.title, outcome)

    def limits(self) -> WorkerAnswer:
        """The limits along the motion shown."""
        self._unchecked = False
        results = () if self._motion is None else check_limits(self._motion.motion, self._limits)
        return self._show_limits(results)

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
        return self._saved(plan(problem, search, self._limits), file)


class GoalAnalysis(Analysis):
    """Answers about a scenario with a goal."""

    def __init__(self, state: WorkerState, scenario: Scenario, robots: RobotCache) -> None:
        """Pose the goal of a scenario; raises an InputError if it is invalid."""
        super().__init__(state, robots.with_model(scenario))
        self._posed = named(SECTIONS["goal"].posed)(self._scenario)
        self._setting: JointSetting = self._posed.setting
        self._sketched, self._unchecked = False, False
        self._found: Any = None

    def outline(self) -> WorkerAnswer:
        """The goal, its handle and the values of the sliders."""
        setting = self._setting
        content = {
            "is_goal": True,
            "planar": setting.has_headings,
            "normal": setting.plane.normal.tolist() if setting.has_headings else None,
            "size": thickness(setting),
            "lines": [],
            **_handle(self._scenario, self._posed),
            "momentum": setting.momentum.tolist(),
            "duration": self._posed.goal.duration,
            "margin": None,
        }
        return WorkerAnswer("outline", content)

    def urgent(self, state: WorkerState, progress: Progress) -> WorkerAnswer | None:
        """A sketch while the goal is dragged, then the motion and its limits."""
        if state.dragging:
            return None if self._sketched else self._sketch(state)
        if self._found is None or self._wants_motion(state):
            self._found, self._unchecked = self._posed.plan(progress=progress), True
            return self._showing(state, self._found.motion, self._found.reason)
        if self._unchecked:
            self._unchecked = False
            return self._show_limits(self._found.limit_results)
        return None

    def further(self, progress: Progress) -> WorkerAnswer | None:
        """Nothing: there are no maps of attitudes."""
        return None

    def save(self, file: Path, attitude: Attitude) -> WorkerAnswer:
        """Save the motion that was found."""
        if self._found is None:
            return WorkerAnswer("saved", {"refused": "not saved: no motion was found"})
        return self._saved(self._found, file)

    def _sketch(self, state: WorkerState) -> WorkerAnswer:
        """A motion to the goal that limits may forbid; never abandoned, so that drags show some."""
        self._sketched = True
        try:
            motion = self._posed.sketch()
        except InputError:  # the present state is dragged to itself, for example
            motion = None
        return self._showing(state, motion, "a sketch, which need not keep clear of bodies")

    def _showing(self, state: WorkerState, motion: Motion | None, outcome: str) -> WorkerAnswer:
        """Show a motion, or the present attitude where there is none."""
        return self._show(state, motion, self._setting, self._posed.present[0], "goal", outcome)


def _handle(scenario: Scenario, posed: Any) -> dict[str, Any]:
    """The handle of the goal's pose, in inertial axes, and its frame; none without a fixed pose."""
    goal, setting = posed.goal, posed.setting
    target, body = goal.target(setting, *posed.present), goal.body(setting)
    if goal.pose is None or (body and body.motion != "fixed"):
        return {"paths": [], "handles": [], "rpy": None}
    pose = target.pose_at(0.0)
    rotation = pose.rotation @ goal.pose.rotation.T
    place = pose.position.round(6).tolist()
    origin = pose.position - rotation @ goal.pose.position
    frame = {"position": origin.tolist(), "rotation": rotation.tolist()}
    section = scenario.content.goal and scenario.content.goal.pose
    stated = section and section.orientation and section.orientation.rpy
    return {
        "paths": [{"arm": "", "frame": frame, "handles": 1}],
        "handles": [{"name": "goal", "position": place, "shift": [0.0, 0.0, 0.0]}],
        "rpy": [*stated] if stated else rounded_rpy(goal.pose.rotation),
    }


def analysis_of(state: WorkerState, robots: RobotCache) -> Analysis:
    """The analysis of the scenario of a state; raises an InputError if it is invalid."""
    scenario = parse_scenario(state.text, state.source)
    kind = PathAnalysis if scenario.content.goal is None else GoalAnalysis
    return kind(state, scenario, robots)
