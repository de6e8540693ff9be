"""Laws of motion: what moves the arm, a path of the end-effector or prescribed joints.

The conservation of momentum adds the motion of the spacecraft. Limits, forces, states that are
handed on, exports and checks ask the law of a motion.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np

from freefloat.dynamics.inverse_dynamics import Forces, InverseDynamics
from freefloat.dynamics.tasks import Task
from freefloat.motion.joint_curves import JointSpline
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, IntArray, Pose, rotated_in_body

_DIFFERENCES = np.array([1.0, 2.0, -1.0, -2.0])
_WEIGHTS = np.array([8.0, -1.0, -8.0, 1.0]) / 12.0
"""Weights of central differences of fourth order."""
_EXCURSION = 4e-4
"""Displacement of attitude and joints in a step of the differences [rad, m]."""

Times: TypeAlias = float | Array
Segments: TypeAlias = int | IntArray | None


class Rates(NamedTuple):
    """Rates of a state, or of K states.

    Attributes:
        base: Angular velocity of the spacecraft in its own frame [rad/s], shape (..., 3).
        joints: Joint rates [rad/s or m/s], shape (..., n).
    """

    base: Array
    joints: Array


class Law(Protocol):
    """What moves the arm.

    Functions of a state take its time [s], the attitude of the spacecraft, a unit quaternion x, y,
    z, w, the joints (n,), and the segment of the time law, see
    :meth:`freefloat.paths.timing.Timing.s`; or K of each.
    """

    @property
    def duration(self) -> float:
        """Of a whole motion [s]."""
        ...

    def rates(self, t: Times, attitude: Array, joints: Array, segment: Segments = None) -> Rates:
        """The rates at a state; infinite where the arm is exactly singular."""
        ...

    def effort(self, t: Times, attitude: Array, joints: Array, segment: Segments = None) -> Forces:
        """Rates, accelerations and forces at a state; all NaN where the arm is exactly singular."""
        ...

    def target(self, t: Times, attitude: Array, joints: Array) -> Pose:
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

    def rates(self, t: Times, attitude: Array, joints: Array, segment: Segments = None) -> Rates:
        """See :class:`Law`."""
        prescribed = self._problem.prescribed(t, segment)
        return Rates(*self._solver.rates(attitude, joints, *prescribed))

    def effort(self, t: Times, attitude: Array, joints: Array, segment: Segments = None) -> Forces:
        """See :class:`Law`."""
        path = self._problem.path
        prescribed = path.twist_and_speed(t, segment)
        change = path.twist_rate(t, segment), path.timing.s(t, 2, segment)
        further = self._problem.arms.at(t, 1), self._problem.arms.at(t, 2)
        return self.effort_of(attitude, joints, prescribed, change, further)

    def target(self, t: Times, attitude: Array, joints: Array) -> Pose:
        """See :class:`Law`."""
        return self._problem.path.pose(t)

    def effort_of(
        self,
        attitude: Array,
        joints: Array,
        prescribed: tuple[Array, Any],
        change: tuple[Array, Any],
        further: tuple[Array, Array] | None = None,
    ) -> Forces:
        """The same for an end-effector twist with ds/dt, and for their derivatives.

        Further arms that move have given joint rates and accelerations.
        """
        twist, speed = prescribed
        arm_rates, arm_accelerations = further or (None, joints[..., :0])
        solved = self._solver.rates(attitude, joints, twist, speed, arm_rates)
        problem, rates = self._problem, np.concatenate(solved, axis=-1)
        if not problem.redundant and problem.task is not Task.POINTING:
            return self._dynamics.of_end_effector(
                attitude, joints, rates, change[0], problem.task, arm_accelerations
            )
        accelerations = self._differentiated(
            attitude, joints, rates,
            np.concatenate(
                [twist, np.asarray(speed)[..., None], rates[..., 3 + problem.model.arm_dof :]], -1
            ),
            np.concatenate([change[0], np.asarray(change[1])[..., None], arm_accelerations], -1),
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
            attitude: Unit quaternion x, y, z, w, shape (..., 4).
            joints: Joint values, shape (..., n).
            rates: Angular velocity of the base and joint rates, shape (..., 3 + n).
            prescribed: Twist of the end-effector, or twists of several, ds/dt, and joint rates of
                further arms on joint curves.
            change: Its time derivative.
        """
        still = _EXCURSION / self._problem.path.duration
        step = _EXCURSION / np.maximum(np.abs(rates).max(axis=-1, keepdims=True), still)
        end = 6 * len(self._problem.model.end_effector_links)
        states = joints + np.multiply.outer(_DIFFERENCES, step * rates[..., 3:])
        turns = np.multiply.outer(_DIFFERENCES, step * rates[..., :3]).reshape(-1, 3)
        attitudes = np.broadcast_to(attitude, (*states.shape[:-1], 4)).reshape(-1, 4)
        later = prescribed + np.multiply.outer(_DIFFERENCES, step * change)
        later = later.reshape(-1, later.shape[-1])
        _, solved = self._solver.rates(
            rotated_in_body(attitudes, turns), states.reshape(-1, states.shape[-1]),
            later[:, :end], later[:, end], later[:, end + 1 :],
        )  # fmt: skip
        return np.asarray(np.tensordot(_WEIGHTS, solved.reshape(states.shape), 1) / step)


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

    def rates(self, t: Times, attitude: Array, joints: Array, segment: Segments = None) -> Rates:
        """See :class:`Law`."""
        s, speed = (self._timing.s(t, order, segment) for order in range(2))
        rates = self._curve.at(s, 1) * speed[..., None]
        return Rates(self._problem.system.base_rate(attitude, self._curve.at(s), rates), rates)

    def effort(self, t: Times, attitude: Array, joints: Array, segment: Segments = None) -> Forces:
        """See :class:`Law`."""
        s, speed, change = (self._timing.s(t, order, segment) for order in range(3))
        q, slope, bend = (self._curve.at(s, order) for order in range(3))
        accelerations = bend * speed[..., None] ** 2 + slope * change[..., None]
        rates = np.concatenate(self.rates(t, attitude, joints, segment), axis=-1)
        return self._dynamics.of_joints(attitude, q, rates, accelerations)

    def target(self, t: Times, attitude: Array, joints: Array) -> Pose:
        """See :class:`Law`."""
        return self._problem.model.end_effector_pose(attitude, joints)

    @cached_property
    def _dynamics(self) -> InverseDynamics:
        return InverseDynamics(self._problem.system)
