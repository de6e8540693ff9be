"""Certified distances to dynamic singularities, and the motion that is impossible there.

A point of either sign of det A bounds the distance from above: the line to it crosses zero. Boxes
without singularities bound it from below; the others are halved until both bounds agree.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.generalized_jacobian import generalized_jacobian
from freefloat.dynamics.joint_space import joint_box
from freefloat.dynamics.measures import unit_factors
from freefloat.dynamics.tasks import Task, require_task, required_plane
from freefloat.errors import InputError
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import rotation_matrix
from freefloat.singularities.global_maximum import halved
from freefloat.singularities.joint_polynomial import JointPolynomial
from freefloat.singularities.singularity_polynomial import SingularityPolynomial
from freefloat.so3 import UPRIGHT, Array, frozen, unit_quaternion

_TOLERANCE = 1e-3
"""Relative difference of the bounds at which the search ends."""
_MOST = 1_000_000
"""Number of boxes after which the search ends."""
_LINES, _BISECTIONS, _POLISHED = 1024, 40, 4
"""Lines to random points on which zeros are searched for, their halvings, and zeros from which the
nearest one is searched for."""


@dataclass(frozen=True, eq=False)
class SingularityDistance:
    """The distance of a configuration from dynamic singularities.

    Distances are Euclidean, in rad for revolute joints and m for prismatic ones.

    Attributes:
        lower_bound: No configuration closer than this is singular, prismatic joints within their
            ranges.
        distance: Distance of ``joints``; infinite where no singular configuration was found.
        joints: Nearest singular configuration that was found, shape (n,); revolute joints continue
            from those given.
        direction: Unit vector w of the task's rows, in spacecraft axes, shape (m,), of the task
            ``pointing`` and in planes other than x-y (6,): no joint rates give the end-effector
            twist v a component along it there, w·v = 0 at zero momentum.
        inertial_direction: The unit vector w in inertial axes.
    """

    lower_bound: float
    distance: float
    joints: Array | None
    direction: Array | None
    inertial_direction: Array | None

    def to_dict(self) -> dict[str, Any]:
        """The distance as a JSON document."""
        arrays = (self.joints, self.direction, self.inertial_direction)
        lists = [None if array is None else array.tolist() for array in arrays]
        names = ("joints", "direction", "inertial_direction")
        distance = self.distance if math.isfinite(self.distance) else None
        bounds = {"lower_bound": self.lower_bound, "distance": distance}
        return {**bounds, **dict(zip(names, lists, strict=True))}


def distance_to_singularity(
    model: FreeFloatingModel,
    joints: npt.ArrayLike,
    task: Task | str = Task.POSE,
    *,
    attitude: Sequence[float] = (0.0, 0.0, 0.0, 1.0),
    polynomial: JointPolynomial | None = None,
) -> SingularityDistance:
    """How far the joints are from the nearest dynamic singularity.

    Args:
        model: Robot, whose arm is not redundant.
        joints: Joint values, shape (n,).
        task: Task or its value, such as ``"position"``.
        attitude: Attitude of the spacecraft, unit quaternion x, y, z, w, for
            ``inertial_direction``.
        polynomial: Det A of this robot and task, where it is known:
            :meth:`SingularityPolynomial.of` takes a quarter of a second for six joints.

    Raises:
        InputError: See :meth:`SingularityPolynomial.of`; if the arm is redundant or a prismatic
            joint is out of its range.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_2dof")
        >>> found = distance_to_singularity(model, [0.3, 0.7], "planar-position")
        >>> print(f"{found.lower_bound:.3f} {found.distance:.3f} {found.joints.round(3)}")
        0.598 0.599 [0.432 0.116]
    """
    task = require_task(model, task)
    model.require_supported("distances to singularities")
    q = model.joint_vector(joints)
    R = rotation_matrix(unit_quaternion("attitude", attitude))
    if model.dof > len(task.rows):
        raise InputError("robot", "its arm is redundant", "as many joints as rows of the task")
    lower, upper = joint_box(model)
    if np.any(model.prismatic & ((q < lower) | (q > upper))):
        raise InputError("joints", f"{q.tolist()} is out of range", "prismatic joints within it")
    lower, upper = np.where(model.prismatic, (lower, upper), (q - np.pi, q + np.pi))
    S = polynomial or SingularityPolynomial.of(model, task)
    if any((basis.upper - basis.lower < 2.0 * np.pi) & (not basis.prismatic) for basis in S.bases):
        raise InputError("polynomial", "some of its joints are fixed", "that of all joints")
    search = _ZeroSearch(S, q, lower, upper)
    lower_bound = search.lower_bound()
    if search.nearest is None:
        return SingularityDistance(lower_bound, math.inf, None, None, None)
    w = _immovable(model, search.nearest, task)
    twist = np.zeros(6)
    twist[task.rows] = w
    rows: list[int] | slice = task.rows
    if task is Task.POINTING:
        axes = model.end_effector_pose(UPRIGHT, search.nearest).rotation
        twist, rows = (twist.reshape(2, 3) @ axes.T).ravel(), slice(None)
    if task.planar and not (plane := required_plane(model, task)).is_level:
        twist, rows = (twist.reshape(2, 3) @ plane.axes.T).ravel(), slice(None)
    rotated = (twist.reshape(2, 3) @ R.T).ravel()
    arrays = frozen(search.nearest), frozen(twist[rows]), frozen(rotated[rows])
    return SingularityDistance(lower_bound, search.distance, *arrays)


def _immovable(model: FreeFloatingModel, joints: Array, task: Task) -> Array:
    """The left null vector of S* at a singular configuration, of unit length."""
    rows, columns = unit_factors(model, task)
    S = rows[:, None] * generalized_jacobian(model, joints, task) * columns
    w = rows * np.linalg.svd(S)[0][:, -1]
    w *= np.sign(w[np.abs(w).argmax()])
    return np.asarray(w / np.linalg.norm(w))


class _ZeroSearch:
    """The nearest zero of a polynomial to joint values q (n,) within bounds (n,)."""

    def __init__(self, S: JointPolynomial, q: Array, lower: Array, upper: Array) -> None:
        self._S, self._q, self._lower, self._upper = S, q, lower, upper
        self._sign = float(np.sign(S.values(q[None])[0]))
        self.nearest: Array | None = None
        self.distance = math.inf

    def lower_bound(self) -> float:
        """Search for the nearest zero; return a radius in which there is none."""
        if abs(float(self._S.values(self._q[None])[0])) <= self._S.rounding:
            self.nearest, self.distance = self._q, 0.0
            return 0.0
        fractions = low_discrepancy(_LINES, len(self._q))
        self._improve(self._lower + (self._upper - self._lower) * fractions)
        lower, upper = self._lower[None], self._upper[None]
        centres, halves = (lower + upper) / 2.0, (upper - lower) / 2.0
        count = 0
        while True:
            gaps = self._gaps(centres, halves)
            near = gaps < (1.0 - _TOLERANCE) * self.distance
            if not near.any():
                return (1.0 - _TOLERANCE) * self.distance
            centres, halves = centres[near], halves[near]
            count += len(centres)
            if count > _MOST:
                return float(gaps[near].min())
            values, parts = self._S.variations(centres, halves)
            left = np.abs(values) <= parts.sum(axis=1) + self._S.rounding
            self._improve(centres[left & (values * self._sign < 0.0)])
            centres, halves = halved(centres[left], halves[left], parts[left])

    def _gaps(self, centres: Array, halves: Array) -> Array:
        """Distances of boxes from the joint values, shape (K,); infinite without any joint."""
        moving = self._S.moving
        if not moving:
            return np.full(len(centres), np.inf)
        gaps = np.maximum(np.abs(centres - self._q) - halves, 0.0)[:, moving]
        return np.asarray(np.linalg.norm(gaps, axis=1))

    def _improve(self, points: Array) -> None:
        """Use zeros on the lines to points of the other sign, shape (K, n), the nearest of them."""
        moving = self._S.moving
        directions = np.zeros(points.shape)
        directions[:, moving] = (points - self._q)[:, moving]
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        directions *= np.minimum(1.0, (1.0 - _TOLERANCE) * self.distance / lengths)
        directions = directions[self._S.values(self._q + directions) * self._sign < 0.0]
        low, high = np.zeros(len(directions)), np.ones(len(directions))
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2.0
            same = self._S.values(self._q + middle[:, None] * directions) * self._sign > 0.0
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        zeros = directions * high[:, None]
        order = np.linalg.norm(zeros, axis=1).argsort()
        for k in order[: _POLISHED if self.nearest is None else 1]:
            self._polish(self._q + zeros[k])

    def _polish(self, start: Array) -> None:
        """Use the zero nearest to the joint values that a local search finds, or its start."""
        scale = float(self._S.derivative_bounds[0])
        minimum = scipy.optimize.minimize(
            lambda x: float(((x - self._q) ** 2).sum()), start, jac=lambda x: 2.0 * (x - self._q),
            method="SLSQP", bounds=list(zip(self._lower, self._upper, strict=True)),
            constraints={
                "type": "eq",
                "fun": lambda x: self._S.values(x[None])[0] / scale,
                "jac": lambda x: self._S.gradients(x[None])[0] / scale,
            },
            options={"ftol": 1e-12, "maxiter": 50},
        )  # fmt: skip
        for point in (start, minimum.x):
            distance = float(np.linalg.norm(point - self._q))
            zero = abs(float(self._S.values(point[None])[0])) <= 1e-10 * scale
            if zero and distance < self.distance:
                self.nearest, self.distance = point, distance
