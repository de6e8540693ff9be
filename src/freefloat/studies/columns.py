"""Columns of the table of a study: a row for each finished run, the same on disk and in memory."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

FEASIBLE, INFEASIBLE, ERROR = "feasible", "infeasible", "error"
VERDICTS = (FEASIBLE, INFEASIBLE, ERROR)
"""Verdicts."""
INTEGER, REAL, TEXT, BOOLEAN = "INTEGER", "REAL", "TEXT", "BOOLEAN"
"""Types of columns, by their names in the database."""
UNCHECKED = "not considered"
"""Contact between bodies, in the rows of studies whose runs do not consider it."""
MARGIN_REASON, LIMITS_REASON = "The margin is not kept.", "Limits are not kept: {}."
"""Why a motion that completes is infeasible."""
LIMITING, MARGIN_LIMITS, SINGULARITY_LIMITS = "{} of {}", "margin", "singularity"
"""What limits a motion: a limit and a joint, or another place; the margin; where it ends."""
NUMBER = "number"
"""The first column; parameters follow, then results."""
_FIRST = {
    "verdict": TEXT, "reason": TEXT, "margin": REAL, "margin_time": REAL, "margin_required": REAL,
    "measure": TEXT, "completed": BOOLEAN, "singular_time": REAL, "branch": INTEGER,
    "attitude.x": REAL, "attitude.y": REAL, "attitude.z": REAL, "attitude.w": REAL,
    "heading_deg": REAL, "robust_radius_deg": REAL, "deviation_deg": REAL,
    "feasible_fraction": REAL, "motion_fraction": REAL, "duration": REAL,
    "limits_kept": BOOLEAN, "limiting": TEXT, "limiting_time": REAL, "base_rate": REAL,
    "base_turn_deg": REAL, "contact": TEXT,
}  # fmt: skip
_LAST = {"decided_by": TEXT, "seconds": REAL, "began": TEXT, "file": TEXT, "bytes": INTEGER,
         "error": TEXT}  # fmt: skip
RESULTS = _FIRST | _LAST
"""Types of the results that every study has, empty where its command does not compute them."""
BOOLEANS = {name for name, kind in RESULTS.items() if kind == BOOLEAN}
"""Names of the results that are true or false, which the database stores as integers."""
FAMILIES = {
    "joints": REAL, "final_attitude": REAL, "joint_rates": REAL, "range_ratios": REAL,
    "residuals": REAL, "limits": REAL, "attitude_ranges_deg": TEXT,
}  # fmt: skip
"""Types of results that a study has by joint, quantity, limit and arm branch, such as joints.0."""
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

Column = Sequence[Any] | npt.NDArray[Any]
Columns = Mapping[str, Column]
"""Values of runs by column."""


def result_type(name: str) -> str:
    """The type of a column of results."""
    name = name.removeprefix(FOUND)
    return RESULTS.get(name) or FAMILIES[name.partition(".")[0]]


def in_order(names: Iterable[str], parameters: Sequence[str]) -> list[str]:
    """Columns in the order of tables: number, parameters, verdict and margin, families, others."""
    before, results = [NUMBER, *parameters], [*_FIRST, *FAMILIES, *_LAST]

    def place(name: str) -> int:
        if name in before:
            return before.index(name)
        name = name.removeprefix(FOUND)
        name = name if name in RESULTS else name.partition(".")[0]
        return len(before) + (results.index(name) if name in results else len(results))

    return sorted(names, key=place)


FOUND = "found."
"""Before the name of a result where a parameter has this name, such as ``limits.base_rate``."""


def by_entry(key: str, values: Sequence[Any]) -> dict[str, npt.NDArray[Any]]:
    """Values of a key as columns of numbers, of lists one for each entry; else as a text."""
    if all(map(_is_number, values)):
        return {key: np.array(values, dtype=float)}
    lists = all(isinstance(value, list) and all(map(_is_number, value)) for value in values)
    if lists and len(lengths := set(map(len, values))) == 1 and lengths != {0}:
        columns = np.array(values, dtype=float).T
        return {f"{key}.{index}": column for index, column in enumerate(columns)}
    texts = [value if isinstance(value, str) else json.dumps(value) for value in values]
    return {key: np.array(texts, dtype=object)}


def as_numbers(column: Column, shape: tuple[int, ...]) -> npt.NDArray[np.float64]:
    """Values as an array, NaN where one is not a number or list of numbers of the shape."""
    if isinstance(column, np.ndarray):
        return column if column.shape[1:] == shape else np.full((len(column), *shape), np.nan)
    return np.array([_row(value, shape) for value in column]).reshape(-1, *shape)


def _row(value: Any, shape: tuple[int, ...]) -> Any:
    entries = value if shape else [value]
    numbers = isinstance(entries, list) and len(entries) == int(np.prod(shape))
    if numbers and all(map(_is_number, entries)):
        return value
    return np.full(shape, np.nan)


def finite(value: Any) -> Any:
    """Replace numbers that JSON does not know by None."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def family(name: str, values: Mapping[Any, Any]) -> dict[str, Any]:
    """The columns of a family, such as ``joints.0`` and ``joints.1``."""
    return {f"{name}.{key}": value for key, value in values.items()}


def result_name(column: str, joints: Sequence[str]) -> str:
    """The name of a column of results, with its unit, for a robot with these joints."""
    family, _, entry = column.partition(".")
    if family in _OF_JOINTS and int(entry) < len(joints):
        return f"{_OF_JOINTS[family]} of {joints[int(entry)]}"
    if family == "limits":
        return f"ratio of the {entry.replace('_', ' ')} limit"
    return _RESULTS.get(column, column.replace("_", " "))
