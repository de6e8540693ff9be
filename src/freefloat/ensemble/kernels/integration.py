"""Integration of (8) for many motions in lock step.

A motion ends at a singularity: a step across it finds a determinant of the other sign, is rejected and
shortened until it is negligible. Where a motion ends, the next one takes its place.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from freefloat.dynamics.kernels.compilation import compiled, inlined, inner
from freefloat.dynamics.redundancy import SINGULAR_SPEED
from freefloat.ensemble.kernels.equation import JOINT_COLUMNS, Robot
from freefloat.ensemble.kernels.flow import END, LAW, Course
from freefloat.ensemble.kernels.lanes import (
    WIDTH,
    any_of,
    bits,
    magnitude,
    maximum,
    minimum,
    select,
    sqrt,
)
from freefloat.ensemble.kernels.measures import GJM, SIGMA, SYSTEM, measure_at, of_determinants
from freefloat.ensemble.kernels.null_space import NullSpace
from freefloat.ensemble.kernels.steps import (
    BY_TIME, FORWARD, FRESH, HIGHEST, LARGEST, LAST_ERROR, LEG, LOWEST, LOWEST_AT, MOTION_ROWS,
    POSITIVE, SEGMENT, SIGN, SMALLEST, SPEED, STEP, TOLERANCE, VALUE, Measure, error_of,
    make_stages, note_minimum, step_length, _FIRST_STEP,
)  # fmt: skip
from freefloat.ensemble.kernels.tables import floats, get_lane, lanes, set_lane
from freefloat.so3 import Array, IntArray

if TYPE_CHECKING:
    from freefloat.ensemble.ensemble import EnsembleResult

COMPLETED, SINGULAR, MARGIN, FAILED = 0, 1, 2, 3
"""Codes of endings."""
UNREACHED = -1
"""Ending of an arm branch that does not exist at an attitude."""
_SHORTEST_STEP, _SINGULAR_STEP = 1e-11, 1e-7
"""Lengths of negligible steps, and of those across a singularity, in units of the duration."""
_MAX_STEPS = 20_000
_SMALL, _STRICTER, _UNDECIDED = 0.15, 0.1, 0.9


class Problem(NamedTuple):
    """Data common to all motions of a problem."""

    robot: Robot
    course: Course
    measure: Measure
    null_space: NullSpace | None
    tableau: object


class Motions(NamedTuple):
    """Initial states and ends of motions."""

    attitudes: Array
    joints: Array
    momenta: Array
    starts: Array
    goals: Array
    stop_below: float


class Workspace(NamedTuple):
    """Workspace of one thread: arrays for the caller, tables of ``Lanes`` in the kernels."""

    y: Array  # attitude, joints and time
    at: Array  # at the end of a step
    K: Array  # derivatives of the stages, (5 + n, 7)
    probe: Array  # joints and time inside a step
    weights: Array  # of the interpolant
    now: Array  # see freefloat.ensemble.kernels.steps
    h: Array  # angular momentum
    extent: Array  # largest rates, smallest and largest joint values, (n, 3)
    momenta: Array  # see freefloat.ensemble.kernels.equation
    centre: Array
    S: Array  # columns of S* in rows, then its factors, (n, 6)
    scales: Array
    b: Array
    rates: Array
    metric: Array  # (n, n); this and the following for redundant arms
    basis: Array
    normal: Array
    right: Array
    column: Array
    gradient: Array


def make_workspace(n: int, m: int) -> Workspace:
    """Workspace for a robot of n joints and a task of m rows."""
    r = n - m
    shapes = (
        (5 + n, 1), (5 + n, 1), (5 + n, 7), (1 + n, 1), (7, 1), (MOTION_ROWS, 1), (3, 1), (3 * n, 1),
        (n, JOINT_COLUMNS), (1, 3), (n, 6), (6, 1), (6, 1), (max(n, 6), 1), (n * n, 1), (n * r, 1),
        (r * r, 1), (2 * r, 1), (n, 1), (n, 1),
    )  # fmt: skip
    return Workspace(*(np.zeros((*shape, WIDTH)) for shape in shapes))


@inner
def in_tables(work):
    """A workspace's arrays as tables."""
    return Workspace(
        lanes(work.y, 1), lanes(work.at, 1), lanes(work.K, 7), lanes(work.probe, 1),
        lanes(work.weights, 1), lanes(work.now, 1), lanes(work.h, 1), lanes(work.extent, 1),
        lanes(work.momenta, 15), lanes(work.centre, 3), lanes(work.S, 6), lanes(work.scales, 1),
        lanes(work.b, 1), lanes(work.rates, 1), lanes(work.metric, 1), lanes(work.basis, 1),
        lanes(work.normal, 1), lanes(work.right, 1), lanes(work.column, 1), lanes(work.gradient, 1),
    )  # fmt: skip


