"""Plans, simulations and their motions in HDF5 files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from math import tau
from typing import Any

import numpy as np

from freefloat.certificate.certificate import Certificate, CertifiedMinimum, Comparison, Worst
from freefloat.ik.branches import ArmBranch
from freefloat.io.records.hdf5 import QUATERNION, TEXT, Document, read_numbers, write_arrays
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.contact import Contact
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.extrema import closest_approach
from freefloat.motion.law import JointCurve
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import DEGREE
from freefloat.motion.problem import Problem
from freefloat.planning.plan import Plan
from freefloat.planning.plane.arcs import BranchRanges, HeadingRange, RangeLimitCause
from freefloat.planning.plane.ranges import RangeLimit
from freefloat.planning.plane.segment import Segment
from freefloat.planning.plane.tangency import PlanarTangencyPoint, TangencyKind
from freefloat.planning.settings import Search
from freefloat.planning.simulation import SimulatedBranch, Simulation
from freefloat.so3 import Array, without_jumps

_MAX = 1e12
"""Largest number in a motion."""
_ROUNDING = 1e-9
"""Deviation of the length of a stored quaternion from 1, and of the centre of mass [m]."""
_WORST = ("end_effector_position", "end_effector_attitude", "momentum", "rates")
_CAUSES_BEFORE_0_2 = (RangeLimitCause.MARGIN, RangeLimitCause.MARGIN)
"""Causes of the ends of a range in files without causes, which freefloat 0.1.0 wrote."""
_SEGMENT_RANGES = {
    "ranges_at_start_deg": "at_start", "ranges_at_end_deg": "at_end",
    "joined_at_end_deg": "joined_at_end",
}  # fmt: skip
"""Ranges of a segment: keys of its document, which are also those of their causes in its group."""


def write_simulation(file: Any, simulation: Simulation, _: Document) -> None:
    """Write the motions of a simulation, the chosen one as ``motion``."""
    file.attrs["feasible"] = simulation.feasible
    file.attrs["limits_checked"] = simulation.limits is not None
    for number, branch in enumerate(simulation.branches):
        if branch is simulation.chosen:
            file.attrs["chosen"] = number
            _write_branch(file, "motion", branch)
        else:
            _write_branch(file, f"branches/{number}", branch)


def read_simulation(file: Any, scenario: Scenario, document: Document) -> Simulation:
    """Simulation of a file."""
    problem = scenario.problem()
    chosen = _read_branch(file["motion"], problem, document["branch"])
    others = file.get("branches", {})
    branches = [_read_branch(others[name], problem, -1) for name in sorted(others, key=int)]
    branches.insert(int(file.attrs.get("chosen", 0)), chosen)
    return Simulation(tuple(branches), chosen, *read_limits(file, scenario, document))


def write_plan(file: Any, plan: Plan, _: Document) -> None:
    """Write ranges, segments, motion and map of a plan."""
    file.attrs["feasible"], file.attrs["stretch"] = plan.feasible, plan.stretch
    file.attrs["limits_checked"] = plan.limits is not None
    for entry in plan.ranges:
        values = np.reshape([(heading.low, heading.high) for heading in entry.ranges], (-1, 2))
        ranges = file.create_dataset(f"ranges/branch_{entry.branch}", data=values)
        ranges.attrs["label"], ranges.attrs["unit"] = entry.label, "rad"
        _write_causes(ranges, "causes", (entry,))
    for number, segment in enumerate(plan.segments):
        group = file.create_group(f"segments/{number}")
        for key, name in _SEGMENT_RANGES.items():
            _write_causes(group, f"{key}_causes", getattr(segment, name))
    if plan.chosen is not None:
        _write_branch(file, "motion", plan.chosen)
    if plan.map is not None:
        from freefloat.io.records.map_file import (
            write_samples,  # compiled kernels are slow to import
        )

        write_samples(file.create_group("map"), plan.map)


def read_plan(
    file: Any, scenario: Scenario, document: Document, problem: Problem | None = None
) -> Plan:
    """Plan of a file; those of version 0.1.0 lack its map.

    A plan of another problem than the scenario's starts from a given state, without a search.
    """
    search = scenario.search() if problem is None else Search()
    problem = search.applied_to(scenario.problem()) if problem is None else problem
    tolerance, effort = document.get("tolerance"), document.get("robust_radius_effort")
    samples = None
    if tolerance is not None or "map" in file:
        from freefloat.io.records.map_file import (
            read_samples,  # compiled kernels are slow to import
        )
        from freefloat.planning.searches.adversary import Effort
        from freefloat.planning.space.disturbances import Tolerance

        samples = read_samples(file["map"], problem, search) if "map" in file else None
        tolerance = tolerance and Tolerance.from_dict(tolerance)
        effort = effort and Effort(**effort)
    limits, results, contact = read_limits(file, scenario, document)
    stretched = document["stretched_duration"]
    radius = document["robust_radius_deg"]
    motion = file.get("motion")
    return Plan(
        problem=problem,
        search=search,
        feasible=bool(file.attrs["feasible"]),
        reason=str(document["reason"]),
        ranges=_read_ranges(file.get("ranges", {}), document["attitude_ranges_deg"]),
        segments=tuple(
            _segment(entry, file.get(f"segments/{number}", {}))
            for number, entry in enumerate(document["segments"])
        ),
        chosen=None if motion is None else _read_branch(motion, problem, document["branch"]),
        robust_radius=None if radius is None else float(np.radians(radius)),
        radius_effort=effort,
        map=samples,
        tolerance=tolerance,
        disagreements=tuple(document["disagreements"]),
        limits=limits,
        limit_results=results,
        excluded=dict(document["excluded"]),
        needed_stretch=None if stretched is None else stretched / problem.path.duration,
        stretch=float(file.attrs.get("stretch", 1.0)),
        certificate=_certificate(document.get("certificate")),
        contact=contact,
    )


def _write_causes(item: Any, name: str, entries: Iterable[BranchRanges]) -> None:
    """Write the causes of the ends of ranges as an attribute: two of each but full circles."""
    causes = [str(cause) for e in entries for part in e.ranges for cause in part.causes]
    if causes:
        item.attrs[name] = np.array(causes, dtype=TEXT)


def _read_causes(item: Any, name: str) -> Iterator[str]:
    """The causes of an attribute; none in files without."""
    return (str(cause) for cause in item.attrs.get(name, ()))


def _read_ranges(group: Any, documents: list[Document]) -> tuple[BranchRanges, ...]:
    entries = {}
    for document in documents:
        name = f"branch_{document['branch']}"
        (values,) = read_numbers(group, name)
        causes = _read_causes(group[name], "causes")
        entries[name] = _branch_ranges(document, _with_causes(values.tolist(), causes))
    if entries.keys() != set(group):
        raise ValueError("its ranges are not of the branches in its document")
    return tuple(entries.values())


def _branch_ranges(document: Document, ranges: tuple[HeadingRange, ...]) -> BranchRanges:
    limits = tuple(np.radians(document["limits"]).tolist())
    return BranchRanges(document["branch"], document["label"], ranges, limits)


def _segment(document: Document, group: Any) -> Segment:
    """Segment of its document, and of the group with the causes of its ranges."""
    limits = tuple(
        RangeLimit(
            PlanarTangencyPoint(
                TangencyKind(entry["kind"]), entry["time"], entry["s"], entry["level"],
                entry["heading"], np.array(entry["joints"]),
            ),
            float(np.radians(entry["heading_at_start_deg"])),
            float(np.radians(entry["heading_at_end_deg"])),
        ) for entry in document["touch_points"]
    )  # fmt: skip
    ranges = {}
    for key, name in _SEGMENT_RANGES.items():
        causes = _read_causes(group, f"{key}_causes") if group else iter(())
        ranges[name] = tuple(
            _branch_ranges(entry, _with_causes(_spans(entry["ranges"]), causes))
            for entry in document[key]
        )
    return Segment((document["from"], document["to"]), limits, **ranges)


def _spans(degrees: list[list[float]]) -> list[tuple[float, float]]:
    """First and last headings [rad] of the ranges of a document, those across zero joined again."""
    parts = [(float(low), float(high)) for low, high in np.radians(degrees).reshape(-1, 2)]
    if len(parts) > 1 and parts[0][0] == 0.0 and parts[-1][1] == tau:
        parts = [*parts[1:-1], (parts[-1][0], tau + parts[0][1])]
    return parts


def _with_causes(
    spans: Iterable[Sequence[float]], causes: Iterator[str]
) -> tuple[HeadingRange, ...]:
    """Ranges between headings [rad]; each but full circles takes the next two causes."""
    ranges = []
    for low, high in spans:
        full = high - low >= tau - 1e-9
        ends = () if full else tuple(islice(causes, 2)) or _CAUSES_BEFORE_0_2
        ranges.append(HeadingRange(low, high, ends))
    return tuple(ranges)


def read_limits(
    file: Any, scenario: Scenario, document: Document
) -> tuple[Limits | None, tuple[LimitResult, ...], Contact | None]:
    """Limits of a file, their results, contact; version 0.1.0 always checked the scenario's."""
    results = map(LimitResult.from_dict, document["limits"])
    checked = bool(file.attrs.get("limits_checked", True))
    contact = document.get("contact")
    if contact is not None:
        contact = Contact(**{**contact, "bodies": tuple(contact["bodies"])})
    return scenario.limits() if checked else None, tuple(results), contact


