"""Answers of planning: phases after one another, one unless the answer is a manoeuvre."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Protocol

from freefloat.kinds import named
from freefloat.limits.limits import Contact, Limits, deepest_contact
from freefloat.limits.result import LimitResult, violated
from freefloat.motion.motion import Motion
from freefloat.so3 import Array, frozen, zeros

if TYPE_CHECKING:
    from freefloat.planning.motions import SimulatedBranch


class Finding(Protocol):
    """What a phase found: its motion, the verdict, and whatever is special to its kind."""

    @property
    def motion(self) -> Motion | None:
        """Motion of the phase; None where there is none."""

    @property
    def feasible(self) -> bool:
        """Whether the motion completes and keeps margin and limits."""

    @property
    def reason(self) -> str:
        """Why this motion was chosen, or why there is none that is feasible."""

    @property
    def limits(self) -> Limits | None:
        """Limits in addition to the joint ranges; None where none were checked."""

    @property
    def limit_results(self) -> Sequence[LimitResult]:
        """Limits along the motion."""

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""


@dataclass(frozen=True, eq=False)
class PhaseResult:
    """What was found for a phase, and when and where it begins.

    Attributes:
        name: Name of the phase.
        kind: ``path``, ``goal`` or ``capture``.
        result: What was found.
        start: Time at which the phase begins; the first path begins at zero [s].
        centre: Centre of mass at this time in the frame of the manoeuvre [m], shape (3,).
    """

    name: str
    kind: str
    result: Finding = field(repr=False)
    start: float = 0.0
    centre: Annotated[Array, "m"] = field(default_factory=zeros)

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", frozen(self.centre))

    @property
    def motion(self) -> Motion | None:
        """Motion of the phase; None for a capture, and where none was found."""
        return self.result.motion

    @property
    def chosen(self) -> SimulatedBranch | None:
        """The motion of a path with its minimum margin, which other phases do not have."""
        return getattr(self.result, "chosen", None)

    @property
    def feasible(self) -> bool:
        """Whether the phase succeeds and keeps margin and limits."""
        return self.result.feasible

    @property
    def reason(self) -> str:
        """Why this motion, or why none; empty for a capture."""
        return self.result.reason

    @property
    def limit_results(self) -> Sequence[LimitResult]:
        """Limits along the motion."""
        return self.result.limit_results

    @property
    def duration(self) -> float:
        """Duration [s]; zero for a capture, and where there is no motion."""
        motion = self.motion
        return 0.0 if motion is None else abs(float(motion.times[-1] - motion.times[0]))

    def to_dict(self) -> dict[str, Any]:
        """The phase as a JSON document."""
        return self.result.to_dict() | {  # whose duration may be the duration of the path
            "name": self.name,
            "kind": self.kind,
            "start": self.start,
            "duration": self.duration,
            "feasible": self.feasible,
            "start_centre_of_mass": self.centre.tolist(),
        }


def violation_of(results: Iterable[LimitResult]) -> str:
    """Which limits are violated, as in a title; empty where all are kept."""
    names = dict.fromkeys(entry.limit for entry in violated(results))
    return f"infeasible: violates {', '.join(names)}" if names else ""


class Answer:
    """A result of planning.

    Attributes:
        kind: Kind of the result, of its file and of the report of its check.
    """

    kind: ClassVar[str]

    if TYPE_CHECKING:  # fields of some answers, properties of others

        @property
        def feasible(self) -> bool:
            """Whether all phases succeed, and keep margin and limits."""

        @property
        def reason(self) -> str:
            """Why this answer, or why there is none that is feasible."""

        @property
        def contact(self) -> Contact | None:
            """The deepest contact of bodies along the motions; None without contact."""

        @property
        def phases(self) -> tuple[PhaseResult, ...]:
            """The phases in order."""

        def to_dict(self) -> dict[str, Any]:
            """The JSON document."""

    def _repr_html_(self) -> str:
        """What the command prints, for notebooks."""
        return str(named("cli.delivery:answer_html")(self))

    @property
    def violation(self) -> str:
        """Which limits the motions violate, as in a title; empty where they keep all."""
        return violation_of(entry for phase in self.phases for entry in phase.limit_results)

    def deepest_contact(self) -> Contact | None:
        """The deepest contact of bodies along the motions, at its time after the first path began.

        None without contact.
        """
        contacts = list[Contact]()
        for phase in self.phases:
            motion = phase.motion
            contact = None if motion is None else deepest_contact(motion, phase.limit_results)
            if contact is not None:
                contacts.append(replace(contact, time=phase.start + contact.time))
        return max(contacts, key=lambda contact: contact.depth, default=None)
