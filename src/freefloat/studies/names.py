"""Names of varied keys for people: quantities with units."""

from __future__ import annotations

import re
from collections.abc import Sequence

from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.yaml import description_at
from freefloat.studies.study_file import TRACK, StudyFile

_VECTORS = ("momentum", "wheels.momentum", "drift", "attitude")
"""Keys whose entries are components."""
_ROBOT = "robot."
_NAMES = {
    "wheels.momentum": "wheel momentum",
    "timing.duration": "duration",
    "scale mass": "mass factor",
    "margin.value": "required margin",
    "heading_deg": "heading [deg]",
}


def readable_name(key: str) -> str:
    """The name of a varied key, or of an entry: ``momentum x`` of ``momentum.0``; else the key."""
    vector, _, entry = key.rpartition(".")
    if vector in _VECTORS and entry in ("0", "1", "2", "3"):
        return f"{_NAMES.get(vector, vector)} {'xyzw'[int(entry)]}"
    if vector == "robot.scale_mass":
        return f"mass factor of {entry}"
    if key.startswith((TRACK, _ROBOT)):
        key = key.removeprefix(TRACK).removeprefix(_ROBOT).replace("_", " ").replace(".", " ")
    return _NAMES.get(key, key)


_RESULTS = {
    "margin": "minimum margin", "margin_time": "time of the minimum margin [s]",
    "margin_required": "required margin", "singular_time": "singular at [s]",
    "robust_radius_deg": "attitude tolerance [deg]", "deviation_deg": "deviation [deg]",
    "limiting": "limiting quantity", "limiting_time": "time of the limiting quantity [s]",
    "branch": "arm branch",
    "base_rate": "largest base rate [rad/s]", "base_turn_deg": "largest base turn [deg]",
    "duration": "duration [s]", "heading_deg": "heading [deg]", "seconds": "computed in [s]",
    "residuals.end_effector_position": "largest distance from the path [m]",
    "residuals.end_effector_attitude": "largest orientation error [rad]",
    "residuals.momentum": "momentum error [N m s]",
    "residuals.final_position": "distance at the end [m]",
}  # fmt: skip
_OF_JOINTS = {
    "joints": "initial value",
    "joint_rates": "largest rate",
    "range_ratios": "range ratio",
}


def result_name(column: str, joints: Sequence[str]) -> str:
    """The name of a column of results, with its unit, for a robot with these joints."""
    family, _, entry = column.partition(".")
    if family in _OF_JOINTS and int(entry) < len(joints):
        return f"{_OF_JOINTS[family]} of {joints[int(entry)]}"
    if family == "limits":
        return f"ratio of the {entry.replace('_', ' ')} limit"
    return _RESULTS.get(column, column.replace("_", " "))


def heading(key: str) -> str:
    """The name of a varied key with its unit, which the schema describes."""
    schema, name = StudyFile if key.startswith(TRACK) else ScenarioFile, readable_name(key)
    description = description_at(schema, key.split(".")) or ""
    unit = re.search(r"\[[^\]]*\]", description)
    return name if unit is None or "[" in name else f"{name} {unit[0]}"