def _certificate(document: Document | None) -> Certificate | None:
    if document is None:
        return None
    numbers = ((key, document[key]) for key in _WORST)
    worst = {k: v and Worst(float(v["value"]), float(v["time"])) for k, v in numbers}
    worst["end_effector_orientation"] = worst.pop("end_effector_attitude")
    others = {"least", "centre_of_mass", "end_effector_attitude"}
    fields = {key: document[key] for key in document.keys() - others}
    return Certificate(**{
        **fields,
        **worst,
        "minima": tuple(CertifiedMinimum(**entry) for entry in document["least"]),
        "integration": Comparison(**document["integration"]),
    })  # fmt: skip


# --- motions --------------------------------------------------------------------------------------


def write_motion(file: Any, name: str, motion: Motion) -> Any:
    """Write a motion as a group of an open file; the group."""
    group = file.create_group(name)
    group.attrs["ending"] = motion.ending.name
    group.attrs["joint_names"] = np.array(motion.problem.model.joint_names, dtype=TEXT)
    write_arrays(group, {
        "time": (motion.times, "s"),
        "attitude": (motion.attitudes, QUATERNION),
        "joints": (motion.joints, "rad or m"),
        "base_position": (motion.base_positions, "m"),
    })  # fmt: skip
    return group


def _write_branch(file: Any, name: str, branch: SimulatedBranch) -> None:
    group = write_motion(file, name, branch.motion)
    group.attrs["branch"], group.attrs["label"] = branch.branch.index, branch.branch.label


