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

from freefloat.dynamics.kernels.compilation import borrowed, compiled
from freefloat.dynamics.kernels.equation import DEMAND, WORK_COLUMNS, form_jacobian
from freefloat.dynamics.kernels.right_side import Robot, flow
from freefloat.ensemble.kernels.measures import ARM, GJM, SIGMA, measure_at
from freefloat.ensemble.kernels.steps import dip, error_of, inside, make_stages, may_dip
from freefloat.motion.problem import is_kept
from freefloat.so3 import Array, IntArray

COMPLETED, SINGULAR, MARGIN, FAILED = 0, 1, 2, 3
"""Codes of endings."""
UNREACHED = -1
"""Ending of an arm branch that does not exist at an attitude."""

_FIRST_STEP, _SHORTEST_STEP = 0.02, 1e-11
_SINGULAR_STEP = 1e-7
_MAX_STEPS = 20_000
_TOO_FAST = 2e4
"""Speed, in radians and metres per duration, at which a redundant arm stands still in time."""
_SMALL, _STRICTER, _UNDECIDED = 0.15, 0.01, 0.9


class Buffers(NamedTuple):
    """Workspace of one thread; kept by the caller, see ``borrowed``."""

    last: Array  # (4 + n,)
    extent: Array  # (3, n)
    w: Array  # see drift_kernels, also S and L
    S: Array
    L: Array
    stages: Array  # (2, 7, 4 + n), of this step and the one before
    states: Array  # (3, 4 + n)
    vectors: Array  # (4, max(n, DEMAND)): joints, their rates, room for a measure, a demand


def make_buffers(n: int, m: int) -> Buffers:
    """Workspace for a robot of n joints and a task of m rows."""
    equations = (m, m + 1) if n == m else (n + m, n + m + 2)  # with the choice of a redundant arm
    return Buffers(
        last=np.zeros(4 + n), extent=np.zeros((3, n)), w=np.zeros((n + 1, WORK_COLUMNS)),
        S=np.zeros((m, n)), L=np.zeros(equations), stages=np.zeros((2, 7, 4 + n)),
        states=np.zeros((3, 4 + n)), vectors=np.zeros((4, max(n, DEMAND))),
    )  # fmt: skip


class EnsembleResult(NamedTuple):
    """Results of K motions; in tables of arm branches the leading shape is (K, B) instead.

    Attributes:
        endings: 0 completed, 1 singular, 2 margin violated, 3 given up, shape (K,); in tables -1
            where there is no such arm branch.
        ended_at: Final times [s], shape (K,).
        minimum: Smallest magnitude of the measure, zero where it changes sign, shape (K,).
        minimum_at: When [s], shape (K,).
        attitudes: Final attitudes, quaternions x, y, z, w, shape (K, 4).
        joints: Final joint values [rad or m], shape (K, n).
        rates: Largest magnitudes of the joint rates at the integrator's steps, shape (K, n).
        lower: Smallest joint values at the steps, shape (K, n).
        upper: Largest joint values at the steps, shape (K, n).
        determinant_ratios: Smallest over largest magnitude of det S* at the steps; small near any
            singularity, also one at which the measure does not vanish, shape (K,).
        evaluations: Number of evaluations of (4), shape (K,).
    """

    endings: npt.NDArray[np.int8]
    ended_at: Array
    minimum: Array
    minimum_at: Array
    attitudes: Array
    joints: Array
    rates: Array
    lower: Array
    upper: Array
    determinant_ratios: Array
    evaluations: IntArray

    @classmethod
    def empty(cls, shape: tuple[int, ...], n: int) -> EnsembleResult:
        """Arrays for motions of n joints where there is no motion yet."""
        times, minimum_at = np.full((2, *shape), np.nan)
        minimum, determinant_ratios = np.zeros((2, *shape))
        joints, rates, lower, upper = np.full((4, *shape, n), np.nan)
        return cls(
            np.full(shape, UNREACHED, np.int8), times, minimum, minimum_at,
            np.full((*shape, 4), np.nan), joints, rates, lower, upper, determinant_ratios,
            np.zeros(shape, np.int64),
        )  # fmt: skip

    def keeps(self, margin: float) -> npt.NDArray[np.bool_]:
        """Which motions complete and keep a margin, shape (K,)."""
        return np.asarray((self.endings == COMPLETED) & is_kept(self.minimum, margin))


