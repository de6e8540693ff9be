"""Null-space motion of redundant arms in lock step, see :mod:`freefloat.dynamics.resolved_rates`.

With a basis N of the null space of S*, the null-space rates are z = N c with

    (N^T W N) c = -N^T W u   and   (N^T W N) c = N^T g,

where u are the rates of least Euclidean norm, W is the metric and g the gradient of the objective.
So z neither moves the end-effector nor changes the momentum, and W may be singular.
"""

from __future__ import annotations

from freefloat.dynamics.kernels.equation import determinants, rigid_velocity
from freefloat.dynamics.kernels.kinematics import ANGULAR, AXIS, LINEAR, POINT, TURN
from freefloat.dynamics.kernels.robot import PRISMATIC, TOTAL_MASS, Robot
from freefloat.ensemble.kernels.records import Buffers, NullSpace
from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.factors import reflect
from freefloat.lockstep.lanes import Float, select, sqrt
from freefloat.lockstep.tables import Table, get_vector, subtable
from freefloat.lockstep.vectors import cross, dot

WEIGHTED, ENERGY = 1, 2
"""Codes of the metrics."""
SIGMA, MIDDLE_OF_RANGE = 1, 2
"""Codes of the objectives; 0 for none."""
_STEP = 1e-4
"""Step of the joint values for differences of the manipulability [rad, m]."""


@inner
def gradient(robot: Robot, null_space: NullSpace, q: Table, work: Buffers) -> None:
    """Write the gradient of the objective at joint values into ``work.gradient``."""
    g = work.gradient
    for k in range(robot.n):
        here = q[k]
        if null_space.toward == MIDDLE_OF_RANGE:
            g[k] = (null_space.middles[k] - here) * null_space.ranges[k]
            continue
        q[k] = here + _STEP
        above, _ = determinants(robot, q, work.solver)
        q[k] = here - _STEP
        under, _ = determinants(robot, q, work.solver)
        q[k] = here
        total = above + under
        g[k] = select(total > 0.0, (above - under) / (_STEP * total), 0.0 * total)


@inner
def add_null_space_motion(robot: Robot, null_space: NullSpace, speed: Float, work: Buffers) -> None:
    """Add the null-space motion to the rates of least norm in ``work.solver.rates``.

    Args:
        robot: Data of the robot.
        null_space: Settings.
        speed: Path speed ds/dt.
        work: Workspace, with the factors of S* and, if there is an objective, its gradient.
    """
    n, r = robot.n, robot.n - robot.m
    _basis(robot, work)
    _components(robot, null_space, work)
    square = 0.0 * speed
    for i in range(n):
        toward = 0.0 * speed
        for c in range(r):
            toward += work.basis[c * n + i] * work.right[2 * c + 1]
        square += toward * toward
    pace = speed / sqrt(1.0 + square * (1.0 / null_space.bound**2))
    for i in range(n):
        for c in range(r):
            along = work.right[2 * c] + pace * work.right[2 * c + 1]
            work.solver.rates[i] = work.solver.rates[i] + work.basis[c * n + i] * along


@inner
def _components(robot: Robot, null_space: NullSpace, work: Buffers) -> None:
    """Write both components c, in pairs, into ``work.right``."""
    n, r, W = robot.n, robot.n - robot.m, work.metric
    if null_space.metric == ENERGY:
        _kinetic_energy(robot, work)
    else:
        for i in range(n):
            for j in range(n):
                W[i * n + j] = null_space.weights[i] if i == j else 0.0
    for c in range(r):
        N = subtable(work.basis, c * n, 1)
        for i in range(n):
            total = 0.0 * N[0]
            for j in range(n):
                total += W[i * n + j] * N[j]
            work.column[i] = total
        for d in range(r):
            work.normal[c * r + d] = _product(n, subtable(work.basis, d * n, 1), work.column)
        work.right[2 * c] = -_product(n, work.solver.rates, work.column)
        work.right[2 * c + 1] = 0.0
        if null_space.toward != 0:
            work.right[2 * c + 1] = _product(n, N, work.gradient) * null_space.gain
    _solve(r, work.normal, work.right)


@inlined
def _product(n: int, a: Table, b: Table) -> Float:
    """Scalar product of two columns."""
    total = a[0] * b[0]
    for i in range(1, n):
        total += a[i] * b[i]
    return total


