"""Gaussian elimination with partial pivoting, compiled."""

from __future__ import annotations

import math

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.so3 import Array


@compiled
def eliminate(S: Array, L: Array) -> float:
    """Gaussian elimination of ``S``, or of ``S S^T`` for redundant arms.

    Args:
        S: Shape (m, n).
        L: At least (m, m + 1); column m holds the right-hand side, which is transformed, too.

    Returns:
        det S, or sqrt(det(S S^T)).
    """
    m, n = S.shape
    for i in range(m):
        if m == n:
            for j in range(m):
                L[i, j] = S[i, j]
            continue
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += S[i, k] * S[j, k]
            L[i, j] = total
            L[j, i] = total
    determinant = 1.0
    for k in range(m):
        pivot, best = k, abs(L[k, k])
        for i in range(k + 1, m):
            if abs(L[i, k]) > best:
                pivot, best = i, abs(L[i, k])
        if pivot != k:
            determinant = -determinant
            for j in range(k, m + 1):
                L[k, j], L[pivot, j] = L[pivot, j], L[k, j]
        determinant *= L[k, k]
        inverse = 1.0 / L[k, k]
        for i in range(k + 1, m):
            factor = L[i, k] * inverse
            for j in range(k + 1, m + 1):
                L[i, j] -= factor * L[k, j]
    return float(determinant if m == n else math.sqrt(max(0.0, determinant)))


@compiled
def solve(L: Array) -> None:
    """Replace the right-hand sides in the last two columns of ``L`` by the solutions."""
    N = len(L)
    for k in range(N):
        pivot = k
        for i in range(k + 1, N):
            if abs(L[i, k]) > abs(L[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, N + 2):
                L[k, j], L[pivot, j] = L[pivot, j], L[k, j]
        inverse = 1.0 / L[k, k]
        for i in range(k + 1, N):
            factor = L[i, k] * inverse
            if factor != 0.0:
                for j in range(k + 1, N + 2):
                    L[i, j] -= factor * L[k, j]
    for k in range(N - 1, -1, -1):
        for j in range(N, N + 2):
            total = L[k, j]
            for i in range(k + 1, N):
                total -= L[k, i] * L[i, j]
            L[k, j] = total / L[k, k]
