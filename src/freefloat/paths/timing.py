"""When the end-effector is where: the law s(t), and a path travelled by it."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from itertools import pairwise
from numbers import Real

import numpy as np
from numpy.polynomial import Polynomial
from scipy.optimize import brentq

from freefloat.brief import brief
from freefloat.errors import InputError, member, require_type
from freefloat.paths.path import EndEffectorPath
from freefloat.so3 import Array, Pose, finite_number, frozen

_BLEND = 0.25
"""Share of a trapezoidal segment spent speeding up, and again slowing down."""
_SHORTEST, _LONGEST = 1e-6, 1e12
"""Durations [s] between which rates and their squares stay far from the ends of the numbers."""
_APART = 1e-6
"""Share of the duration by which breaks must be apart to count as several."""
_STOPS = "a list of stops, such as [Stop(s=0.5, t=40)], t in seconds"
_CLOSEST = 1e-9
"""Shares of the whole by which stops must be apart in s and t."""


class TimeLaw(StrEnum):
    """How s rises from 0 to 1 with the dimensionless time of a segment, from rest to rest."""

    QUINTIC = "quintic"
    CUBIC = "cubic"
    TRAPEZOIDAL = "trapezoidal"

    @property
    def polynomials(self) -> tuple[tuple[float, Polynomial], ...]:
        """The law in pieces: where each ends, and s as a polynomial of dimensionless time."""
        if self is TimeLaw.QUINTIC:  # (18b)
            return ((1.0, Polynomial([0, 0, 0, 10, -15, 6])),)
        if self is TimeLaw.CUBIC:
            return ((1.0, Polynomial([0, 0, 3, -2])),)
        cruise = 1.0 / (1.0 - _BLEND)
        rise = Polynomial([0, 0, cruise / (2.0 * _BLEND)])
        return (
            (_BLEND, rise),
            (1.0 - _BLEND, Polynomial([-cruise * _BLEND / 2.0, cruise])),
            (1.0, 1.0 - rise(Polynomial([1, -1]))),
        )


@dataclass(frozen=True)
class Stop:
    """A rest on the way.

    Attributes:
        s: Where, in (0, 1).
        t: When [s].
    """

    s: float
    t: float

    def __post_init__(self) -> None:
        for name in ("s", "t"):
            require_type(f"stop.{name}", getattr(self, name), Real, "a number: Stop(s, t)")


@dataclass(frozen=True)
class Piece:
    """s as a polynomial of ``(t - origin) / span``, smooth beyond its ends, too."""

    end: float
    origin: float
    span: float
    orders: tuple[tuple[float, ...], ...]  # highest power first, of s and its two derivatives

    def __call__(self, t: float, order: int) -> float:
        """S, or its derivative of order 1 or 2, at a time [s]."""
        tau, value = (t - self.origin) / self.span, 0.0
        for coefficient in self.orders[order]:
            value = value * tau + coefficient
        return value


@dataclass(frozen=True)
class Timing:
    """s(t), from rest to rest, at rest at every stop.

    Attributes:
        duration: Of the whole motion [s].
        law: Applied to every segment between rests.
        stops: In order.
    """

    duration: float
    law: TimeLaw = TimeLaw.QUINTIC
    stops: tuple[Stop, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "law", member("timing.law", TimeLaw, self.law))
        accepted = f"a positive number, {_SHORTEST:g} to {_LONGEST:g} s"
        duration = finite_number("timing.duration", self.duration, accepted)
        object.__setattr__(self, "duration", duration)
        if not _SHORTEST <= self.duration <= _LONGEST:
            raise InputError("timing.duration", f"{self.duration} was given", accepted)
        require_type("timing.stops", self.stops, Sequence, _STOPS)
        for index, stop in enumerate(self.stops):
            require_type(f"timing.stops.{index}", stop, Stop, _STOPS)
        object.__setattr__(self, "stops", tuple(self.stops))
        times = (0.0, *(stop.t for stop in self.stops), self.duration)
        places = (0.0, *(stop.s for stop in self.stops), 1.0)
        steps = np.diff([np.array(times) / self.duration, places])
        if not (np.isfinite([times, places]).all() and (steps > _CLOSEST).all()):
            raise InputError(
                "timing.stops",
                "they do not rise in s and t",
                f"0 < s < 1 and 0 < t < {self.duration:g}, both rising from stop to stop",
            )

    def stretched(self, factor: float) -> Timing:
        """The same law with all times multiplied by a factor."""
        stops = tuple(Stop(stop.s, factor * stop.t) for stop in self.stops)
        return replace(self, duration=factor * self.duration, stops=stops)

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """S by time, piece by piece."""
        rests = [Stop(0.0, 0.0), *self.stops, Stop(1.0, self.duration)]
        return tuple(
            _piece(before, after, end, law)
            for before, after in pairwise(rests)
            for end, law in self.law.polynomials
        )

    @cached_property
    def ends(self) -> tuple[float, ...]:
        """Times at which the pieces of s(t) end, the last one the duration [s]."""
        return tuple(piece.end for piece in self.pieces)

    def piece_at(self, t: float) -> int:
        """Index of the piece of s(t) that holds at a time [s]."""
        return min(bisect_right(self.ends, t), len(self.ends) - 1)

    def s(self, t: float, order: int = 0, piece: int | None = None) -> float:
        """S or its derivative of order 1 or 2 by time.

        Args:
            t: Time [s]; without ``piece``, at rest before 0 and after the end.
            order: 0, 1 or 2.
            piece: Use this piece of the law, also a little beyond its ends.
        """
        if piece is None:
            t = min(max(t, 0.0), self.duration)
            piece = self.piece_at(t)
        return self.pieces[piece](t, order)


def _piece(before: Stop, after: Stop, end: float, law: Polynomial) -> Piece:
    span = after.t - before.t
    s = before.s + (after.s - before.s) * law
    orders = tuple(tuple((s.deriv(k) / span**k).coef[::-1].tolist()) for k in range(3))
    return Piece(after.t if end == 1.0 else before.t + end * span, before.t, span, orders)


@dataclass(frozen=True, eq=False)
class TimedPath:
    """A path and the time law along which it is travelled.

    Attributes:
        path: Where.
        timing: When.
    """

    __repr__ = brief

    path: EndEffectorPath
    timing: Timing

    def __post_init__(self) -> None:
        require_type("path", self.path, EndEffectorPath, "EndEffectorPath(curve, orientation)")
        require_type("timing", self.timing, Timing, "Timing(duration), in seconds")

    @property
    def duration(self) -> float:
        """Of the whole motion [s]."""
        return self.timing.duration

    def pose(self, t: float) -> Pose:
        """End-effector pose at time t [s], inertial frame."""
        return self.path.pose(self.timing.s(t))

    @cached_property
    def breaks(self) -> Array:
        """Times, rising, at which high derivatives by time jump: the path's or the law's [s]."""
        times, law, apart = [0.0], self.timing, _APART * self.duration
        for piece, (low, high) in enumerate(pairwise((0.0, *law.ends))):
            first, last = law.s(low, 0, piece), law.s(high, 0, piece)
            for s in self.path.breaks[(self.path.breaks > first) & (self.path.breaks < last)]:
                t = brentq(lambda t, s=s, p=piece: law.s(t, 0, p) - s, low, high, xtol=1e-300)
                if t - times[-1] > apart and high - t > apart:
                    times.append(t)
            times.append(high)
        return frozen(times[1:-1])

    def between(self, start: float, end: float) -> tuple[int, Callable[[float], Array]]:
        """Piece of the time law, and the path's tangent by s, that hold between two times [s].

        Both hold a little beyond, too, without a jump where there is none between.
        """
        piece = self.timing.piece_at((start + end) / 2.0)
        low, high = sorted(self.timing.s(t, 0, piece) for t in (start, end))
        return piece, self.path.tangent_within(low, high)

    def twist(self, t: float, piece: int | None = None) -> Array:
        """End-effector twist: [linear; angular], inertial axes [m/s; rad/s], shape (6,).

        Args:
            t: Time [s].
            piece: As for :meth:`Timing.s`.
        """
        return self.twist_and_speed(t, piece)[0]

    def twist_and_speed(self, t: float, piece: int | None = None) -> tuple[Array, float]:
        """The twist as in :meth:`twist`, and the speed ds/dt along the path [1/s]."""
        s, speed = self.timing.s(t, 0, piece), self.timing.s(t, 1, piece)
        return self.path.tangent(s) * speed, speed

    def twist_rate(self, t: float, piece: int | None = None) -> Array:
        """Derivative of the twist by time, axes fixed [m/s²; rad/s²], shape (6,).

        Args:
            t: Time [s].
            piece: As for :meth:`Timing.s`; where two pieces of the law meet it may jump.
        """
        s, rate, growth = (self.timing.s(t, order, piece) for order in range(3))
        return self.path.second_derivative(s) * rate**2 + self.path.tangent(s) * growth
