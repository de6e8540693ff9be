"""Paths from which a search begins: random ones, and straight ways to arm branches at the goal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from freefloat.beyond.missions.goals.relaxation import Relaxation, TermWeights
from freefloat.ik.branches import many_arm_branches
from freefloat.ik.nearest import newton_solutions, toward
from freefloat.so3 import Array

_RANDOM = 300
"""Random paths, of which those that end nearest to the goal are kept."""
_WIDEST = 1.5
"""Largest amplitude of a random deviation, but for its harmonics [rad, m]."""
_ATTITUDES, _ROUNDS = 16, 6
"""Attitudes at the ends of random paths whose arm branches are looked at, and how often the
attitude at the end of a straight way changes its arm branch."""
_MOST_BRANCHES, _APART = 8, 0.01
"""Most straight ways, and least difference of their ends [rad, m]."""
_FOLLOWED = 32
"""Most arm branches that are followed to the attitudes at which their straight ways end."""
_CONFIGURATIONS, _DISTINCT = 1024, 0.3
"""Random configurations from which Newton's method leads a redundant arm to the goal's pose where
its arm branches violate a limit there, and least difference of ends [rad, m]."""
_ERROR, _TIME = 3.0, 0.05
"""Weights of the error at the end [1/rad, 1/m] and of the duration over half a turn's duration."""
_MEAN_SQUARE, _LOOK = TermWeights(1.0, 0.0), TermWeights(1.0, 1.0)
_COMPARED_RESIDUAL = 1e-2
"""Residual of the end with which random paths are compared [rad, m]."""
_CLOSED_PER_START = 2
"""Random paths that are moved onto the goal for each of the most promising paths."""


def starts(relaxation: Relaxation, rng: np.random.Generator, most: int) -> Iterator[Array]:
    """Unknowns of paths that end at the goal, the most promising of random ones last.

    Args:
        relaxation: The family of paths and the goal.
        rng: Generator of the random paths.
        most: Most random paths.
    """
    paths = relaxation.paths
    blank = np.append(np.zeros((paths.rows, paths.joint_count)), 1.0)
    random = [random_path(relaxation, rng) for _ in range(_RANDOM)]
    random.sort(key=lambda unknowns: _promise(relaxation, unknowns))
    ends = _branches(relaxation, random[:_ATTITUDES])
    candidates = [_with_end(relaxation, blank, joints) for joints in ends]
    if not any(_keeps_end(relaxation, unknowns) for unknowns in candidates):
        ways = (_with_end(relaxation, blank, joints) for joints in _redundant(relaxation, rng))
        kept = (unknowns for unknowns in ways if _keeps_end(relaxation, unknowns))
        candidates = list(islice(kept, _MOST_BRANCHES)) or candidates
    if paths.ends.end is not None and not paths.closed:
        candidates.append(blank)
    yield from (relaxation.with_duration(unknowns) for unknowns in candidates)
    looked_at = []
    for unknowns in map(relaxation.with_duration, random[: _CLOSED_PER_START * most]):
        closed = relaxation.closed(unknowns, _MEAN_SQUARE, accuracy=_COMPARED_RESIDUAL)
        if closed is not None:  # the path comes to the goal
            looked_at.append(relaxation.linearized(relaxation.with_duration(closed), _LOOK))
    for path in sorted(looked_at, key=lambda path: path.promise)[:most]:
        yield path.course.unknowns


def _promise(relaxation: Relaxation, unknowns: Array) -> float:
    course = relaxation.course(unknowns, 0)
    error = float(np.linalg.norm(relaxation.target.error(relaxation.paths, course)))
    half_turn = np.pi / float(relaxation.joint_rate.mean())
    return _ERROR * error + _TIME * course.duration * relaxation.usage(course) / half_turn


def random_path(relaxation: Relaxation, rng: np.random.Generator) -> Array:
    """A path with two random harmonics of the joints and, where it is free, a random end."""
    paths, ranges = relaxation.paths, relaxation.ranges
    n, half = paths.joint_count, np.minimum(np.diff(ranges, axis=0)[0] / 2.0, np.pi)
    count = paths.inner
    phase = 2.0 * np.pi * (np.arange(count) + 1.0) / (count + 1.0)
    series = np.zeros((count, n))
    for k in (1, 2):
        series += np.outer(1.0 - np.cos(k * phase), rng.normal(size=n)) / (2.0 * k)
        series += np.outer(np.sin(k * phase), rng.normal(size=n)) / k
    series *= rng.uniform(0.0, 0.5) * np.minimum(half, _WIDEST)
    rows = np.zeros((paths.rows, n))
    rows[:count] = series
    unknowns = np.append(rows, relaxation.reference)
    if paths.ends.end is not None:
        return unknowns
    end = paths.ends.start + rng.normal(size=n) * half * rng.uniform(0.1, 0.7)
    return _with_end(relaxation, unknowns, np.clip(end, *ranges))


