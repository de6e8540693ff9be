"""Outline of a scenario with a goal for the page: the handle of its pose, values of the sliders."""

from __future__ import annotations

from typing import Any

from freefloat.beyond.studio.outline import rounded_rpy
from freefloat.io.scenario.scenario import Scenario
from freefloat.visualization.scenes.overlays import thickness


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
