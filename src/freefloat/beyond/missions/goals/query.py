"""A motion to a goal that is asked for: what is known of it before any search, and its paths."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from freefloat.beyond.missions.goals.goal import Goal
from freefloat.beyond.missions.goals.goal_motion import FIRST_DURATION, earlier, required_limits
from freefloat.beyond.missions.goals.joint_integration import integrate_spline
from freefloat.beyond.missions.goals.joint_paths import Ends, JointPaths
from freefloat.beyond.missions.goals.placements import PlacedArm
from freefloat.beyond.missions.goals.quadratic import SolverBudget
from freefloat.beyond.missions.goals.relaxation import Relaxation
from freefloat.beyond.missions.goals.target import EndState, Target
from freefloat.beyond.missions.goals.violations import ShapeLimits
from freefloat.dynamics.inverse_dynamics import InverseDynamics
from freefloat.dynamics.virtual_manipulator import reach_bound
from freefloat.errors import InputError
from freefloat.limits.kinds.spacecraft import BaseRateLimit
from freefloat.limits.limits import GIVEN, LimitChecker, Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.joint_curves import DEGREE, JointSpline
from freefloat.motion.law import JointLaw
from freefloat.motion.setting import JointSetting
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, angle_between

_SAME_STATE = 1e-9
"""Distance from a goal that is the state at the start [rad, m]."""
_INSTANT = 1e-3
"""Duration of a motion that stays where it is [s]."""
_MOVING = ((8, 1), (12, 1), (16, 1))
"""Spans and loops of paths that need not turn the spacecraft."""
_TURNING = ((8, 1), (8, 2), (8, 4), (8, 8), (8, 16), (8, 32))
"""Spans and loops of paths that turn the spacecraft by area; small loops fit where large do not."""
_USED = 0.99
"""Fraction of limits of rates that paths in a given duration use."""
_ASSUMED = 1.0
"""Least limit that is assumed of joint rates without limit [rad/s or m/s]."""
_LEFT = 0.01
"""Least fraction of a limit of torques that the weight of the arm is assumed to leave."""


class GoalStart(NamedTuple):
    """The state at which a motion begins."""

    attitude: Array  # of the spacecraft, unit quaternion x, y, z, w
    joints: Array  # [rad or m], (n,)
    joint_rates: Array  # [rad/s or m/s], (n,)


@dataclass(frozen=True, eq=False)
class Query:
    """A motion to a goal that is asked for."""

    setting: JointSetting  # robot, momentum, scene and limits, from the centre of mass at the start
    start: GoalStart  # whose joints may move
    goal: Goal
    goal_words: str = "the goal"  # what the goal is called in reasons
    first_duration: float = FIRST_DURATION  # of the search where the goal has no duration [s]

    @cached_property
    def target(self) -> Target:
        """What the last state must be."""
        return self.goal.target(self.setting, self.start.attitude, self.start.joints)

    @property
    def limits(self) -> Limits:
        """Limits in addition to the joint ranges."""
        return required_limits(self.setting)

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
        setting = self.setting
        changes = setting.system.rotates or setting.drifts or setting.scene.tumbles
        return bool(ends_move or self.target.body or changes)

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
        model.require_supported("motions to a goal")
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
        duration = self.goal.duration
        for there, attitude, joints, rests in self._known_states():
            known = there is self.setting
            checker = self.checker if known else LimitChecker(there, required_limits(there))
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


def violation_at_rest(
    setting: JointSetting,
    checker: LimitChecker,
    attitude: Array,
    joints: Array,
    rests: bool = False,
) -> LimitResult | None:
    """The first limit that a state violates, rates of joints apart; None where it keeps all.

    The bodies of the scene are where they are at time zero. Where the joints rest, momentum may
    turn the spacecraft too fast.
    """
    still = JointSpline(np.tile(joints, (DEGREE + 1, 1)))
    motion = integrate_spline(JointLaw(setting, still, _INSTANT), attitude)
    for result in checker.violations(motion, timed=rests):
        if not result.timed or result.limit == BaseRateLimit.name:
            return result
    return None


def families_of(query: Query, shapes: Sequence[ShapeLimits]) -> Iterator[Relaxation]:
    """Families of paths in the order in which they are tried; their effort is shared."""
    setting, start, goal, limits = query.setting, query.start, query.goal, query.limits
    model, n, effort = setting.model, setting.model.dof, SolverBudget()
    end_rates = np.zeros(n) if goal.joint_rates is None else goal.joint_rates
    accelerations = _accelerations(query)
    rates = np.full(n, np.inf) if limits.joint_rate is None else limits.joint_rate
    half_turn = np.sqrt(np.pi * np.where(np.isfinite(accelerations), accelerations, 0.0))
    assumed = np.maximum(half_turn, rates[np.isfinite(rates)].max(initial=_ASSUMED))
    rates = np.where(np.isfinite(rates), rates, assumed)
    used = 1.0 if goal.duration is None else _USED
    ends = Ends(*start[1:], goal.joints, None if query.target.body is not None else end_rates)
    both = np.array([start.joints, start.joints if goal.joints is None else goal.joints])
    half = np.where(model.prismatic, 1.0, np.pi)
    low, high = model.joint_ranges
    low = np.where(np.isfinite(low), low, both.min(axis=0) - half)
    high = np.where(np.isfinite(high), high, both.max(axis=0) + half)
    momenta = np.array([setting.momentum, setting.wheel_momentum])
    for spans, loops in _MOVING if query.target.attitude is None else _TURNING:
        yield Relaxation(
            PlacedArm.of(model), JointPaths(ends, spans, loops), query.target, query.attitude,
            momenta, used * rates, accelerations, used * (limits.base_rate or np.inf),
            np.array([low, high]), shapes, goal.duration is None,
            goal.duration or query.first_duration, effort,
        )  # fmt: skip


def _accelerations(query: Query) -> Array:
    """Accelerations that their limits permit, and at the start limits of torques, shape (n,)."""
    limit, (attitude, joints, _) = query.limits.joint_torque, query.start
    n, stated = len(joints), query.limits.joint_acceleration
    most = np.full(n, np.inf) if stated is None else stated
    if limit is None:
        return most
    dynamics, still = InverseDynamics(query.setting.system), np.zeros(3 + n)
    rest, *torques = (
        dynamics.of_joints(attitude, joints, still, axis).joint_torques
        for axis in (np.zeros(n), *np.eye(n))
    )
    left = np.maximum(limit - np.abs(rest), _LEFT * limit)
    return np.minimum(most, left / np.abs(np.diag(torques) - rest))
