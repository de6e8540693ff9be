"""Forward kinematics in lock step, with the momenta of the bodies on both sides of each joint.

A joint moves the bodies on the spacecraft's side of it against the bodies beyond. With the bodies
beyond at rest, a unit rate gives the others the linear momentum -P and the angular momentum -L
about the system's centre of mass: L = D a - Dq for a revolute joint with axis a, and L = -Dq for a
prismatic one. Other arms that follow paths are on the spacecraft's side of the joints of each arm.

All vectors are in the spacecraft frame.
"""

from __future__ import annotations

from freefloat.dynamics.kernels.cubics import SIX, six_cubics, slope, value
from freefloat.dynamics.kernels.inertia import (
    Inertia,
    in_axes,
    in_joint_frame,
    minus,
    of_point,
    plus,
    rolled_inertia,
    times,
)
from freefloat.dynamics.kernels.robot import (
    ALONG_X,
    ALONG_Z,
    ANGLE,
    COSINE,
    DIAGONAL,
    FIRST,
    MASS,
    MOMENT,
    PRISMATIC,
    PRODUCTS,
    SINE,
    TILT_COSINE,
    TILT_SINE,
    TOOL,
    Robot,
    Solver,
    base_of,
    bodies_of,
    joints_of,
)
from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.lanes import Float, floor, maximum, minimum, sine_cosine
from freefloat.lockstep.tables import Table, get_vector, set_vector
from freefloat.lockstep.vectors import Vector, components, cross, rolled, vector

X_AXIS, AXIS, POINT, LINEAR, ANGULAR, TURN = range(0, 18, 3)
"""Columns of ``Solver.momenta``: x axis of a joint's link frame, z axis, which is the axis of the
joint, and its origin; P and L; the spacecraft's angular velocity per joint rate, in whose place the
sine and the cosine of the joint's angle are before."""
TIP, TIP_X, TIP_Y, TIP_Z, END_MASS, END_MOMENT, END_DIAGONAL, END_PRODUCTS = (
    0, 3, 6, 9, 12, 13, 16, 19,
)  # fmt: skip
"""Columns of ``Solver.ends``: position and axes of an end-effector; mass, first moment and
inertia of spacecraft and arm, where there are several."""


@inner
def place_arms(robot: Robot, q: Table, work: Solver) -> tuple[Float, Vector, Inertia]:
    """Write link frames, P and L of all joints, and the end-effectors.

    Args:
        robot: Data of the robot.
        q: Joint values, and the time in units of the duration where further arms move.
        work: Solver.

    Returns:
        Mass and centre of mass of the system, and D, the inertia about the centre of mass.
    """
    w, M, (c, D) = work.momenta, 0.0 * q[0], row_of(robot.root, 0)
    for e in range(robot.arms):
        M, c, D = place_arm(robot, e, q, work)
        if robot.arms > 1:
            _keep(e, M, c, D, work.ends)
    if robot.arms > 1:
        M, c, D = _place_others(robot, M, work)
    set_vector(work.centre, 0, 0, c)
    for j in range(robot.n):
        set_vector(w, j, ANGULAR, get_vector(w, j, ANGULAR) - cross(c, get_vector(w, j, LINEAR)))
    return M, c, D


@inlined
def _keep(e: int, M: Float, c: Vector, I: Inertia, ends: Table) -> None:
    """Write mass, first moment and inertia of the spacecraft with an arm, about the origin."""
    I = plus(I, of_point(M, c))
    ends[e, END_MASS] = M
    set_vector(ends, e, END_MOMENT, c * M)
    set_vector(ends, e, END_DIAGONAL, I.diagonal)
    set_vector(ends, e, END_PRODUCTS, I.products)


