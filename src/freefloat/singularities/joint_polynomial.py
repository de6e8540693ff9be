"""Polynomials of the joints: trigonometric in revolute ones, ordinary in prismatic ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations_with_replacement, permutations
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev

from freefloat.errors import InputError
from freefloat.robot.joint_values import configurations
from freefloat.so3 import Array, IntArray

_ROUNDINGS, _EPSILON = 10.0, 1e-15
"""Number of residuals that enclosures allow for, and the smallest residual."""
_BATCH, _NUMBERS = 8192, 2**23
"""Largest number of configurations evaluated together, and of numbers kept for them."""


@dataclass(frozen=True)
class JointBasis:
    """Functions of one joint value q of which a polynomial is composed.

    Functions of a revolute joint are 1, cos q, sin q, cos 2q, sin 2q, ...; functions of a prismatic
    joint are the Chebyshev polynomials of its range.
    """

    degree: int  # degree of the polynomial in this joint
    prismatic: bool  # whether the joint is prismatic
    lower: float  # lower end of its range [rad or m]
    upper: float  # upper end of its range

    @property
    def size(self) -> int:
        """Number of functions."""
        return self.degree + 1 if self.prismatic else 2 * self.degree + 1

    @property
    def nodes(self) -> Array:
        """As many joint values as there are functions; these are orthogonal on them."""
        if not self.prismatic:
            return 2.0 * np.pi * np.arange(self.size) / self.size
        return self._middle + self._half * chebyshev.chebpts1(self.size)

    @property
    def _middle(self) -> float:
        return (self.lower + self.upper) / 2.0

    @property
    def _half(self) -> float:
        return (self.upper - self.lower) / 2.0

    def functions(self, q: Array, derivative: int = 0) -> Array:
        """The functions, or their derivatives, at joint values (K,); shape (K, size)."""
        if self.prismatic:
            u, matrix = (q - self._middle) / self._half, np.eye(self.size)
            if derivative:
                matrix = np.reshape(chebyshev.chebder(matrix, derivative), (-1, self.size))
            return np.asarray(chebyshev.chebval(u, matrix).T / self._half**derivative)
        values = np.zeros((len(q), self.size))
        orders = np.arange(1, self.degree + 1)
        angles = q[:, None] * orders + derivative * np.pi / 2.0
        values[:, 0] = derivative == 0
        values[:, 1::2] = orders**derivative * np.cos(angles)
        values[:, 2::2] = orders**derivative * np.sin(angles)
        return values

    def coefficients(self, samples: Array) -> Array:
        """Coefficients from samples at the nodes, along the first axis."""
        inverse = np.linalg.inv(self.functions(self.nodes))
        return np.asarray(np.tensordot(inverse, samples, axes=1))

    def exponential(self, coefficients: Array) -> Array:
        """Coefficients of complex exponentials instead of cosines and sines, along axis 0."""
        if self.prismatic:
            return coefficients
        cosines, sines = coefficients[1::2], coefficients[2::2]
        pairs = [(cosines - 1j * sines) / 2.0, (cosines + 1j * sines) / 2.0]
        return np.concatenate([coefficients[:1], *pairs])

    def largest(self, derivative: int) -> Array:
        """Largest magnitudes of the derivative of the functions of :meth:`exponential`, (size,)."""
        if not self.prismatic:
            orders = np.arange(1.0, self.degree + 1)
            return np.asarray(np.concatenate([[0.0], orders, orders]) ** derivative)
        ends = self.functions(np.array([self.upper]), derivative)  # where each is largest
        return np.asarray(np.abs(ends[0]))


@dataclass(frozen=True, eq=False)
class JointPolynomial:
    """A polynomial of the joints of a robot.

    Attributes:
        bases: Functions of each joint.
        coefficients: Coefficients of products of these functions, an axis for each joint.
        residual: Largest deviation from the function that it represents, relative to the largest
            magnitude, at configurations that were not used to determine the coefficients.

    Raises:
        InputError: If the coefficients do not belong to products of these functions.
    """

    bases: tuple[JointBasis, ...]
    coefficients: Array = field(repr=False)
    residual: float

    def __post_init__(self) -> None:
        sizes = tuple(basis.size for basis in self.bases)
        if self.coefficients.shape != sizes:
            problem = f"coefficients of shape {self.coefficients.shape} were given"
            raise InputError("polynomial", problem, f"shape {sizes}")

    @property
    def degrees(self) -> tuple[int, ...]:
        """Degree in each joint."""
        return tuple(basis.degree for basis in self.bases)

    def values(self, joints: npt.ArrayLike) -> Array:
        """Values at joint values (K, n); shape (K,)."""
        q = configurations(joints, len(self.bases))
        return self._by_batch(q, [()])[:, 0]

    def gradients(self, joints: npt.ArrayLike) -> Array:
        """Gradients at joint values (K, n); shape (K, n)."""
        q = configurations(joints, len(self.bases))
        return self._by_batch(q, [(joint,) for joint in range(len(self.bases))])

    def hessians(self, joints: npt.ArrayLike) -> Array:
        """Second derivatives at joint values (K, n); shape (K, n, n)."""
        n = len(self.bases)
        q = configurations(joints, n)
        rows, columns = np.triu_indices(n)
        upper = self._by_batch(q, list(zip(rows.tolist(), columns.tolist(), strict=True)))
        result = np.empty((len(q), n, n))
        result[:, rows, columns] = result[:, columns, rows] = upper
        return result

    def enclosures(self, centres: Array, halves: Array) -> tuple[Array, Array]:
        """Guaranteed bounds of the values in boxes of the joint space.

        Args:
            centres: Shape (K, n).
            halves: Half the widths of the boxes, shape (n,) or (K, n).

        Returns:
            Lower and upper bounds, shape (K,).
        """
        values, parts = self.variations(centres, halves)
        far = parts.sum(axis=1) + self.rounding
        return values - far, values + far

    def variations(self, centres: Array, halves: Array) -> tuple[Array, Array]:
        """Values at the centres of boxes, and by how much each joint can change them.

        About the centre c of a box with the half widths e, the value differs from the value at c by
        at most the sum of

            |dS/dq_i| e_i + |d2S/dq_i dq_j| e_i e_j / 2 + T_ijk e_i e_j e_k / 6,

        with derivatives at c, T from :attr:`derivative_bounds`. In large boxes the bounds of the
        second derivatives are used in place of the last two terms.

        Returns:
            Values (K,), and the terms of these sums by i, shape (K, n).
        """
        moving = self.moving
        pairs = list(combinations_with_replacement(moving, 2))
        values = self._by_batch(centres, [(), *((joint,) for joint in moving), *pairs])
        e = np.broadcast_to(halves, centres.shape)[:, moving]
        m, k = len(moving), 1 + len(moving)
        H, T = (bound[np.ix_(*[moving] * bound.ndim)] for bound in self.derivative_bounds[2:])
        far = e * (e @ H) / 2.0
        near = (e[:, :, None] * e[:, None]).reshape(len(e), m * m) @ T.reshape(m * m, m) * e / 6.0
        rows, columns = np.triu_indices(m)
        for i, j, second in zip(rows, columns, np.abs(values[:, k:]).T, strict=True):
            term = second * e[:, i] * e[:, j] / 2.0
            near[:, i] += term
            if i != j:
                near[:, j] += term
        closer = near.sum(axis=1) < far.sum(axis=1)
        parts = np.zeros(centres.shape)
        parts[:, moving] = np.abs(values[:, 1:k]) * e + np.where(closer[:, None], near, far)
        return values[:, 0], parts

    @property
    def moving(self) -> list[int]:
        """Joints on which the values depend."""
        return [joint for joint, basis in enumerate(self.bases) if basis.degree]

    @property
    def rounding(self) -> float:
        """Allowance for the errors of the coefficients and of evaluation."""
        return _ROUNDINGS * max(self.residual, _EPSILON) * float(self.derivative_bounds[0])

    def __neg__(self) -> JointPolynomial:
        """Minus the polynomial."""
        return JointPolynomial(self.bases, -self.coefficients, self.residual)

    def fixed(self, joint: int, value: float) -> JointPolynomial:
        """The polynomial of the other joints at a value of one joint [rad or m]."""
        (functions,) = self.bases[joint].functions(np.array([value]))
        bases = list(self.bases)
        bases[joint] = replace(bases[joint], degree=0)

        def inserted(tensor: Array) -> Array:
            return np.tensordot(functions, tensor, axes=1)[None]

        coefficients = np.ascontiguousarray(along(joint, inserted, self.coefficients))
        return JointPolynomial(tuple(bases), coefficients, self.residual)

    def minus(self, other: JointPolynomial, factor: float) -> JointPolynomial:
        """The polynomial less a multiple of another one of the same joints."""
        pairs = list(zip(self.bases, other.bases, strict=True))
        bases = tuple(max(pair, key=lambda basis: basis.degree) for pair in pairs)
        sum_ = np.zeros([basis.size for basis in bases])
        for polynomial, weight in ((self, 1.0), (other, -factor)):
            part = tuple(slice(basis.size) for basis in polynomial.bases)
            sum_[part] += weight * polynomial.coefficients
        return JointPolynomial(bases, sum_, max(self.residual, other.residual))

    def _by_batch(self, q: Array, derivatives: list[tuple[int, ...]]) -> Array:
        """Partial derivatives by the joints listed, shape (K, len(derivatives))."""
        order = np.lexsort(q.T[::-1])  # neighbours share work
        result = np.empty((len(q), len(derivatives)))
        batch = max(1, min(_BATCH, _NUMBERS // self.coefficients[0].size))
        for first in range(0, len(q), batch):
            rows = order[first : first + batch]
            result[rows] = self._derivatives(q[rows], derivatives)
        return result

    def _derivatives(self, q: Array, derivatives: list[tuple[int, ...]]) -> Array:
        """Partial derivatives for joint values in lexicographic order.

        Joint after joint, the coefficients are contracted once for all configurations that agree in
        the joints so far, and once for all derivatives that agree in derivatives by these joints.
        """
        partial: dict[tuple[int, ...], Array] = {(): self.coefficients[None]}
        group = np.zeros(len(q), dtype=int)
        for joint, basis in enumerate(self.bases):
            new = np.diff(group, prepend=-1) != 0
            if basis.degree:
                new |= np.diff(q[:, joint], prepend=np.nan) != 0.0
            before, group = group[new], np.cumsum(new) - 1
            functions = {
                order: basis.functions(q[new, joint], order)
                for order in {entry.count(joint) for entry in derivatives}
            }
            entries = {tuple(k for k in entry if k <= joint) for entry in derivatives}
            earlier = {entry: tuple(k for k in entry if k < joint) for entry in entries}
            partial = {
                entry: _contracted(partial[known], functions[entry.count(joint)], before)
                for entry, known in earlier.items()
            }
        return np.stack([partial[entry][group] for entry in derivatives], axis=-1)

    @cached_property
    def derivative_bounds(self) -> tuple[Array, Array, Array, Array]:
        """Bounds on the magnitudes of the value () and of its derivatives.

        Shapes (n,), (n, n) and (n, n, n); they hold in the whole joint space.
        """
        series: Any = self.coefficients
        for axis, basis in enumerate(self.bases):
            series = along(axis, basis.exponential, series)
        n = len(self.bases)
        bounds = [np.zeros((n,) * order) for order in range(4)]
        for order, bound in enumerate(bounds):
            for joints in combinations_with_replacement(range(n), order):
                total = np.abs(series)
                for joint, basis in enumerate(self.bases):
                    total = np.tensordot(basis.largest(joints.count(joint)), total, axes=1)
                for permutation in permutations(joints):
                    bound[permutation] = total
        return bounds[0], bounds[1], bounds[2], bounds[3]


def along(axis: int, function: Callable[[Any], Any], tensor: Any) -> Any:
    """A function of a tensor's first axis, applied to another one."""
    return np.moveaxis(function(np.moveaxis(tensor, axis, 0)), 0, axis)


def _contracted(tensors: Array, functions: Array, rows: IntArray) -> Array:
    """Sums (K, ...) over the second axis of rows of tensors (R, s, ...) times functions (K, s)."""
    if len(tensors) == 1:
        return np.asarray(np.tensordot(functions, tensors[0], axes=1))
    flat = tensors[rows].reshape(*functions.shape, -1)
    result = np.matmul(functions[:, None], flat)
    return np.asarray(result.reshape(len(rows), *tensors.shape[2:]))
