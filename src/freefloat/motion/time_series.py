"""A motion sampled at given times, with its rates."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from freefloat.motion.motion import Motion
from freefloat.so3 import Array, frozen, without_jumps


@dataclass(frozen=True, eq=False)
class TimeSeries:
    """A motion at given times.

    Rates solve equation (4) at each state: no differences are taken. Towards an end in a dynamic
    singularity they grow beyond all bounds.

    Attributes:
        times: [s], shape (K,).
        joints: Joint values [rad or m], shape (K, n).
        joint_rates: [rad/s or m/s], shape (K, n).
        attitudes: Of the spacecraft, unit quaternions x, y, z, w without jumps of sign, (K, 4).
        euler_angles: The same as turns about x, then the new y, then the new z axis [rad], shape
            (K, 3); the first and the last without jumps.
        angular_velocities: Of the spacecraft, in the inertial frame [rad/s], shape (K, 3).
        base_positions: Of the spacecraft's root link from the centre of mass [m], shape (K, 3).
        end_effector: Its position from the centre of mass, inertial frame [m], shape (K, 3).
        measure: The margin's measure, signed, shape (K,).
        momentum_errors: See :meth:`freefloat.motion.motion.Motion.momentum_errors` [N m s], shape
            (K,).
    """

    times: Array = field(repr=False)
    joints: Array = field(repr=False)
    joint_rates: Array = field(repr=False)
    attitudes: Array = field(repr=False)
    euler_angles: Array = field(repr=False)
    angular_velocities: Array = field(repr=False)
    base_positions: Array = field(repr=False)
    end_effector: Array = field(repr=False)
    measure: Array = field(repr=False)
    momentum_errors: Array = field(repr=False)

    def __post_init__(self) -> None:
        for one in fields(self):
            object.__setattr__(self, one.name, frozen(getattr(self, one.name)))

    @classmethod
    def of(cls, motion: Motion, times: npt.ArrayLike) -> TimeSeries:
        """Sample a motion.

        Args:
            motion: The motion.
            times: In order [s], shape (K,).

        Raises:
            InputError: If a time lies outside the motion.
        """
        wanted = np.atleast_1d(np.asarray(times, dtype=float))
        place = motion.parameter_at(wanted)
        _, attitudes, joints = motion.evaluate(place)
        problem = motion.problem
        model, measure = problem.model, problem.margin.measure
        equation = problem.resolved_rate_solver()
        states = list(zip(wanted.tolist(), attitudes, joints, strict=True))
        rates = [equation.rates(a, q, *problem.path.twist_and_speed(t)) for t, a, q in states]
        turning = np.array([omega for omega, _ in rates])
        with np.errstate(invalid="ignore"):  # infinite where the arm is exactly singular
            inertial = np.einsum("kij,kj->ki", Rotation.from_quat(attitudes).as_matrix(), turning)
        return cls(
            times=wanted,
            joints=joints,
            joint_rates=np.array([rate for _, rate in rates]),
            attitudes=without_jumps(attitudes),
            euler_angles=euler_angles(attitudes),
            angular_velocities=inertial,
            base_positions=np.array([model.base_position(a, q) for _, a, q in states]),
            end_effector=np.array([model.end_effector_pose(a, q).position for _, a, q in states]),
            measure=np.array([measure(q) for q in joints]),
            momentum_errors=motion.momentum_errors(place),
        )

    @property
    def headings(self) -> Array:
        """Of a planar spacecraft [rad], shape (K,); the first in [0, 2 pi), then without jumps."""
        angles = np.unwrap(2.0 * np.arctan2(self.attitudes[:, 2], self.attitudes[:, 3]))
        return np.asarray(angles - 2.0 * np.pi * np.floor(angles[0] / (2.0 * np.pi)))


def euler_angles(attitudes: Array) -> Array:
    """Turns about x, then the new y, then the new z axis [rad], shape (K, 3).

    Args:
        attitudes: Unit quaternions x, y, z, w in order of time, shape (K, 4).

    Returns:
        The first and the last angle without jumps of a full turn, the second in [-pi/2, pi/2].
    """
    R = Rotation.from_quat(attitudes).as_matrix()
    x = np.arctan2(-R[:, 1, 2], R[:, 2, 2])
    y = np.arctan2(R[:, 0, 2], np.hypot(R[:, 0, 0], R[:, 0, 1]))
    z = np.arctan2(-R[:, 0, 1], R[:, 0, 0])
    return np.column_stack([np.unwrap(x), y, np.unwrap(z)])
