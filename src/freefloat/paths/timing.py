"""Timing s(t) with its rests, and time laws between two rests: segments that are polynomials."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from itertools import pairwise, zip_longest
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from freefloat.errors import (
    LARGEST_NUMBER,
    InputError,
    finite_number,
    member,
    number_array,
    require_type,
)
from freefloat.so3 import Array, IntArray

SHORTEST = 1e-6
"""Shortest accepted duration [s]."""
_LENGTH = 1e-9
"""Deviation of the last s from 1."""
_BLEND = 0.25
"""Fraction of a trapezoidal profile spent accelerating, and again decelerating."""

Speeds = tuple[tuple[float, ...], ...]
"""Rows of times [s] and speeds ds/dt [1/s], all or none with their derivatives d²s/dt² [1/s²]."""
_STOPS = "a list of stops, such as [Stop(s=0.5, t=40)], t in seconds"
_CLOSEST = 1e-9
"""Smallest distance of stops in s and in t over the duration."""
_TIME_ERROR = 1e-13
"""Rounding error of times at the ends of a motion, relative to its duration."""
_ORDERS = 0, 1, 2
"""Orders of derivatives by time."""
_BISECTIONS = 50
"""Halvings of a segment until its parts are below rounding errors."""


class TimeLaw(StrEnum):
    """How s rises from 0 to 1 with the dimensionless time between two rests."""

    QUINTIC = "quintic"
    CUBIC = "cubic"
    TRAPEZOIDAL = "trapezoidal"
    OPTIMAL = "optimal"
    UNIFORM = "uniform"

    @property
    def polynomials(self) -> tuple[tuple[float, Polynomial], ...]:
        """Segments of the law: end and s, a polynomial, both in dimensionless time.

        That of ``optimal`` is quintic until the fastest timing is known.
        """
        if self in (TimeLaw.QUINTIC, TimeLaw.OPTIMAL):  # (18b)
            return ((1.0, Polynomial([0, 0, 0, 10, -15, 6])),)
        if self is TimeLaw.CUBIC:
            return ((1.0, Polynomial([0, 0, 3, -2])),)
        if self is TimeLaw.UNIFORM:
            return ((1.0, Polynomial([0, 1])),)
        cruise = 1.0 / (1.0 - _BLEND)
        rise = Polynomial([0, 0, cruise / (2.0 * _BLEND)])
        return (
            (_BLEND, rise),
            (1.0 - _BLEND, Polynomial([-cruise * _BLEND / 2.0, cruise])),
            (1.0, 1.0 - rise(Polynomial([1, -1]))),
        )


def positive_duration(key: str, value: float) -> float:
    """A duration [s]; an InputError that names ``key`` for one that is too short or too long."""
    accepted = f"a positive number, {SHORTEST:g} to {LARGEST_NUMBER:g} s"
    return finite_number(key, value, accepted, SHORTEST, LARGEST_NUMBER)


@dataclass(frozen=True)
class TimeSegment:
    """s as a polynomial of ``(t - origin) / span``, smooth beyond its ends, too.

    Attributes:
        end: Time at which it ends [s].
        origin: Time from which it counts [s].
        span: Unit of its time [s].
        orders: Coefficients of s and its two derivatives by time, highest power first.
    """

    end: float
    origin: float
    span: float
    orders: tuple[tuple[float, ...], ...]

    def __call__(self, t: float, order: int) -> float:
        """s, or its derivative of order 1 or 2, at a time [s]."""
        tau = (t - self.origin) / self.span
        value = 0.0
        for coefficient in self.orders[order]:
            value = value * tau + coefficient
        return value


def require_speeds(speeds: Speeds, duration: float) -> None:
    """Raise an InputError unless speeds lead from s = 0 at rest to s = 1 at rest."""
    accepted = (
        "rows of time and speed ds/dt, all or none with d²s/dt², the times rising from 0 to the "
        "duration, the speeds positive and zero at both ends, with s = 1 at the end"
    )
    rows = number_array("timing.speeds", speeds, accepted)
    if rows.ndim != 2 or rows.shape[1] not in (2, 3):
        raise InputError("timing.speeds", "their rows differ or have other lengths", accepted)
    t, speed, *accelerations = rows.T
    spans = np.diff(t)
    valid = len(t) > 2 and t[0] == 0.0 and abs(t[-1] - duration) <= _LENGTH * duration
    valid = valid and speed[0] == speed[-1] == 0.0
    if not (valid and (spans > 0.0).all() and (speed[1:-1] > 0.0).all()):
        raise InputError("timing.speeds", "they do not lead from rest to rest", accepted)
    length = float((spans * (speed[1:] + speed[:-1])).sum()) / 2.0
    for acceleration in accelerations:
        length -= float((spans**2 * np.diff(acceleration)).sum()) / 12.0
    if not abs(length - 1.0) <= _LENGTH:
        raise InputError("timing.speeds", f"they lead to s = {length:.12g}", accepted)


def segments_of(speeds: Speeds) -> Iterator[TimeSegment]:
    """The segments of a law whose speed is linear between given ones, or cubic with derivatives."""
    s = 0.0
    for (start, slow, *bend), (end, fast, *last) in pairwise(speeds):
        span, change = end - start, fast - slow
        speed = [change, slow]
        if bend:
            a, b = span * bend[0], span * last[0]
            speed = [a + b - 2.0 * change, 3.0 * change - 2.0 * a - b, a, slow]
        powers = range(len(speed), 0, -1)
        place = [span * value / power for value, power in zip(speed, powers, strict=True)]
        rate = [value * (power - 1) / span for value, power in zip(speed, powers, strict=True)]
        yield TimeSegment(end, start, span, ((*place, s), tuple(speed), tuple(rate[:-1])))
        s += sum(place)


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
            if self.law is not TimeLaw.OPTIMAL:
                accepted = "no speeds, or law: optimal, which has them"
                raise InputError("timing.speeds", f"the law is {self.law}", accepted)
            require_speeds(self.speeds, self.duration)

    @property
    def is_sought(self) -> bool:
        """Whether the fastest timing is to be found: ``optimal`` without speeds."""
        return self.law is TimeLaw.OPTIMAL and not self.speeds

    def stretched(self, factor: float) -> Timing:
        """The same law with all times multiplied by a factor."""
        factor = positive_duration("factor", factor)
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
