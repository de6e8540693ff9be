"""End-effector paths: the pose of the end-effector for s in [0, 1]."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from freefloat.errors import InputError, require_type
from freefloat.paths.curves import Curve, SplineCurve
from freefloat.paths.orientation import FreeOrientation, OrientationLaw, OrientationSpline
from freefloat.rotations import Rotation
from freefloat.so3 import Array, Pose, frozen, rotation_vector_between

_CHECKED_AT = np.linspace(0.0, 1.0, 101)
"""Values of s at which a path is checked."""
_CHECKED, _DEVIATION, _SMALL = (0.217, 0.533, 0.871), 1e-3, 1e-6
"""Values of s at which derivatives are compared with differences, the largest relative deviation,
and the derivative up to which rounding errors are larger."""
_FASTEST = 1e3
"""Derivative above which the rotation within a step is too large to be a difference [rad, m]."""
_STEP = 1e-4
"""Step of differences by s: their error and rounding are both far below 1e-9."""


@dataclass(frozen=True, eq=False)
class EndEffectorPath:
    """A curve and an orientation law: the end-effector's pose and its derivatives by s.

    Attributes:
        curve: Position.
        orientation: Orientation; may be left out for position tasks.

    Raises:
        InputError: If a part has another type, a coordinate is not finite, or derivatives are not
            the derivatives of the values.

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
        self._require_shape()
        if not np.isfinite(self._positions).all():
            raise InputError("curve", "a coordinate is not finite", "finite coordinates")
        self._require_derivatives()

    def _require_shape(self) -> None:
        """Raise an InputError unless the curve has a point for each of many values of s."""
        try:
            shape, problem = np.shape(self._positions), ""
        except (TypeError, ValueError) as error:
            shape, problem = (), str(error)
        if shape != (len(_CHECKED_AT), 3):
            problem = problem or f"shape {shape} for s of shape {_CHECKED_AT.shape}"
            raise InputError("curve", problem, "points (K, 3) for s of shape (K,): curve(s, order)")

    def _require_derivatives(self) -> None:
        """Raise an InputError where curve or orientation contradict their derivatives."""
        for s in _CHECKED:
            difference, tangent = self._difference(s), self.tangent(s)
            for key, name, stated, moved, small in (
                ("curve", "derivative", tangent[:3], difference[:3], _SMALL),
                ("curve", "second derivative", self.curve(s, 2), self._second_difference(s), 1.0),
                ("orientation", "derivative", tangent[3:], difference[3:], _SMALL),
            ):
                size, length, error = np.linalg.norm([stated, moved, stated - moved], axis=1)
                if size < _FASTEST and error > _DEVIATION * max(size, length, small):
                    values = ", ".join(f"{value:.4g}" for value in stated)
                    problem = f"its {name} at s = {s} is stated as {values}"
                    accepted = ", ".join(f"{value:.4g}" for value in moved)
                    raise InputError(key, problem, f"{accepted}, the difference of its values")

    def _difference(self, s: float) -> Array:
        """The tangent by a central difference, shape (6,)."""
        before, after = self.pose(s - _STEP), self.pose(s + _STEP)
        turn = rotation_vector_between(before.rotation, after.rotation)
        return np.concatenate([after.position - before.position, turn]) / (2.0 * _STEP)

    def _second_difference(self, s: float) -> Array:
        """The second derivative of the curve by a central difference, shape (3,)."""
        if (np.abs(self.curve.breaks - s) < _STEP).any():
            return self.curve(s, 2)
        part = self.curve.within(s, s)
        return np.asarray((part(s + _STEP, 1) - part(s - _STEP, 1)) / (2.0 * _STEP))

    @cached_property
    def _positions(self) -> Array:
        return self.curve(_CHECKED_AT)

    @property
    def moves(self) -> bool:
        """Whether the end-effector moves or rotates."""
        rates = self.orientation.rate(_CHECKED_AT[::10])
        return bool(np.ptp(self._positions, axis=0).any() or rates.any())

    def pose(self, s: float | Array) -> Pose:
        """Pose in the frame of the path: see :class:`~freefloat.paths.timed_path.TimedPath`."""
        return Pose(self.curve(s), self.orientation.rotation(s))

    def moved(self, pose: Pose) -> EndEffectorPath:
        """The path in another frame, in which ``pose`` is the pose of its own.

        A path in the frame of the spacecraft becomes one in the inertial frame by the pose of the
        spacecraft, ``path.moved(model.body_poses(attitude, joints)[0])``.
        """
        pose = Pose.of("pose", pose)
        return EndEffectorPath(self.curve.moved(pose), self.orientation.moved(pose))

    def tangent(self, s: float | Array) -> Array:
        """Derivative of the pose by s: [linear; angular], inertial axes [m; rad], (..., 6)."""
        return np.concatenate([self.curve(s, 1), self.orientation.rate(s)], axis=-1)

    @cached_property
    def breaks(self) -> Array:
        """Values of s, rising, inside (0, 1), at which high derivatives jump."""
        both = np.concatenate([self.curve.breaks, self.orientation.breaks])
        return frozen(np.unique(both))

    def tangent_within(self, low: float, high: float) -> Callable[[float | Array], Array]:
        """The tangent between two values of s; beyond them it continues as smoothly as there."""
        curve = self.curve.within(low, high)
        orientation = self.orientation.within(low, high)
        return lambda s: np.concatenate([curve(s, 1), orientation.rate(s)], axis=-1)

    def second_derivative(self, s: float | Array) -> Array:
        """Derivative of the tangent by s [m; rad], shape (..., 6).

        That of the orientation's rate is a difference of fourth order, taken a little further
        inside at the ends.
        """
        middle = np.minimum(np.maximum(s, 2.0 * _STEP), 1.0 - 2.0 * _STEP)
        rate = self.orientation.rate
        before, after = (
            (8.0 * rate(middle + side) - rate(middle + 2.0 * side)) / 12.0
            for side in (-_STEP, _STEP)
        )
        return np.concatenate([self.curve(s, 2), (after - before) / _STEP], axis=-1)


def through(poses: Sequence[Pose]) -> EndEffectorPath:
    """The path through poses: splines of position and orientation with continuous acceleration.

    Args:
        poses: Two poses or more in the frame of the path, also as ``pin.SE3``; s is the length of
            the line through their positions, from 0 to 1.

    Raises:
        InputError: If there are fewer, one is no pose, or two in a row have the same position.

    Example:
        >>> from freefloat.so3 import Pose
        >>> axes = [np.eye(3), np.diag([-1.0, -1.0, 1.0])]
        >>> path = ff.paths.through([Pose([x, 0.0, 0.0], axes[x % 2]) for x in (1, 2, 3)])
        >>> path.pose(0.5).position
        array([2., 0., 0.])
    """
    require_type("poses", poses, Sequence, "two poses or more")
    stated = [Pose.of(f"poses.{number}", pose) for number, pose in enumerate(poses)]
    curve = SplineCurve([pose.position for pose in stated])
    attitudes = [Rotation.from_matrix(pose.rotation).as_quat() for pose in stated]
    return EndEffectorPath(curve, OrientationSpline(attitudes, curve.knots))