@inner
def attempt(problem, work):
    """Attempt one step of each motion.

    Returns:
        Which motions arrived at the end of their segment, and which ended at a singularity.
    """
    robot, now, y, at, K = problem.robot, work.now, work.y, work.at, work.K
    n, T = robot.n, 4 + robot.n
    fresh = now[FRESH] > 0.0
    dt, whole = step_length(n, work)
    determinant, det_D, regular = make_stages(problem, dt, work)
    error = error_of(problem, dt, work)
    accepted = (regular & (error < 1.0)) | fresh
    if problem.measure.code < 2:
        value = of_determinants(problem.measure, determinant, det_D)
    else:
        for j in range(n):
            work.probe[j] = at[4 + j]
        value = measure_at(robot, problem.measure, work.probe, work)
    if any_of(fresh):
        begin_motions(fresh, determinant, value, work)
    value = value * now[SIGN]
    note_minimum(problem, dt, value, accepted, work)
    now[VALUE] = select(accepted, value, now[VALUE])
    now[HIGHEST] = select(accepted, maximum(now[HIGHEST], value), now[HIGHEST])
    size = magnitude(determinant)
    now[SMALLEST] = select(accepted, minimum(now[SMALLEST], size), now[SMALLEST])
    now[LARGEST] = select(accepted, maximum(now[LARGEST], size), now[LARGEST])
    advance(problem, accepted, whole, work)
    control_step(fresh, accepted, regular, dt, error, now)
    pace = magnitude(K[T, 0])
    shortest = select(regular, _SHORTEST_STEP, _SINGULAR_STEP)
    ended = ~accepted & (now[STEP] * pace < shortest)
    ended = ended | (accepted & (now[LOWEST] <= 0.0)) | (fresh & ~(size > 0.0))
    if robot.m < n:
        ended = ended | (accepted & (now[SPEED] > SINGULAR_SPEED))
    return bits(accepted & whole), bits(ended)


@inlined
def begin_motions(fresh, determinant, value, work):
    """Write the first values of motions."""
    now = work.now
    sign = select(value < 0.0, -1.0, 1.0)
    now[SIGN] = select(fresh, sign, now[SIGN])
    now[POSITIVE] = select(fresh, select(determinant > 0.0, 1.0, -1.0), now[POSITIVE])
    for row in (VALUE, LOWEST, HIGHEST):
        now[row] = select(fresh, value * sign, now[row])
    for row in (SMALLEST, LARGEST):
        now[row] = select(fresh, magnitude(determinant), now[row])


@inlined
def control_step(fresh, accepted, regular, dt, error, now):
    """Choose the next step: proportional-integral control, see Hairer and Wanner (1996), IV.2."""
    error = maximum(select(error < 1e30, error, 1e30), 1e-10)
    eighth = sqrt(sqrt(sqrt(error)))
    grow = minimum(0.9 * sqrt(sqrt(sqrt(sqrt(now[LAST_ERROR])))) / eighth, 10.0)
    shrink = select(regular, maximum(0.9 / (eighth * eighth), 0.2), 0.4)
    now[STEP] = select(fresh, now[STEP], dt * select(accepted, grow, shrink))
    now[LAST_ERROR] = select(accepted & ~fresh, error, now[LAST_ERROR])
    now[FRESH] = 0.0


