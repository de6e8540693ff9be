"""End-effector paths: where the hand should be and how it should stand, for s in [0, 1]."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from freefloat.attitude_law import AttitudeLaw, SampledAttitude
from freefloat.curve import Curve, SplineCurve
from freefloat.errors import InputError
from freefloat.spatial import Array, Pose, unit_quaternion

_LOOKS = np.linspace(0.0, 1.0, 101)
"""Where a path is inspected when it is made."""


@dataclass(frozen=True, eq=False)
class EndEffectorPath:
    """A curve and an attitude law: the end-effector's pose and its derivative.

    Attributes:
        curve: Position.
        attitude: Attitude.
    """

    curve: Curve
    attitude: AttitudeLaw

    def __post_init__(self) -> None:
        places = np.array([self.curve(float(s)) for s in _LOOKS])
        turns = [np.linalg.norm(self.attitude.rate(float(s))) for s in _LOOKS[::10]]
        if not np.isfinite(places).all():
            raise InputError("path", "it leaves the finite numbers", "finite coordinates")
        if np.ptp(places, axis=0).max() == 0.0 and max(turns) == 0.0:
            raise InputError("path", "its length is zero", "a path that moves or turns")

    def pose(self, s: float) -> Pose:
        """Pose in the inertial frame, whose origin is the system's centre of mass."""
        return Pose(self.curve(s), self.attitude.rotation(s))

    def tangent(self, s: float) -> Array:
        """Derivative of the pose by s: [linear; angular], inertial axes [m; rad], shape (6,)."""
        return np.concatenate([self.curve(s, 1), self.attitude.rate(s)])


def read_samples(file: str | Path) -> tuple[SplineCurve, SampledAttitude | None]:
    """Read a path from a CSV file.

    The first line names the columns: ``x, y, z`` [m], optionally ``qx, qy, qz, qw``, optionally
    ``s``, rising from 0 to 1 (by chord length when absent). Two rows or more.

    Returns:
        The curve, and the attitude where the file has one.

    Raises:
        InputError: Naming line and column.
    """
    rows, columns = _read_csv(Path(file))
    points = np.column_stack([rows[:, columns.index(name)] for name in "xyz"])
    source = str(file)
    s = rows[:, columns.index("s")] if "s" in columns else None
    if s is not None and (s[0] != 0.0 or s[-1] != 1.0 or (np.diff(s) <= 0.0).any()):
        raise InputError("path.samples", "column s does not rise from 0 to 1", "0 to 1", source)
    try:
        curve = SplineCurve(points, s)
        if "qw" not in columns:
            return curve, None
        quaternions = [
            unit_quaternion(f"line {line}", [row[columns.index(name)] for name in _QUATERNION])
            for line, row in enumerate(rows, start=2)
        ]
    except InputError as error:
        raise InputError("path.samples", error.problem, error.accepted, source) from None
    return curve, SampledAttitude(quaternions, curve.knots)


_QUATERNION = ("qx", "qy", "qz", "qw")


def _read_csv(path: Path) -> tuple[Array, list[str]]:
    accepted = "a CSV file with the columns x, y, z and optionally s and qx, qy, qz, qw"
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            lines = [row for row in csv.reader(stream, strict=True) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            "path.samples", f"it cannot be read ({error})", accepted, str(path)
        ) from None
    columns = [name.strip() for name in lines[0]] if lines else []
    known = {"s", "x", "y", "z", *_QUATERNION}
    given = set(columns)
    quaternion_complete = given >= set(_QUATERNION) or not given & set(_QUATERNION)
    if not (
        given >= set("xyz")
        and given <= known
        and len(given) == len(columns)
        and quaternion_complete
    ):
        raise InputError(
            "path.samples", f"columns {', '.join(columns) or 'none'}", accepted, str(path)
        )
    rows = []
    for number, row in enumerate(lines[1:], start=2):
        try:
            values = [float(word) for word in row]
        except ValueError:
            values = []
        if len(values) != len(columns) or not np.isfinite(values).all():
            raise InputError("path.samples", f"row {number} is {','.join(row)!r}",
                             f"{len(columns)} finite numbers", str(path))  # fmt: skip
        rows.append(values)
    if len(rows) < 2:
        raise InputError("path.samples", f"{len(rows)} rows of numbers", "two or more", str(path))
    return np.array(rows), columns
