"""Plans and simulations in HDF5 files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from freefloat.io.decoding import Document, certificate_of, limit_results_of, radians
from freefloat.io.hdf5 import TEXT, read_numbers
from freefloat.io.map_file import read_attitude_map, write_attitude_map
from freefloat.io.motion_group import read_branch, read_motion, write_branch, write_motion
from freefloat.io.scenario import Scenario
from freefloat.limits.limits import LimitResult, Limits
from freefloat.motion.problem import Margin, Problem
from freefloat.planning.plan import Plan, Segment
from freefloat.planning.planar_ranges import (
    TURN,
    BranchRanges,
    HeadingRange,
    RangeLimit,
    RangeLimitCause,
)
from freefloat.planning.planar_tangency import TangencyKind, TangencyPoint
from freefloat.planning.simulation import Simulation


def write_simulation(file: Any, simulation: Simulation) -> None:
    """Write the motions of a simulation, the chosen one as ``motion``."""
    chosen = simulation.chosen
    file.attrs["feasible"] = simulation.feasible
    file.attrs["limits_checked"] = simulation.limits is not None
    for number, branch in enumerate(simulation.branches):
        if branch is chosen:
            file.attrs["chosen"] = number
            write_branch(file, "motion", branch)
        else:
            write_branch(file, f"branches/{number}", branch)


def read_simulation(file: Any, scenario: Scenario, document: Document) -> Simulation:
    """Simulation of a file; those of version 0.1.0 have the chosen motion alone."""
    problem = scenario.problem()
    chosen = read_branch(file["motion"], problem, document["branch"])
    others = file.get("branches", {})
    if "chosen" not in file.attrs:
        document["branches"] = [
            entry for entry in document["branches"] if entry["branch"] == document["branch"]
        ]
    branches = [read_branch(others[name], problem, -1) for name in sorted(others, key=int)]
    branches.insert(int(file.attrs.get("chosen", 0)), chosen)
    limits, results = read_limits(file, scenario, document)
    return Simulation(tuple(branches), chosen, limits, results)


def read_limits(
    file: Any, scenario: Scenario, document: Document
) -> tuple[Limits | None, tuple[LimitResult, ...]]:
    """Limits of a file and their results; version 0.1.0 always checked those of the scenario."""
    checked = bool(file.attrs.get("limits_checked", True))
    return scenario.limits() if checked else None, limit_results_of(document["limits"])


def write_plan(file: Any, plan: Plan) -> None:
    """Write ranges, segments, motion and map of a plan."""
    file.attrs["feasible"], file.attrs["stretch"] = plan.feasible, plan.stretch
    file.attrs["limits_checked"] = plan.limits is not None
    for entry in plan.ranges:
        values = np.reshape([(one.low, one.high) for one in entry.ranges], (-1, 2))
        ranges = file.create_dataset(f"ranges/branch_{entry.branch}", data=values)
        ranges.attrs["label"], ranges.attrs["unit"] = entry.label, "rad"
        causes = [str(cause) for one in entry.ranges for cause in one.causes]
        if causes:
            ranges.attrs["causes"] = np.array(causes, dtype=TEXT)
    for number, segment in enumerate(plan.segments):
        for index, limit in enumerate(segment.limits):
            name = f"segments/{number}/{index}"
            write_motion(file, f"{name}/backward", limit.backward)
            write_motion(file, f"{name}/forward", limit.forward)
    if plan.chosen is not None:
        write_branch(file, "motion", plan.chosen)
    if plan.map is not None:
        write_attitude_map(file.create_group("map"), plan.map)


def read_plan(file: Any, scenario: Scenario, document: Document) -> Plan:
    """Plan of a file; those of version 0.1.0 lack its map and its tangent motions."""
    from freefloat.planning.tolerance import Tolerance  # compiled kernels take half a second

    problem, tolerance = scenario.problem(), document.get("tolerance")
    limits, results = read_limits(file, scenario, document)
    stretched, radius = document["stretched_duration"], document["robust_radius_deg"]
    return Plan(
        problem=problem,
        search=scenario.search(),
        feasible=bool(file.attrs["feasible"]),
        reason=str(document["reason"]),
        ranges=_read_ranges(file.get("ranges", {}), document["attitude_ranges_deg"]),
        segments=tuple(
            _segment(entry, file.get(f"segments/{number}", {}), problem)
            for number, entry in enumerate(document["segments"])
        ),
        chosen=read_branch(file["motion"], problem, document["branch"])
        if "motion" in file
        else None,
        robust_radius=radians(radius),
        map=read_attitude_map(file["map"], problem) if "map" in file else None,
        tolerance=None if tolerance is None else Tolerance(**tolerance),
        disagreements=tuple(document["disagreements"]),
        limits=limits,
        limit_results=results,
        excluded=dict(document["excluded"]),
        needed_stretch=None if stretched is None else stretched / problem.path.duration,
        stretch=float(file.attrs.get("stretch", 1.0)),
        certificate=certificate_of(document.get("certificate")),
    )


def _read_ranges(group: Any, documents: list[Document]) -> tuple[BranchRanges, ...]:
    entries = {}
    for document in documents:
        name = f"branch_{document['branch']}"
        values = read_numbers(group, name)
        causes = [RangeLimitCause(str(cause)) for cause in group[name].attrs.get("causes", ())]
        ranges = []
        for low, high in values.tolist():
            if high - low >= TURN - 1e-9:
                ranges.append(HeadingRange(low, high, ()))
                continue
            ends, causes = causes[:2] or [RangeLimitCause.MARGIN] * 2, causes[2:]
            ranges.append(HeadingRange(low, high, tuple(ends)))
        entries[name] = _ranges(document, tuple(ranges))
    if entries.keys() != set(group):
        raise ValueError("its ranges are not of the branches in its document")
    return tuple(entries.values())


def _ranges(document: Mapping[str, Any], ranges: tuple[HeadingRange, ...]) -> BranchRanges:
    limits = tuple(float(limit) for limit in np.radians(document["limits"]))
    return BranchRanges(document["branch"], document["label"], ranges, limits)


def _segment(document: Document, group: Any, problem: Problem) -> Segment:
    """Segment of its document, and of the group with the motions of its range limits."""
    motions = [
        (_tangency_point(point), *(group[f"{index}/{way}"] for way in ("backward", "forward")))
        for index, point in enumerate(document["touch_points"])
        if f"{index}" in group
    ]
    keys = ("ranges_at_start_deg", "ranges_at_end_deg", "joined_at_end_deg")
    starts, ends, joined = (
        tuple(_ranges(entry, _heading_ranges(entry["ranges"])) for entry in document[key])
        for key in keys
    )
    return Segment(
        (document["from"], document["to"]),
        tuple(
            RangeLimit(
                point,
                *(read_motion(way, _at_level(problem, point.level)) for way in (backward, forward)),
            )
            for point, backward, forward in motions
        ),
        starts,
        ends,
        joined,
    )


def _at_level(problem: Problem, level: float) -> Problem:
    """The problem whose margin is that of a tangency point."""
    return replace(problem, margin=Margin(problem.margin.measure, abs(level)))


def _tangency_point(document: Document) -> TangencyPoint:
    return TangencyPoint(
        TangencyKind(document["kind"]),
        document["time"],
        document["s"],
        document["level"],
        document["heading"],
        np.array(document["joints"]),
    )


def _heading_ranges(degrees: list[list[float]]) -> tuple[HeadingRange, ...]:
    """Ranges of headings of a document, those across zero joined again."""
    margin = (RangeLimitCause.MARGIN, RangeLimitCause.MARGIN)
    parts = [(float(low), float(high)) for low, high in np.radians(degrees).reshape(-1, 2)]
    if len(parts) > 1 and parts[0][0] == 0.0 and parts[-1][1] == TURN:
        parts = [*parts[1:-1], (parts[-1][0], TURN + parts[0][1])]
    return tuple(
        HeadingRange(low, high, () if high - low >= TURN - 1e-9 else margin) for low, high in parts
    )
