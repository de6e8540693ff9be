"""Equation (4) for motions in lock step: joint and spacecraft rates for a twist and a momentum.

A of (5) is not formed: (1), solved for the spacecraft's rate, and (2) give (8b),

    S* q' = C^T v_E - J11* inverse(D) R0^T h,    S* = J12* - J11* inverse(D) Dq.

J11* acts on an angular velocity w of the spacecraft as (w x r, w), where r is the end-effector's
position from the centre of mass. Columns of Dq and J12* do not appear by themselves: a joint moves
the bodies on the spacecraft's side of it against those beyond. With the latter at rest, a unit rate
gives the former the linear momentum -P and the angular momentum -L about the system's centre of
mass: L = D a - Dq for a revolute joint with axis a, and L = -Dq for a prismatic one. Zero momentum
requires that the whole system moves as one rigid body, too, its centre of mass with the velocity
P / M, and with the angular velocity y = inverse(D) L. The end-effector then has the twist
(P / M + y x r, y), column j of S*, and the spacecraft turns with y - a (prismatic: y), which is
-inverse(D) Dq.

A second arm that follows a path is on the spacecraft's side of the joints of the first one, and the
other way round: its bodies add to the momentum of the joint. Its own end-effector moves with them.

All vectors are in the spacecraft frame. The angular rows of the task ``pointing`` are those along
the x and y axes of the end-effector.
"""

from __future__ import annotations

from typing import NamedTuple

from freefloat.ensemble.kernels.cubics import SIX, six_cubics, slope, value
from freefloat.ensemble.kernels.inertia import (
    Inertia,
    in_axes,
    inverse,
    minus,
    of_point,
    plus,
    screwed,
    times,
)
from freefloat.ensemble.kernels.records import (
    BASE,
    BODY_COLUMNS,
    FRAME_COLUMNS,
    JOINT_COLUMNS,
    TOTAL_MASS,
    Arms,
    Robot,
    SecondArm,
    Workspace,
    bodies_of,
)
from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.lanes import Float, floor, maximum, minimum, sine_cosine
from freefloat.lockstep.reflections import factorize, solve_least_norm
from freefloat.lockstep.tables import Table, below, get_vector, set_vector
from freefloat.lockstep.vectors import (
    Vector,
    components,
    cross,
    dot,
    rolled,
    vector,
)

COSINE, SINE, ALONG_X, ANGLE, ALONG_Z, PRISMATIC = 0, 1, 2, 3, 4, 5
"""Columns of ``Robot.joints``, see :class:`freefloat.dynamics.link_frames.LinkFrames`."""
MASS, MOMENT, DIAGONAL, PRODUCTS = 0, 1, 4, 7
"""Columns of the bodies."""
AXIS, POINT, LINEAR, ANGULAR, TURN = 0, 3, 6, 9, 12
"""Columns of ``Workspace.momenta``: axis of a joint and a point on it; P, and L about the origin of
the spacecraft frame; the spacecraft's angular velocity per joint rate."""


@inlined
def spacecraft(robot: Robot, q: Table, work: Workspace) -> tuple[Vector, Inertia]:
    """First moment and inertia of the spacecraft with its further arms, in link frame 0.

    Their momenta are written to ``work.carried``: the linear one is the derivative of the first
    moment. Where such arms move, the element of ``q`` behind the joints is the time in units of the
    duration.
    """
    arms = robot.arms
    if arms.number == 0:
        bodies = bodies_of(robot)
        I = Inertia(get_vector(bodies, 0, DIAGONAL), get_vector(bodies, 0, PRODUCTS))
        return get_vector(bodies, 0, MOMENT), I
    place = q[robot.n] * (1.0 * arms.number)
    cell = maximum(minimum(floor(place), arms.number - 1.0), 0.0)
    x, first = place - cell, cell * (2.0 * SIX)
    mx, my, mz, lx, ly, lz = six_cubics(arms.cells, first)
    xx, yy, zz, yz, zx, xy = six_cubics(arms.cells, first + SIX)
    base, rate = below(robot.properties, BASE, 3), arms.density
    P = get_vector(base, 0, 0) * (slope(mx, x) * rate)
    P = P + get_vector(base, 1, 0) * (slope(my, x) * rate)
    P = P + get_vector(base, 2, 0) * (slope(mz, x) * rate)
    set_vector(work.carried, 0, 0, P)
    set_vector(work.carried, 1, 0, vector(value(lx, x), value(ly, x), value(lz, x)))
    I = Inertia(vector(value(xx, x), value(yy, x), value(zz, x)),
                vector(value(yz, x), value(zx, x), value(xy, x)))  # fmt: skip
    return vector(value(mx, x), value(my, x), value(mz, x)), I


