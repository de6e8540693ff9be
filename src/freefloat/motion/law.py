"""Laws of motion: what moves the arm, a path of the end-effector or prescribed joints.

The conservation of momentum adds the motion of the spacecraft. Limits, forces, states that are
handed on, exports and checks ask the law of a motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from freefloat.dynamics.base_rates import base_rates
from freefloat.dynamics.inverse_dynamics import Effort, InverseDynamics
from freefloat.dynamics.tasks import Task
from freefloat.motion.joint_spline import JointSpline
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, Pose, rotated_in_body

_STEPS = np.array([1.0, 2.0])
_WEIGHTS = np.array([8.0, -1.0]) / 12.0
"""Weights of central differences of fourth order."""
_EXCURSION = 4e-4
"""Displacement of attitude and joints in a step of the differences [rad, m]."""


class Rates(NamedTuple):
    """Rates of a state.

    Attributes:
        base: Angular velocity of the spacecraft in its own frame [rad/s], shape (3,).
        joints: Joint rates [rad/s or m/s], shape (n,).
    """

    base: Array
    joints: Array


class Law(Protocol):
    """What moves the arm.

    Functions of a state take its time [s], the attitude of the spacecraft, a unit quaternion x, y,
    z, w, the joints (n,), and the segment of the time law, see
    :meth:`freefloat.paths.timing.Timing.s`.
    """

    @property
    def duration(self) -> float:
        """Of a whole motion [s]."""
        ...

    def rates(self, t: float, attitude: Array, joints: Array, segment: int | None = None) -> Rates:
        """The rates at a state; infinite where the arm is exactly singular."""
        ...

    def many_rates(
        self, times: Array, attitudes: Array, joints: Array, segments: Sequence[int]
    ) -> Array:
        """Rates of spacecraft and joints at K states, shape (K, 3 + n)."""
        ...

    def effort(
        self, t: float, attitude: Array, joints: Array, segment: int | None = None
    ) -> Effort:
        """Rates, accelerations and forces at a state; all NaN where the arm is exactly singular."""
        ...

    def target(self, t: float, attitude: Array, joints: Array) -> Pose:
        """Pose of the end-effector from the centre of mass, inertial axes.

        Along a path it is the one that the path prescribes. Bodies of the scene may move with it.
        """
        ...


class PathLaw:
    """The end-effector follows the path of a problem: rates solve equation (4).

    Accelerations solve its time derivative. The joint rates of a redundant arm, and those of the
    task ``pointing``, are differentiated along the motion by central differences of fourth order,
    which holds for every redundancy resolution.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._solver = problem.resolved_rate_solver()

    @property
    def duration(self) -> float:
        """See :class:`Law`."""
        return self._problem.path.duration

    def rates(self, t: float, attitude: Array, joints: Array, segment: int | None = None) -> Rates:
        """See :class:`Law`."""
        prescribed = self._problem.prescribed(t, segment)
        return Rates(*self._solver.rates(attitude, joints, *prescribed))

    def many_rates(
        self, times: Array, attitudes: Array, joints: Array, segments: Sequence[int]
    ) -> Array:
        """See :class:`Law`."""
        states = zip(times.tolist(), attitudes, joints, segments, strict=True)
        return np.array([np.concatenate(self.rates(*state)) for state in states])

    def effort(
        self, t: float, attitude: Array, joints: Array, segment: int | None = None
    ) -> Effort:
        """See :class:`Law`."""
        path = self._problem.path
        prescribed = path.twist_and_speed(t, segment)
        change = path.twist_rate(t, segment), path.timing.s(t, 2, segment)
        further = self._problem.arms.at(t, 1), self._problem.arms.at(t, 2)
        return self.effort_of(attitude, joints, prescribed, change, further)

    def target(self, t: float, attitude: Array, joints: Array) -> Pose:
        """See :class:`Law`."""
        return self._problem.path.pose(t)

    def effort_of(
        self,
        attitude: Array,
        joints: Array,
        prescribed: tuple[Array, float],
        change: tuple[Array, float],
        further: tuple[Array, Array] | None = None,
    ) -> Effort:
        """The same for an end-effector twist with ds/dt, and for their derivatives.

        Further arms that move have given joint rates and accelerations.
        """
        twist, speed = prescribed
        arm_rates, arm_accelerations = further or (None, np.zeros(0))
        omega, joint_rates = self._solver.rates(attitude, joints, twist, speed, arm_rates)
        if not np.isfinite(joint_rates).all():
            return Effort.unknown(len(joints))
        problem, rates = self._problem, np.concatenate([omega, joint_rates])
        if not problem.redundant and problem.task is not Task.POINTING:
            return self._dynamics.of_end_effector(
                attitude, joints, rates, change[0], problem.task, arm_accelerations
            )
        accelerations = self._differentiated(
            attitude, joints, rates,
            np.concatenate([twist, [speed], rates[3 + problem.model.arm_dof :]]),
            np.concatenate([change[0], [change[1]], arm_accelerations]),
        )  # fmt: skip
        return self._dynamics.of_joints(attitude, joints, rates, accelerations)

    @cached_property
    def _dynamics(self) -> InverseDynamics:
        return InverseDynamics(self._problem.system)

    def _differentiated(
        self, attitude: Array, joints: Array, rates: Array, prescribed: Array, change: Array
    ) -> Array:
        """Joint accelerations: joint rates differentiated along the tangent of the motion.

        Args:
            attitude: Unit quaternion x, y, z, w.
            joints: Joint values, shape (n,).
            rates: Angular velocity of the base and joint rates, shape (3 + n,).
            prescribed: Twist of the end-effector, or twists of several, ds/dt, and joint rates of
                further arms on joint curves.
            change: Its time derivative.
        """
        largest = max(float(np.abs(rates).max()), _EXCURSION / self._problem.path.duration)
        step = _EXCURSION / largest
        total, end = np.zeros(len(joints)), 6 * len(self._problem.model.end_effector_links)
        for side in (1.0, -1.0):
            for ahead, weight in zip(side * step * _STEPS, side * _WEIGHTS, strict=True):
                rotated = rotated_in_body(attitude, ahead * rates[:3])
                later = prescribed + ahead * change
                solved = self._solver.rates(
                    rotated, joints + ahead * rates[3:],
                    later[:end], float(later[end]), later[end + 1 :],
                )  # fmt: skip
                total += weight * solved[1]
        return np.asarray(total / step)


