"""The system: a robot with the momenta that it conserves."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.momentum import conserved, conserved_inertias, momentum_map
from freefloat.dynamics.plane import LEVEL
from freefloat.errors import InputError, finite_vector
from freefloat.robot.joint_values import configurations, finite_after
from freefloat.robot.model import FreeFloatingModel, require_model
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, frozen, turned, unit_quaternion, zeros


@dataclass(frozen=True, eq=False)
class System:
    """A free-floating robot with its angular momentum, its wheels, and its centre of mass's motion.

    Attributes:
        model: Robot.
        momentum: Angular momentum about the centre of mass, with the momentum of wheels, inertial
            axes [N m s], shape (3,).
        wheels: Part of the momentum that wheels store, constant in the spacecraft frame [N m s],
            shape (3,): the wheels turn with constant rates relative to the spacecraft, and their
            masses and inertias belong to it.
        drift: Velocity of the centre of mass, inertial axes [m/s], shape (3,).

    Raises:
        InputError: If a vector has another shape or is not finite.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_2dof")
        >>> system = ff.System(model, momentum=[0.0, 0.0, 0.1])
        >>> system.base_rate([0.0, 0.0, 0.0, 1.0], [0.3, 0.7], [0.0, 0.0]).round(4)
        array([0.    , 0.    , 0.0051])
    """

    model: FreeFloatingModel = field(repr=False)
    momentum: Array = field(default_factory=zeros)
    wheels: Array = field(default_factory=zeros)
    drift: Array = field(default_factory=zeros)

    def __post_init__(self) -> None:
        require_model(self.model)
        keys = {"momentum": "momentum", "wheels": "wheels.momentum", "drift": "drift"}
        for name, key in keys.items():
            vector = frozen(finite_vector(key, getattr(self, name), 3))
            object.__setattr__(self, name, vector)
            if self.model.on_table and (vector[2:] if name == "drift" else vector[:2]).any():
                accepted = "[vx, vy, 0]" if name == "drift" else "[0, 0, hz]"
                problem = f"{vector.tolist()}, of which a table carries a part"
                raise InputError(key, problem, accepted)

    @property
    def rotates(self) -> bool:
        """Whether system or wheels have angular momentum."""
        return bool(self.momentum.any() or self.wheels.any())

    @property
    def momentum_bound(self) -> float:
        """Largest angular momentum of spacecraft and arm without wheels, any attitude [N m s]."""
        return float(np.linalg.norm(self.momentum) + np.linalg.norm(self.wheels))

    def scaled(self, factor: float) -> System:
        """The system that moves alike at another speed, by (8): momenta and drift by a factor.

        The system that moves backward in time has the factor -1.
        """
        momentum, wheels = factor * self.momentum, factor * self.wheels
        return replace(self, momentum=momentum, wheels=wheels, drift=factor * self.drift)

    def attitude(self, values: npt.ArrayLike) -> Array:
        """The unit quaternion of an attitude; an InputError unless the robot can have it."""
        if self.model.on_table:
            return LEVEL.checked("attitude", values)
        return unit_quaternion("attitude", values)

    def body_momentum(self, attitude: npt.ArrayLike) -> Array:
        """Angular momentum of spacecraft and arm without wheels, inertial [N m s], (..., 3)."""
        return np.asarray(self.momentum - rotation_matrix(attitude) @ self.wheels)

    def base_rate(
        self, attitude: npt.ArrayLike, joints: npt.ArrayLike, rates: npt.ArrayLike
    ) -> Array:
        """Angular velocity of the spacecraft for prescribed joint rates.

        It is D^-1 (R0^T h - h_w - Dq q').

        Args:
            attitude: Unit quaternion x, y, z, w, shape (4,) or (K, 4).
            joints: Joint values, shape (n,) or (K, n).
            rates: Joint rates, of the shape of the joints.

        Returns:
            In the spacecraft frame [rad/s], shape (..., 3).

        Raises:
            InputError: If joints or rates do not fit the robot, or the attitude is no unit
                quaternion or, on a table, no turn about z.
        """
        D, Dq = conserved_inertias(self.model, joints)
        if D.ndim == 2:
            attitude, rates = self.attitude(attitude), self._rates(rates)
        else:
            rates, attitude = configurations(rates, self.model.dof, "rates"), np.asarray(attitude)
            wrong = np.abs(np.linalg.norm(attitude, axis=1) - 1.0)
            wrong += self.model.on_table * np.abs(attitude[:, :2]).sum(axis=1)
            self.attitude(attitude[wrong.argmax()])
        h = turned(rotation_matrix(attitude).swapaxes(-1, -2), self.momentum)
        demanded = h - self.wheels - turned(Dq, np.asarray(rates))
        return np.asarray(np.linalg.solve(D, demanded[..., None])[..., 0])

    def base_twist(
        self, attitude: npt.ArrayLike, joints: npt.ArrayLike, rates: npt.ArrayLike
    ) -> Array:
        """Twist of the spacecraft for prescribed joint rates, in a frame that does not move.

        Args:
            attitude: Unit quaternion x, y, z, w.
            joints: Joint values, shape (n,).
            rates: Joint rates, shape (n,).

        Returns:
            ``[linear; angular]`` at the root link's origin [m/s; rad/s], spacecraft axes,
            shape (6,).

        Raises:
            InputError: If joints or rates do not fit the robot, or the attitude is no unit
                quaternion or, on a table, no turn about z.
        """
        attitude = self.attitude(attitude)
        A_G = conserved(self.model, momentum_map(self.model, joints, attitude))
        linear = self.model.total_mass * self.drift
        demanded = np.concatenate([linear, self.body_momentum(attitude)])
        demanded -= A_G[:, 6:] @ self._rates(rates)
        return np.asarray(np.linalg.solve(A_G[:, :6], demanded))

    def _rates(self, rates: npt.ArrayLike) -> Array:
        return finite_after(np.zeros(0), "rates", rates, self.model.dof)
