"""The flow of (8) compiled: one motion after another, by Dormand and Prince's method.

Time is the variable, in units of the duration. At a singularity no motion goes on: a step that
tries to pass it meets the determinant with the other sign, is taken back and halved until what is
left is below any interest. The measure is known at the ends of the steps; where a parabola through
three of them says that it may set a new minimum in between, the steps' interpolant is searched.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.integrate import RK45

from freefloat.compiled import borrowed, compiled
from freefloat.drift_kernels import WORK_COLUMNS, form_jacobian
from freefloat.flow_kernels import Robot, flow
from freefloat.measure_kernels import ARM, GJM, SIGMA, measure_at
from freefloat.spatial import Array

IntArray = npt.NDArray[np.int64]

COMPLETED, SINGULAR, MARGIN, FAILED = 0, 1, 2, 3
"""Codes of endings."""

TABLEAU = np.zeros((14, 7))
"""Rows 0 to 5: stages, with their times in the last column; 6: the step; 7: its error; 8 to 11: the
interpolant's powers of the share of the step."""
TABLEAU[:6, :5], TABLEAU[:6, 6], TABLEAU[6, :6], TABLEAU[7] = RK45.A, RK45.C, RK45.B, RK45.E
TABLEAU[8:12] = RK45.P.T
_FIRST_STEP, _SHORTEST_STEP = 0.02, 1e-11
_SINGULAR_STEP = 1e-7
_MAX_STEPS = 20_000
_TOO_FAST = 2e4
"""Speed, in radians and metres per duration, at which a redundant arm stands still in time."""
_SMALL, _STRICTER, _UNDECIDED = 0.15, 0.01, 0.9
_DOUBT = 3.0
"""A dip between nodes may be as many times as deep as the parabola says."""


class Room(NamedTuple):
    """Where one motion after another is worked out; kept by the caller, see ``borrowed``."""

    last: Array  # (4 + n,)
    extent: Array  # (3, n)
    w: Array  # see drift_kernels, also S and L
    S: Array
    L: Array
    stages: Array  # (2, 7, 4 + n), of this step and the one before
    states: Array  # (4, 4 + n)
    vectors: Array  # (4, 9)


def make_room(n: int, m: int) -> Room:
    """Room for a robot of n joints and a task of m rows."""
    return Room(
        last=np.zeros(4 + n), extent=np.zeros((3, n)), w=np.zeros((n + 1, WORK_COLUMNS)),
        S=np.zeros((m, n)), L=np.zeros((m, m + 1)), stages=np.zeros((2, 7, 4 + n)),
        states=np.zeros((4, 4 + n)), vectors=np.zeros((4, 9)),
    )  # fmt: skip


class Outcomes(NamedTuple):
    """What became of each motion."""

    ending: npt.NDArray[np.int8]  # (K,)
    ended_at: Array  # (K,) [s]
    least: Array  # (K,), smallest magnitude of the measure, zero where it changes sign
    least_at: Array  # (K,) [s]
    attitude: Array  # (K, 4), the last
    joints: Array  # (K, n), the last
    rates: Array  # (K, n), largest magnitudes of the joint rates
    lower: Array  # (K, n), of the joints on the way
    upper: Array  # (K, n)
    evaluations: IntArray  # (K,), of (4)


@compiled
def _inside(tableau: Array, K: Array, y: Array, h: float, x: float, q: Array) -> None:
    """The joints at a share x of a step."""
    for j in range(len(q)):
        total = 0.0
        for s in range(7):
            P = tableau[8, s] + x * (tableau[9, s] + x * (tableau[10, s] + x * tableau[11, s]))
            total += P * K[s, 4 + j]
        q[j] = y[4 + j] + h * x * total


@compiled
def _dip(
    tableau: Array, K: Array, y: Array, h: float, before: Array, old: Array, h_before: float,
    a: float, b: float, c: float, fa: float, fb: float, fc: float, sign: float,
    bodies: Array, facts: Array, rows: IntArray, measure: int,
    w: Array, S: Array, L: Array, room: Array, q: Array,
) -> tuple[float, float]:  # fmt: skip
    """The smallest value of the measure near a place ``b`` where it is lower than at ``a``, ``c``.

    Places are times from the node between the step before and this step.

    Returns:
        The value and its place.
    """
    for _ in range(7):
        p, r = (b - a) * (fb - fc), (b - c) * (fb - fa)
        under = p - r
        x = b - 0.5 * ((b - a) * p - (b - c) * r) / under if under != 0.0 else b
        least_move = 0.02 * (c - a if c > a else a - c)
        if not abs(x - b) > least_move:
            longer = c - b if abs(c - b) > abs(b - a) else a - b
            x = b + (0.1 * longer if abs(x - b) > 0.0 or under == 0.0 else 0.02 * longer)
        if x * h > 0.0:
            _inside(tableau, K, y, h, min(x / h, 1.0), q)
        else:
            _inside(tableau, before, old, h_before, max(1.0 + x / h_before, 0.0), q)
        fx = sign * measure_at(bodies, facts, rows, measure, q, w, S, L, room)
        beyond = (x - b) * h > 0.0
        if fx < fb:
            if beyond:
                a, fa = b, fb
            else:
                c, fc = b, fb
            b, fb = x, fx
        elif beyond:
            c, fc = x, fx
        else:
            a, fa = x, fx
    return fb, b


