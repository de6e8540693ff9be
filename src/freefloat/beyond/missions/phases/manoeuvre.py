"""Planned manoeuvres: phases, each from the state at which the one before ends, their motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from freefloat.beyond.missions.phases.phase import REORIENTATION, Phase
from freefloat.limits.check import Contact
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.answer import Answer, PhaseResult
from freefloat.planning.plan import Plan
from freefloat.planning.settings import Search
from freefloat.robot.model import FreeFloatingModel


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
        name, reason = self._failed.name, self._failed.reason
        since = f"; t counts from the beginning of {name}" if "t = " in reason else ""
        return f"{name}: {reason}{since}"

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


def with_resting_arms(motions: Sequence[Motion | None]) -> list[Motion | None]:
    """The motions of phases, all with the joints of the arms that move along any of them.

    Args:
        motions: Motions of one manoeuvre; None of phases without motion.
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
