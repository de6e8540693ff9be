"""Margin lines: states of a spatial arm that are on the path and on the margin surface S = S0.

States on the path at given first two joint angles form a surface over (arc, turn), an arc being a
curve of (time, q3); the margin surface cuts it in lines. Where the measure is ``arm``, S depends on
(q2, q3) alone (40) and has the form of (21a) in q3: then the lines are those of constant time and
q3. For every other measure they are contours of S.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from contourpy import contour_generator
from numpy.lib.stride_tricks import sliding_window_view

from freefloat.planar_touch import roots_between
from freefloat.spatial import Array
from freefloat.states_on_path import StatesOnPath

_ELBOWS, _TURNS = 181, 145
"""Samples of q3 and turn on which arcs and lines are looked for."""
_ARC = 97
"""Samples of an arc on which contours of S are looked for."""
_POLISHES = 3
_FINER = 8
"""How much finer S is sampled around its extremes, where small contours hide."""


def margin_lines(
    through: StatesOnPath, bend: float, levels: tuple[float, ...]
) -> Iterator[tuple[float, Array]]:
    """States with S = S0 on the path, to the precision of the sampling.

    Args:
        through: The states on the path.
        bend: Of the wrist.
        levels: Signed values S0.

    Yields:
        S0 and rows of time, q3 and turn along a line, shape (K, 3). Lines may overlap.
    """
    for arc in _arcs(through):
        if through.splits:
            yield from _at_constant_elbow(through, levels, arc)
        else:
            yield from _contours(through, bend, levels, arc)


def _arcs(through: StatesOnPath) -> list[Array]:
    """Curves of (time, q3) along which the wrist is as far out as point 3, (K, 2) each."""
    q3 = np.linspace(-np.pi, np.pi, _ELBOWS)
    out, at = (np.linalg.norm(v, axis=1) for v in (through.wrist(q3), through.point_3))
    curves = contour_generator(through.times, q3, out[:, None] - at[None, :]).lines(0.0)
    return [np.asarray(curve) for curve in curves]


def _turns() -> Array:
    """A full turn and a step more, so that no root hides at its ends."""
    return np.asarray(np.linspace(0.0, 2.0 * np.pi * _TURNS / (_TURNS - 1), _TURNS + 1))


def _at_constant_elbow(
    through: StatesOnPath, levels: tuple[float, ...], arc: Array
) -> Iterator[tuple[float, Array]]:
    """Lines of a measure that splits: where S(q2, q3) = S0 on the arc, a full turn each."""
    samples = 2.0 * np.pi / 3.0 * np.arange(3)
    S = [through.of(np.array([0.0, through.q2, q3, 0.0, 0.0, 0.0])) for q3 in samples]
    form = np.column_stack([np.ones(3), np.sin(samples), np.cos(samples)])
    k0, k1, k2 = np.linalg.solve(form, S)
    along = k0 + k1 * np.sin(arc[:, 1]) + k2 * np.cos(arc[:, 1])
    turns = _turns()
    for level in levels:
        for i in roots_between(along - level):
            before, after = np.abs(along[i : i + 2] - level)
            t, q3 = (arc[i] * after + arc[i + 1] * before) / (before + after)
            yield level, np.column_stack([np.full(len(turns), t), np.full(len(turns), q3), turns])


def _contours(
    through: StatesOnPath, bend: float, levels: tuple[float, ...], arc: Array
) -> Iterator[tuple[float, Array]]:
    """Contours of S over the arc and the turn, sampled again around every extreme of S."""
    steps = np.diff(arc, axis=0) / [through.problem.path.duration, 2.0 * np.pi]
    length = np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))
    fine = np.linspace(0.0, length[-1], _FINER * (_ARC - 1) + 1)
    arc = np.column_stack([np.interp(fine, length, column) for column in arc.T])
    places, turns = arc[::_FINER], _turns()
    S = _sampled(through, bend, places, turns)
    yield from _contours_of(through, bend, places, turns, S, levels)
    for i, j in _extremes(S, levels):
        nearby = arc[_FINER * max(i - 1, 0) : _FINER * (i + 1) + 1]
        around = np.linspace(turns[j] - turns[1], turns[j] + turns[1], 2 * _FINER + 1)
        again = _sampled(through, bend, nearby, around)
        yield from _contours_of(through, bend, nearby, around, again, levels)


def _sampled(through: StatesOnPath, bend: float, arc: Array, turns: Array) -> Array:
    """S over points of an arc and turns, nan where the wrist cannot bend so."""
    states = np.column_stack([np.repeat(arc, len(turns), axis=0), np.tile(turns, len(arc))])
    return through.measured(states, bend).reshape(len(arc), len(turns))


def _contours_of(
    through: StatesOnPath,
    bend: float,
    arc: Array,
    turns: Array,
    S: Array,
    levels: tuple[float, ...],
) -> Iterator[tuple[float, Array]]:
    """Contours in a grid of samples, brought closer to S = S0 than the grid tells them."""
    count, step = np.arange(len(arc)), turns[1] - turns[0]
    generator = contour_generator(np.arange(len(turns)), count, np.ma.masked_invalid(S))

    def states(cells: Array) -> Array:
        t, q3 = (np.interp(cells[:, 1], count, column) for column in arc.T)
        return np.column_stack([t, q3, turns[0] + step * cells[:, 0]])

    around = 1e-3 * np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    for level in levels:
        for line in generator.lines(level):
            cells = np.asarray(line)
            for _ in range(_POLISHES):
                near = (cells[:, None] + around).reshape(-1, 2)
                off = through.measured(states(near), bend).reshape(-1, 5) - level
                slope = (off[:, [1, 3]] - off[:, [2, 4]]) / 2e-3
                steep = (slope**2).sum(axis=1)
                step_there = -(off[:, 0] / np.where(steep > 0.0, steep, np.inf))[:, None] * slope
                length = np.linalg.norm(step_there, axis=1, keepdims=True)
                cells = cells + np.nan_to_num(step_there / np.maximum(1.0, length))
            yield level, states(cells)


def _extremes(S: Array, levels: tuple[float, ...]) -> list[tuple[int, int]]:
    """Samples not surpassed, or not undercut, by their neighbours, with a level within reach."""
    around = sliding_window_view(np.pad(S, 1, mode="edge"), (3, 3))
    low, high = around.min(axis=(2, 3)), around.max(axis=(2, 3))
    reach = high - low
    near = [(low - reach <= level) & (level <= high + reach) for level in levels]
    found = ((low == S) | (high == S)) & np.any(near, axis=0)
    return [(int(i), int(j)) for i, j in np.argwhere(found)]
