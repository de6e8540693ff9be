"""Integration of (8) for many motions in lock step: where one ends, the next takes its place."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from freefloat.ensemble.endings import COMPLETED, FAILED, MARGIN, MAX_STEPS, SINGULAR
from freefloat.ensemble.kernels.cones import LOWEST as LEAST_SLACK
from freefloat.ensemble.kernels.cones import LOWEST_AT as SLACK_AT
from freefloat.ensemble.kernels.extents import evaluate_peaks
from freefloat.ensemble.kernels.flow import END, LAW, TIME_WEIGHT
from freefloat.ensemble.kernels.records import (
    BY_TIME,
    FORWARD,
    FRESH,
    HIGHEST,
    LARGEST,
    LAST_ERROR,
    LEG,
    LOWEST,
    LOWEST_AT,
    PEAK,
    SEGMENT,
    SLACK_ROWS,
    SMALLEST,
    STATE,
    STEP,
    TOLERANCE,
    Buffers,
    Motions,
    ProblemTables,
    load_system,
    problem_in_tables,
    workspace_in_tables,
)
from freefloat.ensemble.kernels.steps import attempt
from freefloat.lockstep.compilation import compiled, inner
from freefloat.lockstep.lanes import WIDTH, bits
from freefloat.lockstep.tables import get_lane, set_lane
from freefloat.so3 import Array

if TYPE_CHECKING:
    from freefloat.ensemble.result import EnsembleResult

_CONTINUES = -1
_FIRST_STEP, _FIRST_ERROR = 0.02, 1e-4
"""Length of the first step, in units of the duration, and error of the one before it."""
_SMALL, _UNDECIDED, _GRAZING = 0.15, 0.9, 1e-5
"""Fractions: of the maximum of the measure and of the margin, below and above which a minimum is
undecided; of the largest det S*, below which a motion may pass a singularity closely."""
_STRICTER, _STRICTEST = 0.1, 1e-4
"""Reductions of the tolerance of motions that are integrated again, the second for motions that may
pass a singularity closely."""


@compiled
def integrate_many(
    problem: ProblemTables, motions: Motions, first: int, beyond: int, tolerance: float,
    workspace: Buffers, out: EnsembleResult,
) -> None:  # fmt: skip
    """Integrate motions ``first`` to ``beyond`` and write their results.

    Where the minimum of the measure is small relative to its maximum along the motion, small errors
    of the motion are large relative to it: such motions are integrated again with a stricter
    tolerance, unless all begin with that. So are motions that become singular after having come so
    close to a singularity that with exact numbers they may pass it.
    """
    work = workspace_in_tables(workspace)
    problem = problem_in_tables(problem, motions.robots, work)
    begun, following = _STRICTER if motions.stricter else 1.0, min(first + WIDTH, beyond)
    busy, recorded = following - first, 0
    owners, steps = np.full(WIDTH, -1), np.zeros(WIDTH, np.int64)
    factors, peaks = np.full(WIDTH, begun), np.empty((beyond - first, len(workspace.peaks)))
    for lane in range(busy):
        owners[lane] = first + lane
        load_motion(problem, motions, owners[lane], lane, begun * tolerance, work)
    while busy > 0:
        accepted, arrived, singular = attempt(problem, motions.extremes, work)
        below = bits(work.status[LOWEST] < motions.stop_below)
        for lane in range(WIDTH):
            k, bit = owners[lane], 1 << lane
            if k < 0:
                continue
            steps[lane] += 1
            if accepted & bit and len(motions.steps) > 0:
                recorded += 1
                record_step(problem, motions.steps[recorded], lane, work)
            ending = _CONTINUES
            if singular & bit:
                ending = SINGULAR
            elif below & bit:
                ending = MARGIN
            elif arrived & bit or steps[lane] == 1:
                ending = go_on(problem, motions.goals[k], arrived & bit != 0, lane, work)
            elif steps[lane] > MAX_STEPS:
                ending = FAILED
            if ending == _CONTINUES:
                continue
            store(problem, motions, k, lane, ending, steps[lane], work, peaks[k - first], out)
            steps[lane] = 0
            if len(motions.steps) > 0:
                motions.steps[0, 0], recorded = recorded, 0
            again = stricter_factor(motions, k, lane, work, out) if factors[lane] == begun else 1.0
            factors[lane] = begun
            if again < begun:
                factors[lane] = again
            elif following < beyond:
                owners[lane], following = following, following + 1
            else:
                owners[lane], busy = -1, busy - 1
                continue
            load_motion(problem, motions, owners[lane], lane, factors[lane] * tolerance, work)
    if motions.extremes:
        evaluate_peaks(problem, motions, first, peaks, work, out)


@inner
def load_motion(
    problem: ProblemTables, motions: Motions, k: int, lane: int, tolerance: float, work: Buffers
) -> None:
    """Begin motion k in a lane."""
    n, course, status = problem.robot.n, problem.course, work.status
    start, goal = motions.starts[k], motions.goals[k]
    for j in range(4):
        set_lane(work.y, j, lane, motions.attitudes[k, j])
        set_lane(work.initial, j, lane, motions.attitudes[k, j])
    for j in range(n):
        q = motions.joints[k, j]
        set_lane(work.y, 4 + j, lane, q)
        set_lane(work.extent, 3 * j, lane, 0.0)
        set_lane(work.extent, 3 * j + 1, lane, -q)
        set_lane(work.extent, 3 * j + 2, lane, q)
    set_lane(work.y, 4 + n, lane, start / course.duration)
    for j in range(5 + n):
        set_lane(work.K, j, lane, 0.0)
    set_lane(work.extent, 3 * n, lane, 0.0)
    for i in range(1 + 3 * n):
        set_lane(work.moments, i, lane, start / course.duration)
    for i in range(problem.cones.number):
        set_lane(work.slacks, SLACK_ROWS * i + SLACK_AT, lane, start / course.duration)
    for i in range(n + 1):
        set_lane(work.peaks, i * (STATE + 5 + n) + PEAK, lane, 0.0)
    load_system(motions, k, lane, work)
    forward, segment = 1.0 if goal >= start else -1.0, 0
    stride = LAW + 2 * (course.degree + 1)
    while segment < course.number - 1 and (
        course.segments[segment * stride + END] <= start
        if forward > 0.0 else course.segments[segment * stride + END] < start
    ):  # fmt: skip
        segment += 1
    for row, value in (
        (FORWARD, forward), (FRESH, 1.0), (BY_TIME, 1.0), (TOLERANCE, tolerance),
        (LAST_ERROR, _FIRST_ERROR), (STEP, _FIRST_STEP), (LOWEST_AT, start / course.duration),
    ):  # fmt: skip
        set_lane(status, row, lane, value)
    enter_segment(problem, segment, goal, lane, work)


@inner
def enter_segment(
    problem: ProblemTables, segment: int, goal: float, lane: int, work: Buffers
) -> None:
    """Let a motion go on in a segment of the time law, up to its end or the goal."""
    course, stride = problem.course, LAW + 2 * (problem.course.degree + 1)
    if get_lane(work.status, FORWARD, lane) > 0.0:
        leg = min(goal, course.segments[segment * stride + END])
    else:
        leg = max(goal, course.segments[(segment - 1) * stride + END] if segment > 0 else 0.0)
    set_lane(work.status, SEGMENT, lane, float(segment))
    set_lane(work.status, LEG, lane, leg / course.duration)


@inner
def go_on(problem: ProblemTables, goal: float, arrived: bool, lane: int, work: Buffers) -> int:
    """Let a motion go on by arc length, in the next segment if it arrived at the end of one.

    Returns:
        The ending of a motion that has reached its goal.
    """
    status, K = work.status, work.K
    if arrived:
        if get_lane(status, LEG, lane) == goal / problem.course.duration:
            return COMPLETED
        segment = get_lane(status, SEGMENT, lane) + get_lane(status, FORWARD, lane)
        enter_segment(problem, int(segment), goal, lane, work)
    total = TIME_WEIGHT
    for j in range(4 + problem.robot.n):
        total += get_lane(K, j, lane) ** 2
    pace = 1.0 / math.sqrt(total)
    for j in range(5 + problem.robot.n):
        set_lane(K, j, lane, get_lane(K, j, lane) * pace)
    set_lane(status, STEP, lane, get_lane(status, STEP, lane) / pace)
    set_lane(status, BY_TIME, lane, 0.0)
    return _CONTINUES


@inner
def record_step(problem: ProblemTables, row: Array, lane: int, work: Buffers) -> None:
    """Write a row of ``Motions.steps``."""
    count, K = 4 + problem.robot.n, work.K
    row[0] = get_lane(work.y, count, lane)
    for j in range(count):
        row[1 + j] = get_lane(work.y, j, lane)
        row[1 + count + j] = get_lane(K, j, lane) / get_lane(K, count, lane)


@inner
def stricter_factor(
    motions: Motions, k: int, lane: int, work: Buffers, out: EnsembleResult
) -> float:
    """Reduction of the tolerance with which a motion is integrated again; 1 where it is not."""
    status, ending, lowest = work.status, out.endings[k], out.minimum[k]
    if ending == SINGULAR:
        closest = get_lane(status, SMALLEST, lane)
        return _STRICTEST if 0.0 < closest < _GRAZING * get_lane(status, LARGEST, lane) else 1.0
    near = ending == MARGIN and lowest > _UNDECIDED * motions.stop_below
    small = lowest < _SMALL * get_lane(status, HIGHEST, lane)
    return _STRICTER if (ending == COMPLETED or near) and small else 1.0


@inner
def store(
    problem: ProblemTables, motions: Motions, k: int, lane: int, ending: int, steps: int,
    work: Buffers, peaks: Array, out: EnsembleResult,
) -> None:  # fmt: skip
    """Write the results of the motion in a lane, and where its rates are largest."""
    n, duration, status = problem.robot.n, problem.course.duration, work.status
    t = get_lane(work.y, 4 + n, lane) * duration
    largest = get_lane(status, LARGEST, lane)
    ratio = get_lane(status, SMALLEST, lane) / largest if largest > 0.0 else 0.0
    singular = ending == SINGULAR
    out.endings[k], out.ended_at[k] = ending, t
    out.minimum[k] = 0.0 if singular else get_lane(status, LOWEST, lane)
    out.minimum_at[k] = t if singular else get_lane(status, LOWEST_AT, lane) * duration
    out.determinant_ratios[k] = 0.0 if singular else ratio
    out.evaluations[k] += 6 * steps
    for j in range(4):
        out.attitudes[k, j] = get_lane(work.y, j, lane)
    for j in range(n):
        out.joints[k, j] = get_lane(work.y, 4 + j, lane)
        out.rates[k, j] = get_lane(work.extent, 3 * j, lane) / duration
        out.lower[k, j] = -get_lane(work.extent, 3 * j + 1, lane)
        out.upper[k, j] = get_lane(work.extent, 3 * j + 2, lane)
    out.base_rate[k] = 2.0 * get_lane(work.extent, 3 * n, lane) / duration
    for i in range(len(peaks)):
        peaks[i] = get_lane(work.peaks, i, lane)
    for i in range(problem.cones.number):
        out.slacks[k, i] = get_lane(work.slacks, SLACK_ROWS * i + LEAST_SLACK, lane)
    if motions.extremes:
        for i in range(1 + 3 * n):
            motions.moments[k, i] = get_lane(work.moments, i, lane) * duration
        for i in range(problem.cones.number):
            at = get_lane(work.slacks, SLACK_ROWS * i + SLACK_AT, lane) * duration
            motions.moments[k, 1 + 3 * n + i] = at
