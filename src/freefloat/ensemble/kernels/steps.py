"""Steps of the Dormand-Prince method for motions in lock step.

Each motion has its own time, step and error. The independent variable is the arc length sigma of
the motion, which evens the steps out: dsigma / dt = sqrt(c + |f|^2), where f are the rates of
attitude and joints, and times are in units of the duration. The last part of a segment goes by
time, to end where the segment ends. A motion begins with a step of length
zero, which evaluates its first rates. A step across a singularity finds a determinant of the other
sign, is rejected and shortened until it is negligible.
"""

from __future__ import annotations

from freefloat.ensemble.kernels.cones import note_slacks
from freefloat.ensemble.kernels.extents import note_extents
from freefloat.ensemble.kernels.flow import TIME_WEIGHT, flow
from freefloat.ensemble.kernels.measures import ARM, measure_at, note_minimum, of_determinants
from freefloat.ensemble.kernels.records import (
    BY_TIME,
    FORWARD,
    FRESH,
    HIGHEST,
    LARGEST,
    LAST_ERROR,
    LEG,
    LOWEST,
    POSITIVE,
    SIGN,
    SMALLEST,
    SPEED,
    STEP,
    TOLERANCE,
    VALUE,
    Buffers,
    ProblemTables,
)
from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.factors import is_singular
from freefloat.lockstep.lanes import (
    Float,
    Mask,
    any_of,
    bits,
    magnitude,
    maximum,
    minimum,
    select,
    sqrt,
)
from freefloat.lockstep.tables import Table, subtable

_LAST_PART = 0.7
"""A step by arc length over more than this part of what remains of a segment goes by time."""
_SHORTEST_STEP, _SINGULAR_STEP = 1e-11, 1e-7
"""Lengths of negligible steps, and of steps across a singularity, in units of the duration."""


@inner
def attempt(problem: ProblemTables, extremes: bool, work: Buffers) -> tuple[int, int, int]:
    """Attempt one step of each motion.

    Args:
        problem: Data of the problem.
        extremes: Whether extreme values between the ends of steps count, too.
        work: Workspace.

    Returns:
        Bits of the motions that took the step, of motions that arrived at the end of their segment,
        and of motions that ended at a singularity.
    """
    robot, measure, status, n = problem.robot, problem.measure, work.status, problem.robot.n
    fresh = status[FRESH] > 0.0
    dt, whole = step_length(n, work)
    determinant, det_D, regular = make_stages(problem, dt, work)
    error = error_of(problem, dt, work)
    early = (status[BY_TIME] > 0.0) | (status[FORWARD] * (status[LEG] - work.at[4 + n]) > 0.0)
    accepted = (regular & early & (error < 1.0)) | fresh
    ended = fresh & is_singular(robot.m, work.solver.S, work.solver.scales)
    if measure.code < ARM:
        value = of_determinants(measure, determinant, det_D)
    else:
        value = measure_at(robot, measure, subtable(work.at, 4, 1), work)
    size = magnitude(determinant)
    if any_of(fresh):
        begin_motions(fresh, determinant, value, work)
    value *= status[SIGN]
    note_minimum(problem, dt, value, accepted, work)
    note_slacks(problem, dt, fresh, accepted, work)
    note_extents(problem, dt, accepted, extremes, work)
    status[VALUE] = select(accepted, value, status[VALUE])
    status[HIGHEST] = select(accepted, maximum(status[HIGHEST], value), status[HIGHEST])
    status[SMALLEST] = select(accepted, minimum(status[SMALLEST], size), status[SMALLEST])
    status[LARGEST] = select(accepted, maximum(status[LARGEST], size), status[LARGEST])
    advance(problem, accepted, whole, work)
    control_step(fresh, accepted, regular & early, dt, error, status)
    shortest = select(regular, _SHORTEST_STEP, _SINGULAR_STEP)
    ended = ended | (~accepted & (status[STEP] * magnitude(work.K[4 + n, 0]) < shortest))
    ended = ended | (accepted & (status[LOWEST] <= 0.0))
    if robot.m < n:
        ended = ended | (accepted & (status[SPEED] > robot.singular_speed))
    return bits(accepted), bits(accepted & whole), bits(ended)


