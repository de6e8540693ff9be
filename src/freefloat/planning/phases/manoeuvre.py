"""Records of planned manoeuvres: phases, each from the state at which the one before ends."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

from freefloat.dynamics.capture import Capture
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.joints.joint_motion import JointMotion
from freefloat.planning.joints.reorientation import Reorientation
from freefloat.planning.plan import Plan
from freefloat.so3 import Array, frozen


@dataclass(frozen=True, eq=False)
class PlannedPhase:
    """A phase of a manoeuvre.

    Attributes:
        name: Its name.
        start: Time at which it begins, that of the first path being zero [s].
        centre: Of mass at this time in the frame of the manoeuvre [m], shape (3,).
        result: What was found.
    """

    name: str
    start: float
    centre: Annotated[Array, "m"]
    result: Plan | Reorientation | JointMotion | Capture = field(repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", frozen(self.centre))

    @property
    def kind(self) -> str:
        """``path``, ``reorientation``, ``joints`` or ``capture``."""
        kinds = {Plan: "path", Reorientation: "reorientation", JointMotion: "joints"}
        return kinds.get(type(self.result), "capture")

    @property
    def motion(self) -> Motion | None:
        """Its motion; None for a capture, and where none was found."""
        if isinstance(self.result, Plan):
            return None if self.result.chosen is None else self.result.chosen.motion
        return None if isinstance(self.result, Capture) else self.result.motion

    @property
    def feasible(self) -> bool:
        """Whether it succeeds and keeps margin and limits."""
        if isinstance(self.result, Reorientation):
            return self.result.reached
        return isinstance(self.result, Capture) or self.result.feasible

    @property
    def reason(self) -> str:
        """Why this motion, or why none; empty for a capture."""
        return "" if isinstance(self.result, Capture) else self.result.reason

    @property
    def duration(self) -> float:
        """[s]; zero for a capture, and where there is no motion."""
        motion = self.motion
        return 0.0 if motion is None else abs(float(motion.times[-1] - motion.times[0]))

    def to_dict(self) -> dict[str, Any]:
        """The phase as a JSON document."""
        return {
            "name": self.name,
            "kind": self.kind,
            "start": self.start,
            "duration": self.duration,
            "feasible": self.feasible,
            "start_centre_of_mass": self.centre.tolist(),
            **self.result.to_dict(),
        }


@dataclass(frozen=True, eq=False)
class Manoeuvre:
    """The phases of a manoeuvre, each from the state at which the one before ends.

    Attributes:
        phases: In order, up to the first that fails.
        reason: Why it succeeds, or which phase fails and why.
    """

    phases: tuple[PlannedPhase, ...]
    reason: str

    @property
    def feasible(self) -> bool:
        """Whether all phases succeed."""
        return all(phase.feasible for phase in self.phases)

    @property
    def path(self) -> Plan:
        """The plan of the first path."""
        return next(p.result for p in self.phases if isinstance(p.result, Plan))

    @property
    def problem(self) -> Problem:
        """The problem of the first path."""
        return self.path.problem

    @property
    def duration(self) -> float:
        """Of all phases [s]."""
        return sum(phase.duration for phase in self.phases)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat plan`` for scenarios with phases."""
        return {
            "feasible": self.feasible,
            "reason": self.reason,
            "duration": self.duration,
            "phases": [phase.to_dict() for phase in self.phases],
        }
