"""Timing s(t) with its rests, and paths travelled by it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise, zip_longest
from typing import Any

import numpy as np
import scipy

from freefloat.errors import InputError, finite_number, finite_vector, member, require_type
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.time_laws import (
    Speeds,
    TimeLaw,
    TimeSegment,
    positive_duration,
    require_speeds,
    segments_of,
)
from freefloat.so3 import Array, IntArray, Pose, frozen, zeros

_APART = 1e-6
"""Smallest distance of breaks, as a fraction of the duration."""
_STOPS = "a list of stops, such as [Stop(s=0.5, t=40)], t in seconds"
_CLOSEST = 1e-9
"""Smallest distance of stops in s and in t over the duration."""
_TIME_ERROR = 1e-13
"""Rounding error of times at the ends of a motion, relative to its duration."""
_ORDERS = 0, 1, 2
"""Orders of derivatives by time."""
_BISECTIONS = 50
"""Halvings of a segment until its parts are below rounding errors."""


@dataclass(frozen=True)
class Stop:
    """A rest along the path.

    Attributes:
        s: Value of s, in (0, 1).
        t: Time [s].
    """

    s: float
    t: float

    def __post_init__(self) -> None:
        for name in ("s", "t"):
            number = finite_number(f"stop.{name}", getattr(self, name), "a number: Stop(s, t)")
            object.__setattr__(self, name, number)


@dataclass(frozen=True)
class Timing:
    """s(t), from rest to rest, at rest at every stop; only ``uniform`` is never at rest.

    Attributes:
        duration: Duration of the path [s].
        law: Law between every two rests.
        stops: Stops in order.
        speeds: Rows of times [s] and speeds ds/dt [1/s], rising in time from rest to rest, between
            which ds/dt is linear, or with d²s/dt² [1/s²] cubic: the law ``optimal``, once the
            fastest timing is known.

    Example:
        >>> timing = ff.Timing(100.0, "quintic", stops=[ff.paths.Stop(0.5, 40.0)])
        >>> float(timing.s(40.0))
        0.5
    """

    duration: float
    law: TimeLaw = TimeLaw.QUINTIC
    stops: tuple[Stop, ...] = ()
    speeds: Speeds = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "law", member("timing.law", TimeLaw, self.law))
        duration = positive_duration("timing.duration", self.duration)
        object.__setattr__(self, "duration", duration)
        require_type("timing.stops", self.stops, Sequence, _STOPS)
        for index, stop in enumerate(self.stops):
            require_type(f"timing.stops.{index}", stop, Stop, _STOPS)
        object.__setattr__(self, "stops", tuple(self.stops))
        times = (0.0, *(stop.t for stop in self.stops), self.duration)
        path = (0.0, *(stop.s for stop in self.stops), 1.0)
        steps = np.diff([np.array(times) / self.duration, path])
        if not (steps > _CLOSEST).all():
            accepted = f"0 < s < 1 and 0 < t < {self.duration:g}, both rising from stop to stop"
            raise InputError("timing.stops", "they do not rise in s and t", accepted)
        if self.stops and self.law is TimeLaw.UNIFORM:
            raise InputError("timing.stops", "s rises uniformly", "another law, which rests there")
        if self.speeds:
            require_speeds(self.speeds, self.duration)

    @property
    def is_sought(self) -> bool:
        """Whether the fastest timing is to be found: ``optimal`` without speeds."""
        return self.law is TimeLaw.OPTIMAL and not self.speeds

    def stretched(self, factor: float) -> Timing:
        """The same law with all times multiplied by a factor."""
        factor = finite_number("factor", factor, "a positive number")
        stops = tuple(Stop(stop.s, factor * stop.t) for stop in self.stops)
        units = factor, 1.0 / factor, factor**-2.0
        speeds = tuple(
            tuple(value * unit for value, unit in zip(row, units, strict=False))
            for row in self.speeds
        )
        return replace(self, duration=factor * self.duration, stops=stops, speeds=speeds)

    @cached_property
    def segments(self) -> tuple[TimeSegment, ...]:
        """The segments of s(t)."""
        if self.speeds:
            return tuple(segments_of(self.speeds))
        segments = []
        for before, after in pairwise([Stop(0.0, 0.0), *self.stops, Stop(1.0, self.duration)]):
            span = after.t - before.t
            for tau, law in self.law.polynomials:
                s = before.s + (after.s - before.s) * law
                orders = ((s.deriv(k) / span**k).coef[::-1].tolist() for k in range(3))
                end = after.t if tau == 1.0 else before.t + tau * span
                segments.append(TimeSegment(end, before.t, span, tuple(map(tuple, orders))))
        return tuple(segments)

    @cached_property
    def ends(self) -> tuple[float, ...]:
        """Times at which the segments of s(t) end, the last one the duration [s]."""
        return tuple(segment.end for segment in self.segments)

    def segment_at(self, t: float | Array) -> Any:
        """Numbers of the segments of s(t) that hold at times [s], an int or shape (K,)."""
        return self._polynomials[0].searchsorted(t, side="right")

    @cached_property
    def _polynomials(self) -> tuple[Array, Array, Array, list[Array]]:
        """Inner ends, origins and spans of the N segments, coefficients by order (degree, N)."""
        origins, spans = np.array([(part.origin, part.span) for part in self.segments]).T
        orders = zip(*(part.orders for part in self.segments), strict=True)
        rows = [zip_longest(*(row[::-1] for row in order), fillvalue=0.0) for order in orders]
        return np.array(self.ends[:-1]), origins, spans, [np.array([*row][::-1]) for row in rows]

    def s(self, t: float | Array, order: int = 0, segment: int | IntArray | None = None) -> Any:
        """The path parameter s at time t, or its first or second time derivative; (K,) at (K,).

        Args:
            t: Time [s]; without ``segment``, at rest before 0 and after the end, but for rounding.
            order: 0, 1 or 2.
            segment: Use this segment of the law, also a little beyond its ends.

        Raises:
            InputError: If there is no such order.
        """
        if order not in _ORDERS:
            raise InputError("order", f"{order!r} was given", "0, 1 or 2")
        moving: Any = 1.0
        if segment is None:
            inside = np.minimum(np.maximum(t, 0.0), self.duration)
            if order:
                moving = 1.0 * (np.abs(inside - t) <= _TIME_ERROR * self.duration)
            t, segment = inside, self.segment_at(inside)
        _, origins, spans, orders = self._polynomials
        tau = (t - origins[segment]) / spans[segment]
        value = 0.0 * tau
        for coefficients in orders[order]:
            value = value * tau + coefficients[segment]
        return value * moving

    def time_at(self, s: float | Array) -> Any:
        """The times [s] at which the path parameter has values in [0, 1], of their shape."""
        ends = np.array([0.0, *self.ends])
        segment = self.s(ends[1:-1]).searchsorted(s)
        low, high = ends[segment], ends[segment + 1]
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2.0
            early = self.s(middle, 0, segment) < s
            low, high = np.where(early, middle, low), np.where(early, high, middle)
        inside = np.where(np.greater_equal(s, self.s(self.duration)), self.duration, high)
        return np.where(np.less_equal(s, 0.0), 0.0, inside)[()]


Prescription = Callable[[float], tuple[Array, float]]
"""Twist and path speed by time along a part of a timed path without jumps of its derivatives."""


@dataclass(frozen=True, eq=False)
class TimedPath:
    """A path, the time law by which it is travelled, and the velocity of the centre of mass.

    The path is given in a frame that does not move. Its origin is the place of the system's centre
    of mass at time zero. Poses and twists are relative to the centre of mass, which has the
    position ``drift * t`` in that frame.

    Attributes:
        path: The path by s.
        timing: s by time.
        drift: Velocity of the centre of mass [m/s], shape (3,).

    Example:
        >>> line = ff.paths.PolynomialCurve.line([1.6, 0.4, 0.0], [1.2, 0.9, 0.0])
        >>> path = ff.TimedPath(ff.EndEffectorPath(line), ff.Timing(20.0))
        >>> path.pose(20.0).position
        array([1.2, 0.9, 0. ])
    """

    path: EndEffectorPath
    timing: Timing
    drift: Array = field(default_factory=zeros)

    def __post_init__(self) -> None:
        require_type("path", self.path, EndEffectorPath, "EndEffectorPath(curve, orientation)")
        require_type("timing", self.timing, Timing, "Timing(duration), in seconds")
        object.__setattr__(self, "drift", frozen(finite_vector("drift", self.drift, 3)))

    @property
    def duration(self) -> float:
        """Duration of the path [s]."""
        return self.timing.duration

    @property
    def arms(self) -> tuple[str, ...]:
        """Names of the further arms that follow paths of their own."""
        return ()

    @property
    def every(self) -> tuple[TimedPath, ...]:
        """The paths of all end-effectors that follow one: this path."""
        return (self,)

    @property
    def moves(self) -> bool:
        """Whether an end-effector moves relative to the centre of mass, or rotates."""
        return self.drifts or any(path.path.moves for path in self.every)

    def stretched(self, factor: float) -> TimedPath:
        """The same path at another speed, its duration multiplied by a factor."""
        return replace(self, timing=self.timing.stretched(factor))

    def lasting(self, duration: float) -> TimedPath:
        """The path with a duration [s], law ``uniform``, for motions that do not follow it."""
        return TimedPath(self.path, Timing(duration, TimeLaw.UNIFORM), self.drift)

    def with_drift(self, drift: Array) -> TimedPath:
        """The same path, relative to a centre of mass with another velocity (3,) [m/s]."""
        return replace(self, drift=drift)

    def displaced(self, offset: Array) -> TimedPath:
        """The path at another place, moved by an offset (3,) [m]; its twists are the same."""
        curve = self.path.curve.moved(Pose(offset, np.eye(3)))
        return replace(self, path=EndEffectorPath(curve, self.path.orientation))

    @property
    def frame(self) -> str | None:
        """Name of the body of the scene in whose frame the path is stated; None for none."""
        return None

    @property
    def stated(self) -> tuple[EndEffectorPath, Timing]:
        """The path and its time law in the frame in which they are stated."""
        return self.path, self.timing

    @property
    def depends_on_time(self) -> bool:
        """Whether poses depend on the time in addition to s."""
        return self.drifts

    @cached_property
    def drifts(self) -> bool:
        """Whether the centre of mass moves."""
        return bool(self.drift.any())

    @cached_property
    def drift_twist(self) -> Array:
        """Twist of the centre of mass in the path's frame, shape (6,)."""
        return frozen([*self.drift, 0.0, 0.0, 0.0])

    def origin(self, t: float | Array) -> Array:
        """The origin of the path's frame at times t [s] from the centre of mass [m], (..., 3)."""
        return np.multiply.outer(t, -self.drift)

    def pose(self, t: float | Array) -> Pose:
        """End-effector pose at time t [s] relative to the centre of mass; K poses at times (K,)."""
        pose = self.path.pose(self.timing.s(t))
        return Pose(pose.position + self.origin(t), pose.rotation)

    def poses(self, t: float | Array) -> tuple[Pose, ...]:
        """Those of all end-effectors that follow a path."""
        return tuple(path.pose(t) for path in self.every)

    def pose_at(self, s: float | Array) -> Pose:
        """The pose at a value of s; :meth:`pose` is more accurate near rests."""
        pose = self.path.pose(s)
        if not self.drifts:
            return pose
        return Pose(pose.position + self.origin(self.timing.time_at(s)), pose.rotation)

    @cached_property
    def breaks(self) -> Array:
        """Times [s], rising, at which high derivatives of the path or of the law jump."""
        times = [0.0]
        law = self.timing
        apart = _APART * self.duration
        for k, (low, high) in enumerate(pairwise((0.0, *law.ends))):
            first, last = law.s(low, 0, k), law.s(high, 0, k)
            for s in self.path.breaks[(self.path.breaks > first) & (self.path.breaks < last)]:
                t = scipy.optimize.brentq(
                    lambda t, s, k: law.s(t, 0, k) - s, low, high, (s, k),
                    xtol=1e-300,  # rtol alone decides
                )  # fmt: skip
                if t - times[-1] > apart and high - t > apart:
                    times.append(t)
            times.append(high)
        return frozen(times[1:-1])

    def prescribed_between(self, start: float, end: float) -> Prescription:
        """The twist and path speed between two times [s] without a break between them.

        They are also valid a little beyond.
        """
        drift, timing = self.drift_twist, self.timing
        segment = timing.segments[timing.segment_at((start + end) / 2.0)]
        low, high = sorted(segment(t, 0) for t in (start, end))
        tangent = self.path.tangent_within(low, high)

        def twist_and_speed(t: float) -> tuple[Array, float]:
            speed = segment(t, 1)
            return tangent(segment(t, 0)) * speed - drift, speed

        return twist_and_speed

    def twist(self, t: float | Array, segment: int | IntArray | None = None) -> Array:
        """End-effector twist relative to the centre of mass, inertial axes.

        ``[linear; angular]`` [m/s; rad/s], shape (6,) or (K, 6). Time [s] and segment are those of
        :meth:`Timing.s`.
        """
        return self.twist_and_speed(t, segment)[0]

    def twist_and_speed(
        self, t: float | Array, segment: int | IntArray | None = None
    ) -> tuple[Array, Any]:
        """The twist as in :meth:`twist`, and the speed ds/dt along the path [1/s]."""
        s, speed = self.timing.s(t, 0, segment), self.timing.s(t, 1, segment)
        return self.path.tangent(s) * speed[..., None] - self.drift_twist, speed

    def twist_rate(self, t: float | Array, segment: int | IntArray | None = None) -> Array:
        """Derivative of the twist by time, axes fixed [m/s²; rad/s²], shape (6,) or (K, 6).

        Where two segments of the law meet it may jump.
        """
        s, rate, change = (self.timing.s(t, order, segment) for order in range(3))
        bend, tangent = self.path.second_derivative(s), self.path.tangent(s)
        return np.asarray(bend * (rate**2)[..., None] + tangent * change[..., None])
