"""End-effector paths: where the hand should be and how it should stand, for s in [0, 1]."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from freefloat.brief import brief
from freefloat.errors import InputError, require_type
from freefloat.paths.curves import Curve, SplineCurve
from freefloat.paths.orientation import FreeOrientation, OrientationLaw
from freefloat.paths.orientation_spline import OrientationSpline
from freefloat.paths.piecewise import breaks_of, within
from freefloat.so3 import Array, Pose, frozen, unit_quaternion

_LOOKS = np.linspace(0.0, 1.0, 101)
"""Where a path is inspected when it is made."""
_STEP = 1e-4
"""Of differences by s: their error and rounding are both far below 1e-9."""


@dataclass(frozen=True, eq=False)
class EndEffectorPath:
    """A curve and an attitude law: the end-effector's pose and its derivative.

    Attributes:
        curve: Position.
        orientation: Orientation; may be left out for position tasks.
    """

    __repr__ = brief

    curve: Curve
    orientation: OrientationLaw = field(default_factory=FreeOrientation)

    def __post_init__(self) -> None:
        accepted = "a curve, such as PolynomialCurve.line(start, end), ArcCurve or SplineCurve"
        require_type("path.curve", self.curve, Curve, accepted)
        accepted = "an attitude law, such as FixedOrientation(axes) or SlerpOrientation(start, end)"
        require_type("path.attitude", self.orientation, OrientationLaw, accepted)
        places = np.array([self.curve(float(s)) for s in _LOOKS])
        turns = [np.linalg.norm(self.orientation.rate(float(s))) for s in _LOOKS[::10]]
        if not np.isfinite(places).all():
            raise InputError("path", "it leaves the finite numbers", "finite coordinates")
        if np.ptp(places, axis=0).max() == 0.0 and max(turns) == 0.0:
            raise InputError("path", "its length is zero", "a path that moves or turns")

    def pose(self, s: float) -> Pose:
        """Pose in the inertial frame, whose origin is the system's centre of mass."""
        return Pose(self.curve(s), self.orientation.rotation(s))

    def tangent(self, s: float) -> Array:
        """Derivative of the pose by s: [linear; angular], inertial axes [m; rad], shape (6,)."""
        return np.concatenate([self.curve(s, 1), self.orientation.rate(s)])

    @cached_property
    def breaks(self) -> Array:
        """Values of s, rising, inside (0, 1), at which high derivatives jump."""
        return frozen(np.union1d(breaks_of(self.curve), breaks_of(self.orientation)))

    def tangent_within(self, low: float, high: float) -> Callable[[float], Array]:
        """The tangent between two places; beyond them it goes on as smoothly as there."""
        curve, orientation = within(self.curve, low, high), within(self.orientation, low, high)
        return lambda s: np.concatenate([curve(s, 1), orientation.rate(s)])

    def second_derivative(self, s: float) -> Array:
        """Derivative of the tangent by s [m; rad], shape (6,).

        That of the attitude's rate is a difference of fourth order, taken a little further inside
        at the ends.
        """
        at = min(max(s, 2.0 * _STEP), 1.0 - 2.0 * _STEP)
        before, after = (
            (8.0 * self.orientation.rate(at + side) - self.orientation.rate(at + 2.0 * side)) / 12.0
            for side in (-_STEP, _STEP)
        )
        return np.concatenate([self.curve(s, 2), (after - before) / _STEP])


def read_samples(file: str | Path) -> tuple[SplineCurve, OrientationSpline | None]:
    """Read a path from a CSV file, see :func:`parse_samples`."""
    return parse_samples(samples_text(file), file)