def _read_branch(group: Any, problem: Problem, index: int) -> SimulatedBranch:
    """The motion of an arm branch; its number is given for groups without one."""
    motion = read_motion(group, problem)
    index = int(group.attrs.get("branch", index))
    branch = ArmBranch(index, str(group.attrs.get("label", index)), motion.initial.joints)
    return SimulatedBranch(branch, motion, closest_approach(motion, problem.margin.measure))


def read_motion(group: Any, problem: Problem, curve: JointCurve | None = None) -> Motion:
    """Motion of a group, along the path of a problem or with prescribed joints."""
    arrays = read_numbers(group, "time", "attitude", "joints", "base_position")
    times, attitudes, joints, positions = arrays
    _require_nodes(arrays, problem.model.dof)
    ending, attitudes = Ending[group.attrs["ending"]], without_jumps(attitudes)
    motion = Motion(problem, ending, times, attitudes, joints, curve)
    distance = np.linalg.norm(positions - motion.base_positions, axis=1)
    if distance.max() > _ROUNDING * max(1.0, float(np.abs(positions).max())):
        node = int(distance.argmax())
        raise ValueError(
            f"its base position at t = {times[node]:.6g} s moves the centre of mass by "
            f"{distance[node]:.3g} m"
        )
    return motion


def _require_nodes(arrays: tuple[Array, ...], dof: int) -> None:
    """Raise a ValueError unless these are the nodes of whole panels."""
    times, attitudes, *_ = arrays
    count = len(times)
    shapes = [(count,), (count, 4), (count, dof), (count, 3)]
    if [values.shape for values in arrays] != shapes or count % DEGREE != 1:
        raise ValueError("its arrays are not those of a motion of its robot")
    if not all((np.abs(values) <= _MAX).all() for values in arrays):
        raise ValueError("its motion holds numbers that are not finite, or beyond 1e12")
    error = np.abs(np.linalg.norm(attitudes, axis=1) - 1.0)
    if error.max() > _ROUNDING:
        raise ValueError(f"its attitude at node {error.argmax()} is no unit quaternion")
    if not (np.diff(times) >= 0.0).all() and not (np.diff(times) <= 0.0).all():
        raise ValueError("its times do not rise")