@inner
def _basis(robot: Robot, work: Buffers) -> None:
    """Write an orthonormal basis of the null space of S* into ``work.basis``, vector by vector."""
    for c in range(robot.n - robot.m):
        N = subtable(work.basis, c * robot.n, 1)
        for i in range(robot.n):
            N[i] = 1.0 if i == robot.m + c else 0.0
        reflect(robot.m, robot.n, work.solver.S, work.solver.scales, N)


@inner
def _solve(r: int, A: Table, b: Table) -> None:
    """Solve A x = b with a symmetric positive definite A and two right-hand sides, by L D L^T."""
    for k in range(r):
        inverse = 1.0 / A[k * r + k]
        for i in range(k + 1, r):
            factor = A[i * r + k] * inverse
            for j in range(k + 1, r):
                A[i * r + j] = A[i * r + j] - factor * A[k * r + j]
            b[2 * i] = b[2 * i] - factor * b[2 * k]
            b[2 * i + 1] = b[2 * i + 1] - factor * b[2 * k + 1]
    for k in range(r - 1, -1, -1):
        for side in range(2):
            total = b[2 * k + side]
            for j in range(k + 1, r):
                total -= A[k * r + j] * b[2 * j + side]
            b[2 * k + side] = total / A[k * r + k]


@inner
def _kinetic_energy(robot: Robot, work: Buffers) -> None:
    """Write the generalized inertia, divided by its mean diagonal element, into ``work.metric``."""
    scale = robot.n / form_inertia(robot, work)
    for i in range(robot.n * robot.n):
        work.metric[i] = work.metric[i] * scale


@inner
def form_inertia(robot: Robot, work: Buffers) -> Float:
    """Write the generalized inertia of the joint rates into ``work.metric``, row by row.

    Its quadratic form is twice the kinetic energy of the system without momentum. Element (i, j), i
    beyond j, is the product of the spacecraft's motion due to joint i and the momentum -P, -L that
    joint j gives to the bodies before it.

    Args:
        robot: Data of the robot.
        work: Workspace, in which :func:`.form_jacobian` has written the momenta.

    Returns:
        Trace of the inertia.
    """
    if robot.on_table:
        return _inertia_on_table(robot, work)
    n, w, W = robot.n, work.solver.momenta, work.metric
    centre, share = get_vector(work.solver.centre, 0, 0), 1.0 / robot.properties[TOTAL_MASS]
    trace = 0.0 * work.solver.scales[0]
    for i in range(n):
        a, P = get_vector(w, i, AXIS), get_vector(w, i, LINEAR)
        if robot.joints[i, PRISMATIC] != 0.0:
            velocity = P * share - a
        else:
            velocity = P * share + cross(a, get_vector(w, i, POINT) - centre)
        turn = get_vector(w, i, TURN)
        for j in range(i + 1):
            W[i * n + j] = -dot(velocity, get_vector(w, j, LINEAR))
            W[i * n + j] = W[i * n + j] - dot(turn, get_vector(w, j, ANGULAR))
            W[j * n + i] = W[i * n + j]
        trace += W[i * n + i]
    return trace


@inner
def _inertia_on_table(robot: Robot, work: Buffers) -> Float:
    """Write the generalized inertia of one arm on a table; see :func:`form_inertia`.

    Element (i, j), j beyond i, is the product of the motion of the bodies beyond joint j due to
    joint i and the momentum that joint j gives to these while the spacecraft rests.
    """
    n, w, W = robot.n, work.solver.momenta, work.metric
    mass = robot.properties[TOTAL_MASS]
    centre, share = get_vector(work.solver.centre, 0, 0), 1.0 / mass
    trace = 0.0 * work.solver.scales[0]
    for j in range(n):
        a = get_vector(w, j, AXIS)
        P, L = a * mass - get_vector(w, j, LINEAR), -get_vector(w, j, ANGULAR)
        if robot.joints[j, PRISMATIC] == 0.0:
            P = cross(a, centre - get_vector(w, j, POINT)) * mass - get_vector(w, j, LINEAR)
        for i in range(j + 1):
            turn = get_vector(w, i, TURN)
            if robot.joints[i, PRISMATIC] == 0.0:
                turn = turn + get_vector(w, i, AXIS)
            W[i * n + j] = dot(rigid_velocity(robot, i, share, work.solver), P) + dot(turn, L)
            W[j * n + i] = W[i * n + j]
        trace += W[j * n + j]
    return trace
