"""Limits that ensembles do not know, along recorded motions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from freefloat.ensemble.known_limits import LimitValues
from freefloat.ensemble.recorded_motions import RecordedMotions
from freefloat.ensemble.systems import ScaledMotions
from freefloat.limits.kinds.clearance import ClearanceLimit
from freefloat.limits.kinds.corridor import CorridorLimit
from freefloat.limits.kinds.joint_acceleration import JointAccelerationLimit
from freefloat.limits.kinds.joint_jerk import JointJerkLimit
from freefloat.limits.kinds.joint_torque import JointTorqueLimit
from freefloat.limits.limit import Limit
from freefloat.limits.limits import Limits
from freefloat.limits.recorded_torques import largest_torques
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, BoolArray

_ALONG = CorridorLimit, JointAccelerationLimit, JointJerkLimit, ClearanceLimit
"""Limits that are checked one motion after the other, the cheapest first."""
_PANELS = 16, 64
"""Least numbers of panels of motions, and of those whose torques these do not resolve."""
_RESOLVED = 1e-5
"""Largest error of a ratio of torques, relative to the ratio."""
_UNDECIDED = 1e-4
"""Distance from a bound within which other limits are not decided, relative to the bound."""


@dataclass(frozen=True, eq=False)
class RecordedLimits:
    """Limits of motions of one arm: torques of all motions at once, others one after the other.

    Attributes:
        problem: The problem that disturbed motions have in common.
        joint_torque: Largest magnitudes [N m or N], shape (n,); None without limit.
        along: Limits that are checked one motion after the other.
    """

    problem: Problem
    joint_torque: Array | None = None
    along: tuple[Limit[Any], ...] = ()

    @classmethod
    def of(cls, problem: Problem, limits: Limits, *, moved: bool) -> RecordedLimits:
        """Those of a problem; contact is none unless a clearance is stated.

        Args:
            problem: The problem.
            limits: Its limits.
            moved: Whether durations or robots vary, so that the bodies of a scene are elsewhere.

        Raises:
            ModelError: If a clearance is required and the shapes of the robot cannot be used.
        """
        apart: set[type[Limit[Any]]] = set()
        if moved and problem.scene.bodies:
            apart = {CorridorLimit, ClearanceLimit}
        if limits.clearance is None:
            apart.add(ClearanceLimit)
        along = (kind.of(problem, limits) for kind in _ALONG if kind not in apart)
        return cls(problem, limits.joint_torque, tuple(limit for limit in along if limit))

    @property
    def without(self) -> RecordedLimits:
        """No limits of the same problem."""
        return RecordedLimits(self.problem)

    @property
    def names(self) -> tuple[str, ...]:
        """Their names in results."""
        torque = () if self.joint_torque is None else (JointTorqueLimit.name,)
        return *torque, *(limit.name for limit in self.along)

    @cached_property
    def places(self) -> tuple[tuple[str, ...], ...]:
        """Of each limit the joints, or other names, of its quantities."""
        joints = self.problem.model.joint_names
        torque = () if self.joint_torque is None else (joints,)
        return *torque, *(limit.places(self.problem) for limit in self.along)

    def values(
        self, disturbed: ScaledMotions, attitudes: Array, joints: Array, threads: int
    ) -> LimitValues:
        """The limits along motions from attitudes (K, 4) and joints (K, n).

        Those that cannot be decided are not certain. The scales of torques are the last columns of
        ``disturbed.scales``; the other limits have none.
        """
        values = LimitValues.empty(len(disturbed), len(self.names))
        missing = np.arange(len(disturbed))
        for panels in _PANELS[: 1 if self.joint_torque is None else 2]:
            starts = attitudes[missing], joints[missing]
            recorded = RecordedMotions.of(disturbed[missing], *starts, panels, threads)
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
        for k in np.flatnonzero(kept).tolist() if self.along else ():
            self._note(recorded, k, values)
        return values, resolved

    def _note(self, recorded: RecordedMotions, k: int, values: LimitValues) -> None:
        """Write the limits along motion k, up to the first that is violated or undecided."""
        problem, stretch = self.problem, recorded.disturbed.stretches[k]
        if problem.scene.bodies or any(limit.exponent for limit in self.along):
            problem = recorded.disturbed.problem_of(k)
        states = recorded.times, recorded.attitudes[k], recorded.joints[k]
        motion = Motion(PathLaw(problem), Ending.COMPLETED, *states)
        for column, limit in enumerate(self.along, len(self.names) - len(self.along)):
            result, scale = limit.worst(motion), stretch**-limit.exponent
            values.ratios[k, column] = result.ratio * scale
            values.times[k, column] = result.time * stretch
            values.places[k, column] = self.places[column].index(result.where)
            worst = (result.worst if result.at_least else abs(result.worst)) * scale
            error = max(limit.accuracy, _UNDECIDED * abs(result.allowed))
            values.certain[k, column] = abs(worst - result.allowed) > error
            if result.ratio * scale > 1.0 or not values.certain[k, column]:
                break
