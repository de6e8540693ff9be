"""Configurations of arms without closed form: all of a square arm, a choice of a redundant one's.

Newton's method starts from evenly distributed configurations, for redundant arms from those whose
end-effector poses are close, see :class:`PoseTable`. Arrays of joint values have shape (n, B, K),
NaN where there are fewer than B configurations at one of K poses; positions have shape (3, K),
rotations (3, 3, K).
"""

from __future__ import annotations

from math import tau
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.joint_space import joint_box
from freefloat.dynamics.tasks import Task
from freefloat.ik.chain import SAME, Chain
from freefloat.ik.numeric import APPROACH, approached, many_solutions, newton, refined_solutions
from freefloat.ik.pose_table import PoseTable, sampled_box
from freefloat.ik.vectors import wrapped
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, BoolArray, IntArray

_TRIALS = (slice(2), slice(2, 8))
"""Starts, the closest first, one of which comes near to a pose that is within reach."""
_PASSES = ((48, 20), (160, 48))
"""Numbers of closest configurations, and of well-spread starts among them, for redundant arms."""
_SPARE = 2
"""Configurations that are refined beyond the number wanted."""
_ROUNDS = 16
"""Attempts to move configurations into the joint ranges."""
_INSET = 0.05
"""Fraction of the ranges, at both ends, that these attempts avoid."""
_STARTS = (96, 512)
"""Numbers of starts of square arms, the greater ones where fewer do not suffice."""
_ALIKE = 1e-3
"""Largest joint difference of starts that are taken to lead to the same solution [rad, m]."""
_HITS = 3
"""The search ends when each solution was found this often and their number is even."""

Floats = npt.NDArray[np.floating[Any]]


def isolated_configurations(
    model: FreeFloatingModel, task: Task, positions: Array, rotations: Array, most: int
) -> Array:
    """All configurations of a square arm that are found from many starts, in (-pi, pi].

    Generic solutions come in pairs, which merge at singularities, and each is reached from many
    starts.
    """
    chain = Chain.of(model)
    found = np.full((model.dof, most, positions.shape[1]), np.nan)
    lower, upper = joint_box(model)
    starts = (lower + (upper - lower) * low_discrepancy(_STARTS[-1], model.dof)).T
    pending = np.arange(positions.shape[1])
    q = np.empty((model.dof, 0, len(pending)))
    for count in _STARTS:
        target = _taken(positions, rotations, pending)
        following = np.repeat(starts[:, q.shape[1] : count, None], len(pending), axis=2)
        q = np.concatenate([q, approached(chain, task, *target, following)], axis=1)
        rough, times_reached = distinct_solutions(
            chain.prismatic, q, np.ones(q.shape[1:]), 2 * most, _ALIKE
        )
        refined = refined_solutions(chain, task, *target, rough)
        refined = np.where(chain.prismatic[:, None, None], refined, wrapped(refined))
        found[..., pending], hits = distinct_solutions(
            chain.prismatic, refined, times_reached, most, SAME
        )
        number = (hits > 0).sum(axis=0)
        more = (number < most) & ~found_often(hits)
        pending, q = pending[more], q[..., more]
    return found


def spread_configurations(
    model: FreeFloatingModel, task: Task, positions: Array, rotations: Array, most: int
) -> Array:
    """A reproducible, well-spread set of configurations of a redundant arm at each of many poses.

    At poses where any are found inside the joint ranges, they all are.

    Args:
        model: Robot.
        task: Part of the poses that is prescribed.
        positions: End-effector positions.
        rotations: End-effector rotations.
        most: Largest number of configurations at a pose.

    Returns:
        Joint values, inside the ranges where possible, else in (-pi, pi].
    """
    chain = Chain.of(model)
    q = np.full((model.dof, most + _SPARE, positions.shape[1]), np.nan)
    unlimited = np.array_equal(sampled_box(model), joint_box(model))
    for inside in (True,) if unlimited else (True, False):
        table = PoseTable.of(model, task, inside=inside)
        few = np.isnan(q[0, most - 1]) & (
            inside | (_excess(chain.joint_ranges, q) > 0.0).all(axis=0)
        )
        (pending,) = np.nonzero(few)
        pending = pending[_within_reach(table, *_taken(positions, rotations, pending))]
        for candidates, starts in _PASSES:
            target = _taken(positions, rotations, pending)
            new = _approached_from(table, *target, candidates, starts)
            together = np.concatenate([q.take(pending, axis=2), new], axis=1)
            q[..., pending] = usable(chain.prismatic, chain.joint_ranges, together, q.shape[1])
            pending = pending[np.isnan(q[0, most - 1, pending])]
    q = chain.into_range(refined_solutions(chain, task, positions, rotations, q))
    _move_inside(model, task, positions, rotations, q)
    order = np.lexsort(np.rint(1e6 * q[::-1]), axis=0)
    return usable(
        chain.prismatic, chain.joint_ranges, np.take_along_axis(q, order[None], axis=1), most
    )


def _taken(positions: Array, rotations: Array, index: IntArray) -> tuple[Array, Array]:
    """The poses with some indices; unlike those of indexing with arrays, results are contiguous."""
    return positions.take(index, axis=1), rotations.take(index, axis=2)


