"""Records told to machines: the JSON documents of the commands."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from freefloat.dynamics.measures import Measure, joint_space_extremes, measure
from freefloat.dynamics.momentum import Task
from freefloat.dynamics.redundancy import Redundancy
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.limits.limits import LimitResult
from freefloat.motion.closest_approach import ClosestApproach
from freefloat.motion.motion import Ending, Motion, State
from freefloat.motion.problem import Problem
from freefloat.motion.reach import told_reach
from freefloat.motion.simulation import SimulatedBranch, Simulation
from freefloat.planning.plan import Plan, Segment
from freefloat.planning.planar_ranges import BranchRanges, Limit
from freefloat.robot.diagnostics import Severity, UrdfDiagnostic
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import heading_of
from freefloat.workspace.margin_curves import Interval, path_areas
from freefloat.workspace.regions import workspace_of

Document = dict[str, Any]


def simulation_document(simulation: Simulation, findings: Iterable[LimitResult] = ()) -> Document:
    """What ``simulate`` answers: the chosen motion, its limits, and every branch in brief."""
    return {
        **_followed_document(simulation.chosen),
        "limits": limits_document(findings),
        "branches": [_branch_document(one) for one in simulation.branches],
        "out_of_reach": told_reach(simulation.chosen.motion.problem),
    }


def _followed_document(chosen: SimulatedBranch) -> Document:
    """The motion of one arm branch, whole."""
    motion = chosen.motion
    problem = motion.problem
    return {
        "completed": motion.completed,
        "ending": motion.ending.value,
        "singular": singular_document(motion),
        "min_margin": margin_document(motion, chosen.closest_approach),
        "branch": chosen.branch.index,
        "joint_names": list(problem.model.joint_names),
        "initial": state_document(motion.initial),
        "final": state_document(motion.final),
        "duration": problem.path.duration,
        "ended_at": motion.final.time,
        "residuals": asdict(motion.residuals()),
        "redundancy": _redundancy_document(problem),
    }


def _redundancy_document(problem: Problem) -> Document | None:
    """How the arm chose among its motions, or None where there is one alone."""
    if not problem.redundant:
        return None
    chosen = problem.redundancy or Redundancy()
    return {
        "metric": dict(chosen.weights) or str(chosen.metric),
        "toward": str(chosen.toward),
        "gain": chosen.gain,
        "bound": chosen.bound,
    }


def limits_document(findings: Iterable[LimitResult]) -> list[Document]:
    """Limits along a motion; null stands for what has no bound."""
    return [
        {key: _bounded(value) for key, value in asdict(one).items()}
        | {"limit": str(one.limit), "notes": list(one.notes)}
        for one in findings
    ]  # fmt: skip


def _bounded(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _branch_document(one: SimulatedBranch) -> Document:
    return {
        "branch": one.branch.index,
        "label": one.branch.label,
        "joints": one.branch.joints.tolist(),
        "completed": one.motion.completed,
        "ended_at": one.motion.final.time,
        "singular": singular_document(one.motion),
        "min_margin": margin_document(one.motion, one.closest_approach),
    }


def singular_document(motion: Motion) -> Document | None:
    """Where a motion became singular, or None where it did not."""
    if motion.ending is not Ending.SINGULAR:
        return None
    final, problem = motion.final, motion.problem
    where = problem.model.end_effector_pose(final.attitude, final.joints).position
    return {
        "time": final.time,
        "s": problem.path.timing.s(final.time),
        "end_effector": where.tolist(),
        "joints": final.joints.tolist(),
    }


def margin_document(motion: Motion, found: ClosestApproach) -> Document:
    """How near a motion came to a singularity, and whether that is as asked."""
    required = motion.problem.margin.threshold
    kept = motion.completed and motion.problem.margin.is_kept(found.value)
    return {**asdict(found), "required": required, "kept": kept}


def state_document(state: State) -> Document:
    """A state as lists."""
    return {
        "time": state.time,
        "attitude": state.attitude.tolist(),
        "joints": state.joints.tolist(),
        "base_position": state.base_position.tolist(),
    }


def plan_document(plan: Plan) -> Document:
    """What ``plan`` answers: the verdict, every range, and the chosen motion where there is one."""
    radius, deviation = plan.robust_radius, plan.deviation
    document: Document = {
        "feasible": plan.feasible,
        "reason": plan.reason,
        "objective": str(plan.search.objective),
        "attitude_ranges_deg": [ranges_document(entry) for entry in plan.ranges],
        "deviation_deg": None if deviation is None else float(np.degrees(deviation)),
        "robust_radius_deg": None if radius is None else float(np.degrees(radius)),
        "segments": [_segment_document(segment) for segment in plan.segments],
        "tolerance": None if plan.tolerance is None else asdict(plan.tolerance),
        "disagreements": list(plan.disagreements),
        "duration": plan.problem.path.duration,
        "limits": limits_document(plan.findings),
        "excluded": {str(limit): count for limit, count in plan.excluded.items()},
        "stretched_duration": None
        if plan.stretch is None
        else plan.stretch * plan.problem.path.duration,
        **_sampled_document(plan),
    }
    if plan.chosen is None:
        empty = ("singular", "min_margin", "branch", "initial", "final", "residuals", "redundancy",
                 "certificate")  # fmt: skip
        return {**document, "completed": False, **dict.fromkeys(empty), "heading_deg": None}
    heading = None
    if plan.problem.task.planar:
        heading = float(np.degrees(heading_of(plan.chosen.motion.initial.attitude)))
    proof = None if plan.certificate is None else plan.certificate.document()
    told = {"heading_deg": heading, "certificate": proof}
    return {**document, **_followed_document(plan.chosen), **told}


def _sampled_document(plan: Plan) -> Document:
    """What a spatial plan began with; nothing of the kind in the plane."""
    found = plan.map
    if found is None:
        keys = ("samples", "seed", "feasible_fraction", "feasible_fraction_error")
        return dict.fromkeys(keys)
    return {
        "samples": len(found.attitudes),
        "seed": found.seed,
        "feasible_fraction": found.feasible_fraction,
        "feasible_fraction_error": found.feasible_fraction_error,
    }


def ranges_document(entry: BranchRanges) -> Document:
    """Ranges of heading in degrees from 0 to 360, those across zero in two parts."""
    parts = []
    for one in entry.ranges:
        low, high = np.degrees(one.low), np.degrees(one.high)
        parts += [[low, high]] if high <= 360.0 else [[0.0, high - 360.0], [low, 360.0]]
    limits = [float(np.degrees(limit)) for limit in entry.limits]
    rounded = [[float(low), float(high)] for low, high in sorted(parts)]
    return {"branch": entry.branch, "label": entry.label, "ranges": rounded, "limits": limits}


def _segment_document(segment: Segment) -> Document:
    start, end = segment.span
    return {
        "from": start,
        "to": end,
        "tangency_points": [_touch_document(limit, segment.span) for limit in segment.limits],
        "ranges_at_start_deg": [ranges_document(entry) for entry in segment.at_start],
        "ranges_at_end_deg": [ranges_document(entry) for entry in segment.at_end],
        "joined_at_end_deg": [ranges_document(entry) for entry in segment.joined_at_end],
    }


def _touch_document(limit: Limit, span: tuple[float, float]) -> Document:
    touch = limit.touch
    return {
        "kind": str(touch.kind),
        "time": touch.time,
        "tau": (touch.time - span[0]) / (span[1] - span[0]),
        "s": touch.s,
        "level": touch.level,
        "heading": touch.heading,
        "joints": touch.joints.tolist(),
        "heading_at_start_deg": float(np.degrees(limit.heading_at(span[0])[0])),
        "heading_at_end_deg": float(np.degrees(limit.heading_at(span[1])[0])),
    }


def workspace_document(problem: Problem) -> Document:
    """What ``workspace`` answers: reach and areas by radius, and the path's parts in them."""
    workspace = workspace_of(problem)
    return {
        "point": workspace.point,
        "measure": workspace.measure,
        "reach": list(workspace.reach),
        "pdw": _intervals(workspace.path_dependent),
        "piw": _intervals(workspace.path_independent),
        "exact": workspace.exact,
        "s_max": workspace.largest_s,
        "s_min": workspace.smallest_s,
        "path": [
            {"s": list(interval), "path_dependent": inside}
            for interval, inside in path_areas(problem, workspace)
        ],
    }


