"""What a chosen motion in space bears: attitudes, momentum and durations that are a little off."""

from __future__ import annotations

from dataclasses import replace

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.plan import Plan
from freefloat.planning.robust_radius import safe_radius
from freefloat.planning.tolerance import tolerance
from freefloat.so3 import grid_spacing


def with_robustness(outlook: FeasibilityEvaluator, found: Plan) -> Plan:
    """A plan in space with its robust radius, if it has none yet, and its tolerance.

    Args:
        outlook: Of the plan's problem.
        found: The plan; one without a motion, or in the plane, is handed back as it is.
    """
    if found.chosen is None or found.map is None:
        return found
    attitude, branch = found.chosen.motion.initial.attitude, found.chosen.branch
    radius = found.robust_radius
    if radius is None:
        redundant = found.problem.redundant
        own = None if redundant else branch.index  # its branches do not vary with the attitude
        radius = safe_radius(outlook, attitude, own, grid_spacing(len(found.map.attitudes)))
    bears = tolerance(outlook.integrator, attitude, branch.joints)
    return replace(found, robust_radius=radius, tolerance=bears)
