"""Manoeuvres: phases, each from the state at which the one before ends, their motions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, count
from typing import Any, ClassVar

import numpy as np

from freefloat.beyond.missions.state import ExpectedState, SystemState, keys_within
from freefloat.errors import InputError, require_type
from freefloat.limits.limits import Contact, Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.motion.setting import Setting
from freefloat.planning.answer import Answer, Finding, PhaseResult
from freefloat.planning.plan import Plan
from freefloat.planning.settings import Search
from freefloat.robot.model import FreeFloatingModel

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

    Keys of the phases in errors are by default ``phases.0`` and so on.

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


@dataclass(frozen=True, eq=False)
class Manoeuvre(Answer):
    """The phases of a manoeuvre, each from the state at which the one before ends.

    Attributes:
        path: The plan of the first path.
        phases: Results of the phases in order, up to the first that fails.
        following: Phases after the first path, those that are not planned, too.
        reorient: Whether a reorientation leads to the start of the path.
    """

    kind: ClassVar[str] = "manoeuvre"

    path: Plan
    phases: tuple[PhaseResult, ...]
    following: tuple[Phase, ...] = field(default=(), repr=False)
    reorient: bool = False

    @property
    def feasible(self) -> bool:
        """Whether all phases succeed."""
        return self._failed is None

    @property
    def _failed(self) -> PhaseResult | None:
        return next((phase for phase in self.phases if not phase.feasible), None)

    @property
    def reason(self) -> str:
        """Why it succeeds, or which phase fails and why."""
        if self._failed is None:
            return f"all {len(self.phases)} phases succeed"
        return phase_reason(self._failed)

    @property
    def not_reached(self) -> tuple[str, ...]:
        """Names of the phases that are not planned, because one before them fails."""
        if self.feasible:
            return ()
        planned = {phase.name for phase in self.phases}
        names = [phase.name for phase in self.following]
        if self.reorient and not self.path.feasible:
            names.insert(0, REORIENTATION)
        return tuple(name for name in names if name not in planned)

    @property
    def worst_results(self) -> tuple[tuple[PhaseResult, LimitResult], ...]:
        """The result of each limit in the phase that comes nearest to it, with that phase."""
        worst: dict[str, tuple[PhaseResult, LimitResult]] = {}
        for phase in self.phases:
            for result in phase.limit_results:
                if result.limit not in worst or result.ratio > worst[result.limit][1].ratio:
                    worst[result.limit] = phase, result
        return tuple(worst.values())

    @property
    def problem(self) -> Problem:
        """The problem of the first path."""
        return self.path.problem

    @property
    def search(self) -> Search:
        """What was searched for on the first path."""
        return self.path.search

    @property
    def limits(self) -> Limits | None:
        """Limits that were to be kept; None where none were checked."""
        return self.path.limits

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
            "feasible": self.feasible, "reason": self.reason, "duration": self.duration,
            "contact": self.contact and self.contact.to_dict(),
            "phases": [phase.to_dict() for phase in self.phases],
            "not_reached": list(self.not_reached),
        }  # fmt: skip


def phase_reason(phase: PhaseResult) -> str:
    """Name and reason of a phase, and from when the times in it count."""
    later = bool(phase.start) and "t = " in phase.reason
    since = f"; t counts from the beginning of {phase.name}" if later else ""
    return f"{phase.name}: {phase.reason}{since}"


def with_resting_arms(motions: Sequence[Motion | None]) -> list[Motion | None]:
    """The motions of the phases of a manoeuvre, None of phases without motion.

    All have the joints of the arms that move along any of them.
    """
    settings = [motion.setting for motion in motions if motion is not None]
    robot = next((setting.model for setting in settings if setting.robot_varies), None)
    if robot is None:
        return list(motions)
    return [motion and _with_resting_arms(motion, robot) for motion in motions]


def _with_resting_arms(motion: Motion, robot: FreeFloatingModel) -> Motion:
    """A motion with the joints that further arms of a robot move, and its own model fixes."""
    if motion.setting.robot_varies:
        return motion
    fixed = dict(motion.model.fixed_joints)
    resting = {
        name: np.array([fixed.pop(joint) for joint in robot.joints_of_arm(name)])
        for name in robot.arms
    }
    model = replace(motion.model, arms=robot.arms, fixed_joints=fixed)
    constant = np.tile(np.concatenate([*resting.values()]), (len(motion.joints), 1))
    law = motion.law.with_arms_at_rest(model, resting)
    return replace(motion, law=law, joints=np.hstack([motion.joints, constant]))
