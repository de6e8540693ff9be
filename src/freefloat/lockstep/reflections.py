"""Householder reflections, S^T = Q R, for motions in lock step: determinants and least norms.

S has m rows and n >= m columns. Reflections need no pivoting, serve square and redundant arms, and
give the sign of the determinant.
"""

from __future__ import annotations

from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.lanes import Float, Mask, magnitude, maximum, select, sqrt
from freefloat.lockstep.tables import Table

_SINGULAR = 1e-13
_USUAL = 6
"""Number of rows and columns of S for which loops are unrolled, a quarter faster."""


@inlined
def factorize(m: int, n: int, A: Table, scales: Table) -> Float:
    """Replace S^T by R above the diagonal and the reflections' normals on and below it.

    Args:
        m: Number of rows of S.
        n: Number of its columns.
        A: S^T, shape (n, m).
        scales: Receives minus two over the normals' squares, shape (m,).

    Returns:
        det S, or sqrt(det(S S^T)) of a redundant arm.
    """
    if m == _USUAL and n == _USUAL:
        return _factorize(_USUAL, _USUAL, A, scales)
    return _factorize(m, n, A, scales)


@inlined
def _factorize(m: int, n: int, A: Table, scales: Table) -> Float:
    """As :func:`factorize`."""
    determinant = 0.0 * A[0, 0] + 1.0
    for k in range(m):
        square = A[k, k] * A[k, k]
        for i in range(k + 1, n):
            square += A[i, k] * A[i, k]
        norm = sqrt(square)
        r = select(A[k, k] > 0.0, -norm, norm)
        determinant *= -r
        pivot = A[k, k] - r
        A[k, k] = pivot
        square = pivot * r
        scale = select(square < 0.0, 1.0 / square, 0.0)  # none for a row of zeros
        scales[k] = scale
        for j in range(k + 1, m):
            along = pivot * A[k, j]
            for i in range(k + 1, n):
                along += A[i, k] * A[i, j]
            along *= scale
            A[k, j] = A[k, j] + along * pivot
            for i in range(k + 1, n):
                A[i, j] = A[i, j] + along * A[i, k]
    if m < n:
        return magnitude(determinant)
    return determinant


@inner
def reflect(m: int, n: int, A: Table, scales: Table, x: Table) -> None:
    """Replace x by Q x."""
    for k in range(m - 1, -1, -1):
        along = 0.0 * x[k]
        for i in range(k, n):
            along += A[i, k] * x[i]
        along *= scales[k]
        for i in range(k, n):
            x[i] = x[i] + along * A[i, k]


@inlined
def solve_least_norm(m: int, n: int, A: Table, scales: Table, b: Table, x: Table) -> None:
    """Write the solution of least norm of S x = b into ``x``, shape (n,)."""
    for k in range(m):
        total = b[k]
        for j in range(k):
            total -= A[j, k] * x[j]
        x[k] = total * A[k, k] * scales[k]  # over R's diagonal element, one over pivot * scale
    for i in range(m, n):
        x[i] = 0.0
    reflect(m, n, A, scales, x)


@inlined
def is_singular(m: int, A: Table, scales: Table) -> Mask:
    """Whether S is singular but for rounding, from its factors."""
    largest = magnitude(A[0, 0])
    for k in range(1, m):
        for j in range(k + 1):
            largest = maximum(largest, magnitude(A[j, k]))
    regular = largest > 0.0
    for k in range(m):
        size = magnitude(
            A[k, k] * scales[k]
        )  # one over R's diagonal element, zero where it is zero
        regular = regular & (size > 0.0) & (size * _SINGULAR * largest < 1.0)
    return ~regular
