"""Limits that motions of an ensemble show to be kept or violated, and by how much."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.result import EnsembleResult
from freefloat.motion.pointing import AttitudeLimits, Keep
from freefloat.robot.joint_ranges import largest_range_ratio, shifts_into_ranges
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, BoolArray

_ERRORS = np.array([1e-4, 1e-6, 1e-8, 1e-8])
"""Errors of the angles of compiled motions [rad], by the code of what decided them."""
_SAMPLED = np.array([0.1, 0.01, 0.01, 0.01])
"""How far the largest ratios of ranges and rates may be above those at the integrator's steps."""
_RATE = 0.1
"""Joint rate relative to its limit that an error of one radian changes by that error, at most."""


@dataclass(frozen=True, eq=False)
class KnownLimits:
    """Limits whose ratios ensembles know; joint ranges are those of the robot.

    Attributes:
        model: The robot, whose arm follows the path.
        joint_rate: Largest magnitudes [rad/s or m/s], shape (n,); None without limit.
        attitude: Limits of attitude.
    """

    model: FreeFloatingModel
    joint_rate: Array | None
    attitude: AttitudeLimits

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Their names in results, in the order in which limits are checked."""
        given = {
            "joint_range": np.isfinite(self.model.joint_ranges).any(),
            "joint_rate": self.joint_rate is not None,
            "base_turn": self.attitude.base_turn is not None,
            "pointing": self.attitude.pointing,
        }
        return tuple(name for name, applies in given.items() if applies)

    @cached_property
    def _scales(self) -> Array:
        """Angles that change the ratios by one [rad], shape (L,)."""
        lower, upper = self.model.joint_ranges
        angles = [limit.angle for limit in self.attitude.pointing]
        scales = {
            "joint_range": min(1.0, np.min(upper - lower) / 2.0), "joint_rate": _RATE,
            "base_turn": self.attitude.base_turn, "pointing": min(angles, default=None),
        }  # fmt: skip
        return np.array([scales[name] for name in self.names])

    def ratios(self, motions: EnsembleResult, stretches: Array) -> Array:
        """Ratios of the limits, 1 where one is just kept, shape (K, L).

        Args:
            motions: Motions of an ensemble with these limits of attitude.
            stretches: Times of the motions that they stand for over theirs, shape (K,).
        """
        columns = {
            "joint_range": self._range_ratios, "joint_rate": self._rate_ratios,
            "base_turn": self._turn_ratios, "pointing": self._pointing_ratios,
        }  # fmt: skip
        ratios = np.empty((len(stretches), len(self.names)))
        for column, name in zip(ratios.T, self.names, strict=True):
            column[:] = columns[name](motions)
            if name == "joint_rate":
                column /= stretches
        return ratios

    def are_certain(self, ratios: Array, deciders: npt.NDArray[np.int8]) -> BoolArray:
        """Whether errors change no verdict on a limit, for what decided the motions, (K,)."""
        errors = _ERRORS[deciders][:, None] / self._scales
        sampled = [name in ("joint_range", "joint_rate") for name in self.names]
        above = _SAMPLED[deciders][:, None] * sampled
        return np.asarray(((ratios <= 1.0 - errors - above) | (ratios > 1.0 + errors)).all(axis=1))

    def _range_ratios(self, motions: EnsembleResult) -> Array:
        shifts = shifts_into_ranges(self.model, motions.lower, motions.upper)
        ranges = self.model.joint_ranges
        return largest_range_ratio(ranges, motions.lower + shifts, motions.upper + shifts)

    def _rate_ratios(self, motions: EnsembleResult) -> Array:
        return motions.rate_usage(np.asarray(self.joint_rate))

    def _turn_ratios(self, motions: EnsembleResult) -> Array:
        half = float(self.attitude.base_turn or 0.0) / 2.0
        cosines = np.cos(half) + motions.slacks[:, -1]
        return np.asarray(np.arccos(np.clip(cosines, -1.0, 1.0)) / half)

    def _pointing_ratios(self, motions: EnsembleResult) -> Array:
        """Those of the axes that are nearest to the edges of their cones, or farthest beyond."""
        limits = self.attitude.pointing
        angles = np.array([limit.angle for limit in limits])
        inside = np.array([limit.keep is Keep.INSIDE for limit in limits])
        slacks = motions.slacks[:, : len(limits)]
        cosines = np.cos(angles) + np.where(inside, slacks, -slacks)
        found = np.arccos(np.clip(cosines, -1.0, 1.0))
        nearest = np.where(inside, angles - found, found - angles).argmin(axis=1)
        with np.errstate(divide="ignore"):
            ratios = np.where(inside, found / angles, angles / found)
        return np.asarray(np.take_along_axis(ratios, nearest[:, None], axis=1)[:, 0])