@compiled
def follow_one(
    tableau: Array, bodies: Array, facts: Array, rows: IntArray, measure: int, ends: Array,
    origins: Array, spans: Array, law: Array, tangents: Array, duration: float, attitude: Array,
    joints: Array, h: Array, start: float, goal: float, stop_below: float, tolerance: float,
    last: Array, extent: Array, w: Array, S: Array, L: Array, stages: Array, states: Array,
    room: Array,
) -> tuple[int, float, float, float, float, int]:  # fmt: skip
    """Follow the path from a state.

    The arguments up to ``duration`` are those of :class:`Robot`; from ``attitude`` to ``tolerance``
    those of :meth:`freefloat.rollout.Roller.follow`, for one motion. ``last`` receives the last
    state, attitude first, and ``extent`` the largest rates, lowest and highest joints, a row each;
    they and what follows them are a :class:`Room`.

    Returns:
        Ending, when, least magnitude of the measure, when, largest magnitude, evaluations of (4).
    """
    n, m = len(joints), len(rows)
    dim, square = 4 + n, n == m
    K, before = stages[0], stages[1]
    y, new, at, old = states[0], states[1], states[2], states[3]
    q, rates, spare, demand = room[0, :n], room[1, :n], room[2, :n], room[3]
    forward = 1.0 if goal >= start else -1.0
    for j in range(4):
        y[j] = attitude[j]
    for j in range(n):
        y[4 + j] = joints[j]
        extent[0, j], extent[1, j], extent[2, j] = 0.0, joints[j], joints[j]
    t, piece, last_piece = start / duration, 0, len(ends) - 1
    while piece < last_piece and (ends[piece] <= start if forward > 0.0 else ends[piece] < start):
        piece += 1
    determinant = flow(bodies, facts, rows, origins, spans, law, tangents, duration, piece, h,
                        t, y, K[0], w, S, L, q, rates, demand)  # fmt: skip
    evaluations, taken, ending = 1, 0, COMPLETED
    positive = determinant > 0.0
    value = measure_at(bodies, facts, rows, measure, y[4:], w, S, L, spare)
    sign = -1.0 if value < 0.0 else 1.0
    value *= sign
    least, least_at, most = value, t, value
    if determinant == 0.0 or not math.isfinite(determinant):
        ending, least = SINGULAR, 0.0
    elif value < stop_below:
        ending = MARGIN
    for j in range(n if ending != SINGULAR else 0):
        extent[0, j] = abs(K[0, 4 + j]) / duration
    step = _FIRST_STEP
    value_before, step_before = value, 0.0
    while ending == COMPLETED:
        leg = ends[piece] if forward > 0.0 else (ends[piece - 1] if piece > 0 else 0.0)
        leg = (min(goal, leg) if forward > 0.0 else max(goal, leg)) / duration
        remaining = forward * (leg - t)
        if remaining <= 0.0:
            if forward * (goal / duration - t) <= 0.0:
                break
            piece += 1 if forward > 0.0 else -1
            continue
        taken += 1
        if taken > _MAX_STEPS:
            ending = FAILED
            break
        whole = step >= remaining
        if not whole and step > 0.5 * remaining:
            step = 0.5 * remaining
        dt = forward * (remaining if whole else step)
        flipped = False
        for s in range(1, 7):
            for j in range(dim):
                at[j] = y[j]
            for i in range(s):
                weight = dt * tableau[s, i]
                for j in range(dim):
                    at[j] += weight * K[i, j]
            share = tableau[s, 6] if s < 6 else 1.0
            determinant = flow(bodies, facts, rows, origins, spans, law, tangents, duration,
                                piece, h, t + dt * share, at, K[s], w, S, L, q, rates,
                                demand)  # fmt: skip
            evaluations += 1
            if square and (determinant > 0.0) != positive:
                flipped = True
                break
        if flipped:
            step = 0.4 * abs(dt)
            if step < _SINGULAR_STEP:
                ending = SINGULAR
            continue
        error = 0.0
        for j in range(dim):
            total = 0.0
            for s in range(7):
                total += tableau[7, s] * K[s, j]
            error += (total / (tolerance * (1.0 + max(abs(y[j]), abs(at[j]))))) ** 2
        error = abs(dt) * math.sqrt(error / dim)
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
        for j in range(dim):
            new[j] = at[j]
        t_new = leg if whole else t + dt
        left, center, middle, right = step_before, 0.0, value, after
        last_step = whole and leg == goal / duration
        if step_before == 0.0 or (last_step and after < value):
            # beside the first and the last node a dip has no node of its own
            left, middle, value_before = 0.0, math.inf, value
            for share in (0.5, 0.97 if last_step else 0.03):
                _inside(tableau, K, y, dt, share, rates)
                probe = sign * measure_at(bodies, facts, rows, measure, rates, w, S, L, spare)
                if probe < middle:
                    center, middle = share * dt, probe
        if middle <= value_before and middle <= right:
            back, on = abs(center + left), abs(dt - center)
            fall, rise = (value_before - middle) / back, (right - middle) / on
            bend = (rise + fall) / (back + on)
            slope = (rise * back - fall * on) / (back + on)
            if bend > 0.0 and middle - _DOUBT * slope * slope / (4.0 * bend) < least:
                low, place = _dip(
                    tableau, K, y, dt, before, old, step_before, -left, center, dt, value_before,
                    middle, right, sign, bodies, facts, rows, measure, w, S, L, spare, rates,
                )  # fmt: skip
                if low < least:
                    least, least_at = low, t + place
        if after < least:
            least, least_at = after, t_new
        most = max(most, after)
        speed = 0.0
        for j in range(n):
            rate = abs(K[6, 4 + j])
            speed = max(speed, rate)
            extent[0, j] = max(extent[0, j], rate / duration)
            extent[1, j] = min(extent[1, j], new[4 + j])
            extent[2, j] = max(extent[2, j], new[4 + j])
        if least <= 0.0 or (not square and speed > _TOO_FAST):
            ending = SINGULAR
        elif least < stop_below:
            ending = MARGIN
        norm = math.sqrt(new[0] ** 2 + new[1] ** 2 + new[2] ** 2 + new[3] ** 2)
        for j in range(dim):
            old[j] = y[j]
            y[j] = new[j] / norm if j < 4 else new[j]
            for s in range(7):
                before[s, j] = K[s, j]
            K[0, j] = K[6, j]
        value_before, step_before = value, dt
        value, t = after, t_new
        step = abs(dt) * min(10.0, 0.9 * max(error, 1e-10) ** (-0.2))
    for j in range(dim):
        last[j] = y[j]
    if ending == SINGULAR:
        least, least_at = 0.0, t
    return ending, t * duration, least, least_at * duration, most, evaluations


