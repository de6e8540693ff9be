"""Time laws between two rests, and the segments of s(t), which are polynomials."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.polynomial import Polynomial

from freefloat.errors import LARGEST_NUMBER, InputError, finite_number, number_array

_SHORTEST = 1e-6
"""Shortest accepted duration [s]."""
_LENGTH = 1e-9
"""Deviation of the last s from 1."""
_BLEND = 0.25
"""Fraction of a trapezoidal profile spent accelerating, and again decelerating."""

Speeds = tuple[tuple[float, ...], ...]
"""Rows of times [s] and speeds ds/dt [1/s], all or none with their derivatives d²s/dt² [1/s²]."""


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
    accepted = f"a positive number, {_SHORTEST:g} to {LARGEST_NUMBER:g} s"
    return finite_number(key, value, accepted, _SHORTEST, LARGEST_NUMBER)


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
