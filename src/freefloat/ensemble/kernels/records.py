"""Records that the kernels read and write: arrays for their caller, tables in the kernels."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.lanes import WIDTH
from freefloat.lockstep.tables import Table, below, first_if_none, floats, lanes, set_lane
from freefloat.so3 import Array

FRAME_COLUMNS, BODY_COLUMNS, JOINT_COLUMNS, CONE_COLUMNS = 6, 10, 15, 13
"""Numbers of columns of ``Robot.joints``, of bodies, ``Workspace.momenta`` and ``Cones.table``."""
BASE, TOTAL_MASS, REACH, BODIES = 0, 12, 13, 14
"""First places of what ``Robot.properties`` has: link frame 0 in the spacecraft frame, x, y and z
axes and origin; total mass; reach; rows of the bodies; coefficients of the measure ``arm``."""
(
    SEGMENT, LEG, FORWARD, STEP, BY_TIME, FRESH, TOLERANCE, LAST_ERROR, POSITIVE, SIGN, VALUE,
    LOWEST, LOWEST_AT, HIGHEST, SMALLEST, LARGEST, SPEED, STATUS_ROWS,
) = range(18)  # fmt: skip
"""Rows of ``Workspace.status``: segment and the time at which the motion leaves it; direction and
length of the next step, whether it goes by time, whether it is the first; tolerance, and error of
the last step; signs of det S* and of the measure at the beginning; measure at the last step, its
minimum and the time of it, its maximum; smallest and largest magnitude of det S*; largest rate."""


PEAK, PEAK_SEGMENT, STATE = 0, 1, 2
"""Places of a rate in ``Workspace.peaks``: its square by the interpolant, in units of the duration,
then the segment and the state there."""


class Arms(NamedTuple):
    """Further arms that move along joint curves, as part of the spacecraft."""

    number: int  # of cells of equal duration; 0 where no further arm moves
    density: float  # cells per second
    cells: Table  # cubics of each cell, highest power first: first moment in link frame 0, angular
    # momentum relative to the spacecraft and about its origin, in its frame, inertia as the first


class Course(NamedTuple):
    """The end-effector's path and its timing."""

    duration: float
    segments: Table  # of the time law, one after the other, see freefloat.ensemble.kernels.flow
    number: int
    degree: int  # of the time law
    cells: Table  # the tangent by s: six cubics of each cell, highest power first
    single_cell: bool


class SecondArm(NamedTuple):
    """A second arm that follows a path of its own.

    Its joints and bodies are behind those of the first one. The spacecraft is a row of mass, first
    moment and inertia.
    """

    joints: int  # number of joints of the first arm
    masses: Table  # of the arms, without the spacecraft, (2,)
    root: Table  # the spacecraft in its own frame, (1, 10)
    root_in_base: Table  # the spacecraft in link frame 0 of this arm, (1, 10)
    base: Table  # link frame 0 in the spacecraft frame, (4, 3)
    tool: Table
    across: Table  # as of Robot
    course: Course


class Robot(NamedTuple):
    """A robot and its task, see :class:`freefloat.ensemble.link_frames.LinkFrames`."""

    joints: Table  # (n, 6)
    properties: Table  # what may differ between the robots of the motions, one row
    tool: Table
    rows: Table  # of the end-effectors' twists that the task prescribes, (m,)
    n: int
    m: int
    planar: bool
    pointing: bool
    singular_speed: float  # of joints per duration, above which a redundant arm is singular
    across: Table  # x and y axes of the end-effector, for the task ``pointing``, (2, 3)
    arms: Arms
    second: SecondArm | None


@inlined
def bodies_of(robot: Robot) -> Table:
    """Rows of mass, first moment and inertia of the bodies, in their link frames."""
    return below(robot.properties, BODIES, BODY_COLUMNS)


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
    damped_below: float  # of the metric ``base``


class Cones(NamedTuple):
    """Limits of attitude."""

    number: int  # of the limits
    duration: float  # of the path
    table: Table  # see freefloat.ensemble.kernels.cones


class Problem(NamedTuple):
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
    momenta: Array  # angular momentum, that of wheels, and the drift, (K, 9)
    robots: Array | None  # rows like ``Robot.properties``, (K, C); None where all are equal
    starts: Array
    goals: Array
    stop_below: float
    stricter: bool  # whether all begin with the tolerance of those with small minima
    extremes: bool  # whether extreme values are those between the ends of steps, too
    moments: Array  # their times, see ``EnsembleIntegrator.integrate``; empty where not asked for


