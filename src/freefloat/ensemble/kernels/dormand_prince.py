"""The Dormand-Prince method of order 5 and its interpolant, polynomials of a step's fraction.

Its coefficients are the numbers of SciPy's ``RK45`` (Dormand and Prince 1980; interpolant of
Shampine 1986), whose import takes longer than the integration of thousands of motions.
"""

from __future__ import annotations

import numpy as np

from freefloat.dynamics.kernels.cubics import Cubic
from freefloat.ensemble.kernels.records import Buffers, ProblemTables
from freefloat.lockstep.compilation import inlined
from freefloat.lockstep.lanes import Float
from freefloat.lockstep.tables import Table

PART, BEGINNING, END = 8, 12, 13
"""Rows of the tableau: the interpolant's coefficients by power of the fraction of the step; the
coefficients of its second derivative at the beginning and at the end."""
TABLEAU = np.zeros((14, 7))
"""Rows 0 to 5: stages; 6: the step; 7: its error; then the interpolant's rows."""
TABLEAU[:6, :5] = [
    [0.0, 0.0, 0.0, 0.0, 0.0],
    [1 / 5, 0.0, 0.0, 0.0, 0.0],
    [3 / 40, 9 / 40, 0.0, 0.0, 0.0],
    [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0],
    [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0],
    [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
]
TABLEAU[6, :6] = 35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
TABLEAU[7] = -71 / 57600, 0.0, 71 / 16695, -71 / 1920, 17253 / 339200, -22 / 525, 1 / 40
_INTERPOLANT = np.array(
    [
        [1.0, -8048581381 / 2820520608, 8663915743 / 2820520608, -12715105075 / 11282082432],
        [0.0, 0.0, 0.0, 0.0],
        [0.0, 131558114200 / 32700410799, -68118460800 / 10900136933, 87487479700 / 32700410799],
        [0.0, -1754552775 / 470086768, 14199869525 / 1410260304, -10690763975 / 1880347072],
        [0.0, 127303824393 / 49829197408, -318862633887 / 49829197408, 701980252875 / 199316789632],
        [0.0, -282668133 / 205662961, 2019193451 / 616988883, -1453857185 / 822651844],
        [0.0, 40617522 / 29380423, -110615467 / 29380423, 69997945 / 29380423],
    ]
)
"""Weights of the seven stages, a row each, by power of the fraction of the step."""
TABLEAU[PART:BEGINNING] = _INTERPOLANT.T
TABLEAU[BEGINNING], TABLEAU[END] = 2.0 * _INTERPOLANT[:, 1], _INTERPOLANT @ [0.0, 2.0, 6.0, 12.0]


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
