"""Families of joint paths to a goal, in the order in which they are tried."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from freefloat.beyond.missions.goals.effort import SolverBudget
from freefloat.beyond.missions.goals.joint_paths import Ends, JointPaths
from freefloat.beyond.missions.goals.placements import PlacedArm
from freefloat.beyond.missions.goals.query import Query
from freefloat.beyond.missions.goals.relaxation import Relaxation
from freefloat.beyond.missions.goals.violations import ShapeLimits
from freefloat.dynamics.inverse_dynamics import InverseDynamics
from freefloat.so3 import Array

_MOVING = ((8, 1), (12, 1), (16, 1))
"""Spans and loops of paths that need not turn the spacecraft."""
_TURNING = ((8, 1), (8, 2), (8, 4), (8, 8), (8, 16), (8, 32))
"""Those of paths that turn it: small loops turn it with their area, and fit where large do not."""
_USED = 0.99
"""Fraction of limits of rates that paths in a given duration use."""
_ASSUMED = 1.0
"""Least limit that is assumed of joint rates without limit [rad/s or m/s]."""
_LEFT = 0.01
"""Least fraction of a limit of torques that the weight of the arm is assumed to leave."""


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
