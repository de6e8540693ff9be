"""Curves of joints: along a path parameter, and by time of the arms that follow no path."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from freefloat.errors import InputError, finite_number, number_array, require_type
from freefloat.records import Joints
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, frozen

DEGREE = 3
_SPAN = 1e-9
"""Deviation of a curve's duration from the path's, and shortest step, over the duration."""


@dataclass(frozen=True, eq=False)
class JointSpline:
    """Joint values as a cubic B-spline with equal spans.

    It begins at the first control point, ends at the last one, and stays between the largest and
    the smallest of them. Where the first two are equal it begins at rest.

    Attributes:
        control_points: [rad or m], shape (spans + 3, n).

    Example:
        >>> spline = JointSpline([[0.0], [0.0], [0.3], [0.6], [0.6]])
        >>> spline.at([0.0, 0.5, 1.0]).round(6).ravel()
        array([0. , 0.3, 0.6])
    """

    control_points: Joints

    def __post_init__(self) -> None:
        object.__setattr__(self, "control_points", frozen(self.control_points))
        if self.control_points.ndim != 2 or len(self.control_points) <= DEGREE:
            shape = self.control_points.shape
            raise InputError("control_points", f"shape {shape} was given", "(4 or more, n)")

    @property
    def spans(self) -> int:
        """Number of polynomials."""
        return len(self.control_points) - DEGREE

    @cached_property
    def _derivatives(self) -> tuple[scipy.interpolate.BSpline, ...]:
        spline = scipy.interpolate.BSpline(knots(self.spans), self.control_points, DEGREE)
        return spline, spline.derivative(), spline.derivative(2)

    def at(self, s: Any, order: int = 0) -> Array:
        """Joint values, or their derivatives by s, at s (...): shape (..., n)."""
        inside = np.clip(np.asarray(s, dtype=float), 0.0, 1.0)
        return np.asarray(self._derivatives[order](inside))

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        return {"control_points": self.control_points.tolist()}


def knots(spans: int) -> Array:
    """The knots of splines with equal spans, shape (spans + 7,)."""
    inner = np.linspace(0.0, 1.0, spans + 1)
    return np.concatenate([np.zeros(DEGREE), inner, np.ones(DEGREE)])


def spline_basis(spans: int, s: Array, order: int) -> Array:
    """Derivatives of joints, or of theirs by s, by the control points at s (K,), (K, spans + 3)."""
    spline = scipy.interpolate.BSpline(knots(spans), np.eye(spans + DEGREE), DEGREE)
    return np.asarray(spline.derivative(order)(s))


@dataclass(frozen=True, eq=False)
class ArmCurve:
    """Joint values of an arm by time: a cubic spline through waypoints, from rest to rest.

    Positions, rates and accelerations are continuous.

    Attributes:
        waypoints: Joint values [rad or m], shape (k, n), k of at least two.
        times: Times of the waypoints [s], rising from 0, shape (k,).

    Raises:
        InputError: If the numbers of waypoints and times differ, or times do not rise from 0.

    Example:
        >>> curve = ff.ArmCurve([[0.0, 0.0], [0.4, -0.2]], [0.0, 10.0])
        >>> curve.at(5.0)
        array([ 0.2, -0.1])
    """

    waypoints: Array
    times: Array

    def __post_init__(self) -> None:
        accepted = "two waypoints or more, each with a finite number for each joint"
        points = number_array("waypoints", self.waypoints, accepted)
        if points.ndim != 2 or len(points) < 2 or not np.isfinite(points).all():
            raise InputError("waypoints", f"shape {points.shape} was given", accepted)
        accepted = f"{len(points)} times [s] that rise from 0, one for each waypoint"
        times = number_array("times", self.times, accepted)
        valid = times.shape == points.shape[:1] and np.isfinite(times).all() and times[0] == 0.0
        if not valid or not (np.diff(times) > _SPAN * times[-1]).all():
            raise InputError("times", f"{times.tolist()} was given", accepted)
        object.__setattr__(self, "waypoints", frozen(points))
        object.__setattr__(self, "times", frozen(times))

    @classmethod
    def evenly(cls, waypoints: npt.ArrayLike, duration: float) -> ArmCurve:
        """The curve through waypoints at equal intervals of a duration [s]."""
        return cls(np.asarray(waypoints), np.linspace(0.0, duration, len(np.asarray(waypoints))))

    @property
    def duration(self) -> float:
        """Time of the last values [s]."""
        return float(self.times[-1])

    @cached_property
    def _derivatives(self) -> tuple[scipy.interpolate.CubicSpline, ...]:
        spline = scipy.interpolate.CubicSpline(self.times, self.waypoints, bc_type="clamped")
        return spline, spline.derivative(), spline.derivative(2)

    def at(self, t: npt.ArrayLike, order: int = 0) -> Array:
        """Joint values (..., n) at times (...) [s], or their derivatives of order 1 or 2.

        Raises:
            InputError: If there is no such order.
        """
        if order not in (0, 1, 2):
            raise InputError("order", f"{order!r} was given", "0, 1 or 2")
        inside = np.clip(np.asarray(t, dtype=float), 0.0, self.duration)
        return np.asarray(self._derivatives[order](inside))

    def prescribed_between(
        self, start: float, end: float
    ) -> tuple[scipy.interpolate.PPoly, scipy.interpolate.PPoly]:
        """Joint values and rates by time between two times [s] without a waypoint between them.

        They are also valid a little beyond.
        """
        k = int(np.searchsorted(self.times[1:-1], (start + end) / 2.0))
        values, rates = (
            scipy.interpolate.PPoly(spline.c[:, k : k + 1], self.times[k : k + 2])
            for spline in self._derivatives[:2]
        )
        return values, rates

    def stretched(self, factor: float) -> ArmCurve:
        """The same curve at another speed, its duration multiplied by a factor."""
        return replace(self, times=factor * self.times)


@dataclass(frozen=True, eq=False)
class ArmCurves:
    """The joint curves of all arms that move but do not follow the path.

    Attributes:
        curves: Curves by the names of the arms, in the order of the model's.

    Example:
        >>> left = ff.ArmCurve([[0.0, 0.0], [0.4, -0.2]], [0.0, 10.0])
        >>> ArmCurves({"left": left}).at(10.0)
        array([ 0.4, -0.2])
    """

    curves: Mapping[str, ArmCurve] = field(default_factory=dict)

    @classmethod
    def at_rest(cls, joints: Mapping[str, Array], duration: float) -> ArmCurves:
        """The curves of arms that rest at joint values for a duration [s]."""
        return cls({name: ArmCurve.evenly([q, q], duration) for name, q in joints.items()})

    def __post_init__(self) -> None:
        accepted = "a map from the name of an arm to an ArmCurve"
        require_type("arms", self.curves, Mapping, accepted)
        for name, curve in self.curves.items():
            require_type(f"arms.{name}", curve, ArmCurve, "an ArmCurve")
        object.__setattr__(self, "curves", dict(self.curves))

    def __bool__(self) -> bool:
        return bool(self.curves)

    def at(self, t: npt.ArrayLike, order: int = 0) -> Array:
        """Joint values (..., dof - arm_dof) at times (...) [s], or derivatives of order 1 or 2."""
        values = [np.zeros((*np.shape(t), 0)), *(c.at(t, order) for c in self.curves.values())]
        return np.concatenate(values, axis=-1)

    @property
    def breaks(self) -> Array:
        """Times [s], rising, at which third derivatives jump."""
        inner = [curve.times[1:-1] for curve in self.curves.values()]
        return np.unique(np.concatenate([np.zeros(0), *inner]))

    def prescribed_between(
        self, start: float, end: float
    ) -> Callable[[float], tuple[Array, Array]]:
        """Joint values and rates of all arms by time, see :meth:`ArmCurve.prescribed_between`."""
        curves = (c.prescribed_between(start, end) for c in self.curves.values())
        values, rates = zip(*curves, strict=True)
        return lambda t: (
            np.concatenate([part(t) for part in values]),
            np.concatenate([part(t) for part in rates]),
        )

    def stretched(self, factor: float) -> ArmCurves:
        """The same curves at another speed, their durations multiplied by a factor."""
        return ArmCurves({name: curve.stretched(factor) for name, curve in self.curves.items()})

    def require_applicable(self, model: FreeFloatingModel, duration: float) -> None:
        """Raise an InputError unless curves belong to a model's arms and last a duration [s]."""
        if list(self.curves) != list(model.arms):
            problem = f"curves of {', '.join(self.curves) or 'no arm'} were given"
            accepted = f"curves of {', '.join(model.arms) or 'no arm'}"
            raise InputError("robot.arms", problem, accepted)
        joints = {name: model.joints_of_arm(name) for name in self.curves}
        for name, curve in self.curves.items():
            key, count = f"robot.arms.{name}.law.joints", len(joints[name])
            if curve.waypoints.shape[1] != count:
                problem = f"waypoints have {curve.waypoints.shape[1]} values"
                raise InputError(key, problem, f"values of {', '.join(joints[name])}")
            tolerance = _SPAN * duration
            finite_number(
                f"robot.arms.{name}.law.times", curve.duration,
                f"a last time of {duration:g} s, the duration of the path",
                duration - tolerance, duration + tolerance,
            )  # fmt: skip
