"""Simulated robots with joint servos, as controllers meet them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freefloat.beyond.engines.mujoco_model import MuJoCoModel
from freefloat.beyond.engines.servo_steps import (
    Dynamics,
    Friction,
    Servos,
    States,
    advance,
    reduce_dynamics,
)
from freefloat.errors import IntegrationError
from freefloat.rotations import Rotation
from freefloat.so3 import Array

_STEPS_IN_PERIOD = 16
"""Steps of the equation of motion in a period."""
_PREDICTION_STEPS = 4
"""Steps that predict where MuJoCo evaluates the dynamics."""
_FASTEST = 1e6
"""Rates at which a simulation diverges [rad/s, m/s]."""


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
        self._rows = engine.mass_matrix_rows()
        bind = self._batch.bind
        self._at, self._velocities = bind("qpos"), bind("qvel")
        self._mass, self._bias, self._centres = bind("M"), bind("qfrc_bias"), bind("subtree_com")
        self._positions, self._rotations = bind("xpos"), bind("xquat")
        self._stage = engine.velocity_stage
        count, n = len(factors), factors.shape[1] - 1
        self._states, self._middle, self._end = (_empty_states(count, n) for _ in range(3))
        self._dynamics = tuple(_empty_dynamics(count, n) for _ in range(3))
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
        if not np.abs(np.hstack([spins, states.rates])).max() < _FASTEST:  # also where it is NaN
            raise IntegrationError(0.0, "a simulated robot diverges", "smaller errors or periods")
        self._velocities[:, 3:6], self._velocities[:, 6:] = spins, states.rates
        self._batch.forward(stage=self._stage)
        momenta = self._momenta(states.attitudes)
        torques = -np.cross(spins, self._system.wheels)
        reduce_dynamics(self._mass, self._bias, *self._rows, momenta, torques, self._prevented, out)

    def _momenta(self, attitudes: Array) -> Array:
        """Angular momenta without those of wheels, spacecraft frame, shape (K, 3)."""
        if not self._system.rotates:
            return np.zeros((len(attitudes), 3))
        turned = Rotation.from_quat(np.roll(attitudes, -1, axis=1)).inv()
        return np.asarray(turned.apply(self._system.momentum.copy()) - self._system.wheels)

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


def _empty_states(count: int, n: int) -> States:
    return States(np.empty((count, 4)), np.empty((count, n)), np.empty((count, n)))


def _empty_dynamics(count: int, n: int) -> Dynamics:
    return Dynamics(
        np.empty((count, n, n)), np.empty((count, n)), np.zeros((count, 3, n)), np.zeros((count, 3))
    )
