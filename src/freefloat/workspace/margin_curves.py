"""Margin curves in joint space, and path-dependent areas around the centre of mass.

For planar arms of two joints, or of three with a prescribed orientation, S depends on the first two
joint angles alone, and so does the distance R of point 3 (the end-effector, or the joint of the
last link) from the centre of mass, at any heading: (21), (28). The radii on singularity curves are
the path-dependent areas; the rest of the reach is path-independent. For other arms see
:mod:`freefloat.workspace.regions`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from contourpy import contour_generator

from freefloat.dynamics.measures import joint_space_extremes, singularity_measure
from freefloat.dynamics.momentum import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, frozen
from freefloat.workspace.planar_arm import PlanarArm

_GRID = 721
_POLISHES = 4

Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class MarginCurve:
    """A continuous curve S(q1, q2) = level in joint space (22).

    Attributes:
        level: Value of S; zero for singularity curves.
        joints: q1 and q2 along the curve [rad], shape (K, 2); a curve ends at the edge of the
            square [-pi, pi] and continues as another one at the opposite edge.
        radii: Distance of point 3 from the centre of mass [m], shape (K,).
    """

    level: float
    joints: Array
    radii: Array


def has_two_angle_form(model: FreeFloatingModel, task: Task) -> bool:
    """Whether S of a planar problem depends on the first two joint angles alone."""
    plain = not any(body.prismatic for body in model.bodies[1:])
    return task.planar and plain and model.dof == len(task.rows)


def two_angles(arm: PlanarArm, joints: npt.ArrayLike) -> Array:
    """Absolute angles (..., n + 1) of the first two joints (..., 2), heading and others at zero."""
    q = np.asarray(joints, dtype=float)
    padded = np.concatenate([q, np.zeros((*q.shape[:-1], len(arm.signs) - 2))], axis=-1)
    return arm.angles(np.zeros(q.shape[:-1]), padded)


def point_3(arm: PlanarArm, joints: npt.ArrayLike) -> npt.NDArray[np.complex128]:
    """Point 3 from the centre of mass at zero heading [m], shape (...), for joints (..., 2)."""
    return np.asarray(arm.vectors(two_angles(arm, joints))[..., :3].sum(axis=-1))


def margin_curves(arm: PlanarArm, *levels: float) -> tuple[MarginCurve, ...]:
    """All curves in joint space on which S has one of several values.

    They are contours on a grid of half a degree, refined by Newton's method. Closed curves smaller
    than half a degree may be missed.

    Args:
        arm: Planar arm of two or three joints.
        levels: Values of S.
    """
    axis = np.linspace(-np.pi, np.pi, _GRID)
    q1, q2 = np.meshgrid(axis, axis)
    S = arm.determinant(two_angles(arm, np.stack([q1, q2], axis=-1)))
    contours, curves = contour_generator(axis, axis, S), []
    for level in levels:
        for line in contours.lines(level):
            joints = _polished(arm, np.asarray(line), level)
            curves.append(MarginCurve(level, frozen(joints), frozen(np.abs(point_3(arm, joints)))))
    return tuple(curves)


def _polished(arm: PlanarArm, joints: Array, level: float) -> Array:
    """Points of a contour after small Newton steps along the gradient of S."""
    step = 1e-6
    for _ in range(_POLISHES):
        errors = arm.determinant(two_angles(arm, joints)) - level
        slopes = [
            arm.determinant(two_angles(arm, joints + d))
            - arm.determinant(two_angles(arm, joints - d))
            for d in step * np.eye(2)
        ]
        gradient = np.stack(slopes, axis=-1) / (2.0 * step)
        length = np.maximum((gradient**2).sum(axis=-1), 1e-12)
        joints = joints - np.clip(errors / length, -0.01, 0.01)[:, None] * gradient
    return joints


@dataclass(frozen=True, eq=False)
class Workspace:
    """Reach and areas: distances of one point from the centre of mass [m].

    Attributes:
        point: ``"end-effector"``, ``"last joint"`` or ``"wrist centre"``.
        tip: That point in the end-effector's frame [m], shape (3,).
        measure: Name of the measure S: ``system``, ``arm`` or ``gjm``.
        reach: Smallest and largest distance.
        path_dependent: Intervals where S can vanish, inner to outer; None if unknown.
        path_independent: The rest of the reach, inner to outer; None if unknown.
        exact: Whether the areas are exact. Sampled areas may be incomplete: S does vanish in the
            path-dependent ones; in the others no singular configuration was found.
        largest_s: Largest S in the joint space.
        smallest_s: Smallest S in the joint space.
        path: Intervals of s along the path, in order, each with whether it lies in a path-dependent
            area; ends accurate to 1e-3. Empty if the areas are unknown.
    """

    point: str
    tip: Array
    measure: str
    reach: Interval
    path_dependent: tuple[Interval, ...] | None
    path_independent: tuple[Interval, ...] | None
    exact: bool
    largest_s: float
    smallest_s: float
    path: tuple[tuple[Interval, bool], ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat workspace``."""
        dependent, independent = self.path_dependent, self.path_independent
        return {
            "point": self.point,
            "measure": self.measure,
            "reach": list(self.reach),
            "pdw": None if dependent is None else [list(interval) for interval in dependent],
            "piw": None if independent is None else [list(interval) for interval in independent],
            "exact": self.exact,
            "s_max": self.largest_s,
            "s_min": self.smallest_s,
            "path": [{"s": list(part), "path_dependent": inside} for part, inside in self.path],
        }


