"""Joint rates for measured states, inertias of the arm and measures, of robots in lock step."""

from __future__ import annotations

from typing import NamedTuple

from freefloat.dynamics.kernels.equation import form_jacobian, solve_rates
from freefloat.dynamics.kernels.robot import Robot, robot_in_tables
from freefloat.ensemble.kernels.flow import to_spacecraft
from freefloat.ensemble.kernels.measures import measure_at
from freefloat.ensemble.kernels.null_space import add_null_space_motion, form_inertia, gradient
from freefloat.ensemble.kernels.records import (
    Buffers,
    Measure,
    NullSpace,
    ProblemTables,
    measure_in_tables,
    problem_in_tables,
    workspace_in_tables,
)
from freefloat.lockstep.compilation import compiled, inner
from freefloat.lockstep.lanes import WIDTH
from freefloat.lockstep.tables import get_lane, get_vector, set_lane, set_vector, subtable
from freefloat.lockstep.vectors import vector
from freefloat.so3 import Array


class Measured(NamedTuple):
    """States, and what is asked of the end-effector."""

    attitudes: Array  # unit quaternions, (K, 4)
    joints: Array  # (K, n)
    twists: Array  # of the end-effector relative to the centre of mass, inertial frame, (K, 6)
    momentum: Array  # about the centre of mass, inertial frame, then momentum of wheels, (6,)
    speed: float  # of the path


@compiled
def command(problem: ProblemTables, measured: Measured, workspace: Buffers, out: Array) -> None:
    """Solve (4) in measured states; write joint rates (K, n)."""
    work = workspace_in_tables(workspace)
    problem = problem_in_tables(problem, None, work)
    robot, count = problem.robot, len(measured.joints)
    for first in range(0, count, WIDTH):
        for lane in range(WIDTH):
            load(measured, min(first + lane, count - 1), lane, work)
        solve(robot, problem.null_space, measured.speed, work)
        for lane in range(min(WIDTH, count - first)):
            for j in range(robot.n):
                out[first + lane, j] = get_lane(work.solver.rates, j, lane)


@inner
def load(measured: Measured, k: int, lane: int, work: Buffers) -> None:
    """Write state k to a lane."""
    for j in range(4):
        set_lane(work.y, j, lane, measured.attitudes[k, j])
    for j in range(measured.joints.shape[1]):
        set_lane(work.y, 4 + j, lane, measured.joints[k, j])
    twists = subtable(work.solver.twists, 0, 1)
    for j in range(6):
        set_lane(twists, j, lane, measured.twists[k, j])
        set_lane(work.h, j, lane, measured.momentum[j])


@inner
def solve(robot: Robot, null_space: NullSpace | None, speed: float, work: Buffers) -> None:
    """Write the joint rates into ``work.solver.rates``."""
    y, h, twists = work.y, work.h, work.solver.twists
    q = subtable(y, 4, 1)
    x, e = vector(y[0], y[1], y[2]), y[3]
    for part in range(2):
        seen = to_spacecraft(x, e, get_vector(twists, 0, 3 * part))
        set_vector(twists, 0, 3 * part, seen)
    momentum = to_spacecraft(x, e, vector(h[0], h[1], h[2])) - vector(h[3], h[4], h[5])
    if null_space is not None and null_space.toward != 0:
        gradient(robot, null_space, q, work)
    solve_rates(robot, q, momentum, work.solver)
    if null_space is not None:
        add_null_space_motion(robot, null_space, speed + 0.0 * e, work)


@compiled
def weigh(problem: ProblemTables, joints: Array, workspace: Buffers, out: Array) -> None:
    """Write generalized inertias of the joint rates (K, n, n)."""
    work = workspace_in_tables(workspace)
    problem = problem_in_tables(problem, None, work)
    robot, (count, n) = problem.robot, joints.shape
    for first in range(0, count, WIDTH):
        for lane in range(WIDTH):
            for j in range(n):
                set_lane(work.y, 4 + j, lane, joints[min(first + lane, count - 1), j])
        form_jacobian(robot, subtable(work.y, 4, 1), work.solver)
        form_inertia(robot, work)
        for lane in range(min(WIDTH, count - first)):
            for j in range(n):
                for i in range(n):
                    out[first + lane, i, j] = get_lane(work.metric, i * n + j, lane)


@compiled
def measure_all(
    robot: Robot, measure: Measure, joints: Array, workspace: Buffers, out: Array
) -> None:
    """Write the singularity measure at joint values (K, n)."""
    work, (count, n) = workspace_in_tables(workspace), joints.shape
    robot, measure = robot_in_tables(robot, None, work.solver), measure_in_tables(measure)
    for first in range(0, count, WIDTH):
        for lane in range(WIDTH):
            for j in range(n):
                set_lane(work.y, 4 + j, lane, joints[min(first + lane, count - 1), j])
        work.solver.b[0] = measure_at(robot, measure, subtable(work.y, 4, 1), work)
        for lane in range(min(WIDTH, count - first)):
            out[first + lane] = get_lane(work.solver.b, 0, lane)
