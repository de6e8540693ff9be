"""Guaranteed maxima of polynomials of the joints, by branch and bound over the joint space."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from freefloat.dynamics.joint_space import joint_space_extremes, largest_measure
from freefloat.dynamics.measures import SingularityMeasure, singularity_measure
from freefloat.dynamics.tasks import Task
from freefloat.robot.model import FreeFloatingModel
from freefloat.singularities.joint_polynomial import JointPolynomial
from freefloat.singularities.singularity_polynomial import (
    SingularityPolynomial,
    locked_inertia_polynomial,
)
from freefloat.so3 import Array, frozen

_TOLERANCE = 1e-7
"""Relative difference between guaranteed bounds and values."""
_ROUNDS = 8
"""Largest number of improvements of the ratio of two polynomials."""
_MOST = 2**20
"""Largest number of boxes at a time."""


@dataclass(frozen=True, eq=False)
class GlobalMaximum:
    """The maximum of a polynomial of the joints."""

    value: float  # largest value found
    joints: Array = field(repr=False)  # joint values there, (n,)
    upper_bound: float  # no value is larger; infinite where nothing was proven


def global_maximum(
    polynomial: JointPolynomial, start: Array, tolerance: float, floor: float = -np.inf
) -> GlobalMaximum:
    """The maximum of a polynomial over the joint space, and a bound that proves it.

    Boxes of the joint space are halved until none can contain a value more than ``tolerance`` above
    the largest one found, the joint being chosen that changes the value most. The bound is wider
    where that takes more than a million boxes at a time, or is finer than rounding.

    Args:
        polynomial: The polynomial.
        start: Joint values (n,) of a large value, such as a local maximum.
        tolerance: Difference of :attr:`GlobalMaximum.upper_bound` from the value.
        floor: Smaller values are not told apart.
    """
    centres, halves = whole_joint_space(polynomial)
    best, at = float(polynomial.values(start[None])[0]), start
    while len(centres):
        values, parts = polynomial.variations(centres, halves)
        first = int(values.argmax())
        if values[first] > best:
            best, at = float(values[first]), centres[first]
        far = parts.sum(axis=1)
        bounds = values + far + polynomial.rounding
        left = bounds > max(best + tolerance, floor)
        if 2 * left.sum() > _MOST or (far[left] < polynomial.rounding).any():
            return GlobalMaximum(best, frozen(at), float(bounds.max()))
        centres, halves = halved(centres[left], halves[left], parts[left])
    return GlobalMaximum(best, frozen(at), max(best + tolerance, floor))


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


def largest_magnitude(model: FreeFloatingModel, task: Task, measure: SingularityMeasure) -> float:
    """Largest magnitude of a measure, guaranteed for det A unless the arm is redundant."""
    if measure.name == "system" and model.dof == len(task.rows):
        return guaranteed_magnitude(model, task, measure.name).value
    return largest_measure(model, measure)


def guaranteed_magnitude(model: FreeFloatingModel, task: Task, name: str) -> GlobalMaximum:
    """The largest magnitude of a determinant over the joint space, and a bound that proves it.

    The magnitude of ``gjm``, det A / det D, is at most r where neither det A - r det D nor
    -det A - r det D is positive anywhere; both are polynomials.

    Args:
        model: Robot, whose arm is not redundant.
        task: Task.
        name: ``system`` or ``gjm``.

    Returns:
        With the bound infinity where nothing could be proven.

    Raises:
        InputError: See :meth:`SingularityPolynomial.of`.
    """
    extremes = joint_space_extremes(model, singularity_measure(model, task, name))
    A = SingularityPolynomial.of(model, task)
    sides = (A, extremes.largest_at), (-A, extremes.smallest_at)
    if name == "system":
        tolerance = _TOLERANCE * extremes.magnitude
        maxima = [global_maximum(side, start, tolerance) for side, start in sides]
        bound = max(maximum.upper_bound for maximum in maxima)
        return replace(max(maxima, key=lambda maximum: maximum.value), upper_bound=bound)
    D = locked_inertia_polynomial(model, task)
    r, at = max(
        (float(side.values(start[None])[0] / D.values(start[None])[0]), start)
        for side, start in sides
    )
    for _ in range(_ROUNDS):
        bound = (1.0 + _TOLERANCE) * r
        maxima = [global_maximum(side.minus(D, bound), at, 0.0, floor=0.0) for side, _ in sides]
        larger = max(maxima, key=lambda maximum: maximum.value)
        if larger.value <= 0.0:
            break
        at = larger.joints
        r = float(np.abs(A.values(at[None])[0] / D.values(at[None])[0]))
    proven = all(maximum.upper_bound <= 0.0 for maximum in maxima)
    return GlobalMaximum(r, at, bound if proven else np.inf)
