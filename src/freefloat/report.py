"""Records told to machines: the JSON documents of the commands."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from freefloat.closeness import Least
from freefloat.dynamics import Task
from freefloat.model import FreeFloatingModel
from freefloat.motion import Ending, Motion, State
from freefloat.planar_ranges import BranchRanges, Limit
from freefloat.planar_search import HeadingMap
from freefloat.plans import Plan, Segment
from freefloat.problem import Problem
from freefloat.simulation import FollowedBranch, Simulation
from freefloat.singularity import Measure, joint_space_extremes, measure
from freefloat.spatial import Array, heading_of, heading_quaternion
from freefloat.virtual_manipulator import VirtualManipulator
from freefloat.workspace import path_areas, planar_workspace

Document = dict[str, Any]


def simulation_document(simulation: Simulation) -> Document:
    """What ``simulate`` answers: the chosen motion, and every branch in brief."""
    return {
        **_followed_document(simulation.chosen),
        "branches": [_branch_document(one) for one in simulation.followed],
    }


def _followed_document(chosen: FollowedBranch) -> Document:
    """The motion of one arm branch, whole."""
    motion = chosen.motion
    problem = motion.problem
    return {
        "completed": motion.completed,
        "ending": motion.ending.value,
        "singular": singular_document(motion),
        "min_margin": _margin_document(motion, chosen.least),
        "branch": chosen.branch.index,
        "joint_names": list(problem.model.joint_names),
        "initial": state_document(motion.initial),
        "final": state_document(motion.final),
        "duration": problem.path.duration,
        "ended_at": motion.final.time,
        "residuals": asdict(motion.residuals()),
    }


def _branch_document(one: FollowedBranch) -> Document:
    return {
        "branch": one.branch.index,
        "label": one.branch.label,
        "joints": one.branch.joints.tolist(),
        "completed": one.motion.completed,
        "ended_at": one.motion.final.time,
        "singular": singular_document(one.motion),
        "min_margin": _margin_document(one.motion, one.least),
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


def _margin_document(motion: Motion, found: Least) -> Document:
    required = motion.problem.margin.value
    kept = motion.completed and found.keeps(required)
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
    }
    if plan.chosen is None:
        empty = ("singular", "min_margin", "branch", "initial", "final", "residuals")
        return {**document, "completed": False, **dict.fromkeys(empty), "heading_deg": None}
    heading = np.degrees(heading_of(plan.chosen.motion.initial.attitude))
    return {**document, **_followed_document(plan.chosen), "heading_deg": float(heading)}


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
        "touch_points": [_touch_document(limit, segment.span) for limit in segment.limits],
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
    workspace = planar_workspace(problem)
    return {
        "point": workspace.point,
        "reach": list(workspace.reach),
        "pdw": [list(interval) for interval in workspace.path_dependent],
        "piw": [list(interval) for interval in workspace.path_independent],
        "s_max": workspace.largest_s,
        "s_min": workspace.smallest_s,
        "path": [
            {"s": list(interval), "path_dependent": inside}
            for interval, inside in path_areas(problem, workspace)
        ],
    }


def map_document(found: HeadingMap, seconds: float) -> Document:
    """What ``map`` answers: how many headings serve, which are best, and the connected regions."""
    kept, step = found.kept, 360.0 / len(found.headings)
    degrees = np.degrees(found.headings)
    regions = [
        {"branch": index, "size_deg": float(width * step), "centre_deg": float(centre % 360.0)}
        for index, row in zip(found.branches, kept, strict=True)
        for width, centre in _runs(row, degrees, step)
    ]
    widest = max(regions, key=lambda region: region["size_deg"], default=None)
    return {
        "samples": len(found.headings),
        "motions": int(np.isfinite(found.least).sum()),
        "feasible_fraction": float(kept.any(axis=0).mean()) if len(kept) else 0.0,
        "motion_fraction": float(kept.sum() / max(1, np.isfinite(found.least).sum())),
        "best": _best_document(found, degrees),
        "robust": widest and {**widest, "radius_deg": widest["size_deg"] / 2.0},
        "regions": regions,
        "branches": [
            {"branch": index, "least": [None if np.isnan(v) else v for v in row.tolist()]}
            for index, row in zip(found.branches, found.least, strict=True)
        ],
        "headings_deg": degrees.tolist(),
        "margin": found.margin,
        "seconds": seconds,
    }


def _best_document(found: HeadingMap, degrees: Array) -> Document | None:
    if not np.isfinite(found.least).any() or np.nanmax(found.least) <= 0.0:
        return None
    b, n = np.unravel_index(np.nanargmax(found.least), found.least.shape)
    heading = float(degrees[n])
    return {"branch": found.branches[b], "heading_deg": heading, "value": float(found.least[b, n]),
            "attitude": heading_quaternion(np.radians(heading)).tolist()}  # fmt: skip


def _runs(row: Array, degrees: Array, step: float) -> Iterator[tuple[int, float]]:
    """Length and centre [deg] of each run of ones round the circle."""
    if row.all():
        yield len(row), 0.0
        return
    first = int(np.argmin(row))
    turned = np.append(np.roll(row, -first), 0.0)
    edges = np.flatnonzero(np.diff(turned, prepend=0.0))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        yield int(stop - start), float(degrees[first] + step * (start + stop - 1) / 2.0)


def natural_task(model: FreeFloatingModel) -> Task:
    """The task with the most rows that an arm can do, planar for planar arms."""
    planar = VirtualManipulator.of(model).is_planar
    tasks = [task for task in Task if task.planar is planar and len(task.rows) <= model.dof]
    return max(tasks, key=lambda task: len(task.rows), default=Task.PLANAR_POSITION)


def info_document(model: FreeFloatingModel, task: Task, of: Measure | None = None) -> Document:
    """What ``info`` answers: what the robot is, and every doubt about its URDF."""
    virtual = VirtualManipulator.of(model)
    of = of or measure(model, task, "gjm")
    extremes = joint_space_extremes(model, of)
    return {
        "urdf": model.description.source,
        "end_effector": model.end_effector,
        "total_mass": model.total_mass,
        "dof": model.dof,
        "task": str(task),
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
        "warnings": [str(doubt) for doubt in model.doubts],
    }  # fmt: skip
