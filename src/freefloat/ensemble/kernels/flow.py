"""The right-hand sides of (8b) and (8c) for motions in lock step: rates of joints and attitude."""

from __future__ import annotations

from freefloat.dynamics.kernels.cubics import SIX, six_cubics, value
from freefloat.dynamics.kernels.equation import solve_rates, spacecraft_rate
from freefloat.dynamics.kernels.robot import Robot
from freefloat.ensemble.kernels.null_space import add_null_space_motion, gradient
from freefloat.ensemble.kernels.records import BY_TIME, FORWARD, SEGMENT, Buffers, Course, NullSpace
from freefloat.lockstep.compilation import inlined
from freefloat.lockstep.lanes import Float, floor, maximum, minimum, select, sqrt
from freefloat.lockstep.tables import Table, pick, set_vector, subtable
from freefloat.lockstep.vectors import Vector, components, cross, dot, vector

END, ORIGIN, FREQUENCY, FIRST_S, DENSITY, FIRST_CELL, CELLS, LAW = 0, 1, 2, 3, 4, 5, 6, 7
"""Columns of a segment; its law has the coefficients of s, then of the derivative of s."""


TIME_WEIGHT = 20.0
"""The constant c of the arc length, see :mod:`freefloat.ensemble.kernels.steps`."""


@inlined
def of_segment(course: Course, e: int, segment: Float, column: int) -> Float:
    """A column of the segments of the motions, of the path with number ``e``."""
    stride = LAW + 2 * (course.degree + 1)
    column += e * course.number * stride
    if course.number == 1:
        return 0.0 * segment + course.segments[column]
    return pick(course.segments, segment * stride + column)


@inlined
def twist_at(course: Course, e: int, segment: Float, t: Float) -> tuple[Vector, Vector, Float]:
    """Velocity, angular velocity and path speed ds/dt of end-effector ``e``, frame of the path."""
    since = t * course.duration - of_segment(course, e, segment, ORIGIN)
    tau = since * of_segment(course, e, segment, FREQUENCY)
    s, speed = 0.0 * tau, 0.0 * tau
    count = course.degree + 1
    for k in range(count):
        s = s * tau + of_segment(course, e, segment, LAW + k)
        speed = speed * tau + of_segment(course, e, segment, LAW + count + k)
    place = (s - of_segment(course, e, segment, FIRST_S)) * of_segment(course, e, segment, DENSITY)
    last = of_segment(course, e, segment, CELLS) - 1.0
    cell = maximum(minimum(floor(place), last), 0.0)
    u = place - cell
    if course.single_cell:
        v = vector(fixed(course, 0, u), fixed(course, 4, u), fixed(course, 8, u))
        omega = vector(fixed(course, 12, u), fixed(course, 16, u), fixed(course, 20, u))
    else:
        first = (of_segment(course, e, segment, FIRST_CELL) + cell) * SIX
        x, y, z, a, b, c = six_cubics(course.cells, first)
        v = vector(value(x, u), value(y, u), value(z, u))
        omega = vector(value(a, u), value(b, u), value(c, u))
    return v * speed, omega * speed, speed


@inlined
def fixed(course: Course, column: int, u: Float) -> Float:
    """A cubic of the only cell, at the fraction ``u``."""
    cells = course.cells
    square = (cells[column] * u + cells[column + 1]) * u + cells[column + 2]
    return square * u + cells[column + 3]


@inlined
def to_spacecraft(a: Vector, e: Float, v: Vector) -> Vector:
    """A vector of the inertial frame in the spacecraft frame, attitude quaternion (a, e)."""
    t = cross(v, a) * 2.0
    return v + t * e + cross(t, a)


@inlined
def flow(
    robot: Robot,
    course: Course,
    null_space: NullSpace | None,
    y: Table,
    work: Buffers,
    stage: int,
) -> tuple[Float, Float]:  # fmt: skip
    """Write the derivatives of attitude, joints and time by the step's variable into ``work.K``.

    Args:
        robot: Data of the robot.
        course: Path and timing.
        null_space: Settings of a redundant arm; None for the rates of least Euclidean norm.
        y: Attitude, joint values and time.
        work: Workspace.
        stage: Column of ``work.K``.

    Returns:
        det S* and det D.
    """
    n, K, status = robot.n, work.K, work.status
    q = subtable(y, 4, 1)
    x, e = vector(y[0], y[1], y[2]), y[3]
    scale = 1.0 / sqrt(dot(x, x) + e * e)
    x, e = x * scale, e * scale
    speed, drift = 0.0 * e, vector(work.h[6], work.h[7], work.h[8])
    farther = vector(work.h[9], work.h[10], work.h[11])
    for arm in range(robot.arms):
        v, omega, speed = twist_at(course, arm, status[SEGMENT], y[4 + n])
        if arm == 0:
            v = v + farther * speed
        v = v - drift  # relative to the centre of mass
        set_vector(work.solver.twists, arm, 0, to_spacecraft(x, e, v))
        set_vector(work.solver.twists, arm, 3, to_spacecraft(x, e, omega))
    h = to_spacecraft(x, e, vector(work.h[0], work.h[1], work.h[2]))
    h = h - vector(work.h[3], work.h[4], work.h[5])  # what wheels do not store
    if null_space is not None and null_space.toward != 0:
        gradient(robot, null_space, q, work)
    drift, determinant, det_D = solve_rates(robot, q, h, work.solver)
    if null_space is not None:
        add_null_space_motion(robot, null_space, speed, work)
    half = spacecraft_rate(robot, drift, work.solver) * (0.5 * course.duration)
    square = dot(half, half)  # of the quaternion's rate
    for j in range(n):
        rate = work.solver.rates[j] * course.duration
        square += rate * rate
        K[4 + j, stage] = rate
    pace = select(status[BY_TIME] > 0.0, 1.0, 1.0 / sqrt(TIME_WEIGHT + square))
    pace *= status[FORWARD]
    for j in range(n):
        K[4 + j, stage] = K[4 + j, stage] * pace
    a, b, c = components(half * e + cross(x, half))  # (8c)
    K[0, stage] = a * pace
    K[1, stage] = b * pace
    K[2, stage] = c * pace
    K[3, stage] = -dot(x, half) * pace
    K[4 + n, stage] = pace
    return determinant, det_D
