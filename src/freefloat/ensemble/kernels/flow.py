"""The right-hand side of (8) for motions in lock step: rates of attitude and joints along a path."""

from __future__ import annotations

from typing import NamedTuple

from freefloat.dynamics.kernels.compilation import inlined, inner
from freefloat.ensemble.kernels.equation import solve_rates, spacecraft_rate
from freefloat.ensemble.kernels.lanes import (
    components,
    cross,
    dot,
    floor,
    maximum,
    minimum,
    sqrt,
    vector,
)
from freefloat.ensemble.kernels.null_space import add_null_space_motion, gradient
from freefloat.ensemble.kernels.tables import below, pick

SEGMENT = 0
"""Row of the workspace's ``now``."""
END, ORIGIN, FREQUENCY, FIRST_S, DENSITY, FIRST_CELL, CELLS, LAW = 0, 1, 2, 3, 4, 5, 6, 7
"""Columns of a segment; its law are the coefficients of s, then those of its derivative."""


class Course(NamedTuple):
    """The end-effector's path and its timing; times are in units of the duration."""

    duration: float
    segments: object  # of the time law, rows of ``stride`` columns
    number: int
    degree: int
    cells: object  # the tangent by s: rows of six cubics, highest power first
    single_cell: bool


@inlined
def of_segment(course, segment, column):
    """A column of the segments of the motions."""
    stride = LAW + 2 * (course.degree + 1)
    if course.number == 1:
        return 0.0 * segment + course.segments[column]
    return pick(course.segments, segment * stride + column)


@inlined
def twist_at(course, segment, t):
    """End-effector velocity, angular velocity and path speed ds/dt, inertial frame."""
    tau = (t * course.duration - of_segment(course, segment, ORIGIN)) * of_segment(course, segment, FREQUENCY)
    s, speed = 0.0 * tau, 0.0 * tau
    count = course.degree + 1
    for k in range(count):
        s = s * tau + of_segment(course, segment, LAW + k)
        speed = speed * tau + of_segment(course, segment, LAW + count + k)
    place = (s - of_segment(course, segment, FIRST_S)) * of_segment(course, segment, DENSITY)
    last = of_segment(course, segment, CELLS) - 1.0
    cell = maximum(minimum(floor(place), last), 0.0)
    u = place - cell
    first = (of_segment(course, segment, FIRST_CELL) + cell) * 24.0
    v = vector(cubic(course, first, 0, u), cubic(course, first, 4, u), cubic(course, first, 8, u))
    omega = vector(
        cubic(course, first, 12, u), cubic(course, first, 16, u), cubic(course, first, 20, u)
    )
    return v * speed, omega * speed, speed


@inlined
def cubic(course, first, column, u):
    """A cubic of each motion's cell, at the fraction ``u`` of the cell."""
    if course.single_cell:
        cells = course.cells
        return (
            (cells[column] * u + cells[column + 1]) * u + cells[column + 2]
        ) * u + cells[column + 3]
    cells, place = course.cells, first + column
    value = pick(cells, place) * u + pick(cells, place + 1.0)
    return (value * u + pick(cells, place + 2.0)) * u + pick(cells, place + 3.0)


@inlined
def to_spacecraft(a, e, v):
    """A vector of the inertial frame in the spacecraft frame, attitude quaternion (a, e)."""
    t = cross(v, a) * 2.0
    return v + t * e + cross(t, a)


@inlined
def flow(robot, course, null_space, y, work, stage):
    """Write the rates of attitude and joints, by time in units of the duration, into ``work.K``.

    Args:
        robot: Data of the robot.
        course: Path and timing.
        null_space: Settings of a redundant arm; None for the rates of least Euclidean norm.
        y: Attitude, joint values and time, one column.
        work: Workspace.
        stage: Column of ``work.K``.

    Returns:
        det S* and det D.
    """
    n, K = robot.n, work.K
    q = below(y, 4, 1)
    x, e = vector(y[0], y[1], y[2]), y[3]
    scale = 1.0 / sqrt(dot(x, x) + e * e)
    x, e = x * scale, e * scale
    v, omega, speed = twist_at(course, work.now[SEGMENT], y[4 + n])
    h = vector(work.h[0], work.h[1], work.h[2])
    if null_space is not None:
        if null_space.toward != 0:
            gradient(robot, null_space, q, work)
    drift, determinant, det_D = solve_rates(
        robot, q, to_spacecraft(x, e, v), to_spacecraft(x, e, omega), to_spacecraft(x, e, h), work
    )
    if null_space is not None:
        add_null_space_motion(robot, null_space, speed, work)
    half = spacecraft_rate(robot, drift, work) * (0.5 * course.duration)
    K[3, stage] = -dot(x, half)
    rates = components(half * e + cross(x, half))
    for j in range(3):
        K[j, stage] = rates[j]
    for j in range(n):
        K[4 + j, stage] = work.rates[j] * course.duration
    return determinant, det_D
