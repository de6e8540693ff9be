"""The interpolant of a step of motions in lock step: polynomials of the fraction of the step."""

from __future__ import annotations

from freefloat.dynamics.kernels.cubics import Cubic
from freefloat.ensemble.kernels.records import Buffers, ProblemTables
from freefloat.lockstep.compilation import inlined
from freefloat.lockstep.lanes import Float
from freefloat.lockstep.tables import Table

PART, BEGINNING, END = 8, 12, 13
"""Rows of the tableau: the interpolant's coefficients by power of the fraction of the step; the
coefficients of its second derivative at the beginning and at the end."""


@inlined
def weighted(tableau: Table, row: int, K: Table, j: int) -> Float:
    """The sum of the stages of element ``j``, with the factors of a row from PART + 1 on.

    The stage with number 1 has no part in the interpolant.
    """
    total = K[j, 0] * tableau[row, 0]
    for s in range(2, 7):
        total += K[j, s] * tableau[row, s]
    return total


@inlined
def derivative(problem: ProblemTables, j: int, work: Buffers) -> Cubic:
    """The derivative of element ``j`` of the state by the fraction, over the length of the step."""
    tableau, K = problem.tableau, work.K
    cube = weighted(tableau, PART + 3, K, j) * 4.0
    square = weighted(tableau, PART + 2, K, j) * 3.0
    return Cubic(cube, square, weighted(tableau, PART + 1, K, j) * 2.0, K[j, 0])


@inlined
def inside(problem: ProblemTables, dt: Float, x: Float, first: int, work: Buffers) -> None:
    """Write attitude, joints and time at a fraction of the step, from an element on."""
    tableau, K, y = problem.tableau, work.K, work.y
    for s in range(7):
        power = tableau[8, s] + x * (tableau[9, s] + x * (tableau[10, s] + x * tableau[11, s]))
        work.weights[s] = power * x * dt
    for j in range(first, 5 + problem.robot.n):
        total = y[j]
        for s in range(7):
            total += work.weights[s] * K[j, s]
        work.inside[j] = total
