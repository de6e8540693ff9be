"""Timing s(t) with its rests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, zip_longest
from typing import Any

import numpy as np

from freefloat.errors import InputError, finite_number, member, require_type
from freefloat.paths.time_laws import (
    Speeds,
    TimeLaw,
    TimeSegment,
    positive_duration,
    require_speeds,
    segments_of,
)
from freefloat.so3 import Array, IntArray

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
