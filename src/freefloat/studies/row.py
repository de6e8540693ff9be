"""Rows of a study: the results of one run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from freefloat.limits.limits import LimitResult
from freefloat.motion.motion import Ending
from freefloat.planning.plan import Plan
from freefloat.planning.planar_ranges import BranchRanges
from freefloat.planning.simulation import SimulatedBranch, Simulation
from freefloat.so3 import heading_of

if TYPE_CHECKING:  # compiled kernels are slow to import
    from freefloat.planning.attitude_map import AttitudeMap
    from freefloat.planning.heading_map import HeadingMap

FEASIBLE, INFEASIBLE, ERROR = "feasible", "infeasible", "error"
"""Verdicts."""


@dataclass(frozen=True)
class Row:
    """Results of a run; None where a command does not compute a value.

    Attributes:
        number: Number of the run.
        verdict: ``feasible``, ``infeasible`` or ``error``.
        parameters: The varied keys and their values.
        error: Message of the error that ended the run.
        reason: Why the run is infeasible, or why a plan's attitude was chosen.
        measure: Name of the singularity measure.
        margin: Minimum margin of the chosen motion; of a map the largest one.
        margin_time: Time of the closest approach [s].
        margin_required: Margin threshold.
        completed: Whether the motion reached the end of the path.
        singular_time: Time of the dynamic singularity [s].
        branch: Arm branch.
        attitude: Initial attitude, quaternion x, y, z, w.
        heading_deg: Initial heading [degrees].
        joints: Initial joint values [rad or m].
        residuals: Largest errors of the motion by quantity.
        limits_kept: Whether the motion keeps all limits.
        limits: Ratio of the largest value to the limit, by limit.
        robust_radius_deg: Attitude tolerance [degrees].
        deviation_deg: Angle from the attitude ``search.from_attitude`` [degrees].
        feasible_fraction: Fraction of attitudes with a feasible motion.
        motion_fraction: Fraction of feasible motions.
        attitude_ranges_deg: Feasible heading ranges by arm branch [degrees].
        seconds: Duration of the computation [s].
        began: When the computation started, UTC.
        file: Result file, relative to the study's folder.
        bytes: Its size.
    """

    number: int
    verdict: str
    parameters: dict[str, Any]
    error: str | None = None
    reason: str | None = None
    measure: str | None = None
    margin: float | None = None
    margin_time: float | None = None
    margin_required: float | None = None
    completed: bool | None = None
    singular_time: float | None = None
    branch: int | None = None
    attitude: list[float] | None = None
    heading_deg: float | None = None
    joints: list[float] | None = None
    residuals: dict[str, float] | None = None
    limits_kept: bool | None = None
    limits: dict[str, float] | None = None
    robust_radius_deg: float | None = None
    deviation_deg: float | None = None
    feasible_fraction: float | None = None
    motion_fraction: float | None = None
    attitude_ranges_deg: dict[str, list[list[float]]] | None = None
    seconds: float | None = None
    began: str | None = None
    file: str | None = None
    bytes: int | None = None


def simulation_values(simulation: Simulation) -> dict[str, Any]:
    """Return the values of a row for a simulation."""
    chosen, limits = simulation.chosen, simulation.limit_results
    violated = [str(result.limit) for result in limits if not result.kept]
    reason = ""
    if not chosen.motion.completed:
        reason = chosen.motion.ending.value
    elif not chosen.feasible:
        reason = "The margin is not kept."
    elif violated:
        reason = f"Limits are not kept: {', '.join(violated)}."
    verdict = INFEASIBLE if reason else FEASIBLE
    return {"verdict": verdict, "reason": reason, **_motion(chosen), **_limits(limits)}


def plan_values(plan: Plan) -> dict[str, Any]:
    """Return the values of a row for a plan."""
    return {
        "verdict": FEASIBLE if plan.feasible else INFEASIBLE,
        "reason": plan.reason,
        **({"completed": False} if plan.chosen is None else _motion(plan.chosen)),
        **_limits(plan.limit_results),
        "robust_radius_deg": _degrees(plan.robust_radius),
        "deviation_deg": _degrees(plan.deviation),
        "feasible_fraction": None if plan.map is None else plan.map.feasible_fraction,
        **_ranges(plan.ranges),
    }


def map_values(result: AttitudeMap | HeadingMap) -> dict[str, Any]:
    """Return the values of a row for a map."""
    document, problem = result.to_dict(), result.problem
    best, robust = document["best"] or {}, document["robust"] or {}
    feasible = result.feasible_fraction > 0.0 or bool(best and not problem.task.planar)
    return {
        "verdict": FEASIBLE if feasible else INFEASIBLE,
        "reason": "" if feasible else "no attitude tried keeps the margin",
        "measure": None if problem.task.planar else problem.margin.measure.name,
        "margin": best.get("value"),
        "margin_required": problem.margin.threshold,
        "robust_radius_deg": robust.get("radius_deg"),
        "feasible_fraction": result.feasible_fraction,
        "motion_fraction": result.motion_fraction,
        **{key: best.get(key) for key in ("branch", "attitude", "heading_deg")},
    }


def _motion(chosen: SimulatedBranch) -> dict[str, Any]:
    motion, margin = chosen.motion, chosen.closest_approach
    attitude = motion.initial.attitude.tolist()
    in_plane = attitude[:2] == [0.0, 0.0]
    return {
        "completed": motion.completed,
        "measure": margin.measure,
        "margin": margin.value,
        "margin_time": margin.time,
        "margin_required": motion.problem.margin.threshold,
        "singular_time": motion.final.time if motion.ending is Ending.SINGULAR else None,
        "branch": chosen.branch.index,
        "attitude": attitude,
        "heading_deg": math.degrees(heading_of(attitude)) if in_plane else None,
        "joints": motion.initial.joints.tolist(),
        "residuals": asdict(motion.residuals()),
    }


def _limits(limits: Sequence[LimitResult]) -> dict[str, Any]:
    return {
        "limits_kept": all(result.kept for result in limits) if limits else None,
        "limits": {str(result.limit): result.ratio for result in limits},
    }


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else float(np.degrees(angle))


def _ranges(branches: Sequence[BranchRanges]) -> dict[str, Any]:
    """Feasible heading ranges by branch, and the fraction of headings in any of them."""
    if not branches:
        return {}
    ranges = {str(entry.branch): entry.degrees for entry in branches}
    fraction, covered = 0.0, 0.0
    for low, high in sorted(span for spans in ranges.values() for span in spans):
        fraction += max(0.0, high - max(low, covered)) / 360.0
        covered = max(covered, high)
    return {"attitude_ranges_deg": ranges, "feasible_fraction": fraction}


def finite(value: Any) -> Any:
    """Replace numbers that JSON does not know by None."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
