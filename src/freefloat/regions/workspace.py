"""Reach of any arm, and the distances from the centre of mass at which it can be singular.

The radii on singularity curves are the path-dependent areas; the rest of the reach is
path-independent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from freefloat.dynamics.joint_space import joint_space_extremes, sampled_reach
from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.tasks import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.motion.problem import Problem, require_problem
from freefloat.motion.setting import Setting
from freefloat.regions.certified_areas import certified_areas
from freefloat.regions.margin_curves import level_curves, reduced_arm
from freefloat.regions.planar_regions import Interval, wrist_in_tool
from freefloat.so3 import Array, frozen

_ADJACENT = 1e-9
"""Gap of adjacent intervals [m]."""


@dataclass(frozen=True, eq=False)
class Workspace:
    """Reach and areas: distances of one point from the centre of mass [m].

    Attributes:
        point: ``"end-effector"``, or of the virtual manipulator ``"virtual last joint"`` or
            ``"virtual wrist centre"``; the robot's own are elsewhere where the links beyond are
            heavy.
        offset: Position of that point in the end-effector's frame [m], shape (3,).
        measure: Name of the measure S: ``system``, ``arm`` or ``gjm``.
        reach: Smallest and largest distance.
        path_dependent: Intervals where S can vanish, inner to outer; None if unknown.
        path_independent: Intervals where S cannot vanish, inner to outer; None if unknown.
        exact: Whether the ends of the areas are exact. Others are those of shells, each of half a
            percent of the reach: S vanishes somewhere in each path-dependent one, and is proven not
            to vanish in the path-independent ones.
        largest_s: Largest S found in the joint space.
        smallest_s: Smallest S found in the joint space.
        undecided: Intervals of which neither is proven.
        area_a: Of exact areas the path-dependent ones of singularity curve I, the paper's PDW A;
            empty for others.
        area_b: Likewise those of singularity curve II, PDW B.
        path: Intervals of s along the path, in order, each with whether it lies in a path-dependent
            area, None in an undecided one; ends accurate to 1e-3. Empty if the areas are unknown.
    """

    point: str
    offset: Array
    measure: str
    reach: Interval
    path_dependent: tuple[Interval, ...] | None
    path_independent: tuple[Interval, ...] | None
    exact: bool
    largest_s: float
    smallest_s: float
    undecided: tuple[Interval, ...] = ()
    area_a: tuple[Interval, ...] = ()
    area_b: tuple[Interval, ...] = ()
    path: tuple[tuple[Interval, bool | None], ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat workspace``."""
        return {
            "point": self.point,
            "measure": self.measure,
            "reach": self.reach,
            "pdw": self.path_dependent,
            "pdw_a": self.area_a,
            "pdw_b": self.area_b,
            "piw": self.path_independent,
            "undecided": self.undecided,
            "exact": self.exact,
            "s_max": self.largest_s,
            "s_min": self.smallest_s,
            "path": [{"s": part, "path_dependent": inside} for part, inside in self.path],
        }


def workspace_regions(problem: Problem) -> Workspace:
    """Reach and areas of a robot, exact if possible, otherwise in certified shells.

    Raises:
        InputError: If a prismatic joint has no limits.

    Example:
        >>> regions = ff.workspace_regions(ff.load_scenario("planar_2dof/line").problem())
        >>> np.round(regions.path_dependent, 3)
        array([[0.351, 0.554],
               [1.436, 2.287]])
    """
    require_problem(problem)
    problem.model.require_supported("reach and regions")
    workspace = regions_of(problem)
    return replace(workspace, path=_path_areas(problem, workspace))


def regions_of(setting: Setting) -> Workspace:
    """Reach and areas as of :func:`workspace_regions`, without those of the path."""
    return exact_workspace(setting) or _general_workspace(setting)