@inlined
def advance(problem, accepted, whole, work):
    """Go on from the ends of accepted steps."""
    y, at, K, now, extent = work.y, work.at, work.K, work.now, work.extent
    n, T = problem.robot.n, 4 + problem.robot.n
    per = 1.0 / magnitude(K[T, 6])
    speed = 0.0 * per
    for j in range(n):
        rate = magnitude(K[4 + j, 6]) * per
        speed = maximum(rate, speed)
        extent[3 * j] = select(accepted, maximum(extent[3 * j], rate), extent[3 * j])
        extent[3 * j + 1] = select(accepted, minimum(extent[3 * j + 1], at[4 + j]), extent[3 * j + 1])
        extent[3 * j + 2] = select(accepted, maximum(extent[3 * j + 2], at[4 + j]), extent[3 * j + 2])
    now[SPEED] = speed
    scale = 1.0 / sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2] + at[3] * at[3])
    for j in range(4):
        at[j] = at[j] * scale
    at[T] = select(whole, now[LEG], at[T])
    for j in range(5 + n):
        y[j] = select(accepted, at[j], y[j])
        K[j, 0] = select(accepted, K[j, 6], K[j, 0])


@inner
def load_motion(problem, motions, k, lane, tolerance, work):
    """Put motion k into a lane."""
    n, duration, now = problem.robot.n, problem.course.duration, work.now
    for j in range(4):
        set_lane(work.y, j, lane, motions.attitudes[k, j])
    for j in range(n):
        set_lane(work.y, 4 + j, lane, motions.joints[k, j])
        for column, value in ((0, 0.0), (1, motions.joints[k, j]), (2, motions.joints[k, j])):
            set_lane(work.extent, 3 * j + column, lane, value)
    set_lane(work.y, 4 + n, lane, motions.starts[k] / duration)
    for j in range(5 + n):
        set_lane(work.K, j, lane, 0.0)
    for j in range(3):
        set_lane(work.h, j, lane, motions.momenta[k, j])
    start, goal = motions.starts[k], motions.goals[k]
    forward = 1.0 if goal >= start else -1.0
    course = problem.course
    stride, segment = LAW + 2 * (course.degree + 1), 0
    while segment < course.number - 1 and (
        course.segments[segment * stride + END] <= start
        if forward > 0.0 else course.segments[segment * stride + END] < start
    ):  # fmt: skip
        segment += 1
    for row, value in (
        (FORWARD, forward), (FRESH, 1.0), (BY_TIME, 1.0), (TOLERANCE, tolerance),
        (LAST_ERROR, 1e-4), (STEP, _FIRST_STEP), (LOWEST_AT, start / duration),
    ):  # fmt: skip
        set_lane(now, row, lane, value)
    enter_segment(problem, segment, goal, lane, work)


@inner
def enter_segment(problem, segment, goal, lane, work):
    """Let a motion go on in a segment of the time law, up to its end or the goal."""
    course, now = problem.course, work.now
    stride = LAW + 2 * (course.degree + 1)
    if get_lane(now, FORWARD, lane) > 0.0:
        leg = min(goal, course.segments[segment * stride + END])
    else:
        leg = max(goal, course.segments[(segment - 1) * stride + END] if segment > 0 else 0.0)
    set_lane(now, SEGMENT, lane, float(segment))
    set_lane(now, LEG, lane, leg / course.duration)


@inner
def go_by_sigma(n, lane, work):
    """Return a motion that goes by time to the variable sigma."""
    total = 20.0
    for j in range(4 + n):
        total += get_lane(work.K, j, lane) ** 2
    pace = total**-0.25
    for j in range(5 + n):
        set_lane(work.K, j, lane, get_lane(work.K, j, lane) * pace)
    set_lane(work.now, STEP, lane, get_lane(work.now, STEP, lane) / pace)
    set_lane(work.now, BY_TIME, lane, 0.0)


@inner
def store(problem, k, lane, ending, steps, work, out):
    """Write the results of the motion in a lane."""
    n, duration, now = problem.robot.n, problem.course.duration, work.now
    t = get_lane(work.y, 4 + n, lane) * duration
    out.endings[k], out.ended_at[k] = ending, t
    out.minimum[k] = get_lane(now, LOWEST, lane)
    out.minimum_at[k] = get_lane(now, LOWEST_AT, lane) * duration
    largest = get_lane(now, LARGEST, lane)
    ratio = get_lane(now, SMALLEST, lane) / largest if largest > 0.0 else 0.0
    if ending == SINGULAR:
        out.minimum[k], out.minimum_at[k], ratio = 0.0, t, 0.0
    out.determinant_ratios[k] = ratio
    out.evaluations[k] += 6 * steps
    for j in range(4):
        out.attitudes[k, j] = get_lane(work.y, j, lane)
    for j in range(n):
        out.joints[k, j] = get_lane(work.y, 4 + j, lane)
        out.rates[k, j] = get_lane(work.extent, 3 * j, lane) / duration
        out.lower[k, j] = get_lane(work.extent, 3 * j + 1, lane)
        out.upper[k, j] = get_lane(work.extent, 3 * j + 2, lane)


