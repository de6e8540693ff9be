"""Cubics by cells: each motion reads the cubics of its own cell."""

from __future__ import annotations

from typing import NamedTuple

from freefloat.lockstep.compilation import inlined
from freefloat.lockstep.lanes import Float
from freefloat.lockstep.tables import Table, pick_row

SIX = 24.0
"""Number of coefficients of six cubics."""


class Cubic(NamedTuple):
    """The coefficients of a cubic, highest power first."""

    cube: Float
    square: Float
    linear: Float
    constant: Float


@inlined
def two_cubics(cells: Table, place: Float) -> tuple[Cubic, Cubic]:
    """The two cubics whose coefficients follow one another from a place."""
    a, b, c, d, e, f, g, h = pick_row(cells, place)
    return Cubic(a, b, c, d), Cubic(e, f, g, h)


@inlined
def six_cubics(cells: Table, place: Float) -> tuple[Cubic, Cubic, Cubic, Cubic, Cubic, Cubic]:
    """The six cubics whose coefficients follow one another from a place."""
    a, b = two_cubics(cells, place)
    c, d = two_cubics(cells, place + 8.0)
    e, f = two_cubics(cells, place + 16.0)
    return a, b, c, d, e, f


@inlined
def value(cubic: Cubic, x: Float) -> Float:
    """The value of a cubic at the fraction ``x`` of its cell."""
    return ((cubic.cube * x + cubic.square) * x + cubic.linear) * x + cubic.constant


@inlined
def slope(cubic: Cubic, x: Float) -> Float:
    """The derivative of a cubic by the fraction of its cell."""
    return (cubic.cube * (3.0 * x) + cubic.square * 2.0) * x + cubic.linear


@inlined
def bend(cubic: Cubic, x: Float) -> Float:
    """The second derivative of a cubic."""
    return cubic.cube * (6.0 * x) + cubic.square * 2.0


@inlined
def integral(cubic: Cubic, x: Float) -> Float:
    """The integral of a cubic from 0."""
    part = (cubic.cube * (0.25 * x) + cubic.square * (1.0 / 3.0)) * x + cubic.linear * 0.5
    return (part * x + cubic.constant) * x
