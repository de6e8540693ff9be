"""Guaranteed maxima of polynomials of the joints, by branch and bound over the joint space."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from freefloat.dynamics.joint_polynomial import JointPolynomial
from freefloat.dynamics.joint_space import joint_space_extremes
from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import Task
from freefloat.dynamics.singularity_polynomial import (
    SingularityPolynomial,
    locked_inertia_polynomial,
)
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, frozen

_TOLERANCE = 1e-7
"""Relative difference between guaranteed bounds and values."""
_MOST = 2**20
"""Largest number of boxes at a time."""


@dataclass(frozen=True, eq=False)
class GlobalMaximum:
    """The maximum of a polynomial of the joints.

    Attributes:
        value: Largest value found.
        joints: Joint values there, shape (n,).
        upper_bound: No value is larger.
    """

    value: float
    joints: Array = field(repr=False)
    upper_bound: float


def global_maximum(polynomial: JointPolynomial, start: Array, tolerance: float) -> GlobalMaximum:
    """The maximum of a polynomial over the joint space, and a bound that proves it.

    Boxes of the joint space are halved until none can contain a value more than ``tolerance`` above
    the largest one found, the joint being chosen that changes the value most. The bound is wider
    where that takes more than a million boxes at a time.

    Args:
        polynomial: The polynomial.
        start: Joint values (n,) of a large value, such as a local maximum.
        tolerance: Difference of :attr:`GlobalMaximum.upper_bound` from the value.
    """
    centres, halves = whole_joint_space(polynomial)
    best, at = float(polynomial.values(start[None])[0]), start
    while len(centres):
        values, parts = polynomial.variations(centres, halves)
        first = int(values.argmax())
        if values[first] > best:
            best, at = float(values[first]), centres[first]
        bounds = values + parts.sum(axis=1) + polynomial.rounding
        left = bounds > best + tolerance
        if 2 * left.sum() > _MOST:
            return GlobalMaximum(best, frozen(at), float(bounds.max()))
        centres, halves = halved(centres[left], halves[left], parts[left])
    return GlobalMaximum(best, frozen(at), best + tolerance)


def whole_joint_space(polynomial: JointPolynomial) -> tuple[Array, Array]:
    """The joint space as one box: its centre and half its widths, shape (1, n)."""
    lower = np.array([basis.lower for basis in polynomial.bases])
    upper = np.array([basis.upper for basis in polynomial.bases])
    return (lower + upper)[None] / 2.0, (upper - lower)[None] / 2.0


def halved(centres: Array, halves: Array, parts: Array) -> tuple[Array, Array]:
    """Centres and half widths of boxes cut in two, across the joint with the largest part.

    The halves of a box follow one another, the lower one first.
    """
    rows, joints = np.arange(len(centres)), parts.argmax(axis=1)
    halves = halves.copy()
    halves[rows, joints] /= 2.0
    shifts = np.zeros_like(centres)
    shifts[rows, joints] = halves[rows, joints]
    both = np.stack([centres - shifts, centres + shifts], axis=1)
    return both.reshape(-1, centres.shape[1]), np.repeat(halves, 2, axis=0)


def guaranteed_magnitude(model: FreeFloatingModel, task: Task, name: str) -> GlobalMaximum:
    """The largest magnitude of a determinant over the joint space, and a bound that proves it.

    Where r is that of ``gjm``, which is det A / det D, neither det A - r det D nor
    -det A - r det D is positive anywhere, and these are polynomials.

    Args:
        model: Robot, whose arm is not redundant.
        task: Task.
        name: ``system`` or ``gjm``.

    Raises:
        InputError: See :meth:`SingularityPolynomial.of`.
    """
    extremes = joint_space_extremes(model, singularity_measure(model, task, name))
    A = SingularityPolynomial.of(model, task)
    r, at = extremes.magnitude, extremes.largest_at
    if extremes.largest < r:
        at = extremes.smallest_at
    if name == "system":
        positive = global_maximum(A, extremes.largest_at, _TOLERANCE * r)
        negative = global_maximum(-A, extremes.smallest_at, _TOLERANCE * r)
        return max(positive, negative, key=lambda maximum: maximum.value)
    D = locked_inertia_polynomial(model, task)
    own = model.bodies[0].inertia  # D less it is positive semidefinite
    smallest = float(own[2, 2] if task.planar else np.linalg.det(own))
    while True:
        tolerance = _TOLERANCE * r * smallest
        positive = global_maximum(A.minus(D, r), extremes.largest_at, tolerance)
        negative = global_maximum((-A).minus(D, r), extremes.smallest_at, tolerance)
        larger = max(positive, negative, key=lambda maximum: maximum.value)
        if larger.value <= tolerance:
            return GlobalMaximum(r, at, r + larger.upper_bound / smallest)
        at = larger.joints
        r = float(np.abs(A.values(at[None])[0] / D.values(at[None])[0]))
