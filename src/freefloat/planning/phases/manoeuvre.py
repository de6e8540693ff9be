"""Planned manoeuvres: phases, each from the state at which the one before ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

from freefloat.limits.contact import Contact
from freefloat.motion.problem import Problem
from freefloat.planning.answer import Answer, PhaseResult
from freefloat.planning.plan import Plan


@dataclass(frozen=True, eq=False)
class Manoeuvre(Answer):
    """The phases of a manoeuvre, each from the state at which the one before ends.

    Attributes:
        path: The plan of the first path.
        phases: Phases in order, up to the first that fails.
        reason: Why it succeeds, or which phase fails and why.
        not_reached: Names of the phases that are not planned, because one before them fails.
    """

    kind: ClassVar[str] = "manoeuvre"

    path: Plan
    phases: tuple[PhaseResult, ...]
    reason: str
    not_reached: tuple[str, ...] = ()

    @classmethod
    def of(cls, path: Plan, phases: Sequence[PhaseResult], names: Sequence[str]) -> Self:
        """The manoeuvre of phases, one of which is the first path.

        Args:
            path: The plan of the first path.
            phases: Phases in order, up to the first that fails.
            names: Names of all phases.
        """
        failed = next((phase for phase in phases if not phase.feasible), None)
        if failed is None:
            return cls(path, tuple(phases), f"all {len(phases)} phases succeed")
        planned = {phase.name for phase in phases}
        not_reached = tuple(name for name in names if name not in planned)
        return cls(path, tuple(phases), f"{failed.name}: {failed.reason}", not_reached)

    @property
    def feasible(self) -> bool:
        """Whether all phases succeed."""
        return all(phase.feasible for phase in self.phases)

    @property
    def problem(self) -> Problem:
        """The problem of the first path."""
        return self.path.problem

    @property
    def duration(self) -> float:
        """Duration of all phases [s]."""
        return sum(phase.duration for phase in self.phases)

    @cached_property
    def contact(self) -> Contact | None:
        """The deepest contact of bodies along the motions; None without contact."""
        return self.deepest_contact()

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat plan`` for scenarios with phases."""
        return {
            "feasible": self.feasible,
            "reason": self.reason,
            "duration": self.duration,
            "contact": self.contact and self.contact.to_dict(),
            "phases": [phase.to_dict() for phase in self.phases],
            "not_reached": list(self.not_reached),
        }