@inlined
def step_length(n: int, work: Buffers) -> tuple[Float, Mask]:
    """The length of the next step, by arc length or by time, and whether it ends the segment."""
    status, K = work.status, work.K
    remaining = magnitude(status[LEG] - work.y[4 + n])
    pace = magnitude(K[4 + n, 0])
    fresh, by_time = status[FRESH] > 0.0, status[BY_TIME] > 0.0
    change = ~fresh & ~by_time & (status[STEP] * pace > _LAST_PART * remaining)
    if any_of(change):
        for j in range(5 + n):
            K[j, 0] = select(change, K[j, 0] / pace, K[j, 0])
        status[STEP] = select(change, status[STEP] * pace, status[STEP])
        by_time = by_time | change
        status[BY_TIME] = select(by_time, 1.0, 0.0)
    step = status[STEP]
    whole = by_time & (step >= remaining) & ~fresh
    step = select(by_time & (step > 0.5 * remaining), 0.5 * remaining, step)
    step = select(whole, remaining, step)
    return select(fresh, 0.0, step), whole


@inlined
def make_stages(problem: ProblemTables, dt: Float, work: Buffers) -> tuple[Float, Float, Mask]:
    """Compute the stages of a step but the first, and its end in ``work.at``.

    Returns:
        det S* and det D at the end, and where det S* keeps its sign.
    """
    robot, tableau, K, y, at = problem.robot, problem.tableau, work.K, work.y, work.at
    determinant, det_D, regular = dt, dt, dt >= 0.0
    for s in range(1, 7):
        for j in range(5 + robot.n):
            total = K[j, 0] * tableau[s, 0]
            for i in range(1, s):
                total += K[j, i] * tableau[s, i]
            at[j] = y[j] + dt * total
        determinant, det_D = flow(robot, problem.course, problem.null_space, at, work, s)
        regular = regular & (determinant * work.status[POSITIVE] > 0.0)
    return determinant, det_D, regular


@inlined
def error_of(problem: ProblemTables, dt: Float, work: Buffers) -> Float:
    """Errors of a step relative to the tolerances, in SciPy's norm.

    Time counts as in the arc length: an error of the time is one of the end-effector's position.
    """
    tableau, K, y, at, T = problem.tableau, work.K, work.y, work.at, 4 + problem.robot.n
    square = 0.0 * dt
    for j in range(T + 1):
        error = K[j, 0] * tableau[7, 0]
        for s in range(1, 7):
            error += K[j, s] * tableau[7, s]
        if j < T:
            error /= 1.0 + maximum(magnitude(y[j]), magnitude(at[j]))
            square += error * error
        else:
            square += error * error * TIME_WEIGHT
    return dt * sqrt(square / T) / work.status[TOLERANCE]


@inlined
def begin_motions(fresh: Mask, determinant: Float, value: Float, work: Buffers) -> None:
    """Write the first values of motions."""
    status, sign = work.status, select(value < 0.0, -1.0, 1.0)
    status[SIGN] = select(fresh, sign, status[SIGN])
    status[POSITIVE] = select(fresh, select(determinant > 0.0, 1.0, -1.0), status[POSITIVE])
    for row in (VALUE, LOWEST, HIGHEST):
        status[row] = select(fresh, value * sign, status[row])
    for row in (SMALLEST, LARGEST):
        status[row] = select(fresh, magnitude(determinant), status[row])


@inlined
def advance(problem: ProblemTables, accepted: Mask, whole: Mask, work: Buffers) -> None:
    """Go on from the ends of accepted steps."""
    y, at, K, status, T = work.y, work.at, work.K, work.status, 4 + problem.robot.n
    norm = sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2] + at[3] * at[3])
    for j in range(4):
        at[j] = at[j] / norm
    at[T] = select(whole, status[LEG], at[T])
    for j in range(T + 1):
        y[j] = select(accepted, at[j], y[j])
        K[j, 0] = select(accepted, K[j, 6], K[j, 0])


@inlined
def control_step(
    fresh: Mask, accepted: Mask, possible: Mask, dt: Float, error: Float, status: Table
) -> None:
    """Choose the next step: proportional-integral control, see Hairer and Wanner (1996), IV.2.

    A step that crosses a singularity or the end of a segment is not ``possible``.
    """
    error = maximum(select(error < 1e30, error, 1e30), 1e-10)
    eighth = sqrt(sqrt(sqrt(error)))
    grow = minimum(0.9 * sqrt(sqrt(sqrt(sqrt(status[LAST_ERROR])))) / eighth, 10.0)
    shrink = select(possible, maximum(0.9 / (eighth * eighth), 0.2), 0.4)
    status[STEP] = select(fresh, status[STEP], dt * select(accepted, grow, shrink))
    status[LAST_ERROR] = select(accepted & ~fresh, error, status[LAST_ERROR])
    status[FRESH] = 0.0
