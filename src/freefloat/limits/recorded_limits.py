"""Limits that ensembles do not know, along recorded motions: joint torques and clearances."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from freefloat.ensemble.equivalence import ScaledMotions
from freefloat.ensemble.known_limits import LimitValues
from freefloat.ensemble.recorded_motions import RecordedMotions
from freefloat.limits.clearance import clearance
from freefloat.limits.kinds.clearance import ClearanceLimit
from freefloat.limits.kinds.joint_torque import JointTorqueLimit
from freefloat.limits.many_torques import largest_torques
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, BoolArray

RECORDED = JointTorqueLimit.name, ClearanceLimit.name
"""Names of these limits, in the order in which they are computed: the cheapest first."""
_PANELS = 16, 64
"""Least numbers of panels of motions, and of those whose torques these do not resolve."""
_RESOLVED = 1e-5
"""Largest error of a ratio of torques, relative to the ratio."""


@dataclass(frozen=True, eq=False)
class RecordedLimits:
    """Limits of torques and of the distance between bodies, for motions of one arm.

    Where robots or durations differ from motion to motion, the scene has no bodies.

    Attributes:
        problem: The problem that disturbed motions have in common.
        joint_torque: Largest magnitudes [N m or N], shape (n,); None without limit.
        clearance: Smallest distance [m]; None without limit.
    """

    problem: Problem
    joint_torque: Array | None
    clearance: float | None

    @property
    def without(self) -> RecordedLimits:
        """No limits of the same problem."""
        return RecordedLimits(self.problem, None, None)

    @property
    def names(self) -> tuple[str, ...]:
        """Their names in results."""
        bounds = self.joint_torque, self.clearance
        return tuple(
            name for name, bound in zip(RECORDED, bounds, strict=True) if bound is not None
        )

    @cached_property
    def places(self) -> tuple[tuple[str, ...], ...]:
        """Of each limit the joints, or pairs of bodies."""
        torque = () if self.joint_torque is None else (self.problem.model.joint_names,)
        if self._distances is None:
            return torque
        pairs = self._distances.pairs
        return *torque, tuple(pairs.name(pair) for pair in range(len(pairs.pairs)))

    @cached_property
    def _distances(self) -> ClearanceLimit | None:
        return None if self.clearance is None else ClearanceLimit(self.problem, self.clearance)

    def values(
        self, disturbed: ScaledMotions, attitudes: Array, joints: Array, threads: int
    ) -> LimitValues:
        """The limits along motions from attitudes (K, 4) and joints (K, n).

        Those that cannot be decided are not certain. The scales of torques are the last columns of
        ``disturbed.scales``.
        """
        values = LimitValues.empty(len(disturbed), len(self.names))
        missing = np.arange(len(disturbed))
        for panels in _PANELS[: 1 if self.joint_torque is None else 2]:
            some = disturbed[missing]
            recorded = RecordedMotions.of(
                some, attitudes[missing], joints[missing], panels, threads
            )
            found, resolved = self._along(recorded, threads)
            for array, part in zip(values, found, strict=True):
                array[missing] = part
            missing = missing[~resolved & recorded.completed]
            if not len(missing):
                break
        return values

    def _along(self, recorded: RecordedMotions, threads: int) -> tuple[LimitValues, BoolArray]:
        """The limits along recorded motions, and whether torques are resolved, shape (K,)."""
        count, rows = len(recorded.joints), np.arange(len(recorded.joints))
        values = LimitValues.empty(count, len(self.names))
        kept, resolved = recorded.completed.copy(), recorded.completed.copy()
        if self.joint_torque is not None:
            torques = largest_torques(recorded, threads)
            scales = recorded.disturbed.scales[:, -len(self.joint_torque) :] / self.joint_torque
            ratios, errors = torques.values * scales, torques.errors * scales
            place = ratios.argmax(axis=1)
            largest, error = ratios[rows, place], errors.max(axis=1)
            values.ratios[:, 0], values.times[:, 0] = largest, torques.times[rows, place]
            values.places[:, 0] = place
            resolved &= error <= _RESOLVED * largest
            values.certain[:, 0] = resolved & (np.abs(largest - 1.0) > 2.0 * _RESOLVED)
            kept &= values.certain[:, 0] & (largest <= 1.0)
        if self._distances is not None:
            for k in np.flatnonzero(kept).tolist():
                self._compare(recorded, k, self._distances, values)
        return values, resolved

    def _compare(
        self, recorded: RecordedMotions, k: int, limit: ClearanceLimit, values: LimitValues
    ) -> None:
        """Write the smallest distance along motion k."""
        if not len(limit.pairs.pairs):
            values.ratios[k, -1], values.certain[k, -1] = 0.0, True
            return
        times, attitudes, joints = recorded.times, recorded.attitudes[k], recorded.joints[k]
        problem = self.problem
        if problem.scene.bodies:
            problem = recorded.disturbed.problem_of(k)
        nearest = clearance(
            Motion(problem, Ending.COMPLETED, times, attitudes, joints), limit.pairs
        )
        distance, bound = nearest.distance, limit.bound
        values.ratios[k, -1] = np.inf if distance <= 0.0 else bound / distance
        values.times[k, -1] = nearest.time * recorded.disturbed.stretches[k]
        values.places[k, -1] = nearest.pair
        values.certain[k, -1] = abs(distance - bound) > limit.accuracy
