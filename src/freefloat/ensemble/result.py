"""Results of many motions, as arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.endings import COMPLETED, UNREACHED
from freefloat.motion.margin import keeps_threshold
from freefloat.so3 import Array, IntArray

REGULAR_RATIO = 0.01
"""Smallest ratio of the minimum and maximum magnitude of det S* along a regular motion."""


class EnsembleResult(NamedTuple):
    """Results of K motions; in tables of arm branches the leading shape is (K, B) instead.

    Attributes:
        endings: 0 completed, 1 singular, 2 margin violated, 3 step limit reached, 4 completed but
            violates a limit of attitude, shape (K,); in tables -1 where the arm branch does not
            exist.
        ended_at: Final times [s], shape (K,).
        minimum: Minimum magnitude of the measure, zero where it changes sign, shape (K,).
        minimum_at: Times of the minimum [s], shape (K,).
        attitudes: Final attitudes, quaternions x, y, z, w, shape (K, 4).
        joints: Final joint values [rad or m], shape (K, n).
        rates: Largest magnitudes of the joint rates at the integrator's steps, shape (K, n).
        lower: Smallest joint values at the steps, shape (K, n).
        upper: Largest joint values at the steps, shape (K, n).
        determinant_ratios: Smallest over largest magnitude of det S* at the steps; small near any
            singularity, also one at which the measure does not vanish, shape (K,).
        evaluations: Number of evaluations of (4), shape (K,).
        slacks: Smallest differences of cosines to the bounds of the limits of attitude, negative
            where they are violated, shape (K, L).
    """

    endings: npt.NDArray[np.int8]
    ended_at: Array
    minimum: Array
    minimum_at: Array
    attitudes: Array
    joints: Array
    rates: Array
    lower: Array
    upper: Array
    determinant_ratios: Array
    evaluations: IntArray
    slacks: Array

    @classmethod
    def empty(cls, shape: tuple[int, ...], n: int, limits: int = 0) -> EnsembleResult:
        """Arrays for results of motions of n joints, with the ending of missing branches."""
        times, minimum_at = np.full((2, *shape), np.nan)
        minimum, determinant_ratios = np.zeros((2, *shape))
        joints, rates, lower, upper = np.full((4, *shape, n), np.nan)
        return cls(
            np.full(shape, UNREACHED, np.int8), times, minimum, minimum_at,
            np.full((*shape, 4), np.nan), joints, rates, lower, upper, determinant_ratios,
            np.zeros(shape, np.int64), np.full((*shape, limits), np.nan),
        )  # fmt: skip

    def columns(self, numbers: IntArray) -> EnsembleResult:
        """The results of some columns of a table."""
        return EnsembleResult._make(values[:, numbers] for values in self)

    def assign(self, chosen: npt.NDArray[np.bool_], motions: EnsembleResult) -> None:
        """Write the results of motions where they are chosen, in place."""
        for name in self._fields:
            getattr(self, name)[chosen] = getattr(motions, name)

    def keeps(self, margin: float) -> npt.NDArray[np.bool_]:
        """Which motions complete and keep a margin, shape (K,)."""
        return np.asarray((self.endings == COMPLETED) & keeps_threshold(self.minimum, margin))


def is_regular(determinant_ratios: Array) -> npt.NDArray[np.bool_]:
    """Which motions avoid every singularity, also those at which the measure does not vanish.

    A motion may pass such a singularity at any distance. The attitudes whose motions meet it form
    surfaces that no sampling hits, but near them det S* becomes small: its minimum magnitude along
    the motion must exceed a hundredth of its maximum.
    """
    return np.asarray(determinant_ratios > REGULAR_RATIO)