class JointLaw:
    """The joints are prescribed, whatever the path of the end-effector.

    The joints of a state are those of the curve at its time.
    """

    def __init__(self, problem: Problem, curve: JointSpline) -> None:
        """Prepare a motion.

        Args:
            problem: Robot and momentum; the curve has the timing of its path.
            curve: The joints.
        """
        self._problem, self._curve, self._timing = problem, curve, problem.path.timing

    @property
    def duration(self) -> float:
        """See :class:`Law`."""
        return self._problem.path.duration

    def rates(self, t: float, attitude: Array, joints: Array, segment: int | None = None) -> Rates:
        """See :class:`Law`."""
        s, speed = self._timing.s(t, 0, segment), self._timing.s(t, 1, segment)
        rates = self._curve.at(s, 1) * speed
        return Rates(self._problem.system.base_rate(attitude, self._curve.at(s), rates), rates)

    def many_rates(
        self, times: Array, attitudes: Array, joints: Array, segments: Sequence[int]
    ) -> Array:
        """See :class:`Law`."""
        s, speed = (
            np.array([
                self._timing.s(t, order, segment)
                for t, segment in zip(times.tolist(), segments, strict=True)
            ])
            for order in (0, 1)
        )  # fmt: skip
        rates = self._curve.at(s, 1) * speed[:, None]
        base = base_rates(self._problem.system, attitudes, self._curve.at(s), rates)
        return np.concatenate([base, rates], axis=1)

    def effort(
        self, t: float, attitude: Array, joints: Array, segment: int | None = None
    ) -> Effort:
        """See :class:`Law`."""
        s, speed, change = (self._timing.s(t, order, segment) for order in range(3))
        q, slope, bend = (self._curve.at(s, order) for order in range(3))
        base = self._problem.system.base_rate(attitude, q, slope * speed)
        rates, accelerations = np.append(base, slope * speed), bend * speed**2 + slope * change
        return self._dynamics.of_joints(attitude, q, rates, accelerations)

    def target(self, t: float, attitude: Array, joints: Array) -> Pose:
        """See :class:`Law`."""
        return self._problem.model.end_effector_pose(attitude, joints)

    @cached_property
    def _dynamics(self) -> InverseDynamics:
        return InverseDynamics(self._problem.system)
