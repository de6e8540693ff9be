"""Equation (4) and measures of one robot in many states at once, by compiled code."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.denavit_hartenberg import link_frames
from freefloat.dynamics.measures import SingularityMeasure
from freefloat.dynamics.robot_arrays import KernelAxes
from freefloat.dynamics.tasks import Task
from freefloat.ensemble.arrays import kernel_measure, kernel_problem
from freefloat.ensemble.kernels.commands import Measured, command, measure_all, weigh
from freefloat.ensemble.kernels.records import make_workspace
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
