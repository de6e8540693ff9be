"""Studies for tests: cheap cases of the paper's first example, written into a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from freefloat.studies.study import Study, load_study

BASE: dict[str, Any] = {
    "robot": {"urdf": "planar_3dof.urdf", "end_effector": "end_effector"},
    "task": "planar-pose",
    "momentum": [0, 0, 0.5],
    "path": {
        "polynomial": {"x": [2, -3], "y": [0, 0.5, 1.5], "z": [0]},
        "attitude": {"follow": {"axis": "-y", "normal": [0, 0, 1]}},
    },
    "timing": {"duration": 100},
    "margin": {"measure": "system", "value": 5},
}
"""Of the paper's first example, in one motion."""
SHORT: dict[str, Any] = BASE | {
    "path": BASE["path"] | {"polynomial": {"x": [2, -0.05], "y": [0, 0.01], "z": [0]}},
    "timing": {"duration": 5},
}
"""A twentieth of the way, in a quarter of the time."""
TURNS: dict[str, Any] = {"heading_deg": {"list": [200.0, 140.0, 20.0]}}
"""Feasible, singular, feasible."""


def write_study(
    folder: Path, vary: dict[str, Any], base: dict[str, Any] | None = None, **keys: Any
) -> Path:
    """A study of simulations, its base beside it; keys with the value None are left out."""
    (folder / "wish.yaml").write_text(yaml.safe_dump(base or BASE, sort_keys=False))
    start = {} if "heading_deg" in vary else {"heading_deg": 200.0}
    document = {"base": "wish.yaml", "task": "simulate", **start, "vary": vary, **keys}
    told = {key: value for key, value in document.items() if value is not None}
    file = folder / "study.yaml"
    file.write_text(yaml.safe_dump(told, sort_keys=False))
    return file


def a_study(folder: Path, vary: dict[str, Any] | None = None, **keys: Any) -> Study:
    """The same, loaded."""
    return load_study(write_study(folder, TURNS if vary is None else vary, **keys))
