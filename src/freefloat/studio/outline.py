"""Outline of a scenario for the page: the path, its handles, and the values of the sliders."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.io.scenario.path_section import frame_of
from freefloat.io.scenario.scenario import Scenario
from freefloat.motion.problem import Problem
from freefloat.paths.curves import SplineCurve
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
    """The outline of a scenario.

    Args:
        scenario: The scenario.
        problem: The problem that it poses.
        largest: Largest magnitude of the measure over the joint space.
    """
    content = scenario.content
    now = problem.arms.at(0.0).tolist()
    frame = frame_of(content.path.frame, problem.model, scenario.search(), problem.scene, now)
    margin = problem.margin
    fraction = content.margin.fraction
    return {
        "is_goal": False,
        "planar": problem.task.planar,
        "size": thickness(problem),
        "path": _positions(problem, np.linspace(0.0, 1.0, _DRAWN)).round(6).tolist(),
        **_handles(scenario, problem, frame),
        **_orientation(scenario, problem, frame),
        "momentum": problem.momentum.tolist(),
        "duration": problem.path.duration,
        "margin": {
            "measure": margin.measure.name,
            "unit": margin.measure.unit,
            "threshold": margin.threshold,
            "value": margin.threshold if fraction is None else fraction,
            "largest": largest if fraction is None else 1.0,
            "is_fraction": fraction is not None,
        },
    }


def _positions(problem: Problem, parameters: Array) -> Array:
    """Points of the path from the centre of mass, inertial axes [m]."""
    return np.array([problem.path.pose_at(float(s)).position for s in parameters])


def _handles(scenario: Scenario, problem: Problem, frame: Pose | SceneBody | None) -> Any:
    """Handles, in inertial axes, and the same points in the frame of the path's section.

    A handle is the drawn point; where the centre of mass drifts, it differs from the path's.
    """
    section, curve = scenario.content.path, problem.path.path.curve
    oriented = problem.task.prescribes_orientation and section.attitude is None  # in the CSV file
    if isinstance(frame, SceneBody) or oriented:  # or the path moves with a tumbling body
        return {"frame": None, "handles": [], "points": []}
    frame = frame or Pose(np.zeros(3), np.eye(3))
    names = ["start", *map(str, range(1, _HANDLES - 1)), "end"]
    parameters = np.linspace(0.0, 1.0, _HANDLES)
    if section.line is not None:
        names, parameters = ["start", "end"], np.array([0.0, 1.0])
    elif isinstance(curve, SplineCurve) and len(section.waypoints or ()) in _FEW:
        parameters = curve.knots
        names = ["start", *map(str, range(1, len(parameters) - 1)), "end"]
    drawn = _positions(problem, parameters)
    points = np.array([curve(float(s)) for s in parameters])
    handles = [
        {"name": name, "position": place.round(6).tolist(), "shift": (place - point).tolist()}
        for name, place, point in zip(names, drawn, points, strict=True)
    ]
    law = section.attitude
    if law is not None and law.point_at is not None:
        target = frame.position + frame.rotation @ np.array(law.point_at.target)
        place = target.round(6).tolist()
        handles.append({"name": "target", "position": place, "shift": [0.0, 0.0, 0.0]})
    local = (points - frame.position) @ frame.rotation
    return {
        "frame": {"position": frame.position.tolist(), "rotation": frame.rotation.tolist()},
        "handles": handles,
        "points": local.round(6).tolist(),
    }


def _orientation(scenario: Scenario, problem: Problem, frame: Pose | SceneBody | None) -> Any:
    """Roll, pitch, yaw [rad] at the end and the quaternion at the start, in the path's frame."""
    law = scenario.content.path.attitude
    if isinstance(frame, SceneBody) or not problem.task.prescribes_orientation or law is None:
        return {"rpy": None, "start_quaternion": None}
    rotation = np.eye(3) if frame is None else frame.rotation
    start, end = (
        Rotation.from_matrix(rotation.T @ problem.path.path.orientation.rotation(s))
        for s in (0.0, 1.0)
    )
    rpy = rounded_rpy(end.as_matrix())
    if law.slerp is not None and law.slerp.end.rpy is not None:
        rpy = list(law.slerp.end.rpy)  # as it was set: other angles may state the same
    return {"rpy": rpy, "start_quaternion": start.as_quat().round(9).tolist()}


def rounded_rpy(rotation: Array) -> list[float]:
    """Roll, pitch and yaw of a rotation matrix [rad], rounded."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # where the pitch is 90 degrees, any roll will do
        rpy: list[float] = Rotation.from_matrix(rotation).as_euler("xyz").round(6).tolist()
    return rpy
