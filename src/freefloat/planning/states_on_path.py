"""States of a spatial arm with its end-effector on the path, at given first two joint angles.

For an elbow arm under a spherical wrist the wrist's centre, the paper's point 3, is known from the
path alone (36). Its distance from the centre of mass ties the elbow to time, its direction fixes
the attitude of the spacecraft up to one turn about it, and the wrist follows, bent one way or the
other. So a state is told by time, q3, turn and bend, the first two of which are tied.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ik.analytic import spherical_wrist_angles
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, low_discrepancy, sphere_directions

_TIMES = 201
_STEP = 1e-5
"""Length of the step in joint space by which S is differentiated [rad]."""


class StatesOnPath:
    """States at given (q1, q2), told by time t, q3, turn about point 3 and bend of the wrist.

    Attributes:
        problem: What was asked.
        q2: Second joint angle [rad].
        of: The problem's measure S.
        splits: Whether S depends on (q2, q3) alone (40).
        drifts: Whether the system has momentum.
        reach: Of the arm [m].
        times: Samples of time [s], shape (T,).
        point_3: At those [m], inertial frame, shape (T, 3).
    """

    def __init__(self, problem: Problem, q1: float, q2: float) -> None:
        """Prepare what does not depend on the state.

        Args:
            problem: A pose task of an elbow arm under a spherical wrist.
            q1: First joint angle [rad].
            q2: Second joint angle [rad].
        """
        self.problem, self.q2, self._q1 = problem, q2, q1
        self.of = problem.margin.measure
        self.splits = problem.margin.measure.name == "arm"
        self.drifts = bool(problem.momentum.any())
        self._gradient = lru_cache(1024)(partial(_gradient_in_plane, self.of))
        self._drift = problem.resolved_rate_solver()
        self._fix_arm(VirtualManipulator.of(problem.model))
        self.times = np.linspace(0.0, problem.path.duration, _TIMES)
        self.point_3 = self.travel(self.times)[0]
        self._across = _direction_across(self.point_3)

    def _fix_arm(self, virtual: VirtualManipulator) -> None:
        """``P`` and ``h`` are positions and axes of the virtual joints at zero."""
        p, R, points, axes = virtual.kinematics(np.zeros(6))
        P, h, wrist = points[:, 0], axes[:, 0], virtual.wrist_centre
        first = _about(h[0], self._q1)
        self._upper = first * _about(h[1], self.q2)
        self._normal = first.apply(h[1])
        self._elbow = P[0] + first.apply(P[1] - P[0]) + self._upper.apply(P[2] - P[1])
        self._fore, self._hand = wrist - P[2], p[0] - wrist
        self._straight = Rotation.from_matrix(R[0]).inv()
        self._h, self.reach = h, virtual.reach

    def travel(self, t: Array) -> tuple[Array, Rotation]:
        """Point 3 by (36) [m], shape (K, 3), and how the hand is turned from its place at zero."""
        poses = [self.problem.path.pose(float(time)) for time in t]
        turned = Rotation.from_matrix([pose.rotation for pose in poses]) * self._straight
        return np.array([pose.position for pose in poses]) - turned.apply(self._hand), turned

    def wrist(self, q3: Array) -> Array:
        """Virtual wrist from the centre of mass, in the spacecraft's frame [m], shape (K, 3)."""
        fore = _about(self._h[2], q3).apply(self._fore)
        return np.asarray(self._elbow + self._upper.apply(fore))

    def at(self, states: Array, bend: float) -> tuple[Rotation, Array]:
        """What the spacecraft and the arm do in states.

        Args:
            states: Rows of time, q3 and turn, shape (K, 3). Where point 3 and the wrist are not
                equally far out, only the direction of point 3 will be right.
            bend: 1 or -1: which of the two wrists.

        Returns:
            Attitudes, and joints of shape (K, 6), nan where the wrist cannot bend so.
        """
        t, q3, turn = states.T
        point_3, turned = self.travel(t)
        onto = _frames(point_3, self._across) * _about(np.array([1.0, 0.0, 0.0]), turn)
        attitude = onto * _frames(self.wrist(q3), self._normal).inv()
        arm = self._upper * _about(self._h[2], q3)
        first = np.broadcast_to([self._q1, self.q2], (len(q3), 2))
        hand = (attitude * arm).inv() * turned
        wrist = spherical_wrist_angles(np.array(self._h[3:]), hand.as_matrix(), float(bend))
        return attitude, np.column_stack([first, q3, wrist])

    def measured(self, joints: Array) -> Array:
        """S at joints (K, 6), shape (K,); nan where those are."""
        return np.array([self.of(q) if np.isfinite(q).all() else np.nan for q in joints])

    def rates(self, t: float, attitude: Array, joints: Array) -> tuple[Array, Array]:
        """Rates (8) by time, without momentum by s."""
        path = self.problem.path
        twist = path.twist(t) if self.drifts else path.path.tangent(path.timing.s(t))
        return self._drift.rates(attitude, joints, twist)

    def slope(self, t: float, attitude: Array, joints: Array) -> float:
        """Rate dS/dt of (14) along the motion through a state; nan where that is singular."""
        rates = self.rates(t, attitude, joints)[1]
        speed = float(np.linalg.norm(rates))
        if not np.isfinite(speed + joints.sum()):
            return float("nan")
        if self.splits:
            by_q2, by_q3 = self._gradient(*joints[1:3].tolist())
            return float(by_q2 * rates[1] + by_q3 * rates[2])
        step = rates * (_STEP / (speed or 1.0))
        return speed * (self.of(joints + step) - self.of(joints - step)) / (2.0 * _STEP)

    def slopes(self, t: Array, attitudes: Rotation, joints: Array) -> Array:
        """Of many states, shape (K,)."""
        rows = zip(t.tolist(), attitudes.as_quat(), joints, strict=True)
        return np.array([self.slope(time, attitude, q) for time, attitude, q in rows])

    def is_least(self, t: float, attitude: Rotation, joints: Array, level: float) -> bool:
        """Whether the magnitude of S bends upwards along the motion."""
        path = self.problem.path
        omega, rates = self.rates(t, attitude.as_quat(), joints)
        pace = 1.0 if self.drifts else path.timing.s(t, 1)
        size = pace * max(np.abs(omega).max(), np.abs(rates).max(), 1.0 / (path.duration * pace))
        slopes = [
            self.slope(
                t + step,
                (attitude * Rotation.from_rotvec(pace * step * omega)).as_quat(),
                joints + pace * step * rates,
            )
            for step in (1e-4 / size, -1e-4 / size)
        ]
        return bool((slopes[0] - slopes[1]) * level > 0.0)


