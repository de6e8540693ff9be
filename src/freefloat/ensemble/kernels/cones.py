"""Limits of attitude along motions in lock step: how far axes stay from the edges of cones.

The slack of a limit is the difference of the cosines of an angle and of its bound, negative where
the limit is violated. It is evaluated at both ends of a step, in the middle, and where the parabola
through these is smallest.
"""

from __future__ import annotations

from freefloat.ensemble.kernels.equation import (
    ALONG_X,
    ALONG_Z,
    ANGLE,
    COSINE,
    MASS,
    MOMENT,
    PRISMATIC,
    SINE,
    spacecraft,
)
from freefloat.ensemble.kernels.flow import to_spacecraft
from freefloat.ensemble.kernels.interpolant import inside
from freefloat.ensemble.kernels.records import (
    BASE,
    FRAME_COLUMNS,
    TOTAL_MASS,
    Cones,
    Problem,
    Robot,
    Workspace,
    bodies_of,
)
from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.lanes import (
    Float,
    Mask,
    any_of,
    magnitude,
    select,
    sine_cosine,
    sqrt,
)
from freefloat.lockstep.tables import Table, below, get_vector
from freefloat.lockstep.vectors import Vector, components, dot, vector
from freefloat.motion.pointing import TOO_NEAR

BODY, OF_POINT, SIDE, BOUND, AXIS, ORIGIN, TARGET = 0, 1, 2, 3, 4, 7, 10
"""Columns of ``Cones.table``: number of the body, -1 for the turn of the spacecraft; 1 for a target
that is a point; 1 for inside, -1 for outside; cosine of the bound; axis and origin of the line of
sight in the body's link frame; direction of the target, or its place in the path's frame."""
BEFORE, LOWEST, LOWEST_AT = 0, 1, 2
"""Rows of a limit in ``Workspace.slacks``: slack at the last step, the smallest, and its time."""


@inner
def note_slacks(problem: Problem, dt: Float, fresh: Mask, accepted: Mask, work: Workspace) -> None:
    """Update the smallest slacks by those along a step; write the first ones of fresh motions."""
    robot, cones, T = problem.robot, problem.cones, 4 + problem.robot.n
    for i in range(cones.number):
        slacks = below(work.slacks, 3 * i, 1)
        after = slack(robot, cones, i, work.at, work)
        before = select(fresh, after, slacks[BEFORE])
        slacks[LOWEST] = select(fresh, after, slacks[LOWEST])
        lower(slacks, after, work.at[T], accepted)
        inside(problem, dt, 0.0 * dt + 0.5, 0, work)
        middle = slack(robot, cones, i, work.inside, work)
        lower(slacks, middle, work.inside[T], accepted)
        curvature = 2.0 * (before + after - 2.0 * middle)
        place = 0.5 * (3.0 * before + after - 4.0 * middle) / curvature
        dips = accepted & (curvature > 0.0) & (place > 0.0) & (place < 1.0)
        if any_of(dips):
            inside(problem, dt, select(dips, place, 0.5), 0, work)
            lower(slacks, slack(robot, cones, i, work.inside, work), work.inside[T], dips)
        slacks[BEFORE] = select(accepted, after, slacks[BEFORE])


@inlined
def lower(slacks: Table, value: Float, t: Float, chosen: Mask) -> None:
    """Lower the smallest slack of a limit to a value at a time where it is larger."""
    smaller = chosen & (value < slacks[LOWEST])
    slacks[LOWEST] = select(smaller, value, slacks[LOWEST])
    slacks[LOWEST_AT] = select(smaller, t, slacks[LOWEST_AT])


@inner
def slack(robot: Robot, cones: Cones, i: int, y: Table, work: Workspace) -> Float:
    """The slack of limit ``i`` in a state."""
    table = cones.table
    x, e = vector(y[0], y[1], y[2]), y[3]
    scale = 1.0 / sqrt(dot(x, x) + e * e)
    body = int(table[i, BODY])
    if body < 0:
        x0 = vector(work.initial[0], work.initial[1], work.initial[2])
        return magnitude(dot(x, x0) + e * work.initial[3]) * scale - table[i, BOUND]
    t = y[4 + robot.n] * (cones.duration * table[i, OF_POINT])
    target = get_vector(table, i, TARGET) - vector(work.h[6], work.h[7], work.h[8]) * t
    target = to_spacecraft(x * scale, e * scale, target)
    axis = to_base(robot, body, get_vector(table, i, AXIS), 0.0, y)
    if table[i, OF_POINT] != 0.0:
        origin = to_base(robot, body, get_vector(table, i, ORIGIN), 1.0, y)
        target = target - origin + centre_of_mass(robot, y, work)
        distance = sqrt(dot(target, target))
        slack = (dot(axis, target) / distance - table[i, BOUND]) * table[i, SIDE]
        return select(distance < TOO_NEAR, 1.0, slack)
    return (dot(axis, target) - table[i, BOUND]) * table[i, SIDE]


@inner
def to_base(robot: Robot, body: int, v: Vector, point: float, y: Table) -> Vector:
    """A direction, or a point (1), of a body's link frame in the spacecraft frame."""
    for k in range(body, 0, -1):
        v = to_previous(robot, k, v, point, y)
    return in_spacecraft(robot, v, point + 0.0 * y[0])


@inlined
def in_spacecraft(robot: Robot, v: Vector, point: Float) -> Vector:
    """A vector of link frame 0 in the spacecraft frame; with the part ``point`` of its origin."""
    base = below(robot.properties, BASE, 3)
    x, y, z = components(v)
    rotated = get_vector(base, 0, 0) * x + get_vector(base, 1, 0) * y + get_vector(base, 2, 0) * z
    return rotated + get_vector(base, 3, 0) * point


@inlined
def to_previous(robot: Robot, k: int, v: Vector, point: Float, y: Table) -> Vector:
    """A vector of link frame k in frame k - 1, with ``point`` times the frame's displacement."""
    joint, q = below(robot.joints, k - 1, FRAME_COLUMNS), y[3 + k]
    angle, along = joint[0, ANGLE] + 0.0 * q, joint[0, ALONG_Z] + 0.0 * q
    if joint[0, PRISMATIC] != 0.0:
        along = along + q
    else:
        angle = angle + q
    s, c = sine_cosine(angle)
    a, b, z = components(v)
    a, b, z = c * a - s * b, s * a + c * b, z + along * point
    s, c = joint[0, SINE], joint[0, COSINE]
    return vector(a + joint[0, ALONG_X] * point, b * c - z * s, b * s + z * c)


@inner
def centre_of_mass(robot: Robot, y: Table, work: Workspace) -> Vector:
    """Centre of mass of the whole system in the spacecraft frame."""
    bodies = bodies_of(robot)
    M, u = bodies[robot.n, MASS], get_vector(bodies, robot.n, MOMENT)
    for k in range(robot.n, 0, -1):
        u = to_previous(robot, k, u, M, y)
        if k > 1:
            u = u + get_vector(bodies, k - 1, MOMENT)
        M += bodies[k - 1, MASS]
    moment, _ = spacecraft(robot, below(y, 4, 1), work)
    u = u + moment
    return in_spacecraft(robot, u, M + 0.0 * y[0]) * (1.0 / robot.properties[TOTAL_MASS])
