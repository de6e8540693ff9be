"""Limits of attitude along motions in lock step: how far axes stay from the edges of cones.

The slack of a limit is the difference of the cosines of an angle and of its bound, negative where
the limit is violated. It is evaluated at both ends of a step, in the middle, and where the parabola
through these is smallest.
"""

from __future__ import annotations

from freefloat.dynamics.kernels.kinematics import AXIS as Z_AXIS
from freefloat.dynamics.kernels.kinematics import POINT, X_AXIS, path_origin, place_arms
from freefloat.dynamics.kernels.robot import Robot, Solver, base_of
from freefloat.ensemble.kernels.dormand_prince import inside
from freefloat.ensemble.kernels.flow import to_spacecraft
from freefloat.ensemble.kernels.records import SLACK_ROWS, Buffers, Cones, ProblemTables
from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.lanes import Float, Mask, any_of, maximum, select, sqrt
from freefloat.lockstep.tables import Table, get_vector, subtable
from freefloat.lockstep.vectors import Vector, components, cross, dot, vector
from freefloat.motion.pointing import TOO_NEAR

BODY, OF_POINT, SIDE, BOUND, AXIS, ORIGIN, TARGET = 0, 1, 2, 3, 4, 7, 10
"""Columns of ``Cones.table``: number of the body, -1 for the turn of the spacecraft; 1 for a target
that is a point; 1 for inside, -1 for outside; cosine of the bound; axis and origin of the line of
sight in the body's link frame; direction of the target, or its place in the path's frame."""
BEFORE, LOWEST, LOWEST_AT, MIDDLE, AFTER = range(SLACK_ROWS)
"""Rows of a limit in ``Buffers.slacks``: slack at the last step, the smallest and its time, and
slacks in the middle and at the end of a step."""


@inner
def note_slacks(
    problem: ProblemTables, dt: Float, fresh: Mask, accepted: Mask, work: Buffers
) -> None:
    """Update the smallest slacks by slacks along a step; write first slacks of fresh motions."""
    if problem.cones.number == 0:
        return
    write_slacks(problem, work.at, AFTER, work)
    inside(problem, dt, 0.0 * dt + 0.5, 0, work)
    write_slacks(problem, work.inside, MIDDLE, work)
    T = 4 + problem.robot.n
    middle_time = work.inside[T]
    for i in range(problem.cones.number):
        slacks = subtable(work.slacks, SLACK_ROWS * i, 1)
        middle, after = slacks[MIDDLE], slacks[AFTER]
        before = select(fresh, after, slacks[BEFORE])
        slacks[LOWEST] = select(fresh, after, slacks[LOWEST])
        lower(slacks, after, work.at[T], accepted)
        lower(slacks, middle, middle_time, accepted)
        curvature = 2.0 * (before + after - 2.0 * middle)
        place = 0.5 * (3.0 * before + after - 4.0 * middle) / curvature
        dips = accepted & (curvature > 0.0) & (place > 0.0) & (place < 1.0)
        if any_of(dips):
            inside(problem, dt, select(dips, place, 0.5), 0, work)
            place_arms(problem.robot, subtable(work.inside, 4, 1), work.solver)
            dip = slack(problem.robot, problem.cones, i, work.inside, work)
            lower(slacks, dip, work.inside[T], dips)
        slacks[BEFORE] = select(accepted, after, slacks[BEFORE])


@inlined
def write_slacks(problem: ProblemTables, y: Table, row: int, work: Buffers) -> None:
    """Write the slacks in a state into rows of all limits."""
    place_arms(problem.robot, subtable(y, 4, 1), work.solver)
    for i in range(problem.cones.number):
        value = slack(problem.robot, problem.cones, i, y, work)
        work.slacks[SLACK_ROWS * i + row] = value


@inlined
def lower(slacks: Table, value: Float, t: Float, chosen: Mask) -> None:
    """Lower the smallest slack of a limit to a value at a time where it is larger."""
    smaller = chosen & (value < slacks[LOWEST])
    slacks[LOWEST] = select(smaller, value, slacks[LOWEST])
    slacks[LOWEST_AT] = select(smaller, t, slacks[LOWEST_AT])


@inner
def slack(robot: Robot, cones: Cones, i: int, y: Table, work: Buffers) -> Float:
    """The slack of limit ``i`` in a state in which the arm is placed."""
    table = cones.table
    x, e = vector(y[0], y[1], y[2]), y[3]
    scale = 1.0 / sqrt(dot(x, x) + e * e)
    body = int(table[i, BODY])
    if body < 0:
        x0 = vector(work.initial[0], work.initial[1], work.initial[2])
        half = dot(x, x0) + e * work.initial[3]  # negative beyond half a turn
        return maximum(half * scale, 0.0) - table[i, BOUND]
    t = y[4 + robot.n] * (cones.duration * table[i, OF_POINT])
    target = get_vector(table, i, TARGET) - vector(work.h[6], work.h[7], work.h[8]) * t
    target = to_spacecraft(x * scale, e * scale, target)
    axis = in_spacecraft(robot, body, get_vector(table, i, AXIS), 0.0, work.solver)
    if table[i, OF_POINT] != 0.0:
        origin = in_spacecraft(robot, body, get_vector(table, i, ORIGIN), 1.0, work.solver)
        target = target - origin + path_origin(robot, work.solver)
        distance = sqrt(dot(target, target))
        slack = (dot(axis, target) / distance - table[i, BOUND]) * table[i, SIDE]
        return select(distance < TOO_NEAR, 1.0, slack)
    return (dot(axis, target) - table[i, BOUND]) * table[i, SIDE]


@inlined
def in_spacecraft(robot: Robot, body: int, v: Vector, point: float, work: Solver) -> Vector:
    """A direction, or a point (1), of a body's link frame in the spacecraft frame."""
    base, w = base_of(robot, 0), work.momenta
    ex, ez, p = get_vector(base, 0, 0), get_vector(base, 2, 0), get_vector(base, 3, 0)
    if body > 0:
        ex, ez = get_vector(w, body - 1, X_AXIS), get_vector(w, body - 1, Z_AXIS)
        p = get_vector(w, body - 1, POINT)
    x, y, z = components(v)
    return ex * x + cross(ez, ex) * y + ez * z + p * point