def exact_workspace(setting: Setting) -> Workspace | None:
    """Reach and areas where S depends on two joint angles alone, without those of the path.

    These are planar arms with as many revolute joints as the task has rows and, for pose tasks,
    elbow arms with a spherical wrist that have the measure ``arm``. The areas of the latter are
    spherical shells about the centre of mass and concern S(q2, q3) of (40). Such an arm is also
    singular where its shoulder factor (the out-of-plane block of (39)) or its wrist factor, sin q5,
    vanishes; that can happen at almost any radius.

    Returns:
        None for other arms, and where further arms move.
    """
    try:
        arm, name = reduced_arm(setting)
    except InputError:
        return None
    virtual = VirtualManipulator.of(setting.model)
    point, offset = "end-effector", np.zeros(3)
    if setting.task is Task.PLANAR_POSE:
        point, offset = "virtual last joint", -virtual.last_link
    elif setting.task is Task.POSE:
        point, offset = "virtual wrist centre", wrist_in_tool(virtual)
    curves = level_curves(arm, 0.0)
    covered = [[curve.covered for curve in curves if curve.first is kind] for kind in (True, False)]
    area_a, area_b = map(merged, covered)
    dependent = merged([*area_a, *area_b])
    measure = singularity_measure(setting.model, setting.task, name)
    extremes = joint_space_extremes(setting.model, measure)
    return Workspace(
        point, frozen(offset), name, arm.reach, dependent, _complement(dependent, arm.reach), True,
        extremes.largest, extremes.smallest, area_a=area_a, area_b=area_b,
    )  # fmt: skip


def _general_workspace(setting: Setting) -> Workspace:
    """Reach and areas of the end-effector, those of redundant arms being unknown."""
    reach = sampled_reach(setting.model, setting.task)
    measure = singularity_measure(setting.model, setting.task, "gjm")
    extremes = joint_space_extremes(setting.model, measure)
    areas = None if setting.redundant else certified_areas(setting, reach)
    return Workspace(
        "end-effector", frozen(np.zeros(3)), measure.name, reach,
        areas.path_dependent if areas else None, areas.path_independent if areas else None, False,
        extremes.largest, extremes.smallest, areas.undecided if areas else (),
    )  # fmt: skip


def merged(intervals: list[Interval]) -> tuple[Interval, ...]:
    """Intervals in order, overlapping and adjacent ones joined."""
    joined: list[Interval] = []
    for low, high in sorted(intervals):
        if joined and low <= joined[-1][1] + _ADJACENT:
            joined[-1] = joined[-1][0], max(joined[-1][1], high)
        else:
            joined.append((low, high))
    return tuple(joined)


def _complement(intervals: tuple[Interval, ...], whole: Interval) -> tuple[Interval, ...]:
    """The rest of an interval between disjoint ones in order, without gaps of rounding errors."""
    edges = [whole[0], *(edge for interval in intervals for edge in interval), whole[1]]
    gaps = zip(edges[::2], edges[1::2], strict=True)
    return tuple((a, b) for a, b in gaps if b - a > 1e-6 * whole[1])


def _path_areas(problem: Problem, workspace: Workspace) -> tuple[tuple[Interval, bool | None], ...]:
    """Parts of the path inside and outside of path-dependent areas, see :class:`Workspace`."""
    if workspace.path_dependent is None:
        return ()
    s = np.linspace(0.0, 1.0, 1001)
    poses = [problem.path.pose_at(float(value)) for value in s]
    points = np.array([pose.position + pose.rotation @ workspace.offset for pose in poses])
    if problem.task.planar:
        points = problem.plane.seen(points)[:, :2]
    radii = np.linalg.norm(points, axis=1)
    kinds = np.zeros(len(s), dtype=int)
    for kind, areas in enumerate((workspace.path_dependent, workspace.undecided), start=1):
        for low, high in areas:
            kinds[(radii >= low) & (radii <= high) & (kinds == 0)] = kind
    changes = np.flatnonzero(np.diff(kinds))
    edges = [0.0, *((s[changes] + s[changes + 1]) / 2.0).tolist(), 1.0]
    flags = [(False, True, None)[kind] for kind in kinds[[0, *(changes + 1)]]]
    return tuple(zip(pairwise(edges), flags, strict=True))