@inlined
def without_arms(
    arms: Arms, h: Vector, v: Vector, share: Float, work: Workspace
) -> tuple[Vector, Vector]:
    """Angular momentum and end-effector velocity that further arms leave to spacecraft and arm."""
    if arms.number == 0:
        return h, v
    P = get_vector(work.carried, 0, 0)
    moment = get_vector(work.carried, 1, 0) - cross(get_vector(work.centre, 0, 0), P)
    return h - moment, v + P * share


class ArmTables(NamedTuple):
    """The tables of an arm."""

    joints: Table  # as of Robot
    bodies: Table  # a row for each body, behind one row
    base: Table
    tool: Table
    across: Table
    n: int
    pointing: bool


@inlined
def place_bodies(
    arm: ArmTables, M: Float, u: Vector, I: Inertia, q: Table, w: Table, axes: Table
) -> tuple[Vector, Vector, Inertia, Vector]:  # fmt: skip
    """Write axis, point, P and L about the spacecraft's origin of each joint of an arm to ``w``.

    ``M``, ``u`` and ``I`` are mass, first moment and inertia of the spacecraft, then of all bodies
    between spacecraft and joint, in the frame (``ex``, ``ey``, ``ez``) at ``p``, about its origin.

    Returns:
        End-effector position, first moment and inertia of spacecraft and arm, and the point to
        which these refer.
    """
    joints, bodies, base = arm.joints, arm.bodies, arm.base
    ex, ey, ez, p = (get_vector(base, 0, 0), get_vector(base, 1, 0), get_vector(base, 2, 0),
                     get_vector(base, 3, 0))  # fmt: skip
    for k in range(1, arm.n + 1):
        s, c, d = joints[k - 1, SINE], joints[k - 1, COSINE], joints[k - 1, ALONG_X]
        p = p + ex * d
        ey, ez = ey * c + ez * s, ez * c - ey * s
        u, I = screwed(M, rolled(u), Inertia(rolled(I.diagonal), rolled(I.products)), s, c, d)
        u = rolled(rolled(u))
        I = Inertia(rolled(rolled(I.diagonal)), rolled(rolled(I.products)))
        angle, d = joints[k - 1, ANGLE] + 0.0 * q[k - 1], joints[k - 1, ALONG_Z] + 0.0 * q[k - 1]
        x, y, z = components(u)
        if joints[k - 1, PRISMATIC] != 0.0:
            d = d + q[k - 1]
            P, L = ez * M, ex * y - ey * x
        else:
            angle = angle + q[k - 1]
            yz, zx, _ = components(I.products)
            _, _, zz = components(I.diagonal)
            P, L = ey * x - ex * y, ex * zx + ey * yz + ez * zz
        set_vector(w, k - 1, AXIS, ez)
        set_vector(w, k - 1, POINT, p)
        set_vector(w, k - 1, LINEAR, P)
        set_vector(w, k - 1, ANGULAR, L + cross(p, P))
        s, c = sine_cosine(angle)
        p = p + ez * d
        ex, ey = ex * c + ey * s, ey * c - ex * s
        u, I = screwed(M, u, I, s, c, d)
        M += bodies[k, MASS]
        u = u + get_vector(bodies, k, MOMENT)
        own = Inertia(get_vector(bodies, k, DIAGONAL), get_vector(bodies, k, PRODUCTS))
        I = plus(I, own)
    x, y, z = components(u)
    u = ex * x + ey * y + ez * z
    I = in_axes(I, ex, ey, ez)
    place_axes(arm, ex, ey, ez, axes)
    x, y, z = arm.tool[0], arm.tool[1], arm.tool[2]
    return p + ex * x + ey * y + ez * z, u, I, p


@inlined
def place_axes(arm: ArmTables, ex: Vector, ey: Vector, ez: Vector, axes: Table) -> None:
    """Write the end-effector's x and y axes, given in the last frame, if the task needs them."""
    across = arm.across
    if arm.pointing:
        for i in range(2):
            set_vector(axes, i, 0, ex * across[i, 0] + ey * across[i, 1] + ez * across[i, 2])


