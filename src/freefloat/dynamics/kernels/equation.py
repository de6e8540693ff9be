"""Equation (4) for motions in lock step: joint and spacecraft rates for a twist and a momentum.

A of (5) is not formed: (1), solved for the spacecraft's rate, and (2) give (8b),

    S* q' = C^T v_E - J11* inverse(D) R0^T h,    S* = J12* - J11* inverse(D) Dq.

J11* acts on an angular velocity w of the spacecraft as (w x r, w), where r is the end-effector's
position from the centre of mass. Columns of Dq and J12* do not appear by themselves: zero momentum
requires that the whole system moves as one rigid body beside the motion of :mod:`.kinematics`, its
centre of mass with the velocity P / M, and with the angular velocity y = inverse(D) L. The
end-effector then has the twist (P / M + y x r, y), column j of S*, and the spacecraft turns with
y - a (prismatic: y), which is -inverse(D) Dq. The end-effectors of other arms move with it.
"""

from __future__ import annotations

from freefloat.dynamics.kernels.inertia import Inertia, inverse, times
from freefloat.dynamics.kernels.kinematics import (
    ANGULAR,
    AXIS,
    LINEAR,
    POINT,
    TIP,
    TIP_X,
    TIP_Y,
    TURN,
    place_arms,
)
from freefloat.dynamics.kernels.robot import PRISMATIC, Robot, Solver, joints_of
from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.factors import factorize, solve_least_norm
from freefloat.lockstep.lanes import Float
from freefloat.lockstep.tables import Table, get_vector, set_vector
from freefloat.lockstep.vectors import Vector, components, cross, dot, vector


@inner
def form_jacobian(robot: Robot, q: Table, work: Solver) -> tuple[Float, Inertia, Float]:
    """Write the columns of S* of (7) into the rows of ``work.S``, momenta into ``work.momenta``.

    On a table D has a zz element alone, and column j of -Dq is written in place of L.

    Returns:
        One over the mass, inverse and determinant of D; for planar tasks and on a table the
        determinant is its zz element.
    """
    M, _, D = place_arms(robot, q, work)
    share, w = 1.0 / M, work.momenta
    inverse_D, det_D = inverse(D)
    if robot.planar or robot.on_table:
        det_D = components(D.diagonal)[2]
    if robot.on_table:
        none = 0.0 * det_D
        inverse_D = Inertia(vector(none, none, 1.0 / det_D), vector(none, none, none))
    for e in range(robot.arms):
        for j in joints_of(robot, e):
            a, slides = get_vector(w, j, AXIS), robot.joints[j, PRISMATIC] != 0.0
            if robot.on_table and not slides:
                set_vector(w, j, ANGULAR, get_vector(w, j, ANGULAR) - times(D, a))
            turn = times(inverse_D, get_vector(w, j, ANGULAR))
            if not (slides or robot.on_table):
                turn = turn - a
            set_vector(w, j, TURN, turn)
            write_columns(robot, e, j, share, turn, work)
    return share, inverse_D, det_D


@inner
def determinants(robot: Robot, q: Table, work: Solver) -> tuple[Float, Float]:
    """Det S* (6), or sqrt(det(S* S*^T)), and det D at joint values."""
    _, _, det_D = form_jacobian(robot, q, work)
    return factorize(robot.m, robot.n, work.S, work.scales), det_D


