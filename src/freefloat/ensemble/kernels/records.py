"""Records that the kernels read and write: arrays for their caller, tables in the kernels."""

from __future__ import annotations

from typing import Any, NamedTuple

from freefloat.dynamics.kernels.robot import (
    Robot,
    Solver,
    load_robot,
    make_solver,
    robot_in_tables,
    solver_in_tables,
)
from freefloat.lockstep.compilation import inner
from freefloat.lockstep.tables import Table, floats, lanes, set_lane, workspace
from freefloat.so3 import Array

CONE_COLUMNS = 13
"""Number of columns of ``Cones.table``."""
(
    SEGMENT, LEG, FORWARD, STEP, BY_TIME, FRESH, TOLERANCE, LAST_ERROR, POSITIVE, SIGN, VALUE,
    LOWEST, LOWEST_AT, HIGHEST, SMALLEST, LARGEST, SPEED, STATUS_ROWS,
) = range(18)  # fmt: skip
"""Rows of ``Buffers.status``: segment and the time at which the motion leaves it; direction and
length of the next step, whether it goes by time, whether it is the first; tolerance, and error of
the last step; signs of det S* and of the measure at the beginning; measure at the last step, its
minimum and the time of it, its maximum; smallest and largest magnitude of det S*; largest rate."""


SYSTEM_ROWS = 12
"""Number of rows of ``Buffers.h``."""
SLACK_ROWS = 5
"""Number of rows of a limit in ``Buffers.slacks``."""
PEAK, PEAK_SEGMENT, STATE = 0, 1, 2
"""Places of a rate in ``Buffers.peaks``: its square by the interpolant, in units of the duration,
then the segment and the state there."""


class Course(NamedTuple):
    """The paths of the end-effectors and their timing."""

    duration: float
    segments: Table  # of the time law, one after the other, see freefloat.ensemble.kernels.flow;
    # path after path
    number: int  # of the segments of a path
    degree: int  # of the time law
    cells: Table  # the tangent by s: six cubics of each cell, highest power first
    single_cell: bool


class Measure(NamedTuple):
    """A singularity measure."""

    code: int
    terms: int
    multiples: Table  # of q2 and q3, see freefloat.ensemble.kernels.measures, (terms, 2)


class NullSpace(NamedTuple):
    """Settings of the null-space motion of a redundant arm."""

    metric: int
    toward: int
    gain: float
    bound: float
    weights: Table  # of the joints, (n,)
    middles: Table  # of the joint ranges, (n,)
    ranges: Table  # 1 where a joint has a range, otherwise 0, (n,)


class Cones(NamedTuple):
    """Limits of attitude."""

    number: int  # of the limits
    duration: float  # of the path
    table: Table  # see freefloat.ensemble.kernels.cones


class ProblemTables(NamedTuple):
    """Data common to all motions of a problem."""

    robot: Robot
    course: Course
    measure: Measure
    null_space: NullSpace | None  # None for the joint rates of least Euclidean norm
    tableau: Table
    cones: Cones


class Motions(NamedTuple):
    """Initial states and ends of motions, see ``EnsembleIntegrator.integrate``."""

    attitudes: Array
    joints: Array
    momenta: Array  # see ``Buffers.h``, (K, SYSTEM_ROWS)
    robots: Array | None  # rows like ``Robot.properties``, (K, C); None where all are equal
    starts: Array
    goals: Array
    stop_below: float
    stricter: bool  # whether all begin with the tolerance for small minima
    extremes: bool  # whether extreme values between the ends of steps count, too
    moments: Array  # times of extremes, see ``EnsembleIntegrator.integrate``; may be empty
    steps: Array  # of the only motion: their number, then at the ends of steps time, attitude and
    # joints, and rates of attitude and joints, in units of the duration, (M, 9 + 2 n); may be empty


