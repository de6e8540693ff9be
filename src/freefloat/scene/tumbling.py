"""Torque-free rotation of a rigid body."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy
from numpy.polynomial import chebyshev

from freefloat.errors import InputError, finite_vector
from freefloat.robot.parts import inertia_matrix
from freefloat.rotations import Rotation, rotation_matrix
from freefloat.so3 import Array, frozen, zeros

_TOLERANCE = 1e-13
"""Relative tolerance: the attitude is exact to 1e-11 over ten revolutions."""
_ABSOLUTE = 1e-15
_TIME_ERROR = 1e-12
"""Rounding error of times, relative to the largest, that may have the other sign."""
_DEGREE = 7
"""Degree of the polynomials by which DOP853 interpolates."""
MOST_REVOLUTIONS = 1000.0
"""Largest number of revolutions that is integrated."""


@dataclass(frozen=True, eq=False)
class Tumbling:
    """Torque-free rotation of a rigid body about its centre of mass.

    Euler's equations and the quaternion's kinematics are integrated by DOP853.

    Attributes:
        inertia: Inertia about the centre of mass, axes of the body's frame, up to a factor
            [kg m²]: three principal moments, six moments xx, xy, xz, yy, yz, zz, or a matrix;
            kept as a matrix, shape (3, 3).
        rate: Angular velocity at time zero, axes of the body's frame [rad/s], shape (3,).
        com: Centre of mass in the body's frame [m], shape (3,); it does not move.

    Raises:
        InputError: If no rigid body has that inertia.

    Example:
        >>> tumbling = ff.Tumbling(inertia=[90.0, 70.0, 40.0], rate=[0.0, 0.0, 0.1])
        >>> tumbling.rotation(5.0 * np.pi).round(12) + 0.0
        array([[ 0., -1.,  0.],
               [ 1.,  0.,  0.],
               [ 0.,  0.,  1.]])
    """

    inertia: Array
    rate: Array
    com: Array = field(default_factory=zeros)

    def __post_init__(self) -> None:
        object.__setattr__(self, "inertia", inertia_matrix("tumbling.inertia", self.inertia))
        for name in ("rate", "com"):
            values = frozen(finite_vector(f"tumbling.{name}", getattr(self, name), 3))
            object.__setattr__(self, name, values)

    @cached_property
    def _principal(self) -> tuple[Array, Array]:
        """Principal moments, rising, and axes in the body's frame as columns, right-handed."""
        moments, axes = np.linalg.eigh(self.inertia)
        return moments, axes * np.sign(np.linalg.det(axes))

    @cached_property
    def largest_rate(self) -> float:
        """Bound of the magnitude of the angular velocity at all times [rad/s].

        It is the rate of the rotation with the same energy about the axis of the smallest moment.
        """
        energy = self.rate @ self.inertia @ self.rate
        return math.sqrt(energy / self._principal[0][0])

    def rotation(self, t: float | Array) -> Array:
        """Rotation of the body from its attitude at time zero to its attitude at time t [s].

        Args:
            t: A time, or times (K,) of one sign.

        Returns:
            Rotates vectors of the body's frame at time t into its frame at time zero, shape (3, 3),
            or (K, 3, 3).

        Raises:
            InputError: If the body may revolve more than 1,000 times, or times have both signs.
        """
        axes = self._principal[1]
        if isinstance(t, np.ndarray):
            quaternions = self._state(t)[:4].T
            return np.asarray(axes @ Rotation.from_quat(quaternions).as_matrix() @ axes.T)
        return np.asarray(axes @ rotation_matrix(_at(self, float(t))[:4]) @ axes.T)

    def angular_velocity(self, t: float | Array) -> Array:
        """Angular velocity at time t [s], axes of the body's frame then [rad/s], shape (..., 3).

        Raises:
            InputError: As :meth:`rotation`.
        """
        state = self._state(t) if isinstance(t, np.ndarray) else _at(self, float(t))
        back = -1.0 if np.sum(t) < 0.0 else 1.0
        return np.asarray(back * state[4:].T @ self._principal[1].T)

    def acceleration(self, rate: Array) -> Array:
        """Angular acceleration at angular velocities, same axes [rad/s²], shape (..., 3)."""
        return np.cross(rate @ self.inertia, rate) @ np.linalg.inv(self.inertia)

    def _state(self, t: float | Array) -> Array:
        """Quaternion and rate at time t, principal axes; before zero, of the reversed motion.

        Shape (7,), or (7, K).
        """
        last = float(np.ravel(t)[np.abs(t).argmax()])
        if not np.min(t * np.sign(last)) >= -_TIME_ERROR * abs(last):  # nan is no time
            raise InputError("t", f"{t} was given", "a finite time, or times of one sign")
        turns = self.revolutions(last)
        if turns > MOST_REVOLUTIONS:
            accepted = f"at most {MOST_REVOLUTIONS:g} revolutions"
            raise InputError("t", f"{turns:.4g} revolutions in {last:g} s", accepted)
        moments, axes = self._principal
        rate = (-1.0 if last < 0.0 else 1.0) * axes.T @ self.rate  # reversible
        if turns == 0.0:
            still = np.array([0.0, 0.0, 0.0, 1.0, *rate])
            return np.asarray(np.multiply.outer(still, np.ones(np.shape(t))))
        rounded = 2.0 ** math.ceil(math.log2(max(turns, 1.0)))  # few different solutions
        duration = rounded * math.tau / self.largest_rate
        solution = _solution(tuple(moments.tolist()), tuple(rate.tolist()), duration)
        return solution(np.abs(t))

    def revolutions(self, t: float) -> float:
        """Upper bound of the number of revolutions between time zero and time t [s]."""
        return self.largest_rate * abs(t) / math.tau


