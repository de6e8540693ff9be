"""Steps of the Dormand-Prince method for motions in lock step, and minima of the measure within them.

Each motion has its own time, step and error. The independent variable sigma evens the steps out: with
rates f by time in units of the duration, dt / dsigma = (c + |f|^2)^(-1/4). The last part of a segment
goes by time, to end where the segment ends. A motion begins with a step of length zero, which evaluates
its first rates.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import RK45

from freefloat.dynamics.kernels.compilation import inlined, inner
from freefloat.ensemble.kernels.flow import flow
from freefloat.ensemble.kernels.lanes import (
    any_of,
    magnitude,
    maximum,
    minimum,
    select,
    sqrt,
)
from freefloat.ensemble.kernels.measures import ARM, SIGMA, measure_at, of_determinants

(
    SEGMENT, LEG, FORWARD, STEP, BY_TIME, FRESH, TOLERANCE, LAST_ERROR, POSITIVE, SIGN, VALUE,
    LOWEST, LOWEST_AT, HIGHEST, SMALLEST, LARGEST, SPEED, MOTION_ROWS,
) = range(18)  # fmt: skip
"""Rows of ``now``: the state of a motion beside attitude, joints and time."""
TABLEAU = np.zeros((14, 7))
"""Rows 0 to 5: stages, with their times in the last column; 6: the step; 7: its error; 8 to 11: the
interpolant's coefficients by power of the fraction of the step."""
TABLEAU[:6, :5], TABLEAU[:6, 6], TABLEAU[6, :6], TABLEAU[7] = RK45.A, RK45.C, RK45.B, RK45.E
TABLEAU[8:12] = RK45.P.T
_EVENNESS = 20.0
_FIRST_STEP = 0.02
_LAST_PART = 0.7
"""A step by sigma that would go further than this part of what remains of a segment goes by time."""
_SKEWED, _DEPTH_FACTOR = 0.02, 3.0
"""A minimum inside a step may be deeper than that of a parabola: by this part of the value, and by this
multiple of the parabola's depth."""


class Measure(NamedTuple):
    """The singularity measure of a problem."""

    code: int
    reach: float
    terms: int
    polynomial: object  # of the measure ``arm``


@inlined
def derivatives(problem, y, work, stage):
    """Write a stage's derivatives by sigma; return det S* and det D."""
    K, now, n = work.K, work.now, problem.robot.n
    determinant, det_D = flow(problem.robot, problem.course, problem.null_space, y, work, stage)
    total = 0.0 * determinant + _EVENNESS
    for j in range(4 + n):
        total += K[j, stage] * K[j, stage]
    pace = select(now[BY_TIME] > 0.0, 1.0, 1.0 / sqrt(sqrt(total))) * now[FORWARD]
    for j in range(4 + n):
        K[j, stage] = K[j, stage] * pace
    K[4 + n, stage] = pace
    return determinant, det_D


@inlined
def step_length(n, work):
    """The length of the next step by sigma or by time, and whether it ends the segment."""
    now, K = work.now, work.K
    remaining = magnitude(now[LEG] - work.y[4 + n])
    pace = magnitude(K[4 + n, 0])
    fresh = now[FRESH] > 0.0
    by_time = now[BY_TIME] > 0.0
    change = ~fresh & ~by_time & (now[STEP] * pace > _LAST_PART * remaining)
    if any_of(change):
        scale = select(change, 1.0 / pace, 1.0)
        for j in range(5 + n):
            K[j, 0] = K[j, 0] * scale
        now[STEP] = select(change, now[STEP] * pace, now[STEP])
        by_time = by_time | change
        now[BY_TIME] = select(by_time, 1.0, 0.0)
    step = now[STEP]
    whole = by_time & (step >= remaining) & ~fresh
    step = select(by_time & (step > 0.5 * remaining), 0.5 * remaining, step)
    step = select(whole, remaining, step)
    return select(fresh, 0.0, step), whole


@inlined
def make_stages(problem, dt, work):
    """Compute the stages of a step but the first, and its end in ``work.at``.

    Returns:
        det S* and det D at the end, and where det S* keeps its sign.
    """
    tableau, K, y, at, states = problem.tableau, work.K, work.y, work.at, 5 + problem.robot.n
    determinant, det_D = dt, dt
    regular = dt == dt
    for s in range(1, 7):
        for j in range(states):
            total = K[j, 0] * tableau[s, 0]
            for i in range(1, s):
                total += K[j, i] * tableau[s, i]
            at[j] = y[j] + dt * total
        determinant, det_D = derivatives(problem, at, work, s)
        regular = regular & (determinant * work.now[POSITIVE] > 0.0)
    return determinant, det_D, regular