@inlined
def rotational_rows(robot: Robot, axes: Table, omega: Vector) -> Vector:
    """The components of an angular velocity from which the task takes its rows."""
    if not robot.pointing:
        return omega
    return vector(dot(omega, get_vector(axes, 0, 0)), dot(omega, get_vector(axes, 1, 0)), 0.0)


@inlined
def form_jacobian(robot: Robot, q: Table, work: Workspace) -> tuple[Vector, Inertia, Float]:
    """Write the columns of S* of (7) into the rows of ``work.S``, momenta into ``work.momenta``.

    Returns:
        End-effector position from the centre of mass, inverse and determinant of D; for planar
        tasks the latter is its zz element.
    """
    return form_rows(robot, robot.second, q, work)


@inlined
def form_rows(
    robot: Robot, second: SecondArm | None, q: Table, work: Workspace
) -> tuple[Vector, Inertia, Float]:
    """See :func:`form_jacobian`."""
    if second is not None:
        return form_rows_of_two(robot, second, q, work)
    w, S, mass = work.momenta, work.S, robot.properties[TOTAL_MASS]
    share = 1.0 / mass
    u, I = spacecraft(robot, q, work)
    tip, u, I, p = place_bodies(
        first_arm(robot, robot.n), bodies_of(robot)[0, MASS], u, I, q, w, work.across
    )
    u = u * share
    c = p + u
    r = tip - c
    set_vector(work.centre, 0, 0, c)
    D = minus(I, of_point(mass, u))
    inverse_D, det_D = inverse(D)
    if robot.planar:
        det_D = components(D.diagonal)[2]
    for j in range(robot.n):
        P = get_vector(w, j, LINEAR)
        L = get_vector(w, j, ANGULAR) - cross(c, P)
        y = times(inverse_D, L)
        set_vector(S, j, 0, P * share + cross(y, r))
        set_vector(S, j, 3, rotational_rows(robot, work.across, y))
        if robot.joints[j, PRISMATIC] == 0.0:
            y = y - get_vector(w, j, AXIS)
        set_vector(w, j, TURN, y)
    if robot.m < 6:
        for j in range(robot.n):
            for i in range(robot.m):
                S[j, i] = S[j, int(robot.rows[i])]
    return r, inverse_D, det_D


@inlined
def first_arm(robot: Robot, n: int) -> ArmTables:
    """The tables of the first n joints."""
    base = below(robot.properties, BASE, 3)
    return ArmTables(robot.joints, bodies_of(robot), base, robot.tool, robot.across, n,
                     robot.pointing)  # fmt: skip


@inlined
def row_of(bodies: Table) -> tuple[Vector, Inertia]:
    """First moment and inertia in the first row of bodies."""
    I = Inertia(get_vector(bodies, 0, DIAGONAL), get_vector(bodies, 0, PRODUCTS))
    return get_vector(bodies, 0, MOMENT), I


@inlined
def about_origin(M: Float, u: Vector, I: Inertia, p: Vector) -> tuple[Vector, Inertia]:
    """First moment and inertia about the origin, for those about a point."""
    r = u * (1.0 / M)
    return u + p * M, plus(minus(I, of_point(M, r)), of_point(M, p + r))


