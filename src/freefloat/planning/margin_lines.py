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

from freefloat.planning.planar_tangency import roots_between
from freefloat.planning.states_on_path import StatesOnPath
from freefloat.so3 import Array

_ELBOWS, _TURNS = 181, 145
"""Samples of q3 and turn on which arcs and lines are looked for."""
_ARC = 97
"""Samples of an arc on which contours of S are looked for."""
_FINER = 8
"""How much finer S is sampled around its extremes, where small contours hide."""
_POLISHES = 3
_SHIFT = 1e-3
"""Of differences across a contour, in cells."""


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
    turns = _turns()
    whole = _Patch(through, bend, arc[::_FINER], turns)
    yield from whole.contours(levels)
    for i, j in whole.extremes(levels):
        nearby = arc[_FINER * max(i - 1, 0) : _FINER * (i + 1) + 1]
        around = np.linspace(turns[j] - turns[1], turns[j] + turns[1], 2 * _FINER + 1)
        yield from _Patch(through, bend, nearby, around).contours(levels)


class _Patch:
    """S over points of an arc and evenly spaced turns; a cell coordinate is (turn, point)."""

    def __init__(self, through: StatesOnPath, bend: float, arc: Array, turns: Array) -> None:
        self._through, self._bend = through, bend
        self._arc, self._turns = arc, turns
        columns, rows = np.meshgrid(np.arange(1.0 * len(turns)), np.arange(1.0 * len(arc)))
        cells = np.column_stack([columns.ravel(), rows.ravel()])
        self._S = self._measured(cells).reshape(columns.shape)

    def _states(self, cells: Array) -> Array:
        """Time, q3 and turn at cell coordinates (K, 2), shape (K, 3)."""
        index = np.arange(len(self._arc))
        t, q3 = (np.interp(cells[:, 1], index, column) for column in self._arc.T)
        spacing = self._turns[1] - self._turns[0]
        return np.column_stack([t, q3, self._turns[0] + spacing * cells[:, 0]])

    def _measured(self, cells: Array) -> Array:
        return self._through.measured(self._through.at(self._states(cells), self._bend)[1])

    def contours(self, levels: tuple[float, ...]) -> Iterator[tuple[float, Array]]:
        """S0 and rows of time, q3 and turn along every contour."""
        generator = contour_generator(z=np.ma.masked_invalid(self._S))
        for level in levels:
            for line in generator.lines(level):
                yield level, self._states(self._nearer(np.asarray(line), level))

    def _nearer(self, cells: Array, level: float) -> Array:
        """Newton steps across a contour: between samples S need not be linear."""
        around = _SHIFT * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
        for _ in range(_POLISHES):
            off = self._measured((cells[:, None] + around).reshape(-1, 2)).reshape(-1, 5) - level
            slope = (off[:, [1, 3]] - off[:, [2, 4]]) / (2.0 * _SHIFT)
            steepness = np.linalg.norm(slope, axis=1, keepdims=True)
            with np.errstate(invalid="ignore", divide="ignore"):
                step = np.clip(off[:, :1] / steepness, -1.0, 1.0) * slope / steepness
            cells = cells - np.nan_to_num(step)
        return cells

    def extremes(self, levels: tuple[float, ...]) -> list[tuple[int, int]]:
        """Samples not surpassed, or not undercut, by their neighbours, a level being in reach."""
        around = sliding_window_view(np.pad(self._S, 1, mode="edge"), (3, 3))
        low, high = around.min(axis=(2, 3)), around.max(axis=(2, 3))
        reach = high - low
        near = [(low - reach <= level) & (level <= high + reach) for level in levels]
        found = ((low == self._S) | (high == self._S)) & np.any(near, axis=0)
        return [(int(i), int(j)) for i, j in np.argwhere(found)]