@inner
def _place_others(robot: Robot, M: Float, work: Solver) -> tuple[Float, Vector, Inertia]:
    """Add the momenta of the other arms to each arm's joint momenta; returns as place_arms."""
    ends, w = work.ends, work.momenta
    root, (moment, inertia) = robot.root[0, MASS], row_of(robot.root, 0)
    M, u, I = 0.0 * M + root, moment, inertia  # of the spacecraft, then with the arms
    for e in range(robot.arms):
        M = M + (ends[e, END_MASS] - root)
        u = u + (get_vector(ends, e, END_MOMENT) - moment)
        I = plus(I, minus(_inertia(ends, e), inertia))
    for e in range(robot.arms):
        mass, c = M - ends[e, END_MASS], u - get_vector(ends, e, END_MOMENT)
        other = minus(I, _inertia(ends, e))
        for j in joints_of(robot, e):
            a, p = get_vector(w, j, AXIS), get_vector(w, j, POINT)
            P, L = cross(a, c - p * mass), times(other, a) - cross(c, cross(a, p))
            if robot.joints[j, PRISMATIC] != 0.0:
                P, L = a * mass, cross(c, a)
            set_vector(w, j, LINEAR, get_vector(w, j, LINEAR) + P)
            set_vector(w, j, ANGULAR, get_vector(w, j, ANGULAR) + L)
    c = u * (1.0 / M)
    return M, c, minus(I, of_point(M, c))


@inlined
def _inertia(ends: Table, e: int) -> Inertia:
    return Inertia(get_vector(ends, e, END_DIAGONAL), get_vector(ends, e, END_PRODUCTS))


@inner
def place_arm(robot: Robot, e: int, q: Table, work: Solver) -> tuple[Float, Vector, Inertia]:
    """Write link frames, P and L of an arm's joints, L about the origin, and its end-effector.

    M, u and I are mass, first moment and inertia of the spacecraft, then of all bodies
    between spacecraft and joint, in the frame (``ex``, ``ey``, ``ez``) at ``p``, about its origin.

    Args:
        robot: Data of the robot.
        e: Number of the arm.
        q: As for :func:`place_arms`.
        work: Solver.

    Returns:
        Mass, centre of mass and inertia about it of spacecraft and arm.
    """
    joints, bodies, base, w = robot.joints, bodies_of(robot), base_of(robot, e), work.momenta
    ex, ey, ez, p = (get_vector(base, 0, 0), get_vector(base, 1, 0), get_vector(base, 2, 0),
                     get_vector(base, 3, 0))  # fmt: skip
    row = int(robot.tools[e, FIRST]) + e
    M = bodies[row, MASS]
    u, I = base_inertia(robot, row, q, work)
    note_angles(robot, e, q, work)
    for k in joints_of(robot, e):
        s, c, d = joints[k, SINE], joints[k, COSINE], joints[k, ALONG_X]
        p = p + ex * d
        ey, ez = ey * c + ez * s, ez * c - ey * s
        u, I = in_joint_frame(M, rolled(u), rolled_inertia(I), s, c, d)
        if joints[k, TILT_SINE] != 0.0:
            s, c = joints[k, TILT_SINE], joints[k, TILT_COSINE]
            ex, ez = ex * c - ez * s, ez * c + ex * s
            u, I = in_joint_frame(M, rolled(u), rolled_inertia(I), s, c, 0.0 * d)
            u, I = rolled(u), rolled_inertia(I)
        else:
            u, I = rolled(rolled(u)), rolled_inertia(rolled_inertia(I))
        d = joints[k, ALONG_Z] + 0.0 * q[k]
        x, y, z = components(u)
        if joints[k, PRISMATIC] != 0.0:
            d = d + q[k]
            P, L = ez * M, ex * y - ey * x
        else:
            yz, zx, _ = components(I.products)
            _, _, zz = components(I.diagonal)
            P, L = ey * x - ex * y, ex * zx + ey * yz + ez * zz
        set_vector(w, k, LINEAR, P)
        set_vector(w, k, ANGULAR, L + cross(p, P))
        s, c = w[k, TURN], w[k, TURN + 1]
        p = p + ez * d
        ex, ey = ex * c + ey * s, ey * c - ex * s
        set_vector(w, k, X_AXIS, ex)
        set_vector(w, k, AXIS, ez)
        set_vector(w, k, POINT, p)
        u, I = in_joint_frame(M, u, I, s, c, d)
        row = k + e + 1
        M += bodies[row, MASS]
        moment, own = row_of(bodies, row)
        u, I = u + moment, plus(I, own)
    x, y, z = components(u)
    u = (ex * x + ey * y + ez * z) * (1.0 / M)
    tools, ends = robot.tools, work.ends
    for i in range(4):
        x, y, z = tools[e, TOOL + 3 * i], tools[e, TOOL + 3 * i + 1], tools[e, TOOL + 3 * i + 2]
        set_vector(ends, e, TIP + 3 * i, ex * x + ey * y + ez * z)
    set_vector(ends, e, TIP, get_vector(ends, e, TIP) + p)
    return M, p + u, minus(in_axes(I, ex, ey, ez), of_point(M, u))