def usable(prismatic: BoolArray, ranges: tuple[Array, Array], q: Array, most: int) -> Array:
    """At most that many well-spread configurations, those inside the ranges if there are any."""
    inside = _excess(ranges, q) == 0.0
    return _well_spread(prismatic, np.where(inside | ~inside.any(axis=0), q, np.nan), most)


def _within_reach(table: PoseTable, positions: Array, rotations: Array) -> IntArray:
    """Indices of the poses to which some configurations of a table lead."""
    reached = np.zeros(positions.shape[1], dtype=bool)
    starts = table.nearest(positions, rotations, _TRIALS[-1].stop)
    for trial in _TRIALS:
        (others,) = np.nonzero(~reached)
        target = _taken(positions, rotations, others)
        _, residual = newton(
            table.chain, table.task, *target, starts[:, trial].take(others, axis=2), APPROACH
        )
        reached[others] = (residual <= APPROACH.residual).any(axis=0)
    return np.flatnonzero(reached)


def _approached_from(
    table: PoseTable, positions: Array, rotations: Array, candidates: int, count: int
) -> Array:
    """Approximate configurations reached from well-spread ones of a table's closest candidates."""
    chain, task = table.chain, table.task
    q = table.nearest(positions, rotations, candidates)
    inside = _excess(chain.joint_ranges, chain.into_range(q)) == 0.0
    q = np.where(inside | (inside.sum(axis=0) < count), q, np.nan)
    starts = _well_spread(chain.prismatic, q, count)
    return chain.into_range(approached(chain, task, positions, rotations, starts))


def _excess(ranges: tuple[Array, Array], q: Array) -> Array:
    """Largest distance of joint values from their ranges, infinite for NaN, shape (B, K)."""
    lower, upper = (ends[:, None, None] for ends in ranges)
    excess = np.maximum(np.maximum(lower - q, q - upper), 0.0).max(axis=0)
    return np.where(np.isnan(excess), np.inf, excess)


def _move_inside(
    model: FreeFloatingModel, task: Task, positions: Array, rotations: Array, q: Array
) -> None:
    """Move configurations into the joint ranges at poses where none is inside, where possible."""
    chain = Chain.of(model)
    lower, upper = (ends[:, None, None] for ends in sampled_box(model))
    inset = _INSET * (upper - lower)
    (pending,) = np.nonzero(
        np.isfinite(q[0]).any(axis=0) & (_excess(chain.joint_ranges, q) > 0.0).all(axis=0)
    )
    moved = q.take(pending, axis=2)
    for _ in range(_ROUNDS):
        if not len(pending):
            break
        outside = (moved < chain.lower[:, None, None]) | (moved > chain.upper[:, None, None])
        starts = np.where(outside, np.clip(moved, lower + inset, upper - inset), moved)
        target = _taken(positions, rotations, pending)
        moved = chain.into_range(many_solutions(chain, task, *target, starts))
        done = (_excess(chain.joint_ranges, moved) == 0.0).any(axis=0)
        q[..., pending[done]] = moved[..., done]
        pending, moved = pending[~done], moved[..., ~done]


def _well_spread(prismatic: BoolArray, q: Array, most: int) -> Array:
    """At most that many configurations by farthest-point sampling from the first one."""
    chosen = np.full((len(q), most, q.shape[2]), np.nan)
    rough = q.astype(np.float32)
    distance = np.where(np.isfinite(rough[0]), np.float32(np.inf), -np.inf)
    poses, farthest = np.arange(q.shape[2]), np.argmax(distance, axis=0)
    for column in range(min(most, q.shape[1])):
        new = distance[farthest, poses] >= SAME
        if not new.any():
            break
        chosen[:, column, new] = q[:, farthest[new], poses[new]]
        centre = np.take_along_axis(rough, farthest[None, None], axis=1)
        distance = np.fmin(distance, _joint_distance(prismatic, rough, centre))
        farthest = np.argmax(distance, axis=0)
    return chosen


def distinct_solutions(
    prismatic: BoolArray, q: Array, hits: Array, most: int, tolerance: float
) -> tuple[Array, Array]:
    """At most that many different configurations, and the sums of their hits, shape (most, K)."""
    different = np.full((len(q), most, q.shape[2]), np.nan)
    total = np.zeros(different.shape[1:])
    others, poses = np.isfinite(q[0]), np.arange(q.shape[2])
    for column in range(most):
        first = np.argmax(others, axis=0)
        new = others[first, poses]
        if not new.any():
            break
        different[:, column, new] = q[:, first[new], poses[new]]
        distance = _joint_distance(prismatic, q, different[:, column, None])
        same = others & (distance <= tolerance)
        total[column] = np.where(same, hits, 0.0).sum(axis=0)
        others &= ~same
    return different, total


def found_often(hits: Array) -> BoolArray:
    """Whether solutions with hits (B, K) are all: each was found often, their number is even."""
    often = ((hits == 0) | (hits >= _HITS)).all(axis=0)
    return np.asarray(often & ((hits > 0).sum(axis=0) % 2 == 0))


def _joint_distance(prismatic: BoolArray, first: Floats, second: Floats) -> Floats:
    """Largest differences (B, K) of joint values, modulo 2 pi for revolute joints."""
    difference = first - second
    revolutions = np.rint(difference * first.dtype.type(1.0 / tau))
    revolutions[prismatic] = 0.0
    difference -= first.dtype.type(tau) * revolutions
    return np.asarray(np.abs(difference).max(axis=0))