@inlined
def error_of(problem, dt, work):
    """Errors of a step relative to the tolerances, in SciPy's norm."""
    tableau, K, y, at, n = problem.tableau, work.K, work.y, work.at, problem.robot.n
    error = 0.0 * dt
    for j in range(4 + n):
        total = 0.0 * dt
        for s in range(7):
            total += K[j, s] * tableau[7, s]
        total = total / (1.0 + maximum(magnitude(y[j]), magnitude(at[j])))
        error += total * total
    return dt * sqrt(error * (1.0 / (4.0 + n))) / work.now[TOLERANCE]


@inlined
def inside(problem, dt, x, work):
    """Write joint values and time at a fraction of the step into ``work.probe``."""
    tableau, K, y, n = problem.tableau, work.K, work.y, problem.robot.n
    for s in range(7):
        power = tableau[8, s] + x * (tableau[9, s] + x * (tableau[10, s] + x * tableau[11, s]))
        work.weights[s] = power * x * dt
    for j in range(n + 1):
        total = y[4 + j]
        for s in range(7):
            total += work.weights[s] * K[4 + j, s]
        work.probe[j] = total


@inlined
def value_inside(problem, dt, x, work):
    """The measure at a fraction of the step, with the sign of the motion's first value."""
    inside(problem, dt, x, work)
    return work.now[SIGN] * measure_at(problem.robot, problem.measure, work.probe, work)


@inlined
def note_minimum(problem, dt, after, accepted, work):
    """Update the lowest value by the end of a step, and by a minimum inside."""
    now, T = work.now, 4 + problem.robot.n
    lower = accepted & (after < now[LOWEST])
    now[LOWEST] = select(lower, after, now[LOWEST])
    now[LOWEST_AT] = select(lower, work.at[T], now[LOWEST_AT])
    before = now[VALUE]
    middle = value_inside(problem, dt, 0.0 * dt + 0.5, work)
    # parabola through beginning, middle and end
    curvature = 2.0 * (before + after - 2.0 * middle)
    slope = 4.0 * middle - 3.0 * before - after
    place = -0.5 * slope / curvature
    vertex = before + 0.5 * slope * place
    low = minimum(before, minimum(middle, after))
    deepest = low - maximum(_DEPTH_FACTOR * (low - vertex), _SKEWED * low)
    dips = (curvature > 0.0) & (place > -0.1) & (place < 1.1) & (deepest < now[LOWEST])
    dips = accepted & ((dips) | (middle < now[LOWEST]))
    if any_of(dips):
        found, place = local_minimum(problem, dt, before, middle, after, work)
        lower = dips & (found < now[LOWEST])
        inside(problem, dt, place, work)
        now[LOWEST] = select(lower, found, now[LOWEST])
        now[LOWEST_AT] = select(lower, work.probe[problem.robot.n], now[LOWEST_AT])


@inlined
def local_minimum(problem, dt, before, middle, after, work):
    """The lowest value of the measure inside a step and its place, by successive parabolas."""
    a, fa, b, fb, c, fc = 0.0 * dt, before, 0.0 * dt + 0.5, middle, 0.0 * dt + 1.0, after
    for _ in range(6):
        p, r = (b - a) * (fb - fc), (b - c) * (fb - fa)
        x = b - 0.5 * ((b - a) * p - (b - c) * r) / (p - r)
        least_move = 0.02 * (c - a)
        longer = select(c - b > b - a, c - b, a - b)
        near = ~(magnitude(x - b) > least_move)
        x = select(near, b + select(magnitude(x - b) > 0.0, 0.1 * longer, 0.02 * longer), x)
        x = minimum(maximum(x, a + 0.05 * (b - a)), c - 0.05 * (c - b))
        fx = value_inside(problem, dt, x, work)
        lower, beyond = fx < fb, x > b
        a, fa = (
            select(beyond, select(lower, b, a), select(lower, a, x)),
            select(beyond, select(lower, fb, fa), select(lower, fa, fx)),
        )
        c, fc = (
            select(beyond, select(lower, c, x), select(lower, b, c)),
            select(beyond, select(lower, fc, fx), select(lower, fb, fc)),
        )
        b, fb = select(lower, x, b), select(lower, fx, fb)
    return fb, b