@lru_cache(maxsize=16)
def _at(tumbling: Tumbling, t: float) -> Array:
    """The state at a time: rotation and rate of a body are looked for one after the other."""
    return frozen(tumbling._state(t))


@lru_cache(maxsize=32)
def _solution(
    moments: tuple[float, float, float], rate: tuple[float, float, float], duration: float
) -> Callable[[float | Array], Array]:
    """Quaternion x, y, z, w and angular velocity by time, principal axes."""
    a, b, c = moments
    first, second, third = (b - c) / a, (c - a) / b, (a - b) / c

    def derivative(_: float, state: npt.NDArray[Any]) -> list[float]:
        x, y, z, w, p, q, r = state.tolist()
        return [
            0.5 * (w * p + y * r - z * q),
            0.5 * (w * q + z * p - x * r),
            0.5 * (w * r + x * q - y * p),
            -0.5 * (x * p + y * q + z * r),
            first * q * r,
            second * r * p,
            third * p * q,
        ]

    scale = max(map(abs, rate))
    tolerance = [_ABSOLUTE] * 4 + [_ABSOLUTE * scale] * 3
    start = [0.0, 0.0, 0.0, 1.0, *rate]
    solution: Any = scipy.integrate.solve_ivp(
        derivative, (0.0, duration), start, "DOP853",
        rtol=_TOLERANCE, atol=tolerance, dense_output=True,
    )  # fmt: skip
    edges, nodes = np.array(solution.t), chebyshev.chebpts2(_DEGREE + 1)
    widths = np.diff(edges)
    times = edges[:-1, None] + np.outer(widths, (nodes + 1.0) / 2.0)
    values = [step(row) for step, row in zip(solution.sol.interpolants, times, strict=True)]
    table = np.linalg.solve(chebyshev.chebvander(nodes, _DEGREE), np.swapaxes(values, 1, 2))

    def interpolant(t: Any) -> Array:
        """The state at times up to the last; in a hundredth of the time of SciPy's."""
        step = edges[1:-1].searchsorted(t)
        at = 2.0 * (t - edges[step]) / widths[step] - 1.0
        states = np.einsum("...d,...dc->...c", chebyshev.chebvander(at, _DEGREE), table[step])
        return np.asarray(states.reshape(*np.shape(t), 7).T)

    return interpolant
