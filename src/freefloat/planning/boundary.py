"""The boundary of the feasible set: by bisection, and from tangency points.

A motion that is tangent to the margin surface and clear of it elsewhere begins on the boundary.
Tangency points, which come from equations alone, so check what bisection between samples finds.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.problem import is_kept
from freefloat.planning.attitude_map import AttitudeMap, BoundaryPoint
from freefloat.planning.search import EXACT, bisect, edge
from freefloat.planning.tangency import boundary_attitude, tangency_family
from freefloat.so3 import Array, angle_between, attitudes_within, rotated, rotation_vector_to

_RADIUS = 0.02
"""Distance from an attitude at which both sides of the boundary are searched for [rad]."""
_CLOUD = 96
_BATCHES, _SPARE = 8, 3
"""Families of tangency points that are computed, and how many more points than are missing: many
belong to wrist-flipped branches or to motions that violate the margin elsewhere."""


def boundary_points(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, count: int
) -> tuple[BoundaryPoint, ...]:
    """Attitudes on the boundary of the feasible set, by bisection between neighbouring samples.

    Args:
        evaluator: Of the same problem.
        samples: The map.
        count: Most points for each arm branch.
    """
    points: list[BoundaryPoint] = []
    for branch, margins in samples.branch_margins():
        inside = partial(evaluator.keeps, branch=branch)
        members = is_kept(margins, samples.problem.margin.threshold)
        attitudes = edge(inside, samples.attitudes, members, count, EXACT)
        points += [BoundaryPoint(attitude, branch) for attitude in attitudes]
    return tuple(points)


def tangent_boundary(
    evaluator: FeasibilityEvaluator, count: int, seed: int = 0, progress: Progress | None = None
) -> tuple[BoundaryPoint, ...]:
    """Attitudes on the boundary of the feasible set, integrated backward from tangency points.

    Args:
        evaluator: Of a problem whose arm has an elbow and a spherical wrist.
        count: Number of points, of wrist-flipped branches the first alone; fewer are found where
            few motions keep the margin elsewhere.
        seed: Shifts the family of tangency points.
        progress: Called with the fraction done, in [0, 1].

    Raises:
        InputError: If the arm has no such tangency points, or the margin is zero.
    """
    problem, points = evaluator.problem, list[BoundaryPoint]()
    for batch in range(_BATCHES):
        for tangency in tangency_family(problem, _SPARE * (count - len(points)), seed + batch):
            if len(points) == count:
                break
            start = boundary_attitude(problem, tangency)
            if start is None:
                continue
            branches = problem.branches(start.attitude)
            branch = problem.branch_near(start.attitude, start.joints, branches).index
            if evaluator.wrist_flipped and branch % 2:
                continue  # the wrist-flipped branch has the same motion
            gap = _gap(evaluator, start.attitude, branch)
            points.append(BoundaryPoint(start.attitude, branch, gap))
            if progress is not None:
                progress(len(points) / count)
        if len(points) == count:
            break
    return tuple(points)


def _gap(evaluator: FeasibilityEvaluator, attitude: Array, branch: int) -> float:
    """Distance from an attitude to the boundary on the geodesic that crosses it most steeply [rad].

    Pi where that geodesic does not lead from inside to outside.
    """
    cloud = attitudes_within(attitude, _RADIUS, _CLOUD)
    margins = evaluator.margins(cloud, branch)
    uphill = rotation_vector_to(attitude, cloud[int(np.argmax(margins))])[0]
    uphill *= _RADIUS / np.linalg.norm(uphill)
    within, beyond = rotated(attitude, uphill), rotated(attitude, -uphill)
    inside, outside = evaluator.keeps(np.vstack([within, beyond]), branch)
    if outside or not inside:
        return float(np.pi)
    (crossing,) = bisect(partial(evaluator.keeps, branch=branch), within, beyond)
    return float(angle_between(crossing, attitude))
