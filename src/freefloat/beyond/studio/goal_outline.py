"""Outline of a scenario with a goal for the page: the handle of its pose, values of the sliders."""

from __future__ import annotations

from typing import Any

from freefloat.beyond.studio.outline import rounded_rpy
from freefloat.io.scenario.scenario import Scenario
from freefloat.motion.problem import Problem
from freefloat.planning.goals.goal import Goal
from freefloat.so3 import Array
from freefloat.visualization.scenes.overlays import thickness


def goal_outline(
    scenario: Scenario, goal: Goal, problem: Problem, attitude: Array, joints: Array
) -> dict[str, Any]:
    """The outline of a scenario with a goal.

    Args:
        scenario: The scenario.
        goal: The goal.
        problem: The problem that the scenario poses.
        attitude: Present attitude of the spacecraft, unit quaternion x, y, z, w.
        joints: Present joint values, shape (n,).
    """
    return {
        "is_goal": True,
        "planar": problem.has_headings,
        "normal": problem.plane.normal.tolist() if problem.has_headings else None,
        "size": thickness(problem),
        "lines": [],
        **_handle(scenario, goal, problem, attitude, joints),
        "momentum": problem.momentum.tolist(),
        "duration": goal.duration,
        "margin": None,
    }


def _handle(
    scenario: Scenario, goal: Goal, problem: Problem, attitude: Array, joints: Array
) -> dict[str, Any]:
    """The handle of the goal's pose, in inertial axes, and its frame; none without a fixed pose."""
    target, body = goal.target(problem, attitude, joints), goal.body(problem)
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