@inlined
def note_angles(robot: Robot, e: int, q: Table, work: Solver) -> None:
    """Write the sines and the cosines of the angles of an arm's joints.

    The processor computes them side by side here, and not as parts of the chain of link frames.
    """
    for k in joints_of(robot, e):
        angle = robot.joints[k, ANGLE] + 0.0 * q[k]
        if robot.joints[k, PRISMATIC] == 0.0:
            angle = angle + q[k]
        work.momenta[k, TURN], work.momenta[k, TURN + 1] = sine_cosine(angle)


@inlined
def row_of(bodies: Table, row: int) -> tuple[Vector, Inertia]:
    """First moment and inertia in a row of bodies."""
    I = Inertia(get_vector(bodies, row, DIAGONAL), get_vector(bodies, row, PRODUCTS))
    return get_vector(bodies, row, MOMENT), I


@inlined
def base_inertia(robot: Robot, row: int, q: Table, work: Solver) -> tuple[Vector, Inertia]:
    """First moment and inertia of the spacecraft with its further arms, in a link frame 0.

    The momenta of the further arms are written to ``work.carried``: the linear momentum is the
    derivative of the first moment. Where the arms move, the element of ``q`` behind the joints is
    the time in units of the duration.
    """
    arms = robot.further
    if arms.number == 0:
        return row_of(bodies_of(robot), row)
    place = q[robot.n] * (1.0 * arms.number)
    cell = maximum(minimum(floor(place), arms.number - 1.0), 0.0)
    x, first = place - cell, cell * (2.0 * SIX)
    mx, my, mz, lx, ly, lz = six_cubics(arms.cells, first)
    xx, yy, zz, yz, zx, xy = six_cubics(arms.cells, first + SIX)
    base, rate = base_of(robot, 0), arms.density
    P = get_vector(base, 0, 0) * (slope(mx, x) * rate)
    P = P + get_vector(base, 1, 0) * (slope(my, x) * rate)
    P = P + get_vector(base, 2, 0) * (slope(mz, x) * rate)
    set_vector(work.carried, 0, 0, P)
    set_vector(work.carried, 1, 0, vector(value(lx, x), value(ly, x), value(lz, x)))
    I = Inertia(vector(value(xx, x), value(yy, x), value(zz, x)),
                vector(value(yz, x), value(zx, x), value(xy, x)))  # fmt: skip
    return vector(value(mx, x), value(my, x), value(mz, x)), I


@inlined
def path_origin(robot: Robot, work: Solver) -> Vector:
    """Origin of the path's frame: the centre of mass, on a table at the spacecraft's height."""
    c = get_vector(work.centre, 0, 0)
    if not robot.on_table:
        return c
    x, y, z = components(c)
    return vector(x, y, 0.0 * z)
