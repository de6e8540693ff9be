"""How fast the system matrix can change: bounds from lengths and masses alone.

Seen from the spacecraft, the entries of A in (5) are sums of products of vectors fixed in bodies of
the arm. When the joints move with q' and q'' by some parameter, such a vector u turns about axes
that add up to w = sum |q'| at most, so that |u'| <= w |u| and |u''| <= (w² + w'), w' = sum |q''|,
times |u|. Products follow by Leibniz' rule. Every vector is a sum of pieces of the chain whose
lengths together do not exceed that of the stretched chain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freefloat.dynamics.momentum import system_matrix
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.joint_extents import joint_extents
from freefloat.motion.motion import Motion
from freefloat.so3 import Array, frozen

_STEP = 1e-5
"""By how much joints move in the differences that give A' [rad]: their error is of its square."""


@dataclass(frozen=True, eq=False)
class ScaledSystem:
    """A of (5) without units, and what bounds its second derivative.

    Lengths are in units of the reach, masses of the total mass, and sliding joints count in units
    of the reach, too, so that S* is scaled as the measure ``sigma`` wants it.

    Attributes:
        motion: Whose joints move.
        base: Number of columns of the spacecraft's rate: 3, or 1 in the plane.
        rows: Factors that free the rows of A from units, shape (base + m,).
        columns: Likewise of the columns, shape (base + n,).
        length: Of the stretched chain in units of the reach.
        locked: What bounds the change of D.
        moving: What bounds that of the columns of Dq, shape (n,).
    """

    motion: Motion
    base: int
    rows: Array
    columns: Array
    length: float
    locked: float
    moving: Array

    @classmethod
    def of(cls, motion: Motion) -> ScaledSystem:
        """The system of a motion's robot; sliding joints slide as far as they do on the way."""
        model, task = motion.problem.model, motion.problem.task
        reach, m = VirtualManipulator.of(model).reach, model.total_mass
        base = 1 if task.planar else 3
        slides = np.array([body.prismatic for body in model.bodies[1:]])
        chain = max(_chain_length(motion, slides), reach)
        spread = [np.linalg.norm(one.inertia - np.trace(one.inertia) / 3.0 * np.eye(3))
                  for one in model.bodies]  # fmt: skip
        most = [np.linalg.norm(one.inertia, 2) for one in model.bodies]
        unit = m * reach**2
        light = 1.0 - model.bodies[0].mass / m
        locked = np.sqrt(2.0) * light * (1.0 + light * (1.0 - light)) * (chain / reach) ** 2
        beyond = [body.mass / m * (chain / reach) ** 2 + inertia / unit
                  for body, inertia in zip(model.bodies[1:], most[1:], strict=True)]  # fmt: skip
        return cls(
            motion,
            base,
            frozen([1.0 / unit] * base + [1.0 / reach if row < 3 else 1.0 for row in task.rows]),
            frozen([1.0] * base + np.where(slides, reach, 1.0).tolist()),
            chain / reach,
            float(locked + sum(spread[1:]) / unit),
            frozen(np.cumsum(beyond[::-1])[::-1]),
        )

    def matrix(self, joints: Array) -> Array:
        """A without units, shape (base + m, base + n)."""
        A = system_matrix(self.motion.problem.model, joints, self.motion.problem.task)
        return np.asarray(self.rows[:, None] * A * self.columns)

    def slope(self, joints: Array, along: Array) -> Array:
        """The derivative of :meth:`matrix` when the joints (n,) move along a direction (n,)."""
        fastest = float(np.abs(along).max())
        if fastest == 0.0:
            return np.zeros((len(self.rows), len(self.columns)))
        h = _STEP / fastest
        ahead, behind = self.matrix(joints + h * along), self.matrix(joints - h * along)
        return np.asarray((ahead - behind) / (2.0 * h))

    def quickness(self, rates: Array) -> float:
        """Sum of joint rates (n,), sliding ones in units of the reach: w of the module."""
        return float(np.abs(rates / self.columns[self.base :]).sum())

    def bends(self, w: float, change: float) -> tuple[float, float]:
        """Bounds on Frobenius norms of second derivatives.

        Args:
            w: Bound on :meth:`quickness` of q'.
            change: The same of q''.

        Returns:
            Of the whole matrix, and of its upper left block D alone.
        """
        once, twice, thrice = (
            k * (w * w + change) + k * (k - 1) * w * w for k in (1.0, 2.0, 3.0)
        )  # of products of so many factors
        locked = self.locked * twice
        hand = [np.sqrt(2.0) * self.length * once]
        hand += [self.length * twice, once] * len(self.moving)
        squares = locked**2 + np.sum((self.moving * thrice) ** 2) + np.sum(np.square(hand))
        return float(np.sqrt(squares)), float(locked)


def _chain_length(motion: Motion, slides: Array) -> float:
    """No two points that the matrix knows are farther apart along the chain [m]."""
    model, spans = motion.problem.model, joint_extents(motion)
    centres = max(float(np.linalg.norm(body.centre)) for body in model.bodies)
    hand = max(float(np.linalg.norm(model.tool.position)), centres)
    steps = sum(float(np.linalg.norm(body.placement.position)) for body in model.bodies[1:])
    strokes = np.maximum(np.abs(spans.low), np.abs(spans.high))[slides.astype(bool)].sum()
    return float(centres + steps + hand + strokes)
