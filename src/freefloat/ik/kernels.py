"""Newton's method for arms that reach poses at the same time, and a choice of what it finds.

In Newton's method, in lock step, the robot is as in equation (4), its spacecraft does not rotate,
and positions are from the centre of mass: with y = a, columns of S* are columns of the virtual
manipulator's Jacobian.
"""

from __future__ import annotations

from math import tau
from typing import NamedTuple

import numpy as np

from freefloat.dynamics.kernels.equation import in_task, write_columns
from freefloat.dynamics.kernels.kinematics import TIP, TIP_X, TIP_Y, TIP_Z, path_origin, place_arms
from freefloat.dynamics.kernels.robot import (
    S_COLUMNS,
    Robot,
    Solver,
    joints_of,
    load_robot,
    make_solver,
    robot_in_tables,
    solver_in_tables,
)
from freefloat.ik.chain import EQUALLY_FAR
from freefloat.lockstep.compilation import compiled, inlined, inner
from freefloat.lockstep.factors import damped_step
from freefloat.lockstep.lanes import WIDTH, Float, magnitude, maximum, select, sqrt
from freefloat.lockstep.tables import (
    Table,
    get_lane,
    get_vector,
    lanes,
    set_lane,
    subtable,
    workspace,
)
from freefloat.lockstep.vectors import Vector, components, cross, dot, vector
from freefloat.so3 import Array, BoolArray, IntArray

_SMALLEST = 1e-12
"""Smallest square of the cosine of half an angle: a rotation by pi has no direction."""
_EXACT = 1e-13
"""Residual at which the iteration stops [m, rad]."""
_GAIN = 0.9
"""A step hardly reduces the residual if it keeps more than this part of the smallest one."""


class NewtonBuffers(NamedTuple):
    """Workspace of one thread."""

    solver: Solver
    q: Table
    targets: Table  # position and axes of each end-effector
    normal: Table  # products of the Jacobian's rows, then their factors
    size: Table  # of the error
    moves: Table  # 1 in lanes that take the step


def make_workspace(robot: Robot, properties: int) -> NewtonBuffers:
    """Workspace for a robot, and so many properties that differ."""
    shapes = (robot.n,), (robot.arms, 12), (S_COLUMNS, S_COLUMNS), (1,), (1,)
    solver = make_solver(robot.n, robot.arms, properties)
    return NewtonBuffers(solver, *workspace(*shapes))


@compiled
def solve_all(
    robot: Robot, robots: Array | None, targets: Array, pose: IntArray, q: Array, residual: Array,
    steps: int, patience: int, workspace: NewtonBuffers,
) -> None:  # fmt: skip
    """Replace joint values by the values to which Newton's method converges; write the residuals.

    Args:
        robot: The robot.
        robots: Rows of ``Robot.properties`` of each pose, shape (K, C); None where all are equal.
        targets: Positions and axes of E end-effectors at K poses, shape (K, E, 12).
        pose: Numbers of the poses, shape (N,).
        q: Joint values, shape (N, n).
        residual: Receives the residuals [m, rad], shape (N,).
        steps: Largest number of steps.
        patience: Largest number of consecutive steps that hardly reduce the residual.
        workspace: Workspace.
    """
    work = _in_tables(workspace)
    robot = robot_in_tables(robot, robots, work.solver)
    owners, lowest = np.empty(WIDTH, np.int64), np.empty(WIDTH)
    taken, vain = np.empty(WIDTH, np.int64), np.empty(WIDTH, np.int64)
    following = busy = min(WIDTH, len(q))
    for lane in range(WIDTH):  # idle ones compute the first again
        k = lane if lane < following else 0
        _load(robots, targets, pose[k], q[k], lane, work)
        owners[lane] = lane if lane < following else -1
        taken[lane], vain[lane], lowest[lane] = 0, 0, np.inf
    while busy > 0:
        work.size[0] = _linearize(robot, work)
        for lane in range(WIDTH):
            k, size = owners[lane], get_lane(work.size, 0, lane)
            vain[lane] = 0 if size < _GAIN * lowest[lane] else vain[lane] + 1
            lowest[lane] = min(size, lowest[lane])
            goes_on = k >= 0 and size > _EXACT
            goes_on = goes_on and taken[lane] < steps and vain[lane] <= patience
            set_lane(work.moves, 0, lane, 1.0 if goes_on else 0.0)
            taken[lane] += 1
            if k < 0 or goes_on:
                continue
            residual[k] = size
            for j in range(robot.n):
                q[k, j] = get_lane(work.q, j, lane)
            owners[lane], taken[lane], vain[lane], lowest[lane] = -1, 0, 0, np.inf
            if following == len(q):
                busy -= 1
                continue
            _load(robots, targets, pose[following], q[following], lane, work)
            owners[lane] = following
            following += 1
        _take_step(robot, work)


