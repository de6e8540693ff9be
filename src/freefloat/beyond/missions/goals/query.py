"""A motion to a goal that is asked for, and what is known of it before any search."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from freefloat.beyond.missions.goals.goal import Goal
from freefloat.beyond.missions.goals.goal_motion import FIRST_DURATION, earlier
from freefloat.beyond.missions.goals.resting import violation_at_rest
from freefloat.beyond.missions.goals.target import EndState, Target
from freefloat.dynamics.virtual_manipulator import reach_bound
from freefloat.errors import InputError
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import GIVEN, Limits
from freefloat.motion.setting import JointSetting
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, angle_between

_SAME_STATE = 1e-9
"""Distance from a goal that is the state at the start [rad, m]."""


class GoalStart(NamedTuple):
    """The state at which a motion begins.

    Attributes:
        attitude: Attitude of the spacecraft, unit quaternion x, y, z, w.
        joints: Joint values [rad or m], shape (n,).
        joint_rates: Joint rates [rad/s or m/s], shape (n,).
    """

    attitude: Array
    joints: Array
    joint_rates: Array


@dataclass(frozen=True, eq=False)
class Query:
    """A motion to a goal that is asked for.

    Attributes:
        setting: Robot, momentum, drift and scene, from the centre of mass at the start.
        start: The state at the start, whose joints may move.
        goal: What is to be reached.
        limits: Limits in addition to the joint ranges.
        goal_words: What the goal is called in reasons.
        first_duration: Duration with which the search begins where the goal has none [s].
    """

    setting: JointSetting
    start: GoalStart
    goal: Goal
    limits: Limits
    goal_words: str = "the goal"
    first_duration: float = FIRST_DURATION

    @cached_property
    def target(self) -> Target:
        """What the last state must be."""
        return self.goal.target(self.setting, self.start.attitude, self.start.joints)

    @cached_property
    def checker(self) -> LimitChecker:
        """The limits, prepared."""
        return LimitChecker(self.setting, self.limits)

    @cached_property
    def attitude(self) -> Array:
        """Rotation of the spacecraft at the start, shape (3, 3)."""
        return rotation_matrix(self.start.attitude)

    @property
    def by_time(self) -> bool:
        """Whether the motion is another one at another duration."""
        ends_move = self.start.joint_rates.any() or self.goal.joint_rates is not None
        return bool(ends_move or self.target.body or self._depends_on_time)

    @property
    def _depends_on_time(self) -> bool:
        return self.setting.system.rotates or self.setting.drifts or self.setting.scene.tumbles

    @property
    def is_there(self) -> bool:
        """Whether the state at the start is the goal."""
        joints, rates = self.start[1:]
        if rates.any() or self.goal.joint_rates is not None:
            return False
        away = [self.target.residuals(EndState(0.0, self.attitude, joints, rates))]
        away += [] if self.goal.joints is None else [self.goal.joints - joints]
        return bool(np.abs(np.concatenate(away)).max() < _SAME_STATE)

    def require_sense(self) -> None:
        """Raise an InputError for a goal that robot, state and limits do not suit."""
        model, goal, limits = self.setting.model, self.goal, self.limits
        model.require_one_arm("motions to a goal")
        goal.require_applicable(self.setting)
        if goal.duration is None and not limits.timed:
            timed = ", ".join(kind.name for kind in GIVEN if kind.exponent)
            accepted = f"a goal.duration, or a limit that depends on it: {timed}"
            raise InputError("goal.duration", "nothing determines the duration", accepted)
        if goal.joint_rates is not None and limits.joint_rate is not None:
            rates = zip(model.joint_names, goal.joint_rates, limits.joint_rate, strict=True)
            for name, rate, most in rates:
                if abs(rate) > most:
                    given, accepted = f"{name} moves at {rate:g}", f"at most {most:g}, its limit"
                    raise InputError("goal.joint_rates", given, accepted)
        if goal.duration is None and self.is_there:
            given = "it is the state at the start"
            raise InputError("goal", given, "another one, or goal.duration")

    def known_obstacle(self) -> str | None:
        """Why no motion reaches the goal, where states at its ends show it; None otherwise."""
        drift, duration = self.setting.drift, self.goal.duration
        for there, attitude, joints, rests in self._known_states():
            seen = self.limits.seen_from((duration or 0.0) * drift)
            checker = self.checker if there is self.setting else LimitChecker(there, seen)
            violation = violation_at_rest(there, checker, attitude, joints, rests)
            if violation is not None:
                values = ", ".join(f"{value:.4g}" for value in joints)
                return violation.violation(f"with joints {values}")
        turned = _turns_too_far(self.goal, self.start.attitude, self.limits)
        moving = self.setting.scene.tumbles or self.setting.drifts
        if turned is not None or (moving and duration is None):
            return turned
        return _too_far(self.target, duration or 0.0)

    def _known_states(self) -> Iterator[tuple[JointSetting, Array, Array, bool]]:
        """The states at both ends, if known, and whether the joints rest there.

        Before them comes the setting from the centre of mass at their time.
        """
        setting, start, goal = self.setting, self.start, self.goal
        yield setting, start.attitude, start.joints, not start.joint_rates.any()
        if goal.attitude is None or goal.joints is None:
            return
        rests = goal.joint_rates is None
        if not (setting.scene.tumbles or setting.drifts):
            yield setting, goal.attitude, goal.joints, rests
        elif goal.duration is not None:
            yield earlier(setting, -goal.duration), goal.attitude, goal.joints, rests


def _too_far(target: Target, t: float) -> str | None:
    """Why no configuration reaches the pose of a target at time t [s]; None where it has none."""
    reach = reach_bound(target.setting.model)
    distance = float(np.linalg.norm(target.pose_at(t).position))
    if target.pose is None or distance <= reach:
        return None
    return f"the pose is {distance:.4g} m from the centre of mass, the reach at most {reach:.4g} m"


def _turns_too_far(goal: Goal, attitude: Array, limits: Limits) -> str | None:
    """Why the attitude of a goal violates the limit of the turn from the first one; None else."""
    if goal.attitude is None or limits.base_turn is None:
        return None
    turn = float(angle_between(attitude, goal.attitude))
    if turn <= limits.base_turn:
        return None
    words = "the goal turns the spacecraft by {:.4g} deg, its limit is {:.4g} deg"
    return words.format(*np.degrees([turn, limits.base_turn]))
