"""Names of varied keys for people: quantities with units."""

from __future__ import annotations

import re

from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.yaml import description_at
from freefloat.studies.study import StudyFile
from freefloat.studies.track_section import TRACK

_VECTORS = ("momentum", "wheels.momentum", "drift", "attitude")
"""Keys whose entries are components."""
_NAMES = {
    "wheels.momentum": "wheel momentum",
    "timing.duration": "duration",
    "robot.scale_mass": "mass factor",
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
    return _NAMES.get(key, key.removeprefix(TRACK).replace("_", " ") if TRACK in key else key)


def heading(key: str) -> str:
    """The name of a varied key with its unit, which the schema describes."""
    schema, name = StudyFile if key.startswith(TRACK) else ScenarioFile, readable_name(key)
    description = description_at(schema, key.split(".")) or ""
    unit = re.search(r"\[[^\]]*\]", description)
    return name if unit is None or "[" in name else f"{name} {unit[0]}"
