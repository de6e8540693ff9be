"""Joint ranges and largest rates of motions in lock step, also between the ends of steps.

Extreme joint values inside a step are extremes of its interpolant. Its derivative has larger
errors, but shows where a rate is largest. For each rate of a motion the state with the highest
rate is stored, and (4) is solved there when all motions have ended: an error of the place enters
squared. A joint whose rate changes its sign twice inside one step, or in the first step from rest,
is not noticed: both ways are then tiny.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from freefloat.dynamics.kernels.cubics import bend, integral, slope, value
from freefloat.dynamics.kernels.robot import Robot
from freefloat.ensemble.kernels.dormand_prince import BEGINNING, END, derivative, inside, weighted
from freefloat.ensemble.kernels.flow import flow
from freefloat.ensemble.kernels.records import (
    BY_TIME,
    FORWARD,
    PEAK,
    PEAK_SEGMENT,
    SEGMENT,
    SPEED,
    STATE,
    Buffers,
    Motions,
    ProblemTables,
    load_system,
)
from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.lanes import (
    WIDTH,
    Float,
    Mask,
    any_of,
    magnitude,
    maximum,
    minimum,
    select,
    sqrt,
)
from freefloat.lockstep.tables import Table, get_lane, set_lane, subtable
from freefloat.so3 import Array

if TYPE_CHECKING:
    from freefloat.ensemble.result import EnsembleResult

_NEWTON_STEPS = 2
_HEIGHT_FACTOR = 4.0
"""Assumed ratio of the height of a peak above the beginning of a step to a parabola's height."""


@inner
def note_extents(
    problem: ProblemTables, dt: Float, accepted: Mask, extremes: bool, work: Buffers
) -> None:
    """Update extreme joint values and largest rates by values at the end of a step.

    With ``extremes`` also by values along the step.
    """
    n, K, t = problem.robot.n, work.K, work.at[4 + problem.robot.n]
    share = 1.0 / magnitude(K[4 + n, 6])
    speed = 0.0 * share
    for j in range(n):
        rate = magnitude(K[4 + j, 6]) * share
        speed = maximum(rate, speed)
        raise_extent(3 * j, rate, t, accepted, work)
        note_value(j, work.at[4 + j], t, accepted, work)
        if extremes:
            note_turning_point(problem, dt, j, accepted, work)
    work.status[SPEED] = speed
    raise_extent(3 * n, attitude_rate(K, 6) * share, t, accepted, work)
    if extremes:
        note_peaks(problem, dt, accepted, work)


@inlined
def attitude_rate(K: Table, stage: int) -> Float:
    """The norm of the derivative of the attitude: half the spacecraft's angular rate."""
    square = K[0, stage] * K[0, stage] + K[1, stage] * K[1, stage]
    return sqrt(square + K[2, stage] * K[2, stage] + K[3, stage] * K[3, stage])


@inlined
def note_value(j: int, q: Float, t: Float, chosen: Mask, work: Buffers) -> None:
    """Extend the range of joint ``j`` to a value at a time."""
    raise_extent(3 * j + 1, 0.0 - q, t, chosen, work)
    raise_extent(3 * j + 2, q, t, chosen, work)


@inlined
def raise_extent(i: int, value: Float, t: Float, chosen: Mask, work: Buffers) -> None:
    """Raise an extent to a value at a time where it is smaller."""
    higher = chosen & (value > work.extent[i])
    work.extent[i] = select(higher, value, work.extent[i])
    work.moments[i] = select(higher, t, work.moments[i])


@inlined
def note_turning_point(
    problem: ProblemTables, dt: Float, j: int, accepted: Mask, work: Buffers
) -> None:
    """Extend the range of joint ``j`` to where its rate changes sign inside the step."""
    n, before, after = problem.robot.n, work.K[4 + j, 0], work.K[4 + j, 6]
    turns = accepted & (before * after < 0.0)
    if any_of(turns):
        d, x = derivative(problem, 4 + j, work), before / (before - after)
        for _ in range(_NEWTON_STEPS):
            x = maximum(minimum(x - value(d, x) / slope(d, x), 1.0), 0.0)
        t = work.y[4 + n] + dt * integral(derivative(problem, 4 + n, work), x)
        note_value(j, work.y[4 + j] + dt * integral(d, x), t, turns, work)


