"""Kinds of results that are saved, and what their files do not hold."""

from __future__ import annotations

from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.planning.answer import Finding
from freefloat.planning.goals.goal_motion import GoalMotion
from freefloat.planning.phases.kinds.capture_phase import PlannedCapture
from freefloat.planning.phases.manoeuvre import Manoeuvre
from freefloat.planning.phases.phase import Phase
from freefloat.planning.plan import Plan
from freefloat.planning.plane.heading_map import HeadingMap
from freefloat.planning.settings import Search
from freefloat.planning.simulation import Simulation
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.records import Codec
from freefloat.robot.model import FreeFloatingModel
from freefloat.singularities.singularity_map import SingularityMap

Result = Plan | Simulation | GoalMotion | Manoeuvre | AttitudeMap | HeadingMap | SingularityMap
KINDS: dict[str, type[Result]] = {
    result.kind: result
    for result in (
        Plan, Simulation, GoalMotion, Manoeuvre, AttitudeMap, HeadingMap, SingularityMap,
    )
}  # fmt: skip
"""Classes of results by the kind of their files."""
CODEC = Codec(
    context=(Problem, Search, Limits, FreeFloatingModel, tuple[Phase, ...]),
    members={Finding: (Plan, GoalMotion, PlannedCapture)},
)
"""Codec of results: scenario and robot are stored as texts."""
