"""What is known about a scenario with a goal: a sketch of the motion, then the motion found."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from freefloat.beyond.studio.analysis import Analysis, Attitude, RobotCache
from freefloat.beyond.studio.messages import WorkerAnswer, WorkerState
from freefloat.beyond.studio.motions import limits_answer
from freefloat.beyond.studio.outline import rounded_rpy
from freefloat.concurrency import Progress
from freefloat.errors import InputError
from freefloat.io.scenario.scenario import Scenario
from freefloat.kinds import SECTIONS, named
from freefloat.motion.motion import Motion
from freefloat.motion.setting import JointSetting
from freefloat.visualization.scenes.overlays import thickness


class GoalAnalysis(Analysis):
    """Answers about a scenario with a goal."""

    def __init__(self, state: WorkerState, scenario: Scenario, robots: RobotCache) -> None:
        """Pose the goal of a scenario.

        Raises:
            InputError: If it is invalid.
        """
        super().__init__(state, robots.with_model(scenario))
        self._posed = named(SECTIONS["goal"].posed)(self._scenario)
        self._setting: JointSetting = self._posed.setting
        self._sketched, self._unchecked = False, False
        self._found: Any = None

    def outline(self) -> WorkerAnswer:
        """The goal, its handle and the values of the sliders."""
        return WorkerAnswer("outline", goal_outline(self._scenario, self._posed))

    def urgent(self, state: WorkerState, progress: Progress) -> WorkerAnswer | None:
        """A sketch while the goal is dragged, then the motion and its limits."""
        if state.dragging:
            return None if self._sketched else self._sketch(state)
        if self._found is None or self._wants_motion(state):
            return self._move(state, progress)
        if self._unchecked:
            self._unchecked = False
            return WorkerAnswer("limits", {"results": limits_answer(self._found.limit_results)})
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

    def _move(self, state: WorkerState, progress: Progress) -> WorkerAnswer:
        """The motion to the goal, or why there is none."""
        self._found = self._posed.plan(progress=progress)
        self._unchecked = True
        return self._showing(state, self._found.motion, self._found.reason)

    def _showing(self, state: WorkerState, motion: Motion | None, outcome: str) -> WorkerAnswer:
        """Show a motion, or the present attitude where there is none."""
        return self._show(state, motion, self._setting, self._posed.present[0], "goal", outcome)


def goal_outline(scenario: Scenario, posed: Any) -> dict[str, Any]:
    """The outline of a scenario with a goal.

    Args:
        scenario: The scenario.
        posed: What it asks for: ``goal``, ``present`` state and ``setting``.
    """
    setting = posed.setting
    return {
        "is_goal": True,
        "planar": setting.has_headings,
        "normal": setting.plane.normal.tolist() if setting.has_headings else None,
        "size": thickness(setting),
        "lines": [],
        **_handle(scenario, posed),
        "momentum": setting.momentum.tolist(),
        "duration": posed.goal.duration,
        "margin": None,
    }


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