@compiled
def follow_many(
    tableau: Array, robot: Robot, attitudes: Array, joints: Array, momenta: Array, starts: Array,
    goals: Array, stop_below: float, tolerance: float, first: int, beyond: int, room: Room,
    out: Outcomes,
) -> None:  # fmt: skip
    """Follow motions ``first`` to ``beyond`` and write what became of them.

    Where the measure gets small beside its largest value on the way, an error that hardly changes
    the motion changes the measure's share of it much: such motions are followed again, stricter.
    """
    _follow_many(
        borrowed(tableau), borrowed(robot.bodies), borrowed(robot.facts), borrowed(robot.rows),
        robot.measure, borrowed(robot.ends), borrowed(robot.origins), borrowed(robot.spans),
        borrowed(robot.law), borrowed(robot.tangents), robot.duration, borrowed(attitudes),
        borrowed(joints), borrowed(momenta), borrowed(starts), borrowed(goals), stop_below,
        tolerance, first, beyond, borrowed(room.last), borrowed(room.extent), borrowed(room.w),
        borrowed(room.S), borrowed(room.L), borrowed(room.stages), borrowed(room.states),
        borrowed(room.vectors), out,
    )  # fmt: skip


@compiled
def _follow_many(
    tableau: Array, bodies: Array, facts: Array, rows: IntArray, measure: int, ends: Array,
    origins: Array, spans: Array, law: Array, tangents: Array, duration: float, attitudes: Array,
    joints: Array, momenta: Array, starts: Array, goals: Array, stop_below: float,
    tolerance: float, first: int, beyond: int, last: Array, extent: Array, w: Array, S: Array,
    L: Array, stages: Array, states: Array, room: Array, out: Outcomes,
) -> None:  # fmt: skip
    n = joints.shape[1]
    for k in range(first, beyond):
        ending, when, least, least_at, most, evaluations = follow_one(
            tableau, bodies, facts, rows, measure, ends, origins, spans, law, tangents, duration,
            attitudes[k], joints[k], momenta[k], starts[k], goals[k], stop_below, tolerance,
            last, extent, w, S, L, stages, states, room,
        )  # fmt: skip
        undecided = ending == COMPLETED or (ending == MARGIN and least > _UNDECIDED * stop_below)
        if undecided and least < _SMALL * most:
            ending, when, least, least_at, most, more = follow_one(
                tableau, bodies, facts, rows, measure, ends, origins, spans, law, tangents,
                duration, attitudes[k], joints[k], momenta[k], starts[k], goals[k], stop_below,
                _STRICTER * tolerance, last, extent, w, S, L, stages, states, room,
            )  # fmt: skip
            evaluations += more
        out.ending[k], out.ended_at[k] = ending, when
        out.least[k], out.least_at[k] = least, least_at
        out.evaluations[k] = evaluations
        for j in range(4):
            out.attitude[k, j] = last[j]
        for j in range(n):
            out.joints[k, j] = last[4 + j]
            out.rates[k, j] = extent[0, j]
            out.lower[k, j], out.upper[k, j] = extent[1, j], extent[2, j]
