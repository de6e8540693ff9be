r"""Bounds on the second derivative of the system matrix, from lengths and masses alone.

Let the joints move with q' and q'' by some parameter, w = sum |q'| and w' = sum |q''|. Seen from
the spacecraft, the entries of A in (5) are sums of products of vectors that are sums of links of
the chain. In the following, lengths are in units of the reach, masses in units of the total mass,
and prismatic joints count in units of the reach.

**One vector.** A vector u fixed in a body rotates about joint axes whose rates add up to w at
most: |u'| <= w |u| and |u''| <= (w^2 + w') |u|. A vector between two points of the chain is a sum
of such links and of strokes of prismatic joints, which add their own rates; with L, the length of
the stretched chain and at least 1, |u| <= L, |u'| <= w L and |u''| <= (w^2 + w') L.

**Products.** By Leibniz' rule the second derivative of a product of k such vectors is bounded by
the product of their lengths times

    p_k = k (w^2 + w') + k (k - 1) w^2.

**D.** With B(u) = u.u 1 - u u^T, D is the sum of mu_i mu_j B(c_i - c_j) over pairs of bodies, c
being their centres of mass, and of the bodies' inertias. The polarized B has the Frobenius norm
sqrt(2) |u| |v| at most. As the mu_i sum up to one, the weights of the pairs sum up to

    m_2 = (1 - sum_i mu_i^2) / 2.

Where further arms move, w and L add up the rates and links of all arms, and the columns belong to
the arms that follow paths. The norms of the rows of e end-effectors are sqrt(e) times the norms of
the rows of one.

An inertia R I R^T is a product of two rotations; its isotropic part is constant, the rest counts
with its Frobenius norm.

    |D''| <= p_2 (sqrt(2) m_2 L^2 + sum_i |I_i - tr(I_i) / 3|)

**Columns of Dq.** Joint j moves the bodies i >= j: r_i x (a_j x (c_i - p_j)) mu_i + R I R^T a_j,
r_i from the centre of mass: products of three.

    |Dq_j''| <= p_3 sum_(i >= j) (mu_i L^2 + |I_i|_2)

**End-effector rows.** Per spacecraft rate: the skew matrix of the end-effector's position from the
centre of mass, whose Frobenius norm is sqrt(2) times its length: sqrt(2) L p_1; the angular rows
are constant. Per joint: a_j times a weighted mean of chain vectors, a product of two, L p_2, and
for the angular rows a_j alone, p_1. In the axes of the end-effector, as for ``pointing``, each is a
product with another rotation; two rows of that rotation alone, the angular ones per spacecraft
rate, add sqrt(2) p_1. On a table, the linear rows along z do not count the motion of the centre of
mass: they are other products of two, so that the norm of all is at most sqrt(2) times as large.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freefloat.dynamics.generalized_jacobian import system_matrix_with_derivative
from freefloat.dynamics.measures import unit_factors, unit_of_length
from freefloat.dynamics.tasks import Task, base_rotations
from freefloat.motion.extrema import joint_extents
from freefloat.motion.motion import Motion
from freefloat.so3 import Array


@dataclass(frozen=True, eq=False)
class SecondDerivatives:
    """Bounds on the Frobenius norms of the second derivatives of blocks of the system matrix."""

    D: float  # bound for the locked inertia
    Dq: Array  # bounds for the columns of Dq, (n,)
    base: float  # bound for the end-effector's rows per spacecraft rate
    linear: float  # bound for the end-effector's linear rows per joint rate
    angular: float  # bound for the end-effector's angular rows per joint rate

    @property
    def whole(self) -> float:
        """Bound for the whole matrix."""
        joint = len(self.Dq) * (self.linear**2 + self.angular**2)
        return float(np.sqrt(self.D**2 + np.sum(self.Dq**2) + self.base**2 + joint))


class ScaledSystem:
    """A of (5) without units, and bounds on its second derivative along a motion.

    S* is scaled as in the measure ``sigma``.

    Attributes:
        base: Number of columns of the spacecraft's rate: 3, or 1 in the plane.
        rows: Factors that free the rows of A from units, shape (base + m,).
        columns: Factors that free the columns from units, shape (base + n,).
    """

    def __init__(self, motion: Motion) -> None:
        """Prepare the robot of a motion, with its strokes of prismatic joints."""
        model, task = motion.model, motion.setting.task
        reach = unit_of_length(model, task)
        m = model.total_mass
        L = max(_chain_length(motion), reach) / reach
        unit = m * reach**2
        inertias = [body.inertia / unit for body in model.bodies]
        isotropic = [np.trace(inertia) / 3.0 * np.eye(3) for inertia in inertias]
        spread = np.linalg.norm(np.array(inertias) - isotropic, axis=(1, 2))[1:]
        pairs = (1.0 - sum((body.mass / m) ** 2 for body in model.bodies)) / 2.0
        moved = [body.mass / m * L**2 + np.linalg.norm(inertia, 2)
                 for body, inertia in zip(model.bodies[1:], inertias[1:], strict=True)]  # fmt: skip
        self._model, self._task, self._length = model, task, L
        self._locked = float(np.sqrt(2.0) * pairs * L**2 + spread.sum())
        self._moving = np.cumsum(moved[::-1])[::-1][: motion.setting.dof]
        self._end_effectors = len(model.single_arms)
        self._joint_units = np.where(model.prismatic, reach, 1.0)
        self.base = base_rotations(model, task)
        rows, columns = unit_factors(model, task)
        self.rows = np.append(np.full(self.base, 1.0 / unit), rows)
        self.columns = np.append(np.ones(self.base), columns)

    def matrices(self, joints: Array, rates: Array) -> tuple[Array, Array]:
        """A without units at joints (n,) or (K, n), and its derivative while they move at rates.

        Both have the shape (base + m, base + n), or are stacks of it.
        """
        A, slope = system_matrix_with_derivative(self._model, joints, rates, self._task)
        return self._scaled(A), self._scaled(slope)

    def _scaled(self, A: Array) -> Array:
        return np.asarray(self.rows[:, None] * A * self.columns)

    def joint_speed(self, rates: Array) -> float:
        """w: the sum of magnitudes of joint rates (n,), prismatic ones in units of the reach."""
        return float(np.abs(rates / self._joint_units).sum())

    def second_derivatives(self, w: float, change: float) -> SecondDerivatives:
        """Bounds on second derivatives.

        Args:
            w: Bound on :meth:`joint_speed` of q'.
            change: w', bound on :meth:`joint_speed` of q''.
        """
        p1, p2, p3 = (k * (w * w + change) + k * (k - 1.0) * w * w for k in (1.0, 2.0, 3.0))
        D, Dq, L = self._locked * p2, self._moving * p3, self._length
        base, linear, angular = float(np.sqrt(2.0) * L * p1), L * p2, p1
        if self._task is Task.POINTING:
            base, linear, angular = float(np.sqrt(2.0) * np.hypot(L * p2, p1)), L * p3, p2
        if self._model.on_table:  # rows along z are other products than those along x and y
            linear *= float(np.sqrt(2.0))
        several = float(np.sqrt(self._end_effectors))
        return SecondDerivatives(D, Dq, *(several * norm for norm in (base, linear, angular)))


def _chain_length(motion: Motion) -> float:
    """Largest distance along the chain between points that the matrix depends on [m]."""
    model = motion.model
    extents = joint_extents(motion)
    centres = max(float(np.linalg.norm(body.centre)) for body in model.bodies)
    last = max(*(float(np.linalg.norm(arm.tool.position)) for arm in model.single_arms), centres)
    links = sum(float(np.linalg.norm(body.placement.position)) for body in model.bodies[1:])
    strokes = np.maximum(np.abs(extents.low), np.abs(extents.high))[model.prismatic].sum()
    return float(centres + links + last + strokes)