def _with_end(relaxation: Relaxation, unknowns: Array, joints: Array) -> Array:
    """Unknowns whose path ends at joints (n,)."""
    n, row = relaxation.paths.joint_count, relaxation.paths.inner
    changed = unknowns.copy()
    changed[n * row : n * (row + 1)] = joints
    return changed


def _branches(relaxation: Relaxation, others: Sequence[Array]) -> list[Array]:
    """Ends (n,) of straight ways to the goal's pose, the shortest first.

    They are the arm branches at the goal's attitude or, where this is free, at the present one and
    attitudes at the ends of other paths, each followed to the attitude where its straight way ends.
    """
    paths, target = relaxation.paths, relaxation.target
    model, start, task = target.setting.model, paths.ends.start, target.task
    if paths.ends.end is not None or target.pose is None or task is None:
        return []
    blank = np.append(np.zeros((paths.rows, len(start))), relaxation.reference)
    attitudes = [relaxation.attitude if target.attitude is None else target.attitude]
    if target.attitude is None:
        attitudes += [relaxation.course(other, 0).attitudes[-1] for other in others]
    branches = many_arm_branches(model, *_seen(relaxation, np.array(attitudes)), task)
    ends = toward(model, branches.joints.reshape(-1, len(start)), start)
    ends = np.array(_distinct(relaxation, ends, _DISTINCT)[:_FOLLOWED]).reshape(-1, len(start))
    for _ in range(_ROUNDS if target.attitude is None else 0):
        if not len(ends):
            break
        courses = (relaxation.course(_with_end(relaxation, blank, end), 0) for end in ends)
        reached = np.array([course.attitudes[-1] for course in courses])
        ends = newton_solutions(model, *_seen(relaxation, reached), task, ends)
        ends = ends[np.isfinite(ends).all(axis=1)]
    return _distinct(relaxation, ends, _APART)[:_MOST_BRANCHES]


def _redundant(relaxation: Relaxation, rng: np.random.Generator) -> list[Array]:
    """Ends (n,) of a redundant arm at the goal's pose, anywhere in the joint ranges.

    They hold at the attitude at the start, unless the goal has one.
    """
    target, (low, high) = relaxation.target, relaxation.ranges
    model, task = target.setting.model, target.task
    if target.pose is None or task is None or model.dof <= len(task.rows):
        return []
    attitude = relaxation.attitude if target.attitude is None else target.attitude
    attitudes = np.tile(attitude, (_CONFIGURATIONS, 1, 1))
    samples = rng.uniform(low, high, (_CONFIGURATIONS, len(low)))
    ends = newton_solutions(model, *_seen(relaxation, attitudes), task, samples)
    return _distinct(relaxation, ends[np.isfinite(ends).all(axis=1)], _DISTINCT)


def _distinct(relaxation: Relaxation, ends: Array, apart: float) -> list[Array]:
    """Ends, of (K, n), inside the ranges and apart from nearer ones, the nearest first."""
    start, (low, high) = relaxation.paths.ends.start, relaxation.ranges
    distinct: list[Array] = []
    for end in ends[np.argsort(np.abs(ends - start).max(axis=1))]:
        if all(np.abs(end - other).max() > apart for other in distinct):
            distinct += [end] if (end >= low).all() and (end <= high).all() else []
    return distinct


def _keeps_end(relaxation: Relaxation, unknowns: Array) -> bool:
    """Whether the end of a path keeps the limits of shapes."""
    paths = replace(relaxation.paths, fineness=1)
    course = replace(relaxation, paths=paths).course(relaxation.with_duration(unknowns), 1)
    relaxation.effort.take(paths.intervals)
    found = [shape.violations(paths, course) for shape in relaxation.shapes]
    return not any(
        (violations.amounts[violations.edges == paths.intervals] > 0.0).any()
        for violations in found
    )


def _seen(relaxation: Relaxation, attitudes: Array) -> tuple[Array, Array]:
    """The goal's pose in spacecraft frames (K, 3, 3), positions (K, 3) and rotations (K, 3, 3)."""
    pose, back = relaxation.target.pose_at(relaxation.reference), attitudes.transpose(0, 2, 1)
    return back @ pose.position, back @ pose.rotation
