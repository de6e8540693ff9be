"""The whole of SO(3): how near to a singularity every initial attitude leads, branch by branch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from freefloat.brief import brief
from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import (
    UNREACHED,
    BranchOutcomes,
    FeasibilityEvaluator,
    clear,
    has_wrist_flipped_branches,
)
from freefloat.ensemble.kernels.integration import COMPLETED
from freefloat.errors import InputError
from freefloat.motion.problem import Problem, is_kept
from freefloat.so3 import Array, attitude_grid, frozen, grid_spacing, whole_number

_BLOCK = 2048
"""Attitudes followed between two writes."""
_NEIGHBOURS = 14
"""About as many samples lie within one and a half spacings of another."""
_FEWEST = 8


@dataclass(frozen=True, eq=False)
class AttitudeMap:
    """S_min over initial attitudes.

    Attributes:
        problem: What was asked.
        seed: Of the grid.
        attitudes: Evenly spread, quaternions x, y, z, w, shape (N, 4).
        least: Smallest magnitude of the measure, zero where the motion becomes singular or there is
            no such arm branch, shape (N, B).
        determinant_ratios: Smallest over largest magnitude of det S* on the way, shape (N, B).
        endings: Codes as in :class:`~freefloat.ensemble.ensemble.Ensemble`; -1: no such branch,
            shape (N, B).
    """

    __repr__ = brief

    problem: Problem
    seed: int
    attitudes: Array
    least: Array
    determinant_ratios: Array
    endings: npt.NDArray[np.int8]

    @property
    def margins(self) -> Array:
        """``least``, and zero for motions that do not complete, shape (N, B)."""
        return np.where(self.endings == COMPLETED, self.least, 0.0)

    @property
    def kept(self) -> npt.NDArray[np.bool_]:
        """Where the margin is kept, shape (N, B)."""
        return self.problem.margin.is_kept(self.margins)

    @property
    def motions(self) -> int:
        """Number of motions followed."""
        return int((self.endings != UNREACHED).sum())

    @property
    def feasible_fraction(self) -> float:
        """Share of the attitudes from which at least one arm branch keeps the margin."""
        return float(self.kept.any(axis=1).mean())

    @property
    def feasible_fraction_error(self) -> float:
        """Standard error of :attr:`feasible_fraction` had the samples been drawn at random.

        They are spread more evenly than that, so the error is smaller.
        """
        p = self.feasible_fraction
        return float(np.sqrt(p * (1.0 - p) / len(self.attitudes)))

    @property
    def motion_fraction(self) -> float:
        """Share of the motions that keep the margin."""
        return float(self.kept.sum() / max(1, self.motions))

    def safe(self, branch: int | None) -> npt.NDArray[np.bool_]:
        """Where a branch, or any, keeps the margin and stays clear of all singularities, (N,)."""
        good = self.kept & clear(self.determinant_ratios)
        return np.asarray(good.any(axis=1) if branch is None else good[:, branch])

    def families(self) -> list[tuple[int | None, Array]]:
        """Arm branches that vary smoothly with the attitude, and the margin that each keeps (N,).

        Those of a redundant arm do not: they are one family without a number, the best of all. Of
        twins, which share their motions, only the first is told.
        """
        margins = self.margins
        if self.problem.redundant:
            return [(None, margins.max(axis=1, initial=0.0))]
        reached = np.flatnonzero((self.endings != UNREACHED).any(axis=0))
        step = 2 if has_wrist_flipped_branches(self.problem) else 1
        return [(int(branch), margins[:, branch]) for branch in reached if branch % step == 0]


@dataclass(frozen=True, eq=False)
class Region:
    """Attitudes that hang together and keep the margin with one arm branch.

    Attributes:
        branch: Number of the branch; None for the best of a redundant arm.
        fraction: Share of SO(3).
        error: Its standard error.
        centre: The sample farthest from those that do not keep the margin, x, y, z, w.
        depth: How far that is [rad].
    """

    __repr__ = brief

    branch: int | None
    fraction: float
    error: float
    centre: Array
    depth: float


def map_attitudes(
    outlook: FeasibilityEvaluator | Problem,
    samples: int,
    seed: int = 0,
    *,
    progress: Progress | None = None,
    sink: Callable[[BranchOutcomes], None] | None = None,
) -> AttitudeMap:
    """Follow the path from attitudes spread over all of SO(3), with every arm branch.

    Args:
        outlook: Of a spatial problem, or that problem.
        samples: Number of attitudes.
        seed: Turns the grid of attitudes.
        progress: Called with the share done, in [0, 1].
        sink: Receives every block of attitudes when it is done.

    Raises:
        InputError: If it is neither, the task is planar, or the samples are too few or not whole.
    """
    if not isinstance(outlook, FeasibilityEvaluator):
        outlook = FeasibilityEvaluator(outlook)
    problem = outlook.problem
    if problem.task.planar:
        raise InputError("task", f"{problem.task} was given", "pose or position")
    samples = whole_number("samples", samples, _FEWEST)
    seed = whole_number("seed", seed, 0)
    attitudes = attitude_grid(samples, seed)
    least, determinant_ratios, endings = [], [], []
    for first in range(0, samples, _BLOCK):
        block = attitudes[first : first + _BLOCK]
        share = len(block) / samples

        def report(part: float, done: float = first / samples, share: float = share) -> None:
            if progress is not None:
                progress(done + share * part)

        found = outlook.prospects(block, progress=report)
        least.append(found.least)
        determinant_ratios.append(found.determinant_ratios)
        endings.append(found.endings)
        if sink is not None:
            sink(found)
    ended = np.concatenate(endings)
    ended.setflags(write=False)
    return AttitudeMap(
        problem, seed, frozen(attitudes), frozen(np.concatenate(least)),
        frozen(np.concatenate(determinant_ratios)), ended,
    )  # fmt: skip


def branch_names(found: AttitudeMap) -> dict[int | None, str]:
    """What the arm branches that exist somewhere are called, by number.

    Those of a redundant arm have no names: all together are one, without a number.
    """
    if found.problem.redundant:
        return {None: "any"}
    reached, names = found.endings != UNREACHED, dict[int, str]()
    for index in np.flatnonzero(reached.any(axis=0)):
        if int(index) not in names:
            somewhere = found.attitudes[int(np.argmax(reached[:, index]))]
            branches = found.problem.branches(somewhere)
            names |= {one.index: one.label for one in branches if one.index not in names}
    return dict(sorted(names.items()))


def depths(attitudes: Array, inside: npt.NDArray[np.bool_]) -> Array:
    """Angle [rad] from each attitude inside to the nearest outside, pi if there is none; (K,)."""
    if inside.all():
        return np.full(len(attitudes), np.pi)
    outside = attitudes[~inside]
    chord, _ = cKDTree(np.vstack([outside, -outside])).query(attitudes[inside])
    found = np.zeros(len(attitudes))
    found[inside] = 4.0 * np.arcsin(np.minimum(chord / 2.0, 1.0))
    return found


def regions(found: AttitudeMap) -> list[Region]:
    """The connected parts of the feasible attitudes, by arm branch, the largest first.

    Samples hang together when they are among each other's nearest and not farther apart than one
    and a half times the grid's spacing; what is narrower than that may be cut or joined.
    """
    N, value = len(found.attitudes), found.problem.margin.threshold
    parts = []
    for branch, margins in found.families():
        inside = is_kept(margins, value)
        if not inside.any():
            continue
        depth = depths(found.attitudes, inside)
        members, own = found.attitudes[inside], depth[inside]
        labels = _components(members, 1.5 * grid_spacing(N))
        for label in range(labels.max() + 1):
            (chosen,) = np.nonzero(labels == label)
            deepest = chosen[np.argmax(own[chosen])]
            share = len(chosen) / N
            parts.append(Region(
                branch, share, float(np.sqrt(share * (1.0 - share) / N)),
                frozen(members[deepest]), float(own[deepest]),
            ))  # fmt: skip
    return sorted(parts, key=lambda part: -part.fraction)


def _components(attitudes: Array, radius: float) -> npt.NDArray[np.int32]:
    """Number of the connected part that each attitude belongs to."""
    K = len(attitudes)
    both = np.vstack([attitudes, -attitudes])
    chord, other = cKDTree(both).query(attitudes, k=min(_NEIGHBOURS + 1, 2 * K))
    near = chord < 2.0 * np.sin(radius / 4.0)
    mine = np.broadcast_to(np.arange(K)[:, None], near.shape)[near]
    theirs = other[near] % K
    graph = coo_array((np.ones(len(mine), dtype=np.int8), (mine, theirs)), shape=(K, K))
    return np.asarray(connected_components(graph, directed=False)[1])
