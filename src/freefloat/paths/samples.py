"""End-effector paths from CSV files of positions and orientations."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from freefloat.errors import LARGEST_NUMBER, InputError
from freefloat.paths.curves import SplineCurve
from freefloat.paths.orientation import OrientationSpline
from freefloat.robot.named_files import read_text
from freefloat.so3 import Array, unit_quaternion

_QUATERNION = ("qx", "qy", "qz", "qw")
_COLUMNS = "a CSV file with the columns x, y, z and optionally s and qx, qy, qz, qw"
_CLOSEST = 1e-9
"""Smallest distance of rows in s."""


def samples_text(file: str | Path) -> str:
    """The text of a CSV file, line ends as they are.

    Raises:
        InputError: If the file is missing, too large or not a text file.
    """
    try:
        return read_text(Path(file))
    except ValueError as error:
        raise _refusal(file, f"it cannot be read: {error}", _COLUMNS) from None


def parse_samples(text: str, source: str | Path) -> tuple[SplineCurve, OrientationSpline | None]:
    """The path in the text of a CSV file.

    The first line names the columns: ``x, y, z`` [m], optionally ``qx, qy, qz, qw``, optionally
    ``s``, rising from 0 to 1 (by chord length when absent). Two rows or more.

    Args:
        text: Text of the file.
        source: Name of the file, for errors.

    Returns:
        The curve, and the orientation where the file has one.

    Raises:
        InputError: Naming the file and, of a row, the line.
    """
    table, lines = _columns(text, source)
    s = table.get("s")
    if s is not None and (s[0] != 0.0 or s[-1] != 1.0 or (np.diff(s) < _CLOSEST).any()):
        accepted = "0 to 1, no two rows closer than 1e-9"
        raise _refusal(source, "column s does not rise from 0 to 1", accepted)
    try:
        curve = SplineCurve(np.column_stack([table[name] for name in "xyz"]), s)
    except InputError as error:
        raise _refusal(source, error.problem, error.accepted) from None
    if "qw" not in table:
        return curve, None
    rows = zip(lines, *(table[name] for name in _QUATERNION), strict=True)
    quaternions = [_quaternion(source, line, values) for line, *values in rows]
    return curve, OrientationSpline(quaternions, curve.knots)


def _quaternion(source: str | Path, line: int, values: list[float]) -> Array:
    try:
        return unit_quaternion("", values)
    except InputError as error:
        raise _refusal(source, f"line {line}: {error.problem}", error.accepted) from None


def _columns(text: str, source: str | Path) -> tuple[dict[str, Array], list[int]]:
    """The columns by name, shape (N,) each, and the line of each row."""
    try:
        reader = csv.reader(io.StringIO(text, newline=""), strict=True)
        lines = [(reader.line_num, row) for row in reader if row]
    except csv.Error:
        raise _refusal(source, "it cannot be read as text", _COLUMNS) from None
    names = [name.strip() for name in lines[0][1]] if lines else []
    known = [set("xyz") | extra for extra in (set(), {"s"}, {*_QUATERNION}, {"s", *_QUATERNION})]
    if set(names) not in known or len(set(names)) != len(names):
        raise _refusal(source, f"columns {', '.join(names) or 'none'}", _COLUMNS)
    rows = [_numbers(source, line, row, len(names)) for line, row in lines[1:]]
    if len(rows) < 2:
        raise _refusal(source, f"{len(rows)} rows of numbers", "two or more")
    columns = dict(zip(names, np.array(rows).T, strict=True))
    return columns, [line for line, _ in lines[1:]]


def _numbers(source: str | Path, line: int, row: list[str], count: int) -> list[float]:
    try:
        values = [_number(word) for word in row]
    except ValueError:
        values = []
    if len(values) == count and all(abs(value) <= LARGEST_NUMBER for value in values):
        return values
    accepted = f"{count} finite numbers, none beyond {LARGEST_NUMBER:g}"
    raise _refusal(source, f"line {line} is {','.join(row)!r}", accepted)


def _refusal(source: str | Path, problem: str, accepted: str) -> InputError:
    return InputError("path.samples", problem, accepted, str(source))


def _number(word: str) -> float:
    """A number as tables have it; Python alone reads others, such as 1_2."""
    if "_" in word or not word.isascii():
        raise ValueError(word)
    return float(word)