@inlined
def form_rows_of_two(
    robot: Robot, second: SecondArm, q: Table, work: Workspace
) -> tuple[Vector, Inertia, Float]:
    """:func:`form_jacobian` of two arms that follow paths."""
    w, S, bodies, mass = work.momenta, work.S, bodies_of(robot), robot.properties[TOTAL_MASS]
    share, n, M = 1.0 / mass, second.joints, bodies[0, MASS]
    u, I = row_of(bodies)
    first = first_arm(robot, n)
    tip, u1, I1, p = place_bodies(first, M, u, I, q, w, work.across)
    u1, I1 = about_origin(M + second.masses[0], u1, I1, p)
    u, I = row_of(second.root_in_base)
    other = ArmTables(
        below(robot.joints, n, FRAME_COLUMNS), below(bodies, n, BODY_COLUMNS), second.base,
        second.tool, second.across, robot.n - n, robot.pointing,
    )  # fmt: skip
    other_tip, u2, I2, p = place_bodies(
        other, M, u, I, below(q, n, 1), below(w, n, JOINT_COLUMNS), below(work.across, 2, 3)
    )
    u2, I2 = about_origin(M + second.masses[1], u2, I2, p)
    u, I = row_of(second.root)
    c = (u1 + u2 - u) * share
    D = minus(minus(plus(I1, I2), I), of_point(mass, c))
    u1, I1, u2, I2 = u1 - u, minus(I1, I), u2 - u, minus(I2, I)  # without the spacecraft
    inverse_D, det_D = inverse(D)
    if robot.planar:
        det_D = components(D.diagonal)[2]
    set_vector(work.centre, 0, 0, c)
    set_vector(work.centre, 1, 0, other_tip - c)
    for j in range(robot.n):
        a, p = get_vector(w, j, AXIS), get_vector(w, j, POINT)
        slides = robot.joints[j, PRISMATIC] != 0.0
        own, far, place = tip, other_tip, 0
        m, u, I = second.masses[1], u2, I2
        if j >= n:
            own, far, place = other_tip, tip, 1
            m, u, I = second.masses[0], u1, I1
        P, L, step, turn = a * m, cross(u, a), a, a * 0.0  # of the other arm
        if not slides:
            P, L = cross(a, u - p * m), times(I, a) - cross(u, cross(a, p))
            step, turn = cross(a, far - p), a
        P = P + get_vector(w, j, LINEAR)
        L = L + get_vector(w, j, ANGULAR) - cross(c, P)
        y = times(inverse_D, L)
        v = P * share
        set_vector(S, j, 6 * place, v + cross(y, own - c))
        set_vector(S, j, 6 * place + 3, rotational_rows(robot, below(work.across, 2 * place, 3), y))
        place = 1 - place
        set_vector(S, j, 6 * place, v + cross(y, far - c) - step)
        y = y - turn
        set_vector(S, j, 6 * place + 3, rotational_rows(robot, below(work.across, 2 * place, 3), y))
        set_vector(w, j, TURN, y)
    if robot.m < 12:
        for j in range(robot.n):
            for i in range(robot.m):
                S[j, i] = S[j, int(robot.rows[i])]
    return tip - c, inverse_D, det_D


@inner
def determinants(robot: Robot, q: Table, work: Workspace) -> tuple[Float, Float]:
    """Det S* (6), or sqrt(det(S* S*^T)), and det D at joint values."""
    _, _, det_D = form_jacobian(robot, q, work)
    return factorize(robot.m, robot.n, work.S, work.scales), det_D


@inlined
def solve_rates(
    robot: Robot, q: Table, v: Vector, omega: Vector, h: Vector, work: Workspace
) -> tuple[Vector, Float, Float]:
    """Solve (4) at joint values ``q``; of redundant arms, for the rates of least Euclidean norm.

    Args:
        robot: Data of the robot.
        q: Joint values, and the time in units of the duration where further arms move.
        v: End-effector velocity.
        omega: Its angular velocity.
        h: Angular momentum about the centre of mass.
        work: Workspace; receives the joint rates.

    Returns:
        The spacecraft's angular velocity for resting joints, det S* and det D as
        :func:`determinants`.
    """
    r, inverse_D, det_D = form_jacobian(robot, q, work)
    h, v = without_arms(robot.arms, h, v, 1.0 / robot.properties[TOTAL_MASS], work)
    drift = times(inverse_D, h)
    turn = rotational_rows(robot, work.across, omega - drift)
    twist = (*components(v - cross(drift, r)), *components(turn))
    b = work.b
    for i in range(6):
        b[i] = twist[i]
    add_second_twist(robot, robot.second, drift, work)
    for i in range(robot.m):
        b[i] = b[int(robot.rows[i])]
    determinant = factorize(robot.m, robot.n, work.S, work.scales)
    solve_least_norm(robot.m, robot.n, work.S, work.scales, b, work.rates)
    return drift, determinant, det_D


@inlined
def add_second_twist(
    robot: Robot, second: SecondArm | None, drift: Vector, work: Workspace
) -> None:
    """Write the rows of the second end-effector behind those of the first."""
    if second is not None:
        v, omega = get_vector(work.second_twist, 0, 0), get_vector(work.second_twist, 1, 0)
        v = v - cross(drift, get_vector(work.centre, 1, 0))
        turn = rotational_rows(robot, below(work.across, 2, 3), omega - drift)
        x, y, z = components(v)
        a, b, c = components(turn)
        work.b[6], work.b[7], work.b[8] = x, y, z
        work.b[9], work.b[10], work.b[11] = a, b, c


@inlined
def spacecraft_rate(robot: Robot, drift: Vector, work: Workspace) -> Vector:
    """The spacecraft's angular velocity for the joint rates in ``work``."""
    for j in range(robot.n):
        drift = drift + get_vector(work.momenta, j, TURN) * work.rates[j]
    return drift
