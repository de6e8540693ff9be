"""Limits that motions of an ensemble show to be kept or violated, and by how much."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from freefloat.ensemble.result import EnsembleResult
from freefloat.ensemble.systems import ScaledMotions
from freefloat.motion.pointing import AttitudeLimits
from freefloat.robot.model import FreeFloatingModel, range_ratios, shifts_into_ranges
from freefloat.so3 import Array, BoolArray, IntArray

KNOWN = "joint_range", "joint_rate", "base_rate", "base_turn", "pointing"
"""Names of the limits that ensembles know, in the order in which limits are checked."""
_ERRORS = np.array([5e-4, 5e-5, 5e-7, 5e-7])
"""Errors of angles of compiled motions [rad], by the code of what decided them: above the
largest ones of 1,400 motions with limits of pointing."""
_RATE = 0.1
"""Error of angles [rad] that changes rates, relative to their limits, by 1 at most."""


class LimitValues(NamedTuple):
    """Limits along K motions at the instants at which each is nearest to its bound, or beyond it.

    Attributes:
        ratios: 1 where a limit is just kept, see :class:`.LimitResult`, shape (K, L).
        times: The instants [s], shape (K, L).
        places: Indices into :attr:`KnownLimits.places` of the limit, shape (K, L).
        certain: Whether errors change no verdict on a limit, shape (K, L).
    """

    ratios: Array
    times: Array
    places: IntArray
    certain: BoolArray

    @classmethod
    def empty(cls, count: int, limits: int) -> LimitValues:
        """Values that are unknown."""
        ratios, times = np.full((2, count, limits), np.nan)
        places = np.zeros((count, limits), np.int64)
        return cls(ratios, times, places, np.zeros((count, limits), dtype=bool))

    def and_others(self, others: LimitValues) -> LimitValues:
        """These limits and others along the same motions."""
        return LimitValues._make(map(np.hstack, zip(self, others, strict=True)))


class _Entry(NamedTuple):
    """A limit of C quantities."""

    ratios: Callable[[EnsembleResult, Array], Array]  # ratios of the quantities, (K, C)
    angle: float  # the angle [rad] that changes them by 1
    columns: IntArray  # columns of the times, see :meth:`.EnsembleIntegrator.integrate`, (C,)
    places: tuple[str, ...]  # joints, or other names, of the quantities


@dataclass(frozen=True, eq=False)
class KnownLimits:
    """Limits whose ratios ensembles know; joint ranges are the robot's.

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
    def compared(self) -> AttitudeLimits:
        """The limits of attitude with which motions are integrated: their turn is always known."""
        turn = self.attitude.base_turn
        return replace(self.attitude, base_turn=np.pi if turn is None else turn)

    @cached_property
    def _entries(self) -> dict[str, _Entry]:
        """What is known of each limit, in the order in which limits are checked."""
        (lower, upper), entries = self.model.joint_ranges, dict[str, _Entry]()
        joints, n, axes = self.model.joint_names, self.model.dof, self.attitude.pointing
        rates, spacecraft = 3 * np.arange(n), ("spacecraft",)
        if np.isfinite([lower, upper]).any():
            width = min(1.0, float((upper - lower).min()) / 2.0)
            columns = np.concatenate([rates + 1, rates + 2])
            entries["joint_range"] = _Entry(self._range_ratios, width, columns, joints * 2)
        if self.joint_rate is not None:
            entries["joint_rate"] = _Entry(self._rate_ratios, _RATE, rates, joints)
        if self.base_rate is not None:
            columns = np.array([3 * n])
            entries["base_rate"] = _Entry(self._base_rate_ratios, _RATE, columns, spacecraft)
        if self.attitude.base_turn is not None:
            columns = np.array([3 * n + 1 + len(axes)])
            turn = self.attitude.base_turn
            entries["base_turn"] = _Entry(self._turn_ratios, turn, columns, spacecraft)
        if axes:
            angle = min(limit.angle for limit in axes)
            columns = 3 * n + 1 + np.arange(len(axes))
            titles = tuple(limit.title(number) for number, limit in enumerate(axes))
            entries["pointing"] = _Entry(self._pointing_ratios, angle, columns, titles)
        return entries

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the limits in results."""
        return tuple(self._entries)

    @property
    def places(self) -> tuple[tuple[str, ...], ...]:
        """Joints, or other names, of the quantities of each limit."""
        return tuple(entry.places for entry in self._entries.values())

    def values(
        self,
        motions: EnsembleResult,
        moments: Array,
        disturbed: ScaledMotions,
        deciders: npt.NDArray[np.int8],
    ) -> LimitValues:
        """The limits along motions.

        Args:
            motions: Motions of an ensemble with the limits :attr:`compared`.
            moments: Times of their extreme values, see :meth:`.EnsembleIntegrator.integrate`.
            disturbed: What they stand for.
            deciders: Codes of what decided them, shape (K,).
        """
        values = LimitValues.empty(len(disturbed), len(self._entries))
        rows, stretches, first = np.arange(len(disturbed)), disturbed.stretches, 0
        for number, entry in enumerate(self._entries.values()):
            scales = disturbed.scales[:, first : first + len(entry.places)]
            first += 0 if disturbed.scales.shape[1] == 1 else len(entry.places)
            ratios = entry.ratios(motions, stretches) * scales
            place = ratios.argmax(axis=1)
            ratio, scale = (np.broadcast_to(array, ratios.shape)[rows, place]
                            for array in (ratios, scales))  # fmt: skip
            values.ratios[:, number] = ratio
            values.times[:, number] = moments[rows, entry.columns[place]] * stretches
            values.places[:, number] = place
            error = _ERRORS[deciders] / entry.angle * scale
            values.certain[:, number] = np.abs(ratio - 1.0) > error
        return values

    def turns(self, motions: EnsembleResult) -> Array:
        """Largest angles of the spacecraft from its attitude at the start [rad], shape (K,)."""
        limits = self.compared
        return np.asarray(limits.ratios(motions.slacks)[:, -1] * float(limits.base_turn or 0.0))

    def _range_ratios(self, motions: EnsembleResult, _: Array) -> Array:
        lower, upper = motions.lower, motions.upper
        shifts = shifts_into_ranges(self.model, lower, upper)
        ratios = range_ratios(self.model.joint_ranges, lower + shifts, upper + shifts)
        return np.concatenate(ratios, axis=1)

    def _rate_ratios(self, motions: EnsembleResult, stretches: Array) -> Array:
        return np.asarray(motions.rates / (np.asarray(self.joint_rate) * stretches[:, None]))

    def _base_rate_ratios(self, motions: EnsembleResult, stretches: Array) -> Array:
        return (motions.base_rate / (float(self.base_rate or 0.0) * stretches))[:, None]

    def _turn_ratios(self, motions: EnsembleResult, _: Array) -> Array:
        return self.attitude.ratios(motions.slacks)[:, -1:]

    def _pointing_ratios(self, motions: EnsembleResult, _: Array) -> Array:
        return self.compared.ratios(motions.slacks)[:, :-1]
