"""Coefficients of the Dormand-Prince method of order 5 with its interpolant.

They are the numbers of SciPy's ``RK45`` (Dormand and Prince 1980; interpolant of Shampine 1986),
whose import takes longer than the integration of thousands of motions.
"""

from __future__ import annotations

import numpy as np

from freefloat.ensemble.kernels.interpolant import BEGINNING, END, PART

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