class Workspace(NamedTuple):
    """Workspace of one thread."""

    y: Table  # attitude, joints and time in units of the duration, (5 + n,)
    at: Table  # the same at the end of a step
    K: Table  # derivatives of the stages, (5 + n, 7)
    weights: Table  # of the interpolant
    inside: Table  # attitude, joints and time inside a step
    status: Table
    h: Table  # angular momentum, that of wheels in the spacecraft frame, and the drift
    extent: Table  # of each joint, the largest rate, minus the smallest and the largest value;
    # largest rate of attitude
    moments: Table  # their times in units of the duration
    peaks: Table  # where the rates of joints and attitude are largest, (1 + n, 7 + n)
    momenta: Table  # see freefloat.ensemble.kernels.equation
    centre: Table  # of mass; then the second end-effector from there
    S: Table  # columns of S* in rows, then its factors, (n, 6), of two arms (n, 12)
    scales: Table
    b: Table
    rates: Table
    metric: Table  # this and the following are for redundant arms
    basis: Table
    normal: Table
    right: Table
    column: Table
    gradient: Table
    initial: Table  # attitude; this and the following are for limits of attitude
    slacks: Table
    across: Table  # x and y axes of the end-effector, for the task ``pointing``
    properties: Table  # of the motions' robots, see ``Robot.properties``; empty where all are equal
    carried: Table  # linear and angular momentum of further arms, relative to the spacecraft
    second_twist: Table  # of the second end-effector, spacecraft frame


def make_workspace(n: int, m: int, cones: int = 0, properties: int = 0, arms: int = 1) -> Workspace:
    """Workspace for a robot of n joints and a task of m rows.

    Args:
        n: Number of joints.
        m: Number of the task's rows.
        cones: Number of limits of attitude.
        properties: Number of properties that differ between the motions' robots.
        arms: Number of arms that follow paths, 1 or 2.
    """
    r = n - m
    shapes = (
        (5 + n,), (5 + n,), (5 + n, 7), (7,), (5 + n,), (STATUS_ROWS,), (9,), (1 + 3 * n,),
        (1 + 3 * n,), ((1 + n) * (STATE + 5 + n),),
        (n, JOINT_COLUMNS), (arms, 3), (n, 6 * arms), (6 * arms,), (6 * arms,), (n,), (n * n,),
        (n * r,), (r * r,), (2 * r,), (n,), (n,), (4,), (3 * cones,),
        (2 * arms, 3), (properties,), (2, 3), (2, 3),
    )  # fmt: skip
    return Workspace(*(np.zeros((*shape, WIDTH)) for shape in shapes))


@inner
def workspace_in_tables(work: Workspace, second: SecondArm | None) -> Workspace:
    """A workspace's arrays as tables."""
    return Workspace(
        lanes(work.y, 1), lanes(work.at, 1), lanes(work.K, 7), lanes(work.weights, 1),
        lanes(work.inside, 1), lanes(work.status, 1), lanes(work.h, 1), lanes(work.extent, 1),
        lanes(work.moments, 1), lanes(work.peaks, 1), lanes(work.momenta, JOINT_COLUMNS),
        lanes(work.centre, 3),
        first_if_none(second, lanes(work.S, 6), lanes(work.S, 12)),
        lanes(work.scales, 1), lanes(work.b, 1), lanes(work.rates, 1), lanes(work.metric, 1),
        lanes(work.basis, 1), lanes(work.normal, 1), lanes(work.right, 1), lanes(work.column, 1),
        lanes(work.gradient, 1), lanes(work.initial, 1),
        lanes(work.slacks, 1), lanes(work.across, 3), lanes(work.properties, 1),
        lanes(work.carried, 3), lanes(work.second_twist, 3),
    )  # fmt: skip


@inner
def load_system(motions: Motions, k: int, lane: int, work: Workspace) -> None:
    """Write momenta and drift of motion k, and the properties of its robot."""
    for j in range(9):
        set_lane(work.h, j, lane, motions.momenta[k, j])
    load_robot(motions.robots, k, lane, work)


@inner
def load_robot(robots: Array | None, k: int, lane: int, work: Workspace) -> None:
    """Write the properties of the robot of motion k, unless those of all are equal."""
    if robots is not None:
        for j in range(robots.shape[1]):
            set_lane(work.properties, j, lane, robots[k, j])


@inner
def robot_in_tables(robot: Robot, robots: Array | None, work: Workspace) -> Robot:
    """A robot's arrays as tables; the properties of robots that differ are those in the lanes."""
    return Robot(
        floats(robot.joints, FRAME_COLUMNS),
        first_if_none(robots, floats(robot.properties, 1), work.properties),
        floats(robot.tool, 1), floats(robot.rows, 1), robot.n, robot.m, robot.planar,
        robot.pointing, robot.singular_speed, floats(robot.across, 3),
        Arms(robot.arms.number, robot.arms.density, floats(robot.arms.cells, 1)),
        _second_in_tables(robot.second),
    )  # fmt: skip


@inner
def _second_in_tables(second: Any) -> Any:
    if second is None:
        return None
    return SecondArm(
        second.joints, floats(second.masses, 1), floats(second.root, BODY_COLUMNS),
        floats(second.root_in_base, BODY_COLUMNS), floats(second.base, 3), floats(second.tool, 1),
        floats(second.across, 3), course_in_tables(second.course),
    )  # fmt: skip


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
def problem_in_tables(problem: Problem, robots: Array | None, work: Workspace) -> Problem:
    """A problem's arrays as tables; the properties of robots that differ are those in the lanes."""
    cones = problem.cones
    return Problem(
        robot_in_tables(problem.robot, robots, work), course_in_tables(problem.course),
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
        null_space.damped_below,
    )  # fmt: skip
