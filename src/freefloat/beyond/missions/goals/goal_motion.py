"""Motions of the joints to goals: what was found, or why nothing was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, cast

import numpy as np

from freefloat.beyond.missions.goals.goal import Goal
from freefloat.beyond.missions.goals.target import EndState
from freefloat.dynamics.system import System
from freefloat.limits.limits import Contact, Limits
from freefloat.limits.result import LimitResult, all_violations, violated
from freefloat.motion.law import JointLaw
from freefloat.motion.motion import Motion
from freefloat.motion.problem_inputs import require_few_revolutions, require_planar_system
from freefloat.motion.setting import JointSetting
from freefloat.planning.answer import Answer, PhaseResult
from freefloat.rotations import Rotation
from freefloat.scene.scene import Scene
from freefloat.so3 import Array

FIRST_DURATION = 60.0
"""Duration with which a search begins where none is given [s]."""


@dataclass(frozen=True, eq=False)
class GoalMotion(Answer):
    """A motion of the joints to a goal.

    Attributes:
        setting: Robot, momentum, scene and the limits that were required, from the centre of mass
            at the start; without ``base_turn`` where the motion is a phase of a manoeuvre.
        goal: What is to be reached.
        feasible: Whether a motion was found that ends at the goal and keeps the limits.
        reason: Why this motion, or why none.
        needed: What would be enough, where it is known: a ``duration`` [s].
        motion: The motion; None where none was found. It may violate a limit.
        limit_results: Limits along it.
        seed: Seed of the random paths of the search.
    """

    kind: ClassVar[str] = "goal"

    setting: JointSetting = field(repr=False)
    goal: Goal
    feasible: bool
    reason: str
    needed: dict[str, float] = field(default_factory=dict)
    motion: Motion | None = field(default=None, repr=False)
    limit_results: tuple[LimitResult, ...] = field(default=(), repr=False)
    seed: int = 0

    @property
    def limits(self) -> Limits:
        """Limits that were required."""
        return required_limits(self.setting)

    @property
    def phases(self) -> tuple[PhaseResult, ...]:
        """The motion as the only phase."""
        return (PhaseResult("goal", "goal", self),)

    @property
    def law(self) -> JointLaw | None:
        """The joints by time; None without a motion."""
        return None if self.motion is None else cast(JointLaw, self.motion.law)

    @property
    def duration(self) -> float | None:
        """[s]; None without a motion."""
        return None if self.motion is None else float(self.motion.times[-1])

    @property
    def error(self) -> float | None:
        """Largest error of the last state [m, rad, m/s, rad/s]; None without a motion."""
        if self.motion is None:
            return None
        first, end = self.motion.initial, last_state(self.motion)
        target = self.goal.target(self.motion.setting, first.attitude, first.joints)
        errors = [target.residuals(end)]
        if self.goal.joints is not None:
            rates = 0.0 if self.goal.joint_rates is None else self.goal.joint_rates
            errors += [end.joints - self.goal.joints, end.joint_rates - rates]
        return float(np.abs(np.concatenate(errors)).max())

    @cached_property
    def contact(self) -> Contact | None:
        """The deepest contact of bodies along the motion; None without contact."""
        return self.deepest_contact()

    def with_motion(self, motion: Motion, results: Sequence[LimitResult]) -> GoalMotion:
        """The result with a motion that ends at the goal, feasible where it keeps its limits."""
        violations = violated(results)
        reason = f"the goal is reached in {float(motion.times[-1]):.4g} s"
        if violations:
            reason = f"along the best motion that was found {all_violations(violations)}"
        return replace(
            self, feasible=not violations, reason=reason, motion=motion,
            limit_results=tuple(results),
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        motion = self.motion
        return {
            "feasible": self.feasible, "reason": self.reason, "needed": dict(self.needed),
            "goal": self.goal.to_dict(), "duration": self.duration, "error": self.error,
            "contact": self.contact and self.contact.to_dict(),
            "initial": None if motion is None else motion.initial.to_dict(),
            "final": None if motion is None else motion.final.to_dict(),
            "limits": [result.to_dict() for result in self.limit_results],
        }  # fmt: skip


def last_state(motion: Motion) -> EndState:
    """The last state of a motion, with its joint rates."""
    final = motion.final
    rates = motion.law.rates(final.time, final.attitude, final.joints).joints
    attitude = Rotation.from_quat(final.attitude).as_matrix()
    return EndState(final.time, attitude, final.joints, rates)


def required_limits(setting: JointSetting) -> Limits:
    """The limits that motions in a setting have to keep in addition to the joint ranges."""
    return cast(Limits, setting.limits or Limits())


def earlier(setting: JointSetting, duration: float) -> JointSetting:
    """The setting a duration [s] earlier, seen from the centre of mass at that time."""
    way, limits = duration * setting.drift, setting.limits
    limits = limits and limits.seen_from(-way)
    return replace(setting, scene=setting.scene.later(-duration, way), limits=limits)


def goal_setting(system: System, attitude: Array, goal: Goal, scene: Scene) -> JointSetting:
    """The setting of a motion to a goal.

    Args:
        system: Robot, momentum, wheels and drift.
        attitude: Attitude of the spacecraft at the start, unit quaternion x, y, z, w.
        goal: What is to be reached.
        scene: Scene from the centre of mass at the start.

    Raises:
        InputError: If momentum, attitude or scene do not suit the robot, or system or bodies would
            rotate too often.
    """
    system.model.require_supported("motions to a goal")
    setting, duration = JointSetting.of(system, scene), goal.duration or FIRST_DURATION
    scene.require_applicable(system.model, duration)
    if setting.task.planar:
        require_planar_system(setting.plane, system)
    require_few_revolutions(system, duration)
    setting.attitude(attitude, key="state.attitude")
    return setting
