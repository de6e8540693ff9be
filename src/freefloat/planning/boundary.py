"""The boundary of the feasible attitudes, by bisection and, where it is known exactly, by touches.

A motion that touches the margin surface and keeps clear of it elsewhere begins on the boundary. So
touch points, which come from equations alone, check what bisection between samples finds.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.problem import is_kept
from freefloat.planning.attitude_map import AttitudeMap, BoundaryPoint
from freefloat.planning.tangency import boundary_attitude, tangency_family
from freefloat.so3 import (
    Array,
    angle_between,
    attitudes_within,
    grid_spacing,
    rotation_vector_to,
    turned,
)

_PARTS = 8
ROUGH, EXACT = 3, 6
"""Rounds of dividing a way into parts: to 0.2 percent of it, to 4e-6."""
_BESIDE = 0.02
"""How far from a touched attitude both sides of the boundary are looked for [rad]."""
_LOOKS = 96
_BATCHES, _SPARE = 8, 3
"""Families of touch points that are asked for, and how many more than are missing: many are twins
or spoiled by other parts of their motion."""

Inside = Callable[[Array], npt.NDArray[np.bool_]]


def bisected(inside: Inside, within: Array, beyond: Array, rounds: int = EXACT) -> Array:
    """Where geodesics from attitudes inside a set to others outside leave it, just inside.

    Args:
        inside: Tells which attitudes (K, 4) belong to the set.
        within: Attitudes inside, shape (K, 4).
        beyond: Attitudes outside, shape (K, 4).
        rounds: Each leaves an eighth of the way.

    Returns:
        Shape (K, 4).
    """
    turns, low, share = rotation_vector_to(within, beyond), np.zeros(len(within)), 1.0
    looks = np.arange(1, _PARTS) / _PARTS
    for _ in range(rounds):
        places = low[:, None] + share * looks
        stays = inside(
            turned(np.repeat(within, len(looks), axis=0),
                   (places[:, :, None] * turns[:, None]).reshape(-1, 3))
        ).reshape(places.shape)  # fmt: skip
        share /= _PARTS
        low = low + share * np.where(stays.all(axis=1), len(looks), np.argmin(stays, axis=1))
    return turned(within, low[:, None] * turns)


def boundary_points(
    outlook: FeasibilityEvaluator, found: AttitudeMap, count: int
) -> tuple[BoundaryPoint, ...]:
    """Attitudes where the margin is just kept, by bisection between neighbouring samples.

    Args:
        outlook: Of the same problem.
        found: The map.
        count: How many for each arm branch, evenly picked among all pairs of neighbours.
    """
    value, points = found.problem.margin.threshold, list[BoundaryPoint]()
    for branch, margins in found.branch_margins():
        inside = partial(outlook.keeps, branch=branch)
        edge_ = edge(inside, found.attitudes, is_kept(margins, value), count, EXACT)
        points += [BoundaryPoint(attitude, branch) for attitude in edge_]
    return tuple(points)


def edge(
    inside: Inside,
    attitudes: Array,
    feasible: npt.NDArray[np.bool_],
    count: int,
    rounds: int,
) -> Array:
    """Attitudes on the boundary of a set, just inside, by bisection between neighbouring samples.

    Args:
        inside: Tells which attitudes (K, 4) belong to the set.
        attitudes: Samples, shape (N, 4).
        feasible: Which of them belong to it, shape (N,).
        count: How many pairs of neighbours to look between, evenly picked.
        rounds: As for :func:`bisected`.

    Returns:
        Shape (K, 4).
    """
    if feasible.all() or not feasible.any():
        return np.empty((0, 4))
    within, beyond = attitudes[feasible], attitudes[~feasible]
    chord, other = cKDTree(np.vstack([beyond, -beyond])).query(within)
    (close,) = np.nonzero(4.0 * np.arcsin(chord / 2.0) < 1.5 * grid_spacing(len(feasible)))
    picked = close[np.linspace(0, len(close) - 1, min(count, len(close))).astype(int)]
    return bisected(inside, within[picked], beyond[other[picked] % len(beyond)], rounds)


def tangent_boundary(
    outlook: FeasibilityEvaluator, count: int, seed: int = 0, progress: Progress | None = None
) -> tuple[BoundaryPoint, ...]:
    """Attitudes of the boundary carried back from touch points, and how bisection agrees with them.

    Args:
        outlook: Of a problem whose arm has an elbow and a spherical wrist.
        count: How many, of twin branches the first alone; fewer are found where few touches are
            unspoiled.
        seed: Shifts the family of touch points.
        progress: Called with the share done, in [0, 1].

    Raises:
        InputError: If the arm has no such touch points, or the margin is zero.
    """
    problem, points = outlook.problem, list[BoundaryPoint]()
    for batch in range(_BATCHES):
        for touch in tangency_family(problem, _SPARE * (count - len(points)), seed + batch):
            if len(points) == count:
                break
            start = boundary_attitude(problem, touch)
            if start is None:
                continue
            branches = problem.branches(start.attitude)
            branch = problem.branch_near(start.attitude, start.joints, branches).index
            if outlook.wrist_flipped and branch % 2:
                continue  # its twin tells the same
            gap = _gap(outlook, start.attitude, branch)
            points.append(BoundaryPoint(start.attitude, branch, gap))
            if progress is not None:
                progress(len(points) / count)
        if len(points) == count:
            break
    return tuple(points)


def _gap(outlook: FeasibilityEvaluator, attitude: Array, branch: int) -> float:
    """How far from an attitude the boundary is met on the line that crosses it most steeply.

    Half a turn where that line does not lead from inside to outside.
    """
    around = attitudes_within(attitude, _BESIDE, _LOOKS)
    margins = outlook.margins(around, branch)
    uphill = rotation_vector_to(attitude, around[int(np.argmax(margins))])[0]
    uphill *= _BESIDE / np.linalg.norm(uphill)
    within, beyond = turned(attitude, uphill), turned(attitude, -uphill)
    inside, outside = outlook.keeps(np.vstack([within, beyond]), branch)
    if outside or not inside:
        return float(np.pi)
    (edge_,) = bisected(partial(outlook.keeps, branch=branch), within, beyond)
    return float(angle_between(edge_, attitude))
