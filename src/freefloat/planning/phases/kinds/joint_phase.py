"""Phases in which the joints move to given values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from freefloat.errors import InputError, require_type
from freefloat.limits.limits import Limits
from freefloat.motion.joint_transfer import JointTransfer
from freefloat.motion.problem import Problem
from freefloat.paths.time_laws import TimeLaw, positive_duration
from freefloat.paths.timing import TimedPath, Timing
from freefloat.planning.joints.joint_motion import JointMotion, joint_motion
from freefloat.planning.phases.expected_state import ExpectedState
from freefloat.planning.phases.phase import Phase
from freefloat.planning.phases.state import SystemState

_FARTHEST = 1e3
"""Largest value of a joint at the end of a phase [rad or m]."""


@dataclass(frozen=True, eq=False)
class JointPhase(Phase):
    """A motion of the joints from where they are to given values, at which they rest.

    Attributes:
        joints: Values at the end, by name or shape (n,) [rad or m].
        duration: Duration of the motion [s].
        name: Its name; by default ``"joints"``, with a number where another phase has that name.

    Example:
        >>> ff.JointPhase({"q1": 0.2, "q2": -0.4}, duration=30.0, name="berth").duration
        30.0
    """

    kind: ClassVar[str] = "joints"

    joints: npt.ArrayLike | dict[str, float]
    duration: float
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "duration", positive_duration("duration", self.duration))
        require_type("name", self.name, str, "a name")

    def expected_after(self, state: ExpectedState) -> ExpectedState:
        """See :class:`~freefloat.planning.phases.phase.Phase`."""
        model = state.problem.model
        for name, value, low, high in zip(
            model.joint_names, model.joint_vector(self.joints, "joints"), *model.joint_ranges,
            strict=True,
        ):  # fmt: skip
            low, high = max(low, -_FARTHEST), min(high, _FARTHEST)
            if not low <= value <= high:
                accepted = f"{low:g} to {high:g} rad or m"
                raise InputError("joints", f"{name} is {value:g}", accepted)
        return state.after(state.resting(self.duration))

    def problem_at(self, state: SystemState) -> Problem:
        """See :class:`~freefloat.planning.phases.phase.Phase`; its path is not followed."""
        path = state.problem.path
        timing = Timing(self.duration, TimeLaw.UNIFORM)
        return state.problem_for(TimedPath(path.path, timing, path.drift))

    def run(self, state: SystemState, limits: Limits) -> JointMotion:
        """The motion of the joints from a state."""
        end = state.problem.model.joint_vector(self.joints, "joints")
        transfer = JointTransfer.between(
            state.joints, state.joint_rates, end, np.zeros_like(end), self.duration
        )
        problem = self.problem_at(state)
        return joint_motion(problem, transfer, state.attitude, self.duration, limits)
