"""A simulated robot with joint servos, as a controller meets it."""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.momentum import mass_matrix
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, Pose
from freefloat.verification.engines.mujoco_model import Engine

_STEPS = 10
"""Steps of the simulation in a period."""
_STIFFNESS = 0.1
"""Natural frequency of the servos times a step."""


class Plant:
    """MuJoCo's robot with dry friction and joint servos that follow commanded rates.

    The servos are computed-torque controllers with the inertias of the nominal robot. They follow
    the integral of the commanded rates.
    """

    def __init__(
        self, engine: Engine, nominal: FreeFloatingModel, period: float, friction: float
    ) -> None:
        """Take over an engine in its initial state.

        Args:
            engine: MuJoCo's robot.
            nominal: The robot that the servos know.
            period: Time between two commands [s].
            friction: Dry friction in every joint [N m or N].
        """
        self._engine, self._nominal = engine, nominal
        self._step = period / _STEPS
        self._reference = self.joints.copy()
        engine.rest(self._step)
        engine.set_friction(friction)

    @property
    def attitude(self) -> Array:
        """Of the spacecraft, unit quaternion x, y, z, w."""
        return np.roll(self._engine.data.qpos[3:7], -1)

    @property
    def joints(self) -> Array:
        """Joint values [rad or m], shape (n,)."""
        return np.array(self._engine.data.qpos[7:])

    @property
    def end_effector(self) -> Pose:
        """Its pose in the frame of the path."""
        return Pose(*self._engine.end_effector())

    def advance(self, rates: Array) -> None:
        """Simulate a period in which the servos follow joint rates (n,)."""
        M = mass_matrix(self._nominal, self.joints)
        H = M[6:, 6:] - M[6:, :6] @ np.linalg.solve(M[:6, :6], M[:6, 6:])
        h, data = self._step, self._engine.data
        stiff, damp = (_STIFFNESS / h) ** 2, 2.0 * _STIFFNESS / h
        for _ in range(_STEPS):
            middle = self._reference + h / 2.0 * rates
            ahead = data.qpos[7:] + h / 2.0 * data.qvel[6:]
            error = stiff * (middle - ahead) + damp * (rates - data.qvel[6:])
            self._engine.step(H @ error)
            self._reference += h * rates