def samples_text(file: str | Path) -> str:
    """The text of a CSV file, line ends as they are.

    Raises:
        InputError: If there is no such file, or it is no text.
    """
    path = Path(file)
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):  # devices never end
            raise _refusal(path, "it is no plain file", _COLUMNS)
        with path.open(encoding="utf-8-sig", newline="") as stream:
            text = stream.read(_LONGEST + 1)
        if len(text) > _LONGEST:
            raise _refusal(path, "it is too long", f"at most {_LONGEST:,} characters")
        return text
    except FileNotFoundError:
        raise _refusal(path, "no such file", _COLUMNS) from None
    except OSError as error:
        raise _refusal(path, f"it cannot be read: {error.strerror}", _COLUMNS) from None
    except ValueError:
        raise _refusal(path, "it cannot be read as text", _COLUMNS) from None


def parse_samples(text: str, source: str | Path) -> tuple[SplineCurve, OrientationSpline | None]:
    """A path from the text of a CSV file.

    The first line names the columns: ``x, y, z`` [m], optionally ``qx, qy, qz, qw``, optionally
    ``s``, rising from 0 to 1 (by chord length when absent). Two rows or more.

    Args:
        text: What the file says.
        source: Its name, for errors.

    Returns:
        The curve, and the attitude where the file has one.

    Raises:
        InputError: Naming the file and the line.
    """
    path = Path(source)
    columns, rows, lines = _parse_csv(text, path)
    points = np.column_stack([rows[:, columns.index(name)] for name in "xyz"])
    s = rows[:, columns.index("s")] if "s" in columns else None
    if s is not None and (s[0] != 0.0 or s[-1] != 1.0 or (np.diff(s) < _CLOSEST).any()):
        raise _refusal(
            path, "column s does not rise from 0 to 1", "0 to 1, no two rows closer than 1e-9"
        )
    try:
        curve = SplineCurve(points, s)
    except InputError as error:
        raise _refusal(path, error.problem, error.accepted) from None
    if "qw" not in columns:
        return curve, None
    quaternions = []
    for line, row in zip(lines, rows, strict=True):
        try:
            given = [row[columns.index(name)] for name in _QUATERNION]
            quaternions.append(unit_quaternion("samples", given))
        except InputError as error:
            raise _refusal(path, f"line {line}: {error.problem}", error.accepted) from None
    return curve, OrientationSpline(quaternions, curve.knots)


_QUATERNION = ("qx", "qy", "qz", "qw")
_COLUMNS = "a CSV file with the columns x, y, z and optionally s and qx, qy, qz, qw"
_LONGEST = 20_000_000
"""Characters; a row of eight numbers has at most 200."""
_CLOSEST = 1e-9
_LARGEST = 1e9


def _refusal(path: Path, problem: str, accepted: str) -> InputError:
    return InputError("path.samples", problem, accepted, str(path))


def _parse_csv(text: str, path: Path) -> tuple[list[str], Array, list[int]]:
    """Column names, rows of numbers, and the line each row stands in."""
    try:
        reader = csv.reader(io.StringIO(text, newline=""), strict=True)
        table = [(reader.line_num, row) for row in reader if row]
    except csv.Error:
        raise _refusal(path, "it cannot be read as text", _COLUMNS) from None
    columns = [name.strip() for name in table[0][1]] if table else []
    given, quaternion = set(columns), set(_QUATERNION)
    complete = given >= set("xyz") and (given >= quaternion or not given & quaternion)
    if not (complete and given <= {"s", *"xyz", *quaternion} and len(given) == len(columns)):
        raise _refusal(path, f"columns {', '.join(columns) or 'none'}", _COLUMNS)
    rows = [_numbers(path, line, row, len(columns)) for line, row in table[1:]]
    if len(rows) < 2:
        raise _refusal(path, f"{len(rows)} rows of numbers", "two or more")
    return columns, np.array(rows), [line for line, _ in table[1:]]


def _numbers(path: Path, line: int, row: list[str], count: int) -> list[float]:
    try:
        values = [float(word) for word in row]
    except ValueError:
        values = []
    if len(values) != count or not np.isfinite(values).all() or max(map(abs, values)) > _LARGEST:
        accepted = f"{count} finite numbers, none beyond {_LARGEST:g}"
        raise _refusal(path, f"line {line} is {','.join(row)!r}", accepted)
    return values