@inlined
def note_peaks(problem: ProblemTables, dt: Float, accepted: Mask, work: Buffers) -> None:
    """Look for states inside a step in which rates are larger than so far.

    There is one if the rate grows at the beginning of the step and falls at its end. The parabola
    with these slopes estimates the maximum of its square. Slopes are derivatives of half the square
    by the fraction x of the step, times the cube of dt/dx.
    """
    K, n, T, tableau = work.K, problem.robot.n, 4 + problem.robot.n, problem.tableau
    forward = work.status[FORWARD]
    s1, s2 = forward * K[T, 0], forward * weighted(tableau, BEGINNING, K, T)
    t1, t2 = forward * K[T, 6], forward * weighted(tableau, END, K, T)
    for i in range(n + 1):
        first, beyond = elements(problem.robot, i)
        square, before, after = 0.0 * s1, 0.0 * s1, 0.0 * s1
        for j in range(first, beyond):
            d = K[j, 0]
            square += d * d
            before += d * (weighted(tableau, BEGINNING, K, j) * s1 - d * s2)
            d = K[j, 6]
            after += d * (weighted(tableau, END, K, j) * t1 - d * t2)
        noted = work.extent[3 * i] * s1
        missing = (noted * noted - square) * s1 * (before - after)
        tops = accepted & (before > 0.0) & (after < 0.0)
        tops = tops & (missing < _HEIGHT_FACTOR * before * before)
        if any_of(tops):
            note_peak(problem, dt, i, before / (before - after), tops, work)


@inlined
def elements(robot: Robot, i: int) -> tuple[int, int]:
    """The first element of the state of which rate i is, and that beyond the last."""
    if i < robot.n:
        return 4 + i, 5 + i
    return 2 if robot.planar else 0, 4


@inner
def note_peak(
    problem: ProblemTables, dt: Float, i: int, x: Float, tops: Mask, work: Buffers
) -> None:
    """Keep the state near a fraction of the step in which rate i is largest, if it is so far."""
    n = problem.robot.n
    first, beyond = elements(problem.robot, i)
    t, height = derivative(problem, 4 + n, work), 0.0 * x
    for _ in range(_NEWTON_STEPS):
        square, growth, change = 0.0 * x, 0.0 * x, 0.0 * x
        t1, t2, t3 = value(t, x), slope(t, x), bend(t, x)
        for j in range(first, beyond):
            d = derivative(problem, j, work)
            d1, d2 = value(d, x), slope(d, x)
            turn = d2 * t1 - d1 * t2
            square += d1 * d1
            growth += d1 * turn
            change += d2 * turn + d1 * (bend(d, x) * t1 - d1 * t3)
        step, share = growth / change, 1.0 / t1
        height = share * share * (square - growth * step * share)
        x = maximum(minimum(x - step, 1.0), 0.0)
    peak, noted = subtable(work.peaks, i * (STATE + 5 + n), 1), work.extent[3 * i]
    higher = tops & (height > maximum(noted * noted, peak[PEAK]))
    if any_of(higher):
        inside(problem, dt, x, 0, work)
        peak[PEAK] = select(higher, height, peak[PEAK])
        peak[PEAK_SEGMENT] = select(higher, work.status[SEGMENT], peak[PEAK_SEGMENT])
        for j in range(5 + n):
            peak[STATE + j] = select(higher, work.inside[j], peak[STATE + j])


@inner
def evaluate_peaks(
    problem: ProblemTables, motions: Motions, first: int, peaks: Array, work: Buffers,
    out: EnsembleResult,
) -> None:  # fmt: skip
    """Raise the largest rates of motions from ``first`` on to rates in the states that were kept.

    Args:
        problem: Data of the problem.
        motions: The motions.
        first: Number of the first motion.
        peaks: Columns of ``work.peaks`` of the motions, in rows.
        work: Workspace.
        out: Results.
    """
    n, duration, K = problem.robot.n, problem.course.duration, work.K
    owners, places = np.empty(WIDTH, np.int64), np.empty(WIDTH, np.int64)
    filled, last = 0, len(peaks) * (n + 1) - 1
    work.status[FORWARD], work.status[BY_TIME] = 1.0, 1.0  # K: by time in units of the duration
    for place in range(last + 1):
        k, i = first + place // (n + 1), place % (n + 1)
        peak = peaks[k - first, i * (STATE + 5 + n) :]
        noted = out.rates[k, i] if i < n else 0.5 * out.base_rate[k]
        if peak[PEAK] > (noted * duration) ** 2:
            load_system(motions, k, filled, work)
            set_lane(work.status, SEGMENT, filled, peak[PEAK_SEGMENT])
            for j in range(5 + n):
                set_lane(work.at, j, filled, peak[STATE + j])
            owners[filled], places[filled] = k, i
            filled += 1
        if filled == WIDTH or (place == last and filled > 0):
            flow(problem.robot, problem.course, problem.null_space, work.at, work, 0)
            work.extent[n] = attitude_rate(K, 0) * 2.0
            for j in range(n):
                work.extent[j] = magnitude(K[4 + j, 0])
            for lane in range(filled):
                k, i = owners[lane], places[lane]
                rate = get_lane(work.extent, i, lane) / duration
                if rate > (out.rates[k, i] if i < n else out.base_rate[k]):
                    if i < n:
                        out.rates[k, i] = rate
                    else:
                        out.base_rate[k] = rate
                    motions.moments[k, 3 * i] = get_lane(work.at, 4 + n, lane) * duration
            filled = 0
