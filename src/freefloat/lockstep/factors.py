"""Factors of matrices in lock step: Householder reflections, and Levenberg's steps by Cholesky.

By reflections, S^T = Q R, with n >= m columns of S, need no pivoting, serve square and redundant
arms, and give the sign of the determinant.
"""

from __future__ import annotations

from freefloat.lockstep.compilation import inlined, inner
from freefloat.lockstep.lanes import Float, Mask, magnitude, maximum, minimum, select, sqrt
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


_DAMPING, _SMALLEST = 0.1, 1e-13
"""Damping relative to the square of the error, up to 1; the smallest one."""
_PIVOT_ERROR = 2e-15
"""Rounding error of a pivot relative to the trace: with less damping one could vanish."""


@inlined
def damped_step(m: int, n: int, J: Table, b: Table, square: Float, A: Table, x: Table) -> None:
    """Write ``S' (S S' + damping)^-1 b`` into ``x``, the damping proportional to the error.

    Args:
        m: Number of rows of S.
        n: Number of its columns.
        J: S', shape (n, m).
        b: Error, shape (m,); is replaced.
        square: Square of the error's norm.
        A: Workspace, shape (m, m).
        x: Receives the step, shape (n,).
    """
    trace = 0.0 * square
    for i in range(m):
        for k in range(i + 1):
            total = 0.0 * square
            for j in range(n):
                total += J[j, i] * J[j, k]
            A[i, k] = total
        trace += A[i, i]
    damping = minimum(square, 1.0 + 0.0 * square) * _DAMPING
    damping += maximum(trace * _PIVOT_ERROR, _SMALLEST + 0.0 * square)
    for k in range(m):
        pivot = A[k, k] + damping
        for j in range(k):
            pivot -= A[k, j] * A[k, j]
        A[k, k] = 1.0 / sqrt(pivot)
        for i in range(k + 1, m):
            total = A[i, k]
            for j in range(k):
                total -= A[i, j] * A[k, j]
            A[i, k] = total * A[k, k]
    for k in range(m):
        total = b[k]
        for j in range(k):
            total -= A[k, j] * b[j]
        b[k] = total * A[k, k]
    for k in range(m - 1, -1, -1):
        total = b[k]
        for j in range(k + 1, m):
            total -= A[j, k] * b[j]
        b[k] = total * A[k, k]
    for j in range(n):
        total = J[j, 0] * b[0]
        for i in range(1, m):
            total += J[j, i] * b[i]
        x[j] = total
