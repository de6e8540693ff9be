"""The codec of results, and what their files do not hold."""

from __future__ import annotations

from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.planning.answer import Finding
from freefloat.planning.goals.goal_motion import GoalMotion
from freefloat.planning.phases.kinds.capture_phase import PlannedCapture
from freefloat.planning.phases.phase import Phase
from freefloat.planning.plan import Plan
from freefloat.planning.settings import Search
from freefloat.records import Codec
from freefloat.robot.model import FreeFloatingModel

CODEC = Codec(
    context=(Problem, Search, Limits, FreeFloatingModel, tuple[Phase, ...]),
    members={Finding: (Plan, GoalMotion, PlannedCapture)},
)
"""Codec of results: scenario and robot are stored as texts."""
