"""Results of a run by column, from the record of its command."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from freefloat.ensemble.endings import DECIDERS, MOTION
from freefloat.kinds import kind_of, named
from freefloat.limits.kinds.base_rate import BaseRateLimit
from freefloat.limits.kinds.base_turn import BaseTurnLimit
from freefloat.limits.result import LimitResult, violated
from freefloat.motion.extrema import joint_extents, maximum
from freefloat.motion.motion import Ending
from freefloat.planning.answer import Answer
from freefloat.planning.margin_map import HeadingMap
from freefloat.planning.motions import SimulatedBranch
from freefloat.planning.plan import Plan
from freefloat.planning.simulation import Simulation
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.robot.joint_ranges import range_ratios
from freefloat.so3 import degrees
from freefloat.studies.columns import (
    FEASIBLE,
    INFEASIBLE,
    LIMITING,
    LIMITS_REASON,
    MARGIN_LIMITS,
    MARGIN_REASON,
    SINGULARITY_LIMITS,
)


def record_values(record: Any) -> dict[str, Any]:
    """The results of a simulation, a map, or what ``plan`` finds."""
    values: dict[str, Any] = named(kind_of(record, saved=True).values)(record)
    return values


def simulation_values(simulation: Simulation) -> dict[str, Any]:
    """The values of a simulation."""
    chosen, limits = simulation.chosen, simulation.limit_results
    names = ", ".join(result.limit for result in violated(limits))
    reason = ""
    if not chosen.motion.completed:
        reason = chosen.motion.ending.value
    elif not chosen.feasible:
        reason = MARGIN_REASON
    elif names:
        reason = LIMITS_REASON.format(names)
    verdict = INFEASIBLE if reason else FEASIBLE
    values = {"verdict": verdict, "reason": reason, "decided_by": DECIDERS[MOTION]}
    others = _extreme_values(chosen), _limiting(chosen, limits)
    return {**values, **motion_values(chosen), **others[0], **others[1], **limit_values(limits)}


def plan_values(plan: Plan) -> dict[str, Any]:
    """The values of a plan."""
    motion = {"completed": False} if plan.chosen is None else motion_values(plan.chosen)
    values = {
        **verdict_values(plan), **motion, **limit_values(plan.limit_results),
        "robust_radius_deg": degrees(plan.robust_radius), "deviation_deg": degrees(plan.deviation),
        "feasible_fraction": plan.feasible_fraction,
    }  # fmt: skip
    ranges = {entry.branch: json.dumps(entry.degrees) for entry in plan.ranges or ()}
    return values | family("attitude_ranges_deg", ranges)


def verdict_values(answer: Answer) -> dict[str, Any]:
    """Whether an answer is feasible, and why."""
    return {"verdict": FEASIBLE if answer.feasible else INFEASIBLE, "reason": answer.reason}


def attitude_map_values(result: AttitudeMap) -> dict[str, Any]:
    """The values of a map over attitudes."""
    return {**_map_values(result), "measure": result.problem.margin.measure.name}


def heading_map_values(result: HeadingMap) -> dict[str, Any]:
    """The values of a map over headings."""
    best = result.best
    return {**_map_values(result), **({"heading_deg": degrees(best.heading)} if best else {})}


def _map_values(result: AttitudeMap | HeadingMap) -> dict[str, Any]:
    feasible, best = result.feasible_found, result.best
    values = {
        "verdict": FEASIBLE if feasible else INFEASIBLE,
        "reason": "" if feasible else "no attitude tried keeps the margin",
        "margin": best and best.minimum_margin,
        "margin_required": result.problem.margin.threshold,
        "feasible_fraction": result.feasible_fraction,
        "motion_fraction": result.motion_fraction,
        "branch": best and best.branch,
        "robust_radius_deg": result.robust and degrees(result.robust.radius),
    }
    return values | (attitude_values(best.attitude.tolist()) if best else {})


def motion_values(chosen: SimulatedBranch) -> dict[str, Any]:
    """The values of a motion by itself."""
    motion = chosen.motion
    attitude = motion.initial.attitude.tolist()
    planar = motion.setting.has_headings
    return {
        **margin_values(chosen),
        "branch": chosen.branch.index,
        **attitude_values(attitude),
        "heading_deg": math.degrees(motion.setting.plane.heading(attitude)) if planar else None,
        **family("joints", dict(enumerate(motion.initial.joints.tolist()))),
        **family("residuals", motion.residuals().to_dict()),
    }


def margin_values(chosen: SimulatedBranch, start: float = 0.0) -> dict[str, Any]:
    """How far a motion that begins at a time [s] gets, and how near to a singularity."""
    motion, margin = chosen.motion, chosen.closest_approach
    singular = motion.ending is Ending.SINGULAR
    return {
        "completed": motion.completed, "measure": margin.measure, "margin": chosen.minimum_margin,
        "margin_time": start + margin.time, "margin_required": motion.setting.margin.threshold,
        "singular_time": start + motion.final.time if singular else None,
    }  # fmt: skip


def _extreme_values(chosen: SimulatedBranch) -> dict[str, Any]:
    """Final attitude, and largest rates, turn and range ratios of a motion that completes."""
    motion, (lower, upper) = chosen.motion, chosen.motion.model.joint_ranges
    values = attitude_values(motion.final.attitude.tolist(), "final_attitude")
    if not (motion.completed and motion.panels):
        return values
    rates, extents = np.abs(motion.node_rates[..., 3:]), joint_extents(motion)
    used = np.maximum(*range_ratios((lower, upper), extents.low, extents.high)).tolist()
    bounded = np.flatnonzero(np.isfinite([lower, upper]).any(axis=0)).tolist()
    return values | {
        "base_rate": BaseRateLimit(motion.setting, 1.0).worst(motion).worst,
        "base_turn_deg": degrees(BaseTurnLimit(motion.setting, np.pi).worst(motion).worst),
        **family("joint_rates", {
            joint: maximum(rates[..., joint : joint + 1]).value for joint in range(rates.shape[2])
        }),
        **family("range_ratios", {joint: used[joint] for joint in bounded}),
    }  # fmt: skip


def _limiting(chosen: SimulatedBranch, limits: Sequence[LimitResult]) -> dict[str, Any]:
    """What is nearest to its bound along a motion, or farthest beyond it, and when."""
    motion, margin = chosen.motion, chosen.closest_approach
    if motion.ending is Ending.SINGULAR:
        return {"limiting": SINGULARITY_LIMITS, "limiting_time": motion.final.time}
    required = motion.setting.margin.threshold
    ratio = required / margin.value if margin.value else math.inf
    candidates = [(ratio, MARGIN_LIMITS, margin.time)]
    candidates += [
        (limit.ratio, LIMITING.format(limit.limit, limit.where), limit.time) for limit in limits
    ]
    _, name, time = max(candidates, key=lambda candidate: candidate[0])
    return {"limiting": name, "limiting_time": time}


def limit_values(limits: Sequence[LimitResult]) -> dict[str, Any]:
    """Whether limits are kept, and the ratio of each."""
    ratios = {result.limit: result.ratio for result in limits}
    return {"limits_kept": not violated(limits) if limits else None, **family("limits", ratios)}


def attitude_values(quaternion: Sequence[float], name: str = "attitude") -> dict[str, Any]:
    """The columns of a quaternion x, y, z, w."""
    return family(name, dict(zip("xyzw", quaternion, strict=True)))


def family(name: str, values: Mapping[Any, Any]) -> dict[str, Any]:
    """The columns of a family, such as ``joints.0`` and ``joints.1``."""
    return {f"{name}.{key}": value for key, value in values.items()}