def _intervals(intervals: tuple[Interval, ...] | None) -> list[list[float]] | None:
    return None if intervals is None else [list(interval) for interval in intervals]


def natural_task(model: FreeFloatingModel) -> Task:
    """The task with the most rows that an arm can do, planar for planar arms."""
    planar = VirtualManipulator.of(model).is_planar
    tasks = [task for task in Task if task.planar is planar and len(task.rows) <= model.dof]
    return max(tasks, key=lambda task: len(task.rows), default=Task.PLANAR_POSITION)


def info_document(
    model: FreeFloatingModel,
    task: Task,
    findings: Sequence[UrdfDiagnostic],
    of: Measure | None = None,
) -> Document:
    """What ``info`` answers: what the robot is, and what was found in its URDF."""
    virtual = VirtualManipulator.of(model)
    of = of or measure(model, task, "gjm")
    extremes = joint_space_extremes(model, of)
    return {
        "urdf": model.description.source,
        "end_effector": model.end_effector,
        "total_mass": model.total_mass,
        "dof": model.dof,
        "task": str(task),
        "spare_joints": model.dof - len(task.rows),
        "joints": [
            {
                "name": body.joint,
                "type": "prismatic" if body.prismatic else "revolute",
                "lower": body.lower if np.isfinite(body.lower) else None,
                "upper": body.upper if np.isfinite(body.upper) else None,
            }
            for body in model.bodies[1:]
        ],
        "bodies": [
            {"moved_by": body.joint, "mass": body.mass, "centre_of_mass": body.centre.tolist(),
             "inertia": body.inertia.tolist()}
            for body in model.bodies
        ],
        "barycentric_lengths": virtual.lengths.tolist(),
        "reach": virtual.reach,
        "measure": {"name": of.name, "definition": of.definition, "unit": of.unit},
        "s_max": extremes.largest,
        "s_max_at": extremes.largest_at.tolist(),
        "s_min": extremes.smallest,
        "warnings": [str(one) for one in findings if one.severity == Severity.DOUBT],
        "findings": [asdict(one) for one in findings],
    }  # fmt: skip
