"""Studies for tests: cheap runs of the paper's first example, written into a folder."""

from pathlib import Path
from typing import Any

import yaml

import freefloat as ff
from freefloat.studies.database import open_results
from freefloat.studies.rows import StudyRows
from freefloat.studies.study import Study
from freefloat.studies.workers import study_files

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
"""Example 1 of the paper without stops."""
SHORT: dict[str, Any] = BASE | {
    "path": BASE["path"] | {"polynomial": {"x": [2, -0.05], "y": [0, 0.01], "z": [0]}},
    "timing": {"duration": 5},
}
"""The first twentieth of the path."""
HEADINGS: dict[str, Any] = {"heading_deg": {"list": [200.0, 140.0, 20.0]}}
"""Feasible, singular, feasible."""


def write_study(
    folder: Path, vary: dict[str, Any], base: dict[str, Any] | None = None, **keys: Any
) -> Path:
    """Write a study of simulations and its base scenario; keys with the value None are left out."""
    (folder / "base.yaml").write_text(yaml.safe_dump(base or BASE, sort_keys=False))
    start = {} if "heading_deg" in vary else {"heading_deg": 200.0}
    document = {"base": "base.yaml", "command": "simulate", **start, "vary": vary, **keys}
    content = {key: value for key, value in document.items() if value is not None}
    file = folder / "study.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False))
    return file


def a_study(folder: Path, vary: dict[str, Any] | None = None, **keys: Any) -> Study:
    """Write a study and load it."""
    return ff.load_study(write_study(folder, HEADINGS if vary is None else vary, **keys))


def finished(study: Study, folder: Path, *runs: dict[str, Any]) -> StudyRows:
    """Add results of runs, by number, to the database of a study, and return its rows."""
    with open_results(folder, study, study_files(study)) as database:
        for run in runs:
            values = {name: [value] for name, value in run.items() if name != "number"}
            database.add([run["number"]], values)
        return database.rows