@inner
def solve_rates(robot: Robot, q: Table, h: Vector, work: Solver) -> tuple[Vector, Float, Float]:
    """Solve (4) at joint values ``q``; of redundant arms, for the rates of least Euclidean norm.

    Args:
        robot: Data of the robot.
        q: As for :func:`.place_arms`.
        h: Angular momentum about the centre of mass.
        work: Solver with the end-effectors' twists; receives the joint rates.

    Returns:
        The spacecraft's angular velocity for resting joints, det S* and det D as
        :func:`determinants`.
    """
    share, inverse_D, det_D = form_jacobian(robot, q, work)
    b, c, P = work.b, get_vector(work.centre, 0, 0), h * 0.0
    if robot.further.number > 0:  # which have momentum
        P = get_vector(work.carried, 0, 0)
        if robot.on_table:
            x, y, z = components(P)
            P = vector(x, y, 0.0 * z)
        h = h - (get_vector(work.carried, 1, 0) - cross(c, P))
    drift = times(inverse_D, h)
    for e in range(robot.arms):
        r = get_vector(work.ends, e, TIP) - c
        v = get_vector(work.twists, e, 0) + P * share - cross(drift, r)
        turn = in_task(robot, e, get_vector(work.twists, e, 3) - drift, work)
        b[6 * e], b[6 * e + 1], b[6 * e + 2] = components(v)
        b[6 * e + 3], b[6 * e + 4], b[6 * e + 5] = components(turn)
    for i in range(robot.m):
        b[i] = b[int(robot.rows[i])]
    determinant = factorize(robot.m, robot.n, work.S, work.scales)
    solve_least_norm(robot.m, robot.n, work.S, work.scales, b, work.rates)
    return drift, determinant, det_D


@inlined
def spacecraft_rate(robot: Robot, drift: Vector, work: Solver) -> Vector:
    """The spacecraft's angular velocity for the joint rates in ``work``."""
    for j in range(robot.n):
        drift = drift + get_vector(work.momenta, j, TURN) * work.rates[j]
    return drift


@inlined
def rigid_velocity(robot: Robot, j: int, share: Float, work: Solver) -> Vector:
    """Velocity at the centre of mass of the bodies beyond joint j, per rate of that joint.

    Args:
        robot: Data of the robot.
        j: Number of the joint.
        share: One over the mass.
        work: Solver, with the link frames.
    """
    w = work.momenta
    v = get_vector(w, j, LINEAR) * share
    if not robot.on_table:
        return v
    lift = get_vector(w, j, AXIS)
    if robot.joints[j, PRISMATIC] == 0.0:
        lift = cross(lift, get_vector(work.centre, 0, 0) - get_vector(w, j, POINT))
    x, y, _ = components(v)
    _, _, z = components(lift)  # while the spacecraft keeps its height
    return vector(x, y, z)


@inlined
def in_task(robot: Robot, e: int, omega: Vector, work: Solver) -> Vector:
    """The components of an angular velocity from which the task of an arm takes its rows.

    The components of ``pointing`` are along the x and y axes of the end-effector.
    """
    if not robot.pointing:
        return omega
    x, y = get_vector(work.ends, e, TIP_X), get_vector(work.ends, e, TIP_Y)
    return vector(dot(omega, x), dot(omega, y), 0.0)


@inlined
def write_columns(
    robot: Robot, e: int, j: int, share: Float, spacecraft: Vector, work: Solver
) -> None:
    """Write the end-effectors' twists per rate of joint j of arm e into a row of ``work.S``.

    Args:
        robot: Data of the robot.
        e: Number of the arm.
        j: Number of the joint.
        share: One over the mass.
        spacecraft: Angular velocity of the spacecraft per rate.
        work: Solver, with the link frames.
    """
    w, S, c = work.momenta, work.S, get_vector(work.centre, 0, 0)
    a, v = get_vector(w, j, AXIS), rigid_velocity(robot, j, share, work)
    slides = robot.joints[j, PRISMATIC] != 0.0
    y = spacecraft if slides else spacecraft + a
    for end in range(robot.arms):
        tip, omega = get_vector(work.ends, end, TIP), y
        speed = v + cross(y, tip - c)
        if end != e:  # on the spacecraft's side
            omega = spacecraft
            speed = speed - (a if slides else cross(a, tip - get_vector(w, j, POINT)))
        set_vector(S, j, 6 * end, speed)
        set_vector(S, j, 6 * end + 3, in_task(robot, end, omega, work))
    if robot.m < 6 * robot.arms:
        for i in range(robot.m):
            S[j, i] = S[j, int(robot.rows[i])]
