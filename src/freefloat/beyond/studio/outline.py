"""Outline of a scenario for the page: the path, its handles, and the values of the sliders."""

from __future__ import annotations

from typing import Any

import numpy as np

from freefloat.dynamics.tasks import Task
from freefloat.io.scenario.path_schema import PathSection
from freefloat.io.scenario.scenario import Scenario
from freefloat.motion.problem import Problem
from freefloat.paths.curves import SplineCurve
from freefloat.paths.timed_path import TimedPath
from freefloat.rotations import Rotation
from freefloat.scene.scene_body import SceneBody
from freefloat.so3 import Array, Pose
from freefloat.visualization.scenes.overlays import thickness

_DRAWN = 121
"""Points of the path that are drawn."""
_HANDLES = 5
"""Handles of other paths than lines and a few waypoints."""
_FEW = range(2, 25)
"""Numbers of waypoints that have a handle each."""


def outline(scenario: Scenario, problem: Problem, largest: float) -> dict[str, Any]:
    """The outline of a scenario, with the largest magnitude of the measure over the joint space."""
    content, margin = scenario.content, problem.margin
    sections = {"": content.path, **content.robot.own_paths}
    frames = {arm: scenario.frame(part, arm, problem.scene) for arm, part in sections.items()}
    paths, handles = [], []
    for arm, path in problem.path.by_arm.items():
        part, own = _handles(problem.task, arm, path, sections[arm], frames[arm])
        paths.append(part)
        handles += own
    fraction = content.margin.fraction
    return {
        "is_goal": False,
        "planar": problem.has_headings,
        "normal": problem.plane.normal.tolist() if problem.has_headings else None,
        "size": thickness(problem),
        "lines": [
            _positions(path, np.linspace(0.0, 1.0, _DRAWN)).round(6).tolist()
            for path in problem.path.by_arm.values()
        ],
        "paths": paths,
        "handles": handles,
        "rpy": _end_angles(scenario, problem, frames[""]),
        "momentum": problem.momentum.tolist(),
        "duration": problem.path.duration,
        "margin": {
            "measure": margin.measure.title,
            "unit": margin.measure.unit,
            "threshold": margin.threshold,
            "value": margin.threshold if fraction is None else fraction,
            "largest": largest if fraction is None else 1.0,
            "is_fraction": fraction is not None,
        },
    }


def _positions(path: TimedPath, parameters: Array) -> Array:
    """Points of a path from the centre of mass, inertial axes [m]."""
    return np.array([path.pose_at(float(s)).position for s in parameters])


def _handles(
    task: Task, arm: str, path: TimedPath, section: PathSection, frame: Pose | SceneBody | None
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Points of a path that have a handle, in the frame of its section, and the handles.

    A handle is the drawn point, in inertial axes; where the centre of mass drifts, it differs from
    the path's.
    """
    curve = path.path.curve
    oriented = task.prescribes_orientation and section.attitude is None  # in the CSV file
    if isinstance(frame, SceneBody) or oriented:  # or the path moves with a tumbling body
        return {"arm": arm, "frame": None, "handles": 0, "points": []}, []
    frame = frame or Pose(np.zeros(3), np.eye(3))
    names = ["start", *map(str, range(1, _HANDLES - 1)), "end"]
    parameters = np.linspace(0.0, 1.0, _HANDLES)
    if section.line is not None:
        names, parameters = ["start", "end"], np.array([0.0, 1.0])
    elif isinstance(curve, SplineCurve) and len(section.waypoints or ()) in _FEW:
        parameters = curve.knots
        names = ["start", *map(str, range(1, len(parameters) - 1)), "end"]
    drawn = _positions(path, parameters)
    points = np.array([curve(float(s)) for s in parameters])
    handles = [
        _handle(arm, name, place, place - point)
        for name, place, point in zip(names, drawn, points, strict=True)
    ]
    law = section.attitude
    if law is not None and law.point_at is not None:
        target = frame.position + frame.rotation @ np.array(law.point_at.target)
        handles.append(_handle(arm, "target", target, np.zeros(3)))
    local = (points - frame.position) @ frame.rotation
    return {
        "arm": arm,
        "frame": {"position": frame.position.tolist(), "rotation": frame.rotation.tolist()},
        "handles": len(handles),
        "points": local.round(6).tolist(),
    }, handles


def _handle(arm: str, name: str, place: Array, shift: Array) -> dict[str, Any]:
    """A handle at a place that differs from the path's point by a shift [m]."""
    return {
        "name": f"{arm} {name}".strip(),
        "is_target": name == "target",
        "position": place.round(6).tolist(),
        "shift": shift.tolist(),
    }


def _end_angles(
    scenario: Scenario, problem: Problem, frame: Pose | SceneBody | None
) -> list[float] | None:
    """Roll, pitch, yaw [rad] at the end in the path's frame; None if they are not stated."""
    law = scenario.content.path.attitude
    if law is None or not (law.fixed or law.slerp):  # a target or the tangent states them
        return None
    if isinstance(frame, SceneBody) or not problem.task.prescribes_orientation:
        return None
    if law.slerp is not None and law.slerp.end.rpy is not None:
        return list(law.slerp.end.rpy)  # as it was set: other angles may state the same
    rotation = np.eye(3) if frame is None else frame.rotation
    return rounded_rpy(rotation.T @ problem.path.path.orientation.rotation(1.0))


def rounded_rpy(rotation: Array) -> list[float]:
    """Roll, pitch and yaw of a rotation matrix [rad], rounded."""
    rpy: list[float] = Rotation.from_matrix(rotation).as_rpy().round(6).tolist()
    return rpy