@inner
def integrate_queue(problem, motions, queue, tolerance, work, out, again):
    """Integrate the motions whose numbers are in a queue.

    Returns:
        Number of motions to integrate again with a stricter tolerance, whose numbers are in
        ``again``: where the minimum of the measure is small relative to its maximum, small errors of
        the motion are large relative to it.
    """
    now, n = work.now, problem.robot.n
    owners, steps = np.full(WIDTH, -1), np.zeros(WIDTH, np.int64)
    following, busy, repeated = 0, 0, 0
    for lane in range(WIDTH):
        load_motion(problem, motions, queue[min(lane, len(queue) - 1)], lane, tolerance, work)
        if lane < len(queue):
            owners[lane], busy, following = queue[lane], busy + 1, following + 1
    while busy > 0:
        arrived, singular = attempt(problem, work)
        below = bits(now[LOWEST] < motions.stop_below)
        for lane in range(WIDTH):
            k, bit = owners[lane], 1 << lane
            if k < 0:
                continue
            steps[lane] += 1
            ending = -1
            if singular & bit:
                ending = SINGULAR
            elif below & bit:
                ending = MARGIN
            elif arrived & bit:
                if get_lane(now, LEG, lane) == motions.goals[k] / problem.course.duration:
                    ending = COMPLETED
                else:
                    segment = get_lane(now, SEGMENT, lane) + get_lane(now, FORWARD, lane)
                    enter_segment(problem, int(segment), motions.goals[k], lane, work)
                    go_by_sigma(n, lane, work)
            elif steps[lane] > _MAX_STEPS:
                ending = FAILED
            elif steps[lane] == 1:
                go_by_sigma(n, lane, work)
            if ending < 0:
                continue
            store(problem, k, lane, ending, steps[lane], work, out)
            undecided = ending == COMPLETED or (
                ending == MARGIN and out.minimum[k] > _UNDECIDED * motions.stop_below
            )
            if undecided and out.minimum[k] < _SMALL * get_lane(now, HIGHEST, lane):
                again[repeated] = k
                repeated += 1
            owners[lane], steps[lane] = -1, 0
            if following < len(queue):
                owners[lane] = queue[following]
                load_motion(problem, motions, owners[lane], lane, tolerance, work)
                following += 1
            else:
                busy -= 1
    return repeated


@inner
def settings_in_tables(null_space):
    """The arrays of a redundant arm's settings as tables."""
    if null_space is None:
        return None
    return NullSpace(
        null_space.metric, null_space.toward, null_space.gain, null_space.bound,
        floats(null_space.weights, 1), floats(null_space.middles, 1), floats(null_space.ranges, 1),
    )  # fmt: skip


@compiled
def integrate_many(
    problem: Problem, motions: Motions, first: int, beyond: int, tolerance: float,
    workspace: Workspace, out: EnsembleResult,
) -> None:  # fmt: skip
    """Integrate motions ``first`` to ``beyond`` and write their results."""
    robot, course, measure = problem.robot, problem.course, problem.measure
    tables = Problem(
        Robot(
            floats(robot.bodies, 16), floats(robot.base, 3), floats(robot.tool, 1),
            floats(robot.rows, 1), robot.n, robot.m, robot.planar, robot.mass,
        ),
        Course(
            course.duration, floats(course.segments, 1), course.number, course.degree,
            floats(course.cells, 1), course.single_cell,
        ),
        Measure(measure.code, measure.reach, measure.terms, floats(measure.polynomial, 4)),
        settings_in_tables(problem.null_space), floats(problem.tableau, 7),
    )  # fmt: skip
    work = in_tables(workspace)
    queue, again = np.arange(first, beyond), np.zeros(beyond - first, np.int64)
    repeated = integrate_queue(tables, motions, queue, tolerance, work, out, again)
    if repeated > 0:
        queue = again[:repeated].copy()
        integrate_queue(tables, motions, queue, _STRICTER * tolerance, work, out, again)