@compiled
def _widen(extent: Array, at: Array, K: Array, duration: float) -> float:
    """Take a step's end into account in the extent; the fastest joint's rate there per duration."""
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
    """Make the end of a step the start of the next, and remember the step."""
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
    room: Array,
) -> tuple[int, float, float, float, float, float, int]:  # fmt: skip
    """Follow the path from a state.

    The arguments up to ``duration`` are those of :class:`Robot`; from ``attitude`` to ``tolerance``
    those of ``EnsembleIntegrator.follow``, for one motion. ``last`` receives
    the last state, attitude first, and ``extent`` the largest rates, lowest and highest joints, a
    row each; they and what follows them are a :class:`Buffers`.

    Returns:
        Ending, when, least magnitude of the measure, when, largest magnitude, smallest over largest
        magnitude of det S, evaluations of (4).
    """
    n, m = len(joints), len(rows)
    square = n == m
    K, before = stages[0], stages[1]
    y, at, old = states[0], states[1], states[2]
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
    smallest, largest = abs(determinant), abs(determinant)
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
        determinant, made, flipped = make_stages(
            tableau, bodies, facts, rows, origins, spans, law, tangents, duration, piece, h, t, dt,
            positive, y, at, K, w, S, L, q, rates, demand,
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
            # beside the first and the last node a dip has no node of its own
            left, middle, value_before = 0.0, math.inf, value
            for share in (0.5, 0.97 if last_step else 0.03):
                inside(tableau, K, y, dt, share, rates)
                probe = sign * measure_at(bodies, facts, rows, measure, rates, w, S, L, spare)
                if probe < middle:
                    center, middle = share * dt, probe
        if may_dip(value_before, middle, after, abs(center + left), abs(dt - center), least):
            low, place = dip(
                tableau, K, y, dt, before, old, step_before, -left, center, dt, value_before,
                middle, after, sign, bodies, facts, rows, measure, w, S, L, spare, rates,
            )  # fmt: skip
            if low < least:
                least, least_at = low, t + place
        if after < least:
            least, least_at = after, t_new
        most = max(most, after)
        smallest, largest = min(smallest, abs(determinant)), max(largest, abs(determinant))
        speed = _widen(extent, at, K, duration)
        if least <= 0.0 or (not square and speed > _TOO_FAST):
            ending = SINGULAR
        elif least < stop_below:
            ending = MARGIN
        _advance(K, before, y, old, at)
        value_before, step_before = value, dt
        value, t = after, t_new
        step = abs(dt) * min(10.0, 0.9 * max(error, 1e-10) ** (-0.2))
    for j in range(4 + n):
        last[j] = y[j]
    if ending == SINGULAR:
        least, least_at, smallest = 0.0, t, 0.0
    clearance = smallest / largest if largest > 0.0 else 0.0
    return ending, t * duration, least, least_at * duration, most, clearance, evaluations


@compiled
def integrate_many(
    tableau: Array, robot: Robot, attitudes: Array, joints: Array, momenta: Array, starts: Array,
    goals: Array, stop_below: float, tolerance: float, first: int, beyond: int, buffers: Buffers,
    out: EnsembleResult,
) -> None:  # fmt: skip
    """Integrate motions ``first`` to ``beyond`` and write their results.

    Where the measure gets small beside its largest value on the way, an error that hardly changes
    the motion changes the measure's share of it much: such motions are followed again, stricter.
    """
    _integrate_many(
        borrowed(tableau), borrowed(robot.bodies), borrowed(robot.facts), borrowed(robot.rows),
        robot.measure, borrowed(robot.ends), borrowed(robot.origins), borrowed(robot.spans),
        borrowed(robot.law), borrowed(robot.tangents), robot.duration, borrowed(attitudes),
        borrowed(joints), borrowed(momenta), borrowed(starts), borrowed(goals), stop_below,
        tolerance, first, beyond, borrowed(buffers.last), borrowed(buffers.extent),
        borrowed(buffers.w), borrowed(buffers.S), borrowed(buffers.L), borrowed(buffers.stages),
        borrowed(buffers.states), borrowed(buffers.vectors), out,
    )  # fmt: skip


@compiled
def _integrate_many(
    tableau: Array, bodies: Array, facts: Array, rows: IntArray, measure: int, ends: Array,
    origins: Array, spans: Array, law: Array, tangents: Array, duration: float, attitudes: Array,
    joints: Array, momenta: Array, starts: Array, goals: Array, stop_below: float,
    tolerance: float, first: int, beyond: int, last: Array, extent: Array, w: Array, S: Array,
    L: Array, stages: Array, states: Array, room: Array, out: EnsembleResult,
) -> None:  # fmt: skip
    n = joints.shape[1]
    for k in range(first, beyond):
        ending, when, least, least_at, most, clearance, evaluations = integrate_one(
            tableau, bodies, facts, rows, measure, ends, origins, spans, law, tangents, duration,
            attitudes[k], joints[k], momenta[k], starts[k], goals[k], stop_below, tolerance,
            last, extent, w, S, L, stages, states, room,
        )  # fmt: skip
        undecided = ending == COMPLETED or (ending == MARGIN and least > _UNDECIDED * stop_below)
        if undecided and least < _SMALL * most:
            ending, when, least, least_at, most, clearance, more = integrate_one(
                tableau, bodies, facts, rows, measure, ends, origins, spans, law, tangents,
                duration, attitudes[k], joints[k], momenta[k], starts[k], goals[k], stop_below,
                _STRICTER * tolerance, last, extent, w, S, L, stages, states, room,
            )  # fmt: skip
            evaluations += more
        out.endings[k], out.ended_at[k] = ending, when
        out.minimum[k], out.minimum_at[k] = least, least_at
        out.determinant_ratios[k], out.evaluations[k] = clearance, evaluations
        for j in range(4):
            out.attitudes[k, j] = last[j]
        for j in range(n):
            out.joints[k, j] = last[4 + j]
            out.rates[k, j] = extent[0, j]
            out.lower[k, j], out.upper[k, j] = extent[1, j], extent[2, j]
