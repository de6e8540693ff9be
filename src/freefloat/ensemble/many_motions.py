"""Results of many motions: endings, minimum margins, joint extents and what decided each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.endings import COMPLETED, FAILED, SINGULAR, UNREACHED
from freefloat.ensemble.known_limits import LimitValues
from freefloat.motion.margin import keeps_threshold
from freefloat.so3 import Array, BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class ManyMotions:
    """Results of K motions.

    Attributes:
        attitudes: Initial attitudes, quaternions x, y, z, w, shape (K, 4).
        joints: Initial joint values, revolute joints within their ranges along the motion where
            possible [rad or m], NaN where no arm configuration reaches the start, shape (K, n).
        branches: Numbers of the arm branches, -1 where none reaches the start, shape (K,).
        endings: Codes of the endings, see :class:`.result.EnsembleResult`, shape (K,).
        ended_at: Final times [s], shape (K,).
        minimum_margins: Smallest magnitudes of the measure; zero where the arm becomes singular,
            shape (K,).
        minimum_times: Their times [s], shape (K,).
        thresholds: The margins that are required, shape (K,).
        deciders: What decided: indices into
            :data:`freefloat.ensemble.endings.DECIDERS`, shape (K,).
        lower: Smallest joint values at the integrator's steps, or along the whole motion where
            limits were given, shape (K, n).
        upper: Largest ones in the same way, shape (K, n).
        final_attitudes: Attitudes at the ends of the motions, shape (K, 4).
        rates: Largest magnitudes of the joint rates in the same way [rad/s or m/s], shape (K, n).
        base_rates: Largest magnitudes of the spacecraft's angular velocity [rad/s], shape (K,).
        turns: Largest angles of the spacecraft from its attitude at the start [rad], shape (K,);
            NaN where no limits were given.
        limits: The limits that were given.
    """

    attitudes: Array
    joints: Array
    branches: IntArray
    endings: npt.NDArray[np.int8]
    ended_at: Array
    minimum_margins: Array
    minimum_times: Array
    thresholds: Array
    deciders: npt.NDArray[np.int8]
    lower: Array
    upper: Array
    final_attitudes: Array
    rates: Array
    base_rates: Array
    turns: Array
    limits: LimitValues

    def __post_init__(self) -> None:
        arrays = {key: value for key, value in vars(self).items() if key != "limits"}
        for array in (*arrays.values(), *self.limits):
            array.setflags(write=False)

    def __repr__(self) -> str:
        return f"ManyMotions({len(self)} motions, {np.count_nonzero(self.feasible)} feasible)"

    def __len__(self) -> int:
        return len(self.endings)

    @property
    def reached(self) -> BoolArray:
        """Whether an arm configuration reaches the start of the path, shape (K,)."""
        return np.asarray(self.endings != UNREACHED)

    @property
    def completed(self) -> BoolArray:
        """Whether the motion reaches the end of the path, shape (K,)."""
        return np.asarray(self.endings == COMPLETED)

    @property
    def singular(self) -> BoolArray:
        """Whether the arm becomes singular, shape (K,)."""
        return np.asarray(self.endings == SINGULAR)

    @property
    def failed(self) -> BoolArray:
        """Whether the integration failed, so that there is no verdict, shape (K,)."""
        return np.asarray(self.endings == FAILED)

    @property
    def feasible(self) -> BoolArray:
        """Whether the motion completes and keeps the margin, shape (K,)."""
        kept = keeps_threshold(self.minimum_margins, self.thresholds)
        return np.asarray(self.completed & kept)

    @property
    def feasible_fraction(self) -> float:
        """Fraction of the motions that are feasible."""
        return float(self.feasible.mean())
