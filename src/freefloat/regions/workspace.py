"""Reach of any arm, and the distances from the centre of mass at which it can be singular.

The radii on singularity curves are the path-dependent areas; the rest of the reach is
path-independent. For other arms both are certified by bounds on det A and on the distance: the
reach is divided into shells. A shell is path-dependent where a singular configuration is found in
it, and path-independent where boxes that fill the joint space are free of singularities or put the
end-effector elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.joint_space import (
    end_effector_distance,
    joint_space_extremes,
    sampled_reach,
)
from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.tasks import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.motion.problem import Problem, require_problem
from freefloat.motion.setting import Setting
from freefloat.regions.margin_curves import level_curves, reduced_arm
from freefloat.regions.planar_regions import Interval, wrist_in_tool
from freefloat.singularities.global_maximum import halved, whole_joint_space
from freefloat.singularities.singularity_polynomial import SingularityPolynomial, fitted
from freefloat.so3 import Array, IntArray, frozen

_ADJACENT = 1e-9
"""Gap of adjacent intervals [m]."""
_SHELLS = 200
_MOST = 200_000
"""Number of boxes after which shells remain undecided."""
_ROWS = 2**16
"""Boxes that are processed together."""
_LINES, _BISECTIONS = 32768, 24
"""Lines through the joint space on which singular configurations are found, and their halvings."""


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
        exact: Whether the ends of the areas are exact. Others are ends of shells, each of half a
            percent of the reach: S vanishes somewhere in each path-dependent one, and is proven not
            to vanish in the path-independent ones.
        largest_s: Largest S found in the joint space.
        smallest_s: Smallest S found in the joint space.
        undecided: Intervals of which neither is proven.
        area_a: Path-dependent areas of singularity curve I, the paper's PDW A; empty unless areas
            are exact.
        area_b: Path-dependent areas of singularity curve II, PDW B, likewise.
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
    """Reach and areas as of :func:`workspace_regions`, without areas along the path."""
    return exact_workspace(setting) or _general_workspace(setting)


def exact_workspace(setting: Setting) -> Workspace | None:
    """Reach and areas where S depends on two joint angles alone, without areas along the path.

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
    """Reach and areas of the end-effector; areas of redundant arms are unknown."""
    reach = sampled_reach(setting.model, setting.task)
    measure = singularity_measure(setting.model, setting.task, "gjm")
    extremes = joint_space_extremes(setting.model, measure)
    areas = None if setting.redundant else _Shells(setting, reach).areas()
    dependent, independent, undecided = areas or (None, None, ())
    return Workspace(
        "end-effector", frozen(np.zeros(3)), measure.name, reach, dependent, independent, False,
        extremes.largest, extremes.smallest, undecided,
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


class _Shells:
    """Shells between the smallest and the largest distance, and what is known of them."""

    def __init__(self, setting: Setting, reach: Interval) -> None:
        model, task = setting.model, setting.task
        self._S = SingularityPolynomial.of(model, task)
        self._square = fitted(
            lambda joints: np.array([end_effector_distance(model, task, q) ** 2 for q in joints]),
            model,
        )
        self._edges = np.linspace(*reach, _SHELLS + 1)
        self.singular = np.zeros(_SHELLS, dtype=bool)
        self.open = np.zeros(_SHELLS, dtype=bool)

    def areas(self) -> tuple[tuple[Interval, ...], tuple[Interval, ...], tuple[Interval, ...]]:
        """Intervals with singular configurations, intervals without any, and the rest [m]."""
        self._search()
        return (
            self._intervals(self.singular),
            self._intervals(~self.singular & ~self.open),
            self._intervals(self.open & ~self.singular),
        )

    def _search(self) -> None:
        """Divide the joint space until every shell is known, or there are too many boxes."""
        centres, halves = whole_joint_space(self._S)
        q = centres + halves * (2.0 * low_discrepancy(_LINES, centres.shape[1]) - 1.0)
        self._record_roots(q[:-1], q[1:])
        count = 0
        while len(centres) and count < _MOST:
            count += len(centres)
            pieces = [slice(first, first + _ROWS) for first in range(0, len(centres), _ROWS)]
            cut = [self._halves(centres[piece], halves[piece]) for piece in pieces]
            centres, halves = (np.concatenate(part) for part in zip(*cut, strict=True))
        for low, high in self._ranges(centres, halves).tolist():
            self.open[low : high + 1] = True

    def _halves(self, centres: Array, halves: Array) -> tuple[Array, Array]:
        """Halves of the boxes in which a configuration of an unknown shell can be singular."""
        values, parts = self._S.variations(centres, halves)
        left = np.flatnonzero(np.abs(values) <= parts.sum(axis=1) + self._S.rounding)
        ranges = self._ranges(centres[left], halves[left])
        shells = self._shells(self._square.values(centres[left]))
        _, some = np.unique(np.where(self.singular[shells], -1, shells), return_index=True)
        steps = np.sign(self._S.gradients(centres[left[some]])) * halves[left[some]]
        self._record_roots(centres[left[some]] - steps, centres[left[some]] + steps)
        left = left[self._unknown(ranges)]
        return halved(centres[left], halves[left], parts[left])

    def _ranges(self, centres: Array, halves: Array) -> IntArray:
        """First and last shell that boxes can reach, shape (K, 2)."""
        return self._shells(np.stack(self._square.enclosures(centres, halves), axis=1))

    def _shells(self, squares: Array) -> IntArray:
        """Shells of squares of distances, of their shape."""
        shells = np.searchsorted(self._edges, np.sqrt(np.maximum(squares, 0.0))) - 1
        return np.clip(shells, 0, _SHELLS - 1)

    def _unknown(self, ranges: IntArray) -> npt.NDArray[np.bool_]:
        """Whether ranges of shells hold one in which no singular configuration is known."""
        known = np.append(0, np.cumsum(~self.singular))
        return known[ranges[:, 1] + 1] > known[ranges[:, 0]]

    def _record_roots(self, starts: Array, ends: Array) -> None:
        """Mark shells of singular configurations on lines, at whose ends det A differs in sign."""
        first, last = self._S.values(starts), self._S.values(ends)
        zero = self._S.rounding
        cross = np.flatnonzero((np.minimum(first, last) < -zero) & (np.maximum(first, last) > zero))
        starts, directions = starts[cross], (ends - starts)[cross]
        rising = last[cross] > 0.0
        low, high = np.zeros(len(cross)), np.ones(len(cross))
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2.0
            above = self._S.values(starts + middle[:, None] * directions) > 0.0
            before = above != rising
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        squares = self._square.values(starts + low[:, None] * directions)
        self.singular[self._shells(squares)] = True

    def _intervals(self, chosen: npt.NDArray[np.bool_]) -> tuple[Interval, ...]:
        """Intervals of adjacent shells [m]."""
        changes = np.flatnonzero(np.diff(chosen, prepend=False, append=False))
        edges = self._edges[changes].tolist()
        return tuple(zip(edges[::2], edges[1::2], strict=True))
