"""Limits that motions of an ensemble show to be kept or violated, and by how much."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.result import EnsembleResult
from freefloat.motion.pointing import AttitudeLimits, Keep
from freefloat.robot.joint_ranges import largest_range_ratio
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, BoolArray

KNOWN = "joint_rate", "base_rate", "base_turn", "pointing"
"""Names of the limits that ensembles know beside the joint ranges."""
_ERRORS = np.array([5e-4, 5e-5, 5e-7, 5e-7])
"""Errors of angles of compiled motions [rad], by the code of what decided them: above the
largest ones of 1,400 motions with limits of pointing."""
_RATE = 0.1
"""Error of angles [rad] that changes rates, relative to their limits, by 1 at most."""


class _Entry(NamedTuple):
    """Ratios of a limit, and the angle [rad] that changes them by 1."""

    ratios: Callable[[EnsembleResult, Array], Array]
    angle: float


@dataclass(frozen=True, eq=False)
class KnownLimits:
    """Limits whose ratios ensembles know; joint ranges are those of the robot.

    Attributes:
        model: The robot, whose arm follows the path.
        joint_rate: Largest magnitudes [rad/s or m/s], shape (n,); None without limit.
        base_rate: Largest magnitude of the spacecraft's angular velocity [rad/s]; None without.
        attitude: Limits of attitude.
    """

    model: FreeFloatingModel
    joint_rate: Array | None
    base_rate: float | None
    attitude: AttitudeLimits

    @cached_property
    def _entries(self) -> dict[str, _Entry]:
        """What is known of each limit, in the order in which limits are checked."""
        (lower, upper), entries = self.model.joint_ranges, dict[str, _Entry]()
        if np.isfinite([lower, upper]).any():
            width = min(1.0, float((upper - lower).min()) / 2.0)
            entries["joint_range"] = _Entry(self._range_ratios, width)
        if self.joint_rate is not None:
            entries["joint_rate"] = _Entry(self._rate_ratios, _RATE)
        if self.base_rate is not None:
            entries["base_rate"] = _Entry(self._base_rate_ratios, _RATE)
        if self.attitude.base_turn is not None:
            entries["base_turn"] = _Entry(self._turn_ratios, self.attitude.base_turn)
        if self.attitude.pointing:
            angle = min(limit.angle for limit in self.attitude.pointing)
            entries["pointing"] = _Entry(self._pointing_ratios, angle)
        return entries

    @property
    def names(self) -> tuple[str, ...]:
        """Their names in results."""
        return tuple(self._entries)

    def ratios(self, motions: EnsembleResult, stretches: Array) -> Array:
        """Ratios of the limits, 1 where one is just kept, shape (K, L).

        Args:
            motions: Motions of an ensemble with these limits of attitude.
            stretches: Times of the motions that they stand for over theirs, shape (K,).
        """
        ratios = np.empty((len(stretches), len(self._entries)))
        for column, entry in zip(ratios.T, self._entries.values(), strict=True):
            column[:] = entry.ratios(motions, stretches)
        return ratios

    def are_certain(self, ratios: Array, deciders: npt.NDArray[np.int8]) -> BoolArray:
        """Whether errors change no verdict on a limit, for what decided the motions, (K,)."""
        certain = np.ones(len(ratios), dtype=bool)
        for column, entry in zip(ratios.T, self._entries.values(), strict=True):
            error = _ERRORS[deciders] / entry.angle
            certain &= np.abs(column - 1.0) > error
        return certain

    def _range_ratios(self, motions: EnsembleResult, _: Array) -> Array:
        return largest_range_ratio(self.model, motions.lower, motions.upper)

    def _rate_ratios(self, motions: EnsembleResult, stretches: Array) -> Array:
        return motions.rate_usage(np.asarray(self.joint_rate)) / stretches

    def _base_rate_ratios(self, motions: EnsembleResult, stretches: Array) -> Array:
        return motions.base_rate / (float(self.base_rate or 0.0) * stretches)

    def _turn_ratios(self, motions: EnsembleResult, _: Array) -> Array:
        return self.attitude.ratios(motions.slacks)[:, -1]

    def _pointing_ratios(self, motions: EnsembleResult, _: Array) -> Array:
        """Those of the axes that are nearest to the edges of their cones, or farthest beyond."""
        limits = self.attitude.pointing
        ratios = self.attitude.ratios(motions.slacks)[:, : len(limits)]
        angles = np.array([limit.angle for limit in limits])
        inside = np.array([limit.keep is Keep.INSIDE for limit in limits])
        with np.errstate(divide="ignore"):
            from_edge = angles * np.where(inside, 1.0 - ratios, 1.0 / ratios - 1.0)
        return np.take_along_axis(ratios, from_edge.argmin(axis=1)[:, None], axis=1)[:, 0]
