"""Levenberg's steps by Cholesky factors, for motions in lock step."""

from __future__ import annotations

from freefloat.lockstep.compilation import inlined
from freefloat.lockstep.lanes import Float, maximum, minimum, sqrt
from freefloat.lockstep.tables import Table

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
