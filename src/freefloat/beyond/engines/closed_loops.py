"""Resolved-rate control of many simulated robots that follow the path of one motion."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from freefloat.beyond.engines.mujoco import start
from freefloat.beyond.engines.mujoco_model import MuJoCoModel
from freefloat.beyond.engines.plant import Plants
from freefloat.beyond.engines.rate_commands import RateCommands
from freefloat.dynamics.tasks import Task
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.robot.base import Base
from freefloat.rotations import Rotation
from freefloat.so3 import Array

_ON_TABLE = 2, 3, 4
"""Motions of the spacecraft that a table prevents: along z, about x and y."""
_FASTEST = 10.0
"""Largest commanded joint rate, in units of the largest planned one."""


class Loops(NamedTuple):
    """Closed loops that differ in the simulated robot, the measurements and the gain.

    Attributes:
        factors: On mass and inertia of every body, shape (K, 1 + n).
        noise: Errors of measurements in every period: of the end-effector's position and rotation,
            of the attitude and the joints, shape (periods, K, 9 + n).
        friction: Dry friction in every joint [N m or N], shape (K,).
        gains: On the error of the pose [1/s], shape (K,).
    """

    factors: Array
    noise: Array
    friction: Array
    gains: Array


class Courses(NamedTuple):
    """What simulated robots did, at the instants of control and the end.

    Attributes:
        attitudes: Spacecraft attitudes, unit quaternions x, y, z, w, shape (periods + 1, K, 4).
        joints: Joint values, shape (periods + 1, K, n).
        errors: Distances of the end-effector from the path [m] and angles from its orientation
            [rad], shape (periods + 1, K, 2).
    """

    attitudes: Array
    joints: Array
    errors: Array


def follow(motion: Motion, times: Array, loops: Loops) -> Courses:
    """Simulate closed loops.

    Args:
        motion: The motion whose path is followed, along the whole of it.
        times: Instants of control, and the end [s].
        loops: The closed loops, K.
    """
    problem, count, dof = motion.problem, len(loops.factors), motion.model.dof
    controller = _Controller(motion, loops.gains)
    model = replace(problem.model, base=Base.FREE, gravity=0.0)  # the servos bear the weight
    engine = MuJoCoModel(replace(problem.system, model=model))
    start(motion, engine, 0.0, controller.planned_rates)
    prevented = _ON_TABLE if problem.model.on_table else ()
    plants = Plants(engine, loops.factors, loops.friction, times[1], prevented)
    shape = len(times), count
    courses = Courses(np.empty((*shape, 4)), np.empty((*shape, dof)), np.empty((*shape, 2)))
    for k, t in enumerate(times.tolist()):
        poses = plants.end_effectors(t)
        error = _pose_errors(problem, *poses, t)
        courses.attitudes[k], courses.joints[k] = plants.attitudes, plants.joints
        courses.errors[k] = np.linalg.norm(error.reshape(count, 2, 3), axis=2)
        if k + 1 < len(times):
            rates = controller.rates(plants, loops.noise[k], t, float(times[k + 1]))
            plants.advance(rates, controller.solver.inertias(plants.joints))
    return courses


class _Controller:
    """Resolved-rate control with the nominal robot and noisy measurements."""

    def __init__(self, motion: Motion, gains: Array) -> None:
        self._problem = problem = motion.problem
        self._gains = gains[:, None]
        self.solver = RateCommands(problem)
        twist, speed = problem.path.twist_and_speed(0.0)
        first = motion.initial
        (self.planned_rates,) = self.solver.rates(
            first.attitude[None], first.joints[None], twist[None], speed
        )
        moved = np.abs(np.diff(motion.joints, axis=0)).max(axis=1)
        self._fastest = _FASTEST * float((moved / np.diff(motion.times)).max())
        self._rates = np.tile(self.planned_rates, (len(gains), 1))

    def rates(self, plants: Plants, noise: Array, t: float, following: float) -> Array:
        """The joint rates to command from one instant to the following one [s], shape (K, n)."""
        position, rotation, turn, joints = np.split(noise, [3, 6, 9], axis=1)
        positions, rotations = plants.end_effectors(t)
        measured = Rotation.from_rotvec(rotation) * rotations
        error = _pose_errors(self._problem, positions + position, measured, t)
        attitudes = (Rotation.from_rotvec(turn) * Rotation.from_quat(plants.attitudes)).as_quat()
        if self._problem.has_headings:  # the heading
            attitudes = self._problem.plane.levelled(attitudes)
        twist, speed = self._problem.path.twist_and_speed((t + following) / 2.0)
        rates = self.solver.rates(
            attitudes, plants.joints + joints, twist + self._gains * error, speed
        )
        largest = np.abs(rates).max(axis=1, keepdims=True)
        with np.errstate(invalid="ignore"):
            limited = rates * np.minimum(1.0, self._fastest / np.maximum(largest, self._fastest))
        # at a singularity the last command holds
        self._rates = np.where(np.isfinite(largest), limited, self._rates)
        return self._rates


def _pose_errors(problem: Problem, positions: Array, rotations: Rotation, t: float) -> Array:
    """Displacements and rotation vectors from poses to the path, inertial axes, shape (K, 6).

    Components that the task leaves free are zero; the rotation of ``pointing`` is that of the z
    axis.
    """
    target = problem.path.path.pose(problem.path.timing.s(t))
    rows = problem.task.rows
    if problem.task is Task.POINTING:
        axes, goal = rotations.apply([0.0, 0.0, 1.0]), target.rotation[:, 2]
        sines = np.cross(axes, goal)
        angles = np.arctan2(np.linalg.norm(sines, axis=1), axes @ goal)
        turns, rows = sines / np.sinc(angles / np.pi)[:, None], list(range(6))
    else:
        turns = (Rotation.from_matrix(target.rotation) * rotations.inv()).as_rotvec()
    axes = problem.plane.axes if problem.has_headings else np.eye(3)
    errors = np.zeros((len(positions), 2, 3))
    offsets = np.stack([target.position - positions, turns], axis=1) @ axes
    errors.reshape(-1, 6)[:, rows] = offsets.reshape(-1, 6)[:, rows]
    return (errors @ axes.T).reshape(-1, 6)