@inner
def _in_tables(work: NewtonBuffers) -> NewtonBuffers:
    """Arrays as tables."""
    return NewtonBuffers(
        solver_in_tables(work.solver), lanes(work.q, 1), lanes(work.targets, 12),
        lanes(work.normal, S_COLUMNS), lanes(work.size, 1), lanes(work.moves, 1),
    )  # fmt: skip


@inner
def _load(
    robots: Array | None, targets: Array, pose: int, q: Array, lane: int, work: NewtonBuffers
) -> None:
    """Write targets and joints (n,) to a lane, and the robot if it differs from others."""
    table = subtable(work.targets, 0, 1)
    for e in range(targets.shape[1]):
        for i in range(12):
            set_lane(table, 12 * e + i, lane, targets[pose, e, i])
    for j in range(len(q)):
        set_lane(work.q, j, lane, q[j])
    load_robot(robots, pose, lane, work.solver)


@inlined
def _take_step(robot: Robot, work: NewtonBuffers) -> None:
    """Add Levenberg's step, of at most one radian or metre per joint."""
    solver, size = work.solver, work.size[0]
    step = solver.rates
    damped_step(robot.m, robot.n, solver.S, solver.b, size * size, work.normal, step)
    largest = magnitude(step[0])
    for j in range(1, robot.n):
        largest = maximum(largest, magnitude(step[j]))
    share = 1.0 / maximum(largest, 1.0 + 0.0 * largest)
    for j in range(robot.n):
        work.q[j] = work.q[j] + select(work.moves[0] > 0.0, share * step[j], 0.0)


@inlined
def _linearize(robot: Robot, work: NewtonBuffers) -> Float:
    """Write errors of the poses and their Jacobian; the errors' norm."""
    solver, still = work.solver, vector(0.0, 0.0, 0.0)
    M, _, _ = place_arms(robot, work.q, solver)
    c = path_origin(robot, solver)
    b, square = solver.b, 0.0 * M
    for e in range(robot.arms):
        for j in joints_of(robot, e):
            write_columns(robot, e, j, 1.0 / M, still, solver)
        error = get_vector(work.targets, e, 0) + c - get_vector(solver.ends, e, TIP)
        b[6 * e], b[6 * e + 1], b[6 * e + 2] = components(error)
        turn = in_task(robot, e, _rotation_error(robot, e, work), solver)
        b[6 * e + 3], b[6 * e + 4], b[6 * e + 5] = components(turn)
    for i in range(robot.m):
        b[i] = b[int(robot.rows[i])]
        square += b[i] * b[i]
    return sqrt(square)


@inlined
def _rotation_error(robot: Robot, e: int, work: NewtonBuffers) -> Vector:
    """The axis of the rotation onto the wanted axes, times twice the sine of half its angle."""
    ends, targets = work.solver.ends, work.targets
    z, wanted = get_vector(ends, e, TIP_Z), get_vector(targets, e, 9)
    across, cosine = cross(z, wanted), dot(z, wanted)
    square = (1.0 + cosine) * 0.5
    if not robot.pointing:
        x, y = get_vector(ends, e, TIP_X), get_vector(ends, e, TIP_Y)
        wanted_x, wanted_y = get_vector(targets, e, 3), get_vector(targets, e, 6)
        across = (across + cross(x, wanted_x) + cross(y, wanted_y)) * 0.5
        square = (1.0 + cosine + dot(x, wanted_x) + dot(y, wanted_y)) * 0.25
    return across * (1.0 / sqrt(maximum(square, _SMALLEST + 0.0 * square)))


@compiled
def spread(prismatic: BoolArray, q: Array, closest: float, chosen: Array) -> None:
    """Write configurations by farthest-point sampling from the first one.

    Of joint values (n, B, K), NaN for missing configurations, at most M at each pose are written to
    ``chosen`` (n, M, K), no two of them ``closest`` or nearer, by the largest joint difference
    [rad, m].
    """
    n, count, poses = q.shape
    own = np.empty((n, count))  # the configurations at a pose, side by side
    distance, largest, turns = np.empty(count), np.empty(count), 1.0 / tau
    for k in range(poses):
        for b in range(count):
            distance[b] = -1.0 if np.isnan(q[0, b, k]) else np.inf
            for j in range(n):
                own[j, b] = q[j, b, k]
        for column in range(min(chosen.shape[1], count)):
            farthest = 0
            for b in range(1, count):
                if distance[b] > distance[farthest] + EQUALLY_FAR:
                    farthest = b
            if distance[farthest] < closest:
                break
            largest[:] = 0.0
            for j in range(n):
                value, turn = own[j, farthest], 0.0 if prismatic[j] else tau
                chosen[j, column, k] = value
                for b in range(count):
                    difference = own[j, b] - value
                    difference -= turn * np.rint(difference * turns)
                    largest[b] = max(largest[b], abs(difference))
            for b in range(count):
                distance[b] = min(distance[b], largest[b])
