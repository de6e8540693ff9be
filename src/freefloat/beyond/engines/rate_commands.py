"""Equation (4) and measures of one robot in many states at once, by compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from freefloat.dynamics.denavit_hartenberg import link_frames
from freefloat.dynamics.kernels.equation import form_jacobian, solve_rates
from freefloat.dynamics.kernels.robot import Robot, robot_in_tables
from freefloat.dynamics.measures import SingularityMeasure
from freefloat.dynamics.robot_arrays import KernelAxes
from freefloat.dynamics.tasks import Task
from freefloat.ensemble.arrays import kernel_measure, kernel_problem
from freefloat.ensemble.kernels.flow import to_spacecraft
from freefloat.ensemble.kernels.measures import measure_at
from freefloat.ensemble.kernels.null_space import add_null_space_motion, form_inertia, gradient
from freefloat.ensemble.kernels.records import (
    Buffers,
    Measure,
    NullSpace,
    ProblemTables,
    make_workspace,
    measure_in_tables,
    problem_in_tables,
    workspace_in_tables,
)
from freefloat.lockstep.compilation import compiled, inner
from freefloat.lockstep.lanes import WIDTH
from freefloat.lockstep.tables import get_lane, get_vector, set_lane, set_vector, subtable
from freefloat.lockstep.vectors import vector
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array


class RateCommands:
    """Solver of equation (4) for the joint rates in many states of a problem's robot.

    Results for a state do not depend on the others.
    """

    def __init__(self, problem: Problem) -> None:
        """Convert a problem to the arrays that the kernels read."""
        problem.model.require_supported("rates of measured states")
        n = problem.model.dof
        self._arrays = kernel_problem(problem)
        self._axes = KernelAxes.of(problem.model, problem.task)
        momenta = np.concatenate([problem.momentum, problem.wheel_momentum])
        self._momentum = self._axes.systems(momenta[None])[0]
        self._workspace = make_workspace(n, len(problem.task.rows))

    def rates(self, attitudes: Array, joints: Array, twists: Array, speed: float) -> Array:
        """Joint rates, with the null-space motion of a redundant arm, shape (K, n).

        Not finite where the arm is exactly singular.

        Args:
            attitudes: Unit quaternions x, y, z, w, shape (K, 4).
            joints: Joint values, shape (K, n).
            twists: Twists of the end-effector, inertial frame, shape (K, 6).
            speed: Path speed ds/dt [1/s], which scales the attraction of a redundant arm.
        """
        rates = np.empty(joints.shape)
        # copies: other kernels would be compiled for arrays that are read-only or of another order
        inputs = self._axes.attitudes(attitudes), joints, twists
        attitudes, joints, twists = (np.array(rows, order="C") for rows in inputs)
        measured = Measured(attitudes, joints, twists, self._momentum, speed)
        command(self._arrays, measured, self._workspace, rates)
        return rates

    def inertias(self, joints: Array) -> Array:
        """Generalized inertias of the joint rates of a free robot, shape (K, n, n)."""
        count, n = joints.shape
        inertias = np.empty((count, n, n))
        weigh(self._arrays, joints, self._workspace, inertias)
        return inertias


class MeasureValues:
    """Values of the singularity measure of a robot and a task, with their signs."""

    def __init__(self, model: FreeFloatingModel, task: Task, measure: SingularityMeasure) -> None:
        """Convert them to the arrays that the kernels read."""
        frames = link_frames(model)
        self._robot, self._measure = kernel_measure(model, task, measure.name, frames)
        self._workspace = make_workspace(model.dof, len(task.rows))

    def __call__(self, joints: Array) -> Array:
        """Values at joint values of shape (K, n), shape (K,)."""
        values = np.empty(len(joints))
        measure_all(
            self._robot, self._measure, np.ascontiguousarray(joints), self._workspace, values
        )
        return values


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
