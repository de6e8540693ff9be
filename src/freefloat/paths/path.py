"""End-effector paths: the pose of the end-effector for s in [0, 1], also from CSV files."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from freefloat.errors import InputError, require_type
from freefloat.paths.curves import Curve, SplineCurve
from freefloat.paths.orientation import FreeOrientation, OrientationLaw, OrientationSpline
from freefloat.robot.names import read_text
from freefloat.so3 import Array, Pose, frozen, unit_quaternion

_SAMPLES = np.linspace(0.0, 1.0, 101)
"""Values of s at which a path is checked."""
_STEP = 1e-4
"""Step of differences by s: their error and rounding are both far below 1e-9."""
_QUATERNION = ("qx", "qy", "qz", "qw")
_COLUMNS = "a CSV file with the columns x, y, z and optionally s and qx, qy, qz, qw"
_CLOSEST = 1e-9
"""Smallest distance of rows in s."""
_LARGEST = 1e9
"""Largest number of a CSV file."""


@dataclass(frozen=True, eq=False)
class EndEffectorPath:
    """A curve and an orientation law: the end-effector's pose and its derivatives by s.

    Attributes:
        curve: Position.
        orientation: Orientation; may be left out for position tasks.

    Example:
        >>> line = ff.paths.PolynomialCurve.line([1.6, 0.4, 0.0], [1.2, 0.9, 0.0])
        >>> path = ff.EndEffectorPath(line, ff.paths.FixedOrientation(np.eye(3)))
        >>> path.pose(0.5).position
        array([1.4 , 0.65, 0.  ])
    """

    curve: Curve
    orientation: OrientationLaw = field(default_factory=FreeOrientation)

    def __post_init__(self) -> None:
        accepted = "a Curve, such as PolynomialCurve.line(start, end), ArcCurve or SplineCurve"
        require_type("curve", self.curve, Curve, accepted)
        accepted = (
            "an OrientationLaw, such as FixedOrientation(axes) or SlerpOrientation(start, end)"
        )
        require_type("orientation", self.orientation, OrientationLaw, accepted)
        if not np.isfinite(self._positions).all():
            raise InputError("curve", "a coordinate is not finite", "finite coordinates")

    @cached_property
    def _positions(self) -> Array:
        return np.array([self.curve(float(s)) for s in _SAMPLES])

    @property
    def has_length(self) -> bool:
        """Whether the end-effector moves or rotates."""
        rates = [self.orientation.rate(float(s)) for s in _SAMPLES[::10]]
        return bool(np.ptp(self._positions, axis=0).any() or np.any(rates))

    def pose(self, s: float) -> Pose:
        """Pose in the frame of the path: see :class:`~freefloat.paths.timing.TimedPath`."""
        return Pose(self.curve(s), self.orientation.rotation(s))

    def tangent(self, s: float) -> Array:
        """Derivative of the pose by s: [linear; angular], inertial axes [m; rad], shape (6,)."""
        return np.concatenate([self.curve(s, 1), self.orientation.rate(s)])

    @cached_property
    def breaks(self) -> Array:
        """Values of s, rising, inside (0, 1), at which high derivatives jump."""
        both = np.concatenate([self.curve.breaks, self.orientation.breaks])
        return frozen(np.unique(both))

    def tangent_within(self, low: float, high: float) -> Callable[[float], Array]:
        """The tangent between two values of s; beyond them it continues as smoothly as there."""
        curve = self.curve.within(low, high)
        orientation = self.orientation.within(low, high)
        return lambda s: np.concatenate([curve(s, 1), orientation.rate(s)])

    def second_derivative(self, s: float) -> Array:
        """Derivative of the tangent by s [m; rad], shape (6,).

        That of the orientation's rate is a difference of fourth order, taken a little further
        inside at the ends.
        """
        middle = min(max(s, 2.0 * _STEP), 1.0 - 2.0 * _STEP)
        rate = self.orientation.rate
        before, after = (
            (8.0 * rate(middle + side) - rate(middle + 2.0 * side)) / 12.0
            for side in (-_STEP, _STEP)
        )
        return np.concatenate([self.curve(s, 2), (after - before) / _STEP])


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
        if "qw" not in table:
            return curve, None
        rows = zip(lines, *(table[name] for name in _QUATERNION), strict=True)
        quaternions = [unit_quaternion(f"line {line}: ", row) for line, *row in rows]
    except InputError as error:
        where = error.key if error.key.startswith("line") else ""
        raise _refusal(source, where + error.problem, error.accepted) from None
    return curve, OrientationSpline(quaternions, curve.knots)


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
        values = [float(word) for word in row]
    except ValueError:
        values = []
    if len(values) == count and all(abs(value) <= _LARGEST for value in values):
        return values
    accepted = f"{count} finite numbers, none beyond {_LARGEST:g}"
    raise _refusal(source, f"line {line} is {','.join(row)!r}", accepted)


def _refusal(source: str | Path, problem: str, accepted: str) -> InputError:
    return InputError("path.samples", problem, accepted, str(source))
