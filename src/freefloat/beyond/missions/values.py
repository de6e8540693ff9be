"""Values of runs of studies whose ``plan`` finds a motion to a goal or a manoeuvre."""

from __future__ import annotations

from typing import Any

from freefloat.beyond.missions.goals.goal_motion import GoalMotion
from freefloat.beyond.missions.phases.manoeuvre import Manoeuvre
from freefloat.studies.run import (
    attitude_values,
    family,
    limit_values,
    margin_values,
    plan_values,
    verdict_values,
)


def goal_values(found: GoalMotion) -> dict[str, Any]:
    """The values of a motion to a goal."""
    values = verdict_values(found)
    values |= {"completed": found.motion is not None, "duration": found.duration}
    if found.motion is not None:
        first = found.motion.initial
        values |= attitude_values(first.attitude.tolist())
        values |= family("joints", dict(enumerate(first.joints.tolist())))
    return values | limit_values(found.limit_results)


def manoeuvre_values(manoeuvre: Manoeuvre) -> dict[str, Any]:
    """The values of a manoeuvre: limits and margin of all phases, others of its first path."""
    duration = manoeuvre.duration if manoeuvre.feasible else None
    limits = limit_values([result for _, result in manoeuvre.worst_results])
    paths = [(phase.chosen, phase.start) for phase in manoeuvre.phases]
    margins = [margin_values(chosen, start) for chosen, start in paths if chosen is not None]
    smallest = min(margins, key=lambda values: values["margin"], default={})
    first = plan_values(manoeuvre.path)
    return first | smallest | verdict_values(manoeuvre) | {"duration": duration} | limits
