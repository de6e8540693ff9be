"""Joint motions between two states of the arm, and the attitude with them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import polynomial

from freefloat.motion.joint_integration import integrate_joints
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.paths.time_laws import TimeLaw
from freefloat.paths.timing import TimedPath, Timing
from freefloat.paths.transfer import quintic
from freefloat.records import Joints
from freefloat.so3 import Array, frozen

_PANELS = 24


@dataclass(frozen=True, eq=False)
class JointTransfer:
    """Joint values as polynomials of degree five of s, accelerations zero at both ends.

    Attributes:
        coefficients: Lowest power first [rad or m], shape (6, n).
    """

    coefficients: Joints

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", frozen(self.coefficients))

    @classmethod
    def between(
        cls, start: Array, start_rates: Array, end: Array, end_rates: Array, duration: float
    ) -> JointTransfer:
        """The transfer between joint values and rates [rad/s or m/s] in a duration [s]."""
        return cls(quintic(start, duration * start_rates, end, duration * end_rates))

    @property
    def reversed(self) -> JointTransfer:
        """The same configurations from the end to the start."""
        powers = [polynomial.polypow([1.0, -1.0], k) for k in range(len(self.coefficients))]
        padded = [np.pad(power, (0, len(powers) - len(power))) for power in powers]
        return JointTransfer(np.array(padded).T @ self.coefficients)

    def at(self, s: Any, order: int = 0) -> Array:
        """Joint values, or their derivatives by s, at s (...): shape (..., n)."""
        derivative = polynomial.polyder(self.coefficients, order)
        return np.moveaxis(polynomial.polyval(np.asarray(s, dtype=float), derivative), 0, -1)


def integrate_transfer(
    problem: Problem, transfer: JointTransfer, attitude: Array, duration: float
) -> Motion:
    """The motion of spacecraft and arm along a transfer, with the momentum of the problem.

    Args:
        problem: Robot, momentum and drift.
        transfer: The joints.
        attitude: Attitude of the spacecraft at the start, unit quaternion x, y, z, w.
        duration: Duration [s].

    Returns:
        The motion; the path of its problem, with its timing, is not followed.
    """
    timing = Timing(duration, TimeLaw.UNIFORM)
    timed = replace(problem, path=TimedPath(problem.path.path, timing, problem.path.drift))
    return integrate_joints(timed, transfer, attitude, _PANELS)


def attitude_before(
    problem: Problem, transfer: JointTransfer, attitude: Array, duration: float
) -> Array:
    """Attitude from which a transfer ends at another one; both unit quaternions x, y, z, w.

    The motion backward in time is one with the opposite momentum.
    """
    opposite = replace(
        problem,
        momentum=-problem.momentum,
        wheel_momentum=-problem.wheel_momentum,
        path=TimedPath(problem.path.path, Timing(duration, TimeLaw.UNIFORM)),
    )
    return integrate_joints(opposite, transfer.reversed, attitude, _PANELS).final.attitude
