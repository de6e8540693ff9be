"""Edits of scenarios: each takes the content of a scenario file and returns the edited content.

Coordinates that the page sends are inertial; the outline of the worker has the frame of the path.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from freefloat.beyond.studio.messages import (
    Edit,
    MoveHandle,
    SetDuration,
    SetMargin,
    SetMomentum,
    TurnEnd,
)
from freefloat.errors import InputError
from freefloat.io.scenario.path_schema import PathSection

Content = Mapping[str, Any]
_DIGITS = 6
"""Decimals of edited numbers: micrometres, milliseconds."""


def edited(content: Content, edit: Edit, outline: Mapping[str, Any] | None) -> dict[str, Any]:
    """The content of a scenario file after an edit.

    The outline is what the worker answered about the scenario, with handles and the frame of the
    path; None while there is no answer.

    Raises:
        InputError: If the path has no such handle, or there is no outline yet.
    """
    match edit:
        case SetMomentum(value=value):
            return {**content, "momentum": list(value)}
        case SetMargin(value=value):
            margin = dict(content.get("margin", {}))
            margin["fraction" if "fraction" in margin else "value"] = value
            return {**content, "margin": margin}
    changes = _goal_changes if "goal" in content else _path_changes
    return {**content, **changes(content, edit, outline)}


def _goal_changes(
    content: Content, edit: SetDuration | TurnEnd | MoveHandle, outline: Content | None
) -> Content:
    """The goal after an edit of its duration, or of its pose."""
    goal = content["goal"]
    if isinstance(edit, SetDuration):
        return {"goal": {**goal, "duration": edit.value}}
    if isinstance(edit, TurnEnd):
        change: Content = {"orientation": {"rpy": _angles(edit, _known(outline))}}
    else:
        change = {"position": _local(edit, _known(outline))}
    return {"goal": {**goal, "pose": {**goal["pose"], **change}}}


def _path_changes(
    content: Content, edit: SetDuration | TurnEnd | MoveHandle, outline: Content | None
) -> Content:
    """The timing or the path after an edit."""
    if isinstance(edit, SetDuration):
        return {"timing": _with_duration(content["timing"], edit.value)}
    known = _known(outline)
    if isinstance(edit, TurnEnd):
        return {"path": _with_end(content["path"], _angles(edit, known))}
    path, handle = _path_of(edit.handle, known)
    point = _local(edit, known)
    if not path["arm"]:
        return {"path": _with_handle(content["path"], handle, point, path["points"])}
    robot = content["robot"]
    arm = robot["arms"][path["arm"]]
    law = {"path": _with_handle(arm["law"]["path"], handle, point, path["points"])}
    return {"robot": {**robot, "arms": {**robot["arms"], path["arm"]: {**arm, "law": law}}}}


def _path_of(handle: int, outline: Content) -> tuple[Content, int]:
    """The path of which a handle is one, and its number there."""
    for path in outline["paths"]:
        if handle < path["handles"]:
            return path, handle
        handle -= path["handles"]
    raise InputError("handle", "there is no such handle", "a handle of the path")


def _known(outline: Content | None) -> Content:
    """The outline; an InputError while there is none."""
    if outline is None:
        accepted = "an edit of the scenario shown"
        raise InputError("path", "its handles are not known yet", accepted)
    return outline


def _angles(edit: TurnEnd, outline: Content) -> list[float]:
    """Roll, pitch and yaw at the end; an InputError where they cannot be set."""
    if outline["rpy"] is None:
        accepted = "a path with a fixed attitude or slerp, or a goal with a pose"
        raise InputError("orientation", "it cannot be set", accepted)
    return [_rounded(angle) for angle in edit.value]


def _with_duration(timing: Content, duration: float) -> dict[str, Any]:
    """The timing with another duration; rests and speeds keep their places on the path."""
    factor = duration / timing["duration"]
    changed: dict[str, Any] = {**timing, "duration": duration}
    if stops := timing.get("stops"):
        changed["stops"] = [{**stop, "t": _rounded(stop["t"] * factor)} for stop in stops]
    if speeds := timing.get("speeds"):
        units = factor, 1.0 / factor, factor**-2.0
        changed["speeds"] = [
            [value * unit for value, unit in zip(row, units, strict=False)] for row in speeds
        ]
    return changed


def _with_end(path: Content, rpy: list[float]) -> dict[str, Any]:
    """The path whose orientation at the start is as it was, and at the end another one."""
    law = path["attitude"]
    start = law["fixed"] if "fixed" in law else law["slerp"]["from"]
    return {**path, "attitude": {"slerp": {"from": start, "to": {"rpy": rpy}}}}


def _local(edit: MoveHandle, outline: Content) -> list[float]:
    """The position of a handle that was moved, in the frame of its path or of the goal's pose."""
    frame = _path_of(edit.handle, outline)[0]["frame"]
    place = np.array(edit.position) - outline["handles"][edit.handle]["shift"]
    return [_rounded(part) for part in np.array(frame["rotation"]).T @ (place - frame["position"])]


def _with_handle(
    path: Content, handle: int, point: list[float], known: Sequence[Sequence[float]]
) -> dict[str, Any]:
    """The path with one of its points, or the target of its orientation, at another position."""
    points = [list(each) for each in known]
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
