"""A phase of a manoeuvre, and the phases that can follow one another."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import chain, count
from typing import Any, ClassVar

from freefloat.beyond.missions.phases.state import ExpectedState, SystemState, keys_within
from freefloat.errors import InputError, require_type
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.motion.setting import Setting
from freefloat.planning.answer import Finding

REORIENTATION, PATH = "reorientation", "path"
"""Names of the phase that leads to the start of the first path, and of this path."""


class Phase(ABC):
    """What a manoeuvre does after its first path, from the state at which the phase before ends.

    Phases are frozen dataclasses.

    Attributes:
        kind: Kind of its result.
        name: Name of the phase; by default its kind, with a number where another phase has that
            name.
    """

    kind: ClassVar[str]
    name: str

    @property
    def default_name(self) -> str:
        """Name of a phase without one, but for a number."""
        return self.kind

    @abstractmethod
    def expected_after(self, state: ExpectedState) -> ExpectedState:
        """What is known of the state at its end before anything is planned.

        Raises:
            InputError: If the phase cannot follow what is known of the state at its beginning.
        """

    @abstractmethod
    def setting_at(self, state: SystemState) -> Setting:
        """The setting of a phase that begins with a state, of a path its problem.

        Files do not hold it.

        Raises:
            InputError: If the phase cannot begin there.
        """

    @abstractmethod
    def run(self, state: SystemState, limits: Limits) -> Finding:
        """Plan the phase from a state.

        Args:
            state: The state at its beginning.
            limits: Limits to keep, from the present centre of mass.

        Raises:
            InputError: If the phase cannot begin there.
        """

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """The keys of a scenario's phase that state it, but for its name and path.

        Raises:
            InputError: If scenario files cannot describe it.
        """

    def end(self, state: SystemState, result: Any) -> SystemState:
        """The state at which the phase ends that begins with a state and has a result."""
        return state.after(result.motion)


def checked_phases(
    problem: Problem, phases: Iterable[Phase], keys: Sequence[str] | None = None
) -> tuple[Phase, ...]:
    """The phases with distinct names, which can follow one another as far as is known beforehand.

    Args:
        problem: Problem of the first path.
        phases: The phases.
        keys: Keys of the phases, for errors; by default ``phases.0`` and so on.

    Raises:
        InputError: If one is no phase, or cannot follow the path and the phases before.
    """
    require_type("phases", phases, Iterable, "a list of phases")
    given = tuple(phases)
    keys = [f"phases.{k}" for k in range(len(given))] if keys is None else keys
    state, taken = ExpectedState.after_first(problem), {REORIENTATION, PATH}
    for number, (phase, key) in enumerate(zip(given, keys, strict=True)):
        accepted = "a phase, such as a PathPhase, a GoalPhase or a CapturePhase"
        require_type(key, phase, Phase, accepted)
        with keys_within(key):
            state = phase.expected_after(state)
        if phase.name in taken:
            twice = f"another phase is named {phase.name!r}"
            raise InputError(f"phases.{number}.name", twice, "another name")
        if phase.name:
            taken.add(phase.name)
    named: list[Phase] = []
    for phase in given:
        kind = phase.default_name
        numbered = chain([kind], (f"{kind} {number}" for number in count(2)))
        name = phase.name or next(name for name in numbered if name not in taken)
        taken.add(name)
        named.append(replace(phase, name=name))  # type: ignore[type-var]
    return tuple(named)
