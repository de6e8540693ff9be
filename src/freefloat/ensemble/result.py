"""Results of many motions, as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.endings import COMPLETED, UNREACHED
from freefloat.errors import InputError
from freefloat.motion.margin import keeps_threshold
from freefloat.records import Joints, Quaternions, Times
from freefloat.so3 import Array, BoolArray, IntArray

REGULAR_RATIO = 0.01
"""Smallest ratio of the minimum and maximum magnitude of det S* along a regular motion."""
_ENDINGS = (
    "code: 0 completed, 1 singular, 2 margin violated, 3 step limit reached, 4 limited, "
    "-1 no such branch"
)


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
        rates: Largest magnitudes of the joint rates, shape (K, n). These and the next three are
            values at the integrator's steps, or along the whole motion with ``extremes``.
        base_rate: Largest magnitudes of the spacecraft's angular velocity, shape (K,).
        lower: Smallest joint values, shape (K, n).
        upper: Largest joint values, shape (K, n).
        determinant_ratios: Smallest over largest magnitude of det S* at the integrator's steps;
            small near any singularity, also one at which the measure does not vanish, shape (K,).
        evaluations: Number of evaluations of (4), shape (K,).
        slacks: Smallest differences of cosines to the bounds of the limits of attitude, negative
            where they are violated, shape (K, L).
    """

    endings: Annotated[npt.NDArray[np.int8], _ENDINGS]
    ended_at: Times
    minimum: Annotated[Array, "that of the measure"]
    minimum_at: Times
    attitudes: Quaternions
    joints: Joints
    rates: Annotated[Array, "rad/s or m/s"]
    base_rate: Annotated[Array, "rad/s"]
    lower: Joints
    upper: Joints
    determinant_ratios: Annotated[Array, "1, smallest over largest det S*"]
    evaluations: IntArray
    slacks: Array

    @classmethod
    def empty(cls, shape: tuple[int, ...], n: int, limits: int = 0) -> EnsembleResult:
        """Arrays for results of motions of n joints, with the ending of missing branches."""
        times, minimum_at, base_rate = np.full((3, *shape), np.nan)
        minimum, determinant_ratios = np.zeros((2, *shape))
        joints, rates, lower, upper = np.full((4, *shape, n), np.nan)
        return cls(
            np.full(shape, UNREACHED, np.int8), times, minimum, minimum_at,
            np.full((*shape, 4), np.nan), joints, rates, base_rate, lower, upper,
            determinant_ratios, np.zeros(shape, np.int64), np.full((*shape, limits), np.nan),
        )  # fmt: skip

    def rate_usage(self, limits: Array) -> Array:
        """Largest ratio of joint rates of arms on paths to limits, shape (K,).

        Args:
            limits: Limits of all joints that move, joints of arms on paths first [rad/s or m/s].
        """
        return np.asarray((self.rates / limits[: self.rates.shape[-1]]).max(axis=-1))

    def columns(self, numbers: IntArray) -> EnsembleResult:
        """The results of some columns of a table."""
        return EnsembleResult._make(values[:, numbers] for values in self)

    def assign(self, chosen: BoolArray | IntArray, motions: EnsembleResult) -> None:
        """Write the results of motions where they are chosen, in place."""
        for name in self._fields:
            getattr(self, name)[chosen] = getattr(motions, name)

    def keeps(self, margin: float) -> npt.NDArray[np.bool_]:
        """Which motions complete and keep a margin, shape (K,)."""
        return np.asarray((self.endings == COMPLETED) & keeps_threshold(self.minimum, margin))


@dataclass(frozen=True, eq=False)
class BranchResults:
    """Results of the motions from K attitudes along B arm branches each.

    Attributes:
        attitudes: Initial attitudes, quaternions x, y, z, w, shape (K, 4).
        joints: Initial joint values of each arm branch, NaN where it does not exist, (K, B, n).
        motions: Results of their motions, arrays of leading shape (K, B).

    Raises:
        InputError: If the shapes are others.
    """

    attitudes: Quaternions = field(repr=False)
    joints: Joints = field(repr=False)
    motions: EnsembleResult = field(repr=False)

    def __post_init__(self) -> None:
        (*shape, n), motions = self.joints.shape, self.motions
        shapes = {values.shape[:2] for values in motions}
        widths = {values.shape[2] for values in (motions.rates, motions.lower, motions.upper)}
        if self.attitudes.shape != (shape[0], 4) or shapes != {(*shape,)} or widths != {n}:
            raise InputError("results", f"shapes {shapes} were given", "a table of motions")
        for values in (self.joints, *motions):
            values.setflags(write=False)

    @property
    def exist(self) -> npt.NDArray[np.bool_]:
        """Where an arm branch exists, shape (K, B)."""
        return np.asarray(self.motions.endings != UNREACHED)

    @property
    def margins(self) -> Array:
        """Minimum magnitudes of the measure, zero for motions that do not complete, (K, B)."""
        return np.where(self.motions.endings == COMPLETED, self.motions.minimum, 0.0)

    @property
    def existing_margins(self) -> Array:
        """As :attr:`margins`, but nan where there is no such arm branch."""
        return np.where(self.exist, self.margins, np.nan)

    def and_others(self, *others: BranchResults) -> BranchResults:
        """These results and results of other attitudes along as many arm branches."""
        parts = (self, *others)
        columns = zip(*(part.motions for part in parts), strict=True)
        return BranchResults(
            np.concatenate([part.attitudes for part in parts]),
            np.concatenate([part.joints for part in parts]),
            EnsembleResult._make(map(np.concatenate, columns)),
        )

    def columns(self, numbers: IntArray) -> BranchResults:
        """The results of some of the columns."""
        return BranchResults(self.attitudes, self.joints[:, numbers], self.motions.columns(numbers))


def is_regular(determinant_ratios: Array) -> npt.NDArray[np.bool_]:
    """Which motions avoid every singularity, also singularities where the measure does not vanish.

    A motion may pass such a singularity at any distance. The attitudes whose motions meet it form
    surfaces that no sampling hits, but near them det S* becomes small: its minimum magnitude along
    the motion must exceed a hundredth of its maximum.
    """
    return np.asarray(determinant_ratios > REGULAR_RATIO)
