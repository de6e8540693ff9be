"""Integration of (8) compiled, motion by motion, by the Dormand-Prince method.

The independent variable is time in units of the duration. A motion ends at a singularity: a step
across it finds a determinant of the other sign, is rejected and shortened until it is negligible.
The measure is evaluated at the ends of the steps; where a parabola through three of its values
admits a new minimum in between, the interpolant of the steps is searched.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from freefloat.dynamics.kernels.compilation import compiled, unowned
from freefloat.dynamics.kernels.equation import DEMAND, WORK_COLUMNS, form_jacobian
from freefloat.dynamics.kernels.right_side import Robot, flow
from freefloat.dynamics.redundancy import SINGULAR_SPEED
from freefloat.ensemble.kernels.steps import (
    ARM,
    GJM,
    SIGMA,
    error_of,
    has_lower_minimum,
    inside,
    local_minimum,
    make_stages,
    measure_at,
)
from freefloat.so3 import Array, IntArray

if TYPE_CHECKING:
    from freefloat.ensemble.ensemble import EnsembleResult

COMPLETED, SINGULAR, MARGIN, FAILED = 0, 1, 2, 3
"""Codes of endings."""
UNREACHED = -1
"""Ending of an arm branch that does not exist at an attitude."""

_FIRST_STEP, _SHORTEST_STEP = 0.02, 1e-11
_SINGULAR_STEP = 1e-7
_MAX_STEPS = 20_000
_SMALL, _STRICTER, _UNDECIDED = 0.15, 0.01, 0.9


class Buffers(NamedTuple):
    """Workspace of one thread; the caller keeps it alive, see ``unowned``."""

    last: Array  # (4 + n,)
    extent: Array  # (3, n)
    w: Array  # see freefloat.dynamics.kernels.equation, also S and L
    S: Array
    L: Array
    stages: Array  # (2, 7, 4 + n), of this step and the previous one
    states: Array  # (3, 4 + n)
    vectors: Array  # (4, max(n, DEMAND)): joints, joint rates, buffer of a measure, demand


def make_buffers(n: int, m: int) -> Buffers:
    """Workspace for a robot of n joints and a task of m rows."""
    equations = (m, m + 1) if n == m else (n + m, n + m + 2)  # redundant: see choose_rates
    return Buffers(
        last=np.zeros(4 + n), extent=np.zeros((3, n)), w=np.zeros((n + 1, WORK_COLUMNS)),
        S=np.zeros((m, n)), L=np.zeros(equations), stages=np.zeros((2, 7, 4 + n)),
        states=np.zeros((3, 4 + n)), vectors=np.zeros((4, max(n, DEMAND))),
    )  # fmt: skip


@compiled
def _widen(extent: Array, at: Array, K: Array, duration: float) -> float:
    """Extend the extent to the end of a step; return the largest joint rate per duration there."""
    speed = 0.0
    for j in range(extent.shape[1]):
        rate = abs(K[6, 4 + j])
        speed = max(speed, rate)
        extent[0, j] = max(extent[0, j], rate / duration)
        extent[1, j] = min(extent[1, j], at[4 + j])
        extent[2, j] = max(extent[2, j], at[4 + j])
    return speed


@compiled
def _advance(K: Array, before: Array, y: Array, old: Array, at: Array) -> None:
    """Start the next step at the end of this step, which is kept for the interpolant."""
    norm = math.sqrt(at[0] ** 2 + at[1] ** 2 + at[2] ** 2 + at[3] ** 2)
    for j in range(len(y)):
        old[j] = y[j]
        y[j] = at[j] / norm if j < 4 else at[j]
        for s in range(7):
            before[s, j] = K[s, j]
        K[0, j] = K[6, j]


@compiled
def integrate_one(
    tableau: Array, bodies: Array, facts: Array, rows: IntArray, measure: int, ends: Array,
    origins: Array, spans: Array, law: Array, tangents: Array, duration: float, attitude: Array,
    joints: Array, h: Array, start: float, goal: float, stop_below: float, tolerance: float,
    last: Array, extent: Array, w: Array, S: Array, L: Array, stages: Array, states: Array,
    vectors: Array,
) -> tuple[int, float, float, float, float, float, int]:  # fmt: skip
    """Integrate a motion along the path from a state.

    The arguments up to ``duration`` are the fields of :class:`Robot`; from ``attitude`` to
    ``tolerance`` those of ``EnsembleIntegrator.integrate`` for a single motion; the others are the
    fields of :class:`Buffers`. ``last`` receives the final state, attitude first, and ``extent``
    the largest rates, smallest and largest joint values, in rows.

    Returns:
        Ending and its time, minimum magnitude of the measure and its time, maximum magnitude,
        minimum over maximum magnitude of det S, evaluations of (4).
    """
    n, m = len(joints), len(rows)
    square = n == m
    K, before = stages[0], stages[1]
    y, at, old = states[0], states[1], states[2]
    q, rates, spare, demand = vectors[0, :n], vectors[1, :n], vectors[2, :n], vectors[3]
    forward = 1.0 if goal >= start else -1.0
    for j in range(4):
        y[j] = attitude[j]
    for j in range(n):
        y[4 + j] = joints[j]
        extent[0, j], extent[1, j], extent[2, j] = 0.0, joints[j], joints[j]
    t, segment, last_segment = start / duration, 0, len(ends) - 1
    while segment < last_segment and (
        ends[segment] <= start if forward > 0.0 else ends[segment] < start
    ):
        segment += 1
    determinant = flow(bodies, facts, rows, origins, spans, law, tangents, duration, segment, h,
                        t, y, K[0], w, S, L, q, rates, demand)  # fmt: skip
    evaluations, taken, ending = 1, 0, COMPLETED
    positive = determinant > 0.0
    smallest, largest = abs(determinant), abs(determinant)
    value = measure_at(bodies, facts, rows, measure, y[4:], w, S, L, spare)
    sign = -1.0 if value < 0.0 else 1.0
    value *= sign
    minimum, minimum_at, maximum = value, t, value
    if determinant == 0.0 or not math.isfinite(determinant):
        ending, minimum = SINGULAR, 0.0
    elif value < stop_below:
        ending = MARGIN
    for j in range(n if ending != SINGULAR else 0):
        extent[0, j] = abs(K[0, 4 + j]) / duration
    step = _FIRST_STEP
    value_before, step_before = value, 0.0
    while ending == COMPLETED:
        leg = ends[segment] if forward > 0.0 else (ends[segment - 1] if segment > 0 else 0.0)
        leg = (min(goal, leg) if forward > 0.0 else max(goal, leg)) / duration
        remaining = forward * (leg - t)
        if remaining <= 0.0:
            if forward * (goal / duration - t) <= 0.0:
                break
            segment += 1 if forward > 0.0 else -1
            continue
        taken += 1
        if taken > _MAX_STEPS:
            ending = FAILED
            break
        whole = step >= remaining
        if not whole and step > 0.5 * remaining:
            step = 0.5 * remaining
        dt = forward * (remaining if whole else step)
        determinant, made, flipped = make_stages(
            tableau, bodies, facts, rows, origins, spans, law, tangents, duration, segment, h, t,
            dt, positive, y, at, K, w, S, L, q, rates, demand,
        )  # fmt: skip
        evaluations += made
        if flipped:
            step = 0.4 * abs(dt)
            if step < _SINGULAR_STEP:
                ending = SINGULAR
            continue
        error = error_of(tableau, K, y, at, dt, tolerance)
        if not error < 1.0:
            step = abs(dt) * (max(0.2, 0.9 * error ** (-0.2)) if math.isfinite(error) else 0.2)
            if step < _SHORTEST_STEP:
                ending = SINGULAR
            continue
        if measure == GJM:
            after = sign * determinant
        elif measure in (ARM, SIGMA):
            after = sign * measure_at(bodies, facts, rows, measure, q, w, S, L, spare)
        else:
            after = sign * determinant * form_jacobian(facts, rows, w, S)
        t_new, last_step = leg if whole else t + dt, whole and leg == goal / duration
        left, center, middle = step_before, 0.0, value
        if step_before == 0.0 or (last_step and after < value):
            # a minimum beside the first or the last node is not bracketed by nodes
            left, middle, value_before = 0.0, math.inf, value
            for fraction in (0.5, 0.97 if last_step else 0.03):
                inside(tableau, K, y, dt, fraction, rates)
                probe = sign * measure_at(bodies, facts, rows, measure, rates, w, S, L, spare)
                if probe < middle:
                    center, middle = fraction * dt, probe
        if has_lower_minimum(
            value_before, middle, after, abs(center + left), abs(dt - center), minimum
        ):
            low, low_at = local_minimum(
                tableau, K, y, dt, before, old, step_before, -left, center, dt, value_before,
                middle, after, sign, bodies, facts, rows, measure, w, S, L, spare, rates,
            )  # fmt: skip
            if low < minimum:
                minimum, minimum_at = low, t + low_at
        if after < minimum:
            minimum, minimum_at = after, t_new
        maximum = max(maximum, after)
        smallest, largest = min(smallest, abs(determinant)), max(largest, abs(determinant))
        speed = _widen(extent, at, K, duration)
        if minimum <= 0.0 or (not square and speed > SINGULAR_SPEED):
            ending = SINGULAR
        elif minimum < stop_below:
            ending = MARGIN
        _advance(K, before, y, old, at)
        value_before, step_before = value, dt
        value, t = after, t_new
        step = abs(dt) * min(10.0, 0.9 * max(error, 1e-10) ** (-0.2))
    for j in range(4 + n):
        last[j] = y[j]
    if ending == SINGULAR:
        minimum, minimum_at, smallest = 0.0, t, 0.0
    ratio = smallest / largest if largest > 0.0 else 0.0
    return ending, t * duration, minimum, minimum_at * duration, maximum, ratio, evaluations


@compiled
def integrate_many(
    tableau: Array, robot: Robot, attitudes: Array, joints: Array, momenta: Array, starts: Array,
    goals: Array, stop_below: float, tolerance: float, first: int, beyond: int, buffers: Buffers,
    out: EnsembleResult,
) -> None:  # fmt: skip
    """Integrate motions ``first`` to ``beyond`` and write their results.

    Where the minimum of the measure is small relative to its maximum along the motion, small
    errors of the motion are large relative to it: such motions are integrated again with a stricter
    tolerance.
    """
    _integrate_many(
        unowned(tableau), unowned(robot.bodies), unowned(robot.facts), unowned(robot.rows),
        robot.measure, unowned(robot.ends), unowned(robot.origins), unowned(robot.spans),
        unowned(robot.law), unowned(robot.tangents), robot.duration, unowned(attitudes),
        unowned(joints), unowned(momenta), unowned(starts), unowned(goals), stop_below,
        tolerance, first, beyond, unowned(buffers.last), unowned(buffers.extent),
        unowned(buffers.w), unowned(buffers.S), unowned(buffers.L), unowned(buffers.stages),
        unowned(buffers.states), unowned(buffers.vectors), out,
    )  # fmt: skip


@compiled
def _integrate_many(
    tableau: Array, bodies: Array, facts: Array, rows: IntArray, measure: int, ends: Array,
    origins: Array, spans: Array, law: Array, tangents: Array, duration: float, attitudes: Array,
    joints: Array, momenta: Array, starts: Array, goals: Array, stop_below: float,
    tolerance: float, first: int, beyond: int, last: Array, extent: Array, w: Array, S: Array,
    L: Array, stages: Array, states: Array, vectors: Array, out: EnsembleResult,
) -> None:  # fmt: skip
    n = joints.shape[1]
    for k in range(first, beyond):
        ending, ended_at, minimum, minimum_at, maximum, ratio, evaluations = integrate_one(
            tableau, bodies, facts, rows, measure, ends, origins, spans, law, tangents, duration,
            attitudes[k], joints[k], momenta[k], starts[k], goals[k], stop_below, tolerance,
            last, extent, w, S, L, stages, states, vectors,
        )  # fmt: skip
        undecided = ending == COMPLETED or (ending == MARGIN and minimum > _UNDECIDED * stop_below)
        if undecided and minimum < _SMALL * maximum:
            ending, ended_at, minimum, minimum_at, maximum, ratio, more = integrate_one(
                tableau, bodies, facts, rows, measure, ends, origins, spans, law, tangents,
                duration, attitudes[k], joints[k], momenta[k], starts[k], goals[k], stop_below,
                _STRICTER * tolerance, last, extent, w, S, L, stages, states, vectors,
            )  # fmt: skip
            evaluations += more
        out.endings[k], out.ended_at[k] = ending, ended_at
        out.minimum[k], out.minimum_at[k] = minimum, minimum_at
        out.determinant_ratios[k], out.evaluations[k] = ratio, evaluations
        for j in range(4):
            out.attitudes[k, j] = last[j]
        for j in range(n):
            out.joints[k, j] = last[4 + j]
            out.rates[k, j] = extent[0, j]
            out.lower[k, j], out.upper[k, j] = extent[1, j], extent[2, j]