def planar_workspace(problem: Problem) -> Workspace:
    """Reach and areas of a planar arm whose S depends on two joint angles.

    Raises:
        InputError: For arms whose S depends on more than two joint angles.
    """
    if not has_two_angle_form(problem.model, problem.task):
        raise InputError(
            "task",
            f"{problem.task} with {problem.model.dof} joints has no areas by radius alone",
            "planar-position with two revolute joints, planar-pose with three",
        )
    arm, tip = PlanarArm.of(problem.model), np.zeros(3)
    if problem.task is Task.PLANAR_POSE:
        virtual = VirtualManipulator.of(problem.model)
        tip = -virtual.tool.T @ virtual.links[-1]
    point = "last joint" if problem.task is Task.PLANAR_POSE else "end-effector"
    return swept_workspace(problem, arm, "system", (point, tip))


def swept_workspace(
    problem: Problem, arm: PlanarArm, name: str, point: tuple[str, Array]
) -> Workspace:
    """Reach and areas from the singularity curves of an equivalent planar arm.

    Args:
        problem: The problem.
        arm: The planar arm, whose S is the measure of that name.
        name: Name of the measure.
        point: Name of the arm's point 3, and its position in the end-effector's frame [m].
    """
    a, b, c = np.abs(arm.links[:3]).tolist()
    reach = max(0.0, 2.0 * max(a, b, c) - (a + b + c)), a + b + c
    curves = margin_curves(arm, 0.0)
    dependent = merged([(float(c.radii.min()), float(c.radii.max())) for c in curves])
    measure = singularity_measure(problem.model, problem.task, name)
    extremes = joint_space_extremes(problem.model, measure)
    return Workspace(
        point=point[0],
        tip=frozen(point[1]),
        measure=name,
        reach=reach,
        path_dependent=dependent,
        path_independent=complement(dependent, reach),
        exact=True,
        largest_s=extremes.largest,
        smallest_s=extremes.smallest,
    )


def merged(intervals: list[Interval], gap: float = 1e-9) -> tuple[Interval, ...]:
    """Intervals in order, overlapping and adjacent ones joined."""
    joined: list[Interval] = []
    for low, high in sorted(intervals):
        if joined and low <= joined[-1][1] + gap:
            joined[-1] = joined[-1][0], max(joined[-1][1], high)
        else:
            joined.append((low, high))
    return tuple(joined)


def complement(intervals: tuple[Interval, ...], whole: Interval) -> tuple[Interval, ...]:
    """The rest of an interval beside disjoint ones in order, without gaps of rounding errors."""
    edges = [whole[0], *(edge for interval in intervals for edge in interval), whole[1]]
    gaps = zip(edges[::2], edges[1::2], strict=True)
    return tuple((low, high) for low, high in gaps if high - low > 1e-6 * whole[1])


def path_areas(problem: Problem, workspace: Workspace) -> tuple[tuple[Interval, bool], ...]:
    """Parts of the path inside and outside of path-dependent areas.

    Args:
        problem: The problem.
        workspace: Its workspace.

    Returns:
        Intervals of s in order, each with whether it lies in a path-dependent area; ends accurate
        to 1e-3. Empty if the areas are unknown.
    """
    if workspace.path_dependent is None:
        return ()
    s = np.linspace(0.0, 1.0, 1001)
    radii = np.array([_radius_on_path(problem, workspace, float(value)) for value in s])
    inside = np.zeros(len(s), dtype=bool)
    for low, high in workspace.path_dependent:
        inside |= (radii >= low) & (radii <= high)
    changes = np.flatnonzero(inside[1:] != inside[:-1])
    edges = [0.0, *((s[changes] + s[changes + 1]) / 2.0), 1.0]
    parts = zip(edges[:-1], edges[1:], inside[[0, *(changes + 1)]], strict=True)
    return tuple(((float(low), float(high)), bool(flag)) for low, high, flag in parts)


def _radius_on_path(problem: Problem, workspace: Workspace, s: float) -> float:
    """Distance of the workspace's point from the centre of mass at a place of the path [m]."""
    pose = problem.path.path.pose(s)
    position = pose.position + pose.rotation @ workspace.tip
    return float(np.linalg.norm(position[:2] if problem.task.planar else position))


def most_singular_place(problem: Problem) -> tuple[float, float]:
    """The s at which the largest attainable |S| is smallest, and that |S|.

    Configurations form a grid of half a degree; the value is accurate to about one percent.
    """
    arm = PlanarArm.of(problem.model)
    axis = np.linspace(-np.pi, np.pi, _GRID)
    q = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    S, radii = np.abs(arm.determinant(two_angles(arm, q))), np.abs(point_3(arm, q))
    shells = np.linspace(0.0, radii.max(), 401)
    largest = np.zeros(len(shells))
    np.maximum.at(largest, np.searchsorted(shells, radii), S)
    s = np.linspace(0.0, 1.0, 401)
    radii_on_path = np.array([abs(point_3_on_path(problem, float(value))) for value in s])
    attainable = np.interp(radii_on_path, shells, np.maximum(largest, np.append(largest[1:], 0.0)))
    worst = int(np.argmin(attainable))
    return float(s[worst]), float(attainable[worst])


def point_3_on_path(problem: Problem, s: float) -> complex:
    """Point 3 on the path [m], the end-effector or the joint of the last link (20)."""
    pose = problem.path.path.pose(s)
    end = complex(pose.position[0], pose.position[1])
    if problem.task is not Task.PLANAR_POSE:
        return end
    virtual = VirtualManipulator.of(problem.model)
    last = pose.rotation @ virtual.tool.T @ virtual.links[-1]
    return end - complex(last[0], last[1])
