"""Resolved-rate control of many simulated robots that follow the path of one motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from freefloat.beyond.engines.mujoco import start
from freefloat.beyond.engines.mujoco_model import MuJoCoModel
from freefloat.beyond.engines.rate_commands import RateCommands
from freefloat.beyond.engines.servo_steps import (
    Dynamics,
    Friction,
    Servos,
    States,
    advance,
    reduce_dynamics,
)
from freefloat.dynamics.tasks import Task
from freefloat.errors import IntegrationError
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.robot.base import Base
from freefloat.rotations import Rotation
from freefloat.so3 import Array

_ON_TABLE = 2, 3, 4
"""Motions of the spacecraft that a table prevents: along z, about x and y."""
_FASTEST = 10.0
"""Largest commanded joint rate, in units of the largest planned one."""
_STEPS_IN_PERIOD = 16
"""Steps of the equation of motion in a period."""
_PREDICTION_STEPS = 4
"""Steps that predict where MuJoCo evaluates the dynamics."""
_DIVERGING = 1e6
"""Rates at which a simulation diverges [rad/s, m/s]."""


class Loops(NamedTuple):
    """Closed loops that differ in the simulated robot, the measurements and the gain."""

    factors: Array  # on mass and inertia of every body, (K, 1 + n)
    noise: Array  # of end-effector position and rotation, attitude, joints, (periods, K, 9 + n)
    friction: Array  # dry, in every joint [N m or N], (K,)
    gains: Array  # on the error of the pose [1/s], (K,)


class Courses(NamedTuple):
    """What simulated robots did, at the instants of control and the end."""

    attitudes: Array  # unit quaternions x, y, z, w, (periods + 1, K, 4)
    joints: Array  # (periods + 1, K, n)
    errors: Array  # distances from path [m] and orientation [rad], (periods + 1, K, 2)


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

    Components that the task leaves free are zero; the rotation of ``pointing`` is the rotation of
    the z axis.
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


class Plants:
    """MuJoCo's robots with dry friction and joint servos that follow commanded rates.

    The servos are computed-torque controllers with the inertias of the nominal robot; their natural
    frequency is one over the period. They follow the integral of the commanded rates.

    No external force acts. Momentum gives the motion of the spacecraft, and an equation of motion
    of the joints remains. MuJoCo evaluates its mass matrices and bias forces at the start of a
    period, and where constant ones would lead in the middle and at the end; polynomials of time
    connect them.
    """

    def __init__(
        self,
        engine: MuJoCoModel,
        factors: Array,
        friction: Array,
        period: float,
        prevented: Sequence[int] = (),
    ) -> None:
        """Take over an engine in its initial state.

        Args:
            engine: MuJoCo's nominal robot. The others have its momentum, poses and joint rates.
            factors: Factors on mass and inertia of every body, shape (K, 1 + n).
            friction: Dry friction in every joint [N m or N], shape (K,).
            period: Time between two commands [s].
            prevented: Numbers of the motions of the spacecraft that a table prevents.
        """
        self._system, self._tool, self._period = engine.system, engine.tools[0], period
        self._prevented = np.array(prevented, dtype=np.int64)
        self._moves = np.isin(range(3), self._prevented, invert=True)
        self._batch = engine.batch(factors)
        self._friction = Friction(friction, *engine.friction_law(self._batch))
        model = engine.model  # columns of the elements of its mass matrix, and ends of the rows
        self._rows = model.M_colind.copy(), np.append(model.M_rowadr, model.nC)
        bind = self._batch.bind
        self._at, self._velocities = bind("qpos"), bind("qvel")
        self._mass, self._bias, self._centres = bind("M"), bind("qfrc_bias"), bind("subtree_com")
        self._positions, self._rotations = bind("xpos"), bind("xquat")
        self._stage = engine.velocity_stage
        count, n = len(factors), factors.shape[1] - 1
        self._states, self._middle, self._end = (
            States(*(np.empty((count, size)) for size in (4, n, n))) for _ in range(3)
        )
        shapes = (count, n, n), (count, n), (count, 3, n), (count, 3)
        self._dynamics = tuple(Dynamics(*map(np.zeros, shapes)) for _ in range(3))
        position, *initial = np.split(engine.data.qpos, [3, 7])
        self._at[:, :3] = position
        for entry, value in zip(self._states, [*initial, engine.data.qvel[6:]], strict=True):
            entry[:] = value
        self._references = self._states.joints.copy()
        for _ in range(2):  # first without the angular velocity of the spacecraft
            self._evaluate(self._states, self._dynamics[0], self._dynamics[0])
        self._centres_at_start = self._centres[:, 0].copy()

    def _evaluate(self, states: States, similar: Dynamics, out: Dynamics) -> None:
        """Evaluate the dynamics with MuJoCo.

        Args:
            states: The states.
            similar: Dynamics that give the angular velocity of the spacecraft.
            out: Receives the dynamics.
        """
        self._at[:, 3:7], self._at[:, 7:] = states.attitudes, states.joints
        spins = similar.spins + (similar.turns @ states.rates[..., None])[..., 0]
        if not np.abs(np.hstack([spins, states.rates])).max() < _DIVERGING:  # also where it is NaN
            raise IntegrationError(0.0, "a simulated robot diverges", "smaller errors or periods")
        self._velocities[:, 3:6], self._velocities[:, 6:] = spins, states.rates
        self._batch.forward(stage=self._stage)
        momenta = np.zeros_like(spins)  # without the wheels', spacecraft frame
        if self._system.rotates:
            turned = Rotation.from_quat(np.roll(states.attitudes, -1, axis=1)).inv()
            momenta = turned.apply(self._system.momentum.copy()) - self._system.wheels
        torques = -np.cross(spins, self._system.wheels)
        reduce_dynamics(self._mass, self._bias, *self._rows, momenta, torques, self._prevented, out)

    @property
    def attitudes(self) -> Array:
        """Attitudes of the spacecraft, unit quaternions x, y, z, w, shape (K, 4)."""
        return np.roll(self._states.attitudes, -1, axis=1)

    @property
    def joints(self) -> Array:
        """Joint values [rad or m], shape (K, n)."""
        return self._states.joints.copy()

    def end_effectors(self, t: float) -> tuple[Array, Rotation]:
        """Their positions (K, 3) and rotations in the frame of the path, at the present time."""
        quaternions = np.roll(self._rotations[:, self._tool], -1, axis=1)
        moved = self._centres_at_start + t * self._system.drift - self._centres[:, 0]
        moved *= self._moves
        return self._positions[:, self._tool] + moved, Rotation.from_quat(quaternions)

    def advance(self, rates: Array, inertias: Array) -> None:
        """Simulate a period in which the servos follow joint rates.

        Args:
            rates: Joint rates, shape (K, n).
            inertias: Inertias about the joints of the nominal robot, shape (K, n, n).
        """
        period, (first, second, third) = self._period, self._dynamics
        servos = Servos(self._references, rates, inertias, 1.0 / period**2, 2.0 / period)
        constant = self._states, servos, self._friction, (first, first, first)
        advance(*constant, period, _PREDICTION_STEPS, self._middle, self._end)
        self._evaluate(self._middle, first, second)
        self._evaluate(self._end, second, third)
        varying = self._states, servos, self._friction, self._dynamics
        advance(*varying, period, _STEPS_IN_PERIOD, self._middle, self._end)
        self._references += period * rates
        self._states, self._end = self._end, self._states
        self._evaluate(self._states, third, first)
