"""End-effector paths: the pose of the end-effector for s in [0, 1]."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from freefloat.errors import InputError, require_type
from freefloat.paths.curves import Curve
from freefloat.paths.orientation import FreeOrientation, OrientationLaw
from freefloat.paths.piecewise import breaks_of, within
from freefloat.so3 import Array, Pose, frozen

_SAMPLES = np.linspace(0.0, 1.0, 101)
"""Values of s at which a path is checked."""
_STEP = 1e-4
"""Step of differences by s: their error and rounding are both far below 1e-9."""


@dataclass(frozen=True, eq=False)
class EndEffectorPath:
    """A curve and an orientation law: the end-effector's pose and its derivatives by s.

    Attributes:
        curve: Position.
        orientation: Orientation; may be left out for position tasks.
    """

    curve: Curve
    orientation: OrientationLaw = field(default_factory=FreeOrientation)

    def __post_init__(self) -> None:
        accepted = "a curve, such as PolynomialCurve.line(start, end), ArcCurve or SplineCurve"
        require_type("path.curve", self.curve, Curve, accepted)
        accepted = "a law, such as FixedOrientation(axes) or SlerpOrientation(start, end)"
        require_type("path.attitude", self.orientation, OrientationLaw, accepted)
        positions = np.array([self.curve(float(s)) for s in _SAMPLES])
        rates = [np.linalg.norm(self.orientation.rate(float(s))) for s in _SAMPLES[::10]]
        if not np.isfinite(positions).all():
            raise InputError("path", "a coordinate is not finite", "finite coordinates")
        if np.ptp(positions, axis=0).max() == 0.0 and max(rates) == 0.0:
            raise InputError("path", "its length is zero", "a path that moves or rotates")

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
        """The tangent between two values of s; beyond them it continues as smoothly as there."""
        curve, orientation = within(self.curve, low, high), within(self.orientation, low, high)
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