class Buffers(NamedTuple):
    """Workspace of one thread."""

    solver: Solver  # of equation (4)
    y: Table  # attitude, joints and time in units of the duration, (5 + n,)
    at: Table  # attitude, joints and time at the end of a step
    K: Table  # derivatives of the stages, (5 + n, 7)
    weights: Table  # of the interpolant
    inside: Table  # attitude, joints and time inside a step
    status: Table
    h: Table  # angular momentum, momentum of wheels in the spacecraft frame, the drift, and how
    # much farther the path leads
    extent: Table  # of each joint, the largest rate, minus the smallest and the largest value;
    # largest rate of attitude
    moments: Table  # times of the extents in units of the duration
    peaks: Table  # where the rates of joints and attitude are largest, (1 + n, 7 + n)
    metric: Table  # this and the following are for redundant arms
    basis: Table
    normal: Table
    right: Table
    column: Table
    gradient: Table
    initial: Table  # attitude; this and the following are for limits of attitude
    slacks: Table


def make_workspace(n: int, m: int, cones: int = 0, properties: int = 0, arms: int = 1) -> Buffers:
    """Workspace for a robot of n joints and a task of m rows.

    Args:
        n: Number of joints.
        m: Number of the task's rows.
        cones: Number of limits of attitude.
        properties: Number of properties that differ between the motions' robots.
        arms: Number of arms that follow paths.
    """
    r = n - m
    shapes = (
        (5 + n,), (5 + n,), (5 + n, 7), (7,), (5 + n,), (STATUS_ROWS,), (SYSTEM_ROWS,),
        (1 + 3 * n,),
        (1 + 3 * n,), ((1 + n) * (STATE + 5 + n),),
        (n * n,), (n * r,), (r * r,), (2 * r,), (n,), (n,), (4,), (SLACK_ROWS * cones,),
    )  # fmt: skip
    return Buffers(make_solver(n, arms, properties), *workspace(*shapes))


@inner
def workspace_in_tables(work: Buffers) -> Buffers:
    """A workspace's arrays as tables."""
    return Buffers(
        solver_in_tables(work.solver), lanes(work.y, 1), lanes(work.at, 1), lanes(work.K, 7),
        lanes(work.weights, 1), lanes(work.inside, 1), lanes(work.status, 1), lanes(work.h, 1),
        lanes(work.extent, 1), lanes(work.moments, 1), lanes(work.peaks, 1),
        lanes(work.metric, 1), lanes(work.basis, 1), lanes(work.normal, 1),
        lanes(work.right, 1), lanes(work.column, 1),
        lanes(work.gradient, 1), lanes(work.initial, 1), lanes(work.slacks, 1),
    )  # fmt: skip


@inner
def load_system(motions: Motions, k: int, lane: int, work: Buffers) -> None:
    """Write momenta, drift and path of motion k, and the properties of its robot."""
    for j in range(SYSTEM_ROWS):
        set_lane(work.h, j, lane, motions.momenta[k, j])
    load_robot(motions.robots, k, lane, work.solver)


@inner
def course_in_tables(course: Course) -> Course:
    """A course's arrays as tables."""
    return Course(
        course.duration, floats(course.segments, 1), course.number, course.degree,
        floats(course.cells, 1), course.single_cell,
    )  # fmt: skip


@inner
def measure_in_tables(measure: Measure) -> Measure:
    """A measure's array as a table."""
    return Measure(measure.code, measure.terms, floats(measure.multiples, 2))


@inner
def problem_in_tables(problem: ProblemTables, robots: Array | None, work: Buffers) -> ProblemTables:
    """A problem's arrays as tables; the lanes have the properties of robots that differ."""
    cones = problem.cones
    return ProblemTables(
        robot_in_tables(problem.robot, robots, work.solver), course_in_tables(problem.course),
        measure_in_tables(problem.measure),
        _settings_in_tables(problem.null_space), floats(problem.tableau, 7),
        Cones(cones.number, cones.duration, floats(cones.table, CONE_COLUMNS)),
    )  # fmt: skip


@inner
def _settings_in_tables(null_space: Any) -> Any:
    if null_space is None:
        return None
    return NullSpace(
        null_space.metric, null_space.toward, null_space.gain, null_space.bound,
        floats(null_space.weights, 1), floats(null_space.middles, 1), floats(null_space.ranges, 1),
    )  # fmt: skip
