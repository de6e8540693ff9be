"""Edits of scenarios: each takes the content of a scenario file and returns the edited content.

Coordinates that the page sends are inertial; the outline of the worker has the frame of the path.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from freefloat.errors import InputError
from freefloat.io.scenario.path_schema import PathSection
from freefloat.studio.messages import (
    Edit,
    MoveHandle,
    SetDuration,
    SetMargin,
    SetMomentum,
    TurnEnd,
)

Content = Mapping[str, Any]
_DIGITS = 6
"""Decimals of edited numbers: micrometres, milliseconds."""


def edited(content: Content, edit: Edit, outline: Mapping[str, Any] | None) -> dict[str, Any]:
    """The content after an edit of its path, or of its goal.

    Args:
        content: Content of a scenario file.
        edit: The edit.
        outline: What the worker answered about this scenario: handles, frame of the path, start
            orientation. None while there is no answer.

    Raises:
        InputError: If the path has no such handle, or there is no outline yet.
    """
    match edit:
        case SetMomentum(value=value):
            return {**content, "momentum": list(value)}
        case SetDuration(value=duration):
            if "goal" in content:
                return {**content, "goal": {**content["goal"], "duration": duration}}
            return {**content, "timing": _with_duration(content["timing"], duration)}
        case SetMargin(value=value):
            margin = dict(content.get("margin", {}))
            margin["fraction" if "fraction" in margin else "value"] = value
            return {**content, "margin": margin}
    if outline is None:
        raise InputError("path", "its handles are not known yet", "an edit of the scenario shown")
    if isinstance(edit, TurnEnd):
        if outline["rpy"] is None:
            accepted = "a path with `attitude`, or a goal with a pose"
            raise InputError("orientation", "it cannot be set", accepted)
        if "goal" in content:
            rpy = [_rounded(angle) for angle in edit.value]
            return _with_pose(content, orientation={"rpy": rpy})
        return {**content, "path": _with_end(content["path"], edit.value, outline)}
    point = _local(edit, outline)
    if "goal" in content:
        return _with_pose(content, position=point)
    return {**content, "path": _with_handle(content["path"], edit.handle, point, outline)}


def _with_pose(content: Content, **changes: Any) -> dict[str, Any]:
    """The content with another position or orientation of the goal's pose."""
    goal = content["goal"]
    return {**content, "goal": {**goal, "pose": {**goal["pose"], **changes}}}


def _with_duration(timing: Content, duration: float) -> dict[str, Any]:
    """The timing with another duration; rests and speeds keep their places on the path."""
    factor = duration / timing["duration"]
    changed: dict[str, Any] = {**timing, "duration": duration}
    if stops := timing.get("stops"):
        changed["stops"] = [{**stop, "t": _rounded(stop["t"] * factor)} for stop in stops]
    if speeds := timing.get("speeds"):
        changed["speeds"] = [[time * factor, speed / factor] for time, speed in speeds]
    return changed


def _with_end(path: Content, rpy: Sequence[float], outline: Content) -> dict[str, Any]:
    """The path whose orientation at the start is as it was, and at the end another one."""
    law = path.get("attitude", {})
    start = law.get("fixed") or law.get("slerp", {}).get("from") or outline["start_quaternion"]
    end = {"rpy": [_rounded(angle) for angle in rpy]}
    return {**path, "attitude": {"slerp": {"from": start, "to": end}}}


def _local(edit: MoveHandle, outline: Content) -> list[float]:
    """The position of a handle that was moved, in the frame of the path or of the goal's pose."""
    frame = outline["frame"]
    if edit.handle >= len(outline["handles"]) or frame is None:
        raise InputError("handle", f"there is no handle {edit.handle}", "a handle of the path")
    place = np.array(edit.position) - outline["handles"][edit.handle]["shift"]
    return [_rounded(part) for part in np.array(frame["rotation"]).T @ (place - frame["position"])]


def _with_handle(
    path: Content, handle: int, point: list[float], outline: Content
) -> dict[str, Any]:
    """The path with one of its points, or the target of its orientation, at another position."""
    points = [list(each) for each in outline["points"]]
    if handle == len(points):  # follows the points
        law = path["attitude"]
        return {**path, "attitude": {"point_at": {**law["point_at"], "target": point}}}
    if "line" in path:
        ends = {**path["line"], ("from", "to")[handle]: point}
        return {**path, "line": ends}
    if len(path.get("waypoints") or ()) == len(points):
        points = list(path["waypoints"])
    points[handle] = point
    kept = {key: value for key, value in path.items() if key not in PathSection.kinds()}
    return {"waypoints": points, **kept}


def _rounded(value: float) -> float:
    return round(float(value), _DIGITS)