def _gradient_in_plane(of: Callable[[Array], float], q2: float, q3: float) -> tuple[float, float]:
    """Derivatives of S(q2, q3) (40) by its two angles."""
    q, (a, b) = np.array([0.0, q2, q3, 0.0, 0.0, 0.0]), _STEP * np.eye(6)[1:3]
    return (of(q + a) - of(q - a)) / (2.0 * _STEP), (of(q + b) - of(q - b)) / (2.0 * _STEP)


def _about(axis: Array, angle: npt.ArrayLike) -> Rotation:
    return Rotation.from_rotvec(np.multiply.outer(angle, axis))


def _frames(x: Array, across: Array) -> Rotation:
    """Rotations whose x axis has given directions (K, 3) and whose y axis leans to another."""
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    y = across - (x @ across)[:, None] * x
    y = y / np.linalg.norm(y, axis=1, keepdims=True)
    return Rotation.from_matrix(np.stack([x, y, np.cross(x, y)], axis=2))


def _direction_across(vectors: Array) -> Array:
    """A direction as far as can be from parallel to all of some vectors."""
    choice = sphere_directions(low_discrepancy(64, 2))
    along = vectors / np.linalg.norm(vectors, axis=1, keepdims=True) @ choice.T
    return np.asarray(choice[np.abs(along).max(axis=0).argmin()])
