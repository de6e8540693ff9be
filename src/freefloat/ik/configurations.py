"""Configurations of arms without closed form: all of a square arm, a choice of a redundant one's.

Newton's method starts from evenly distributed configurations, for redundant arms from those whose
end-effector poses are close, see :class:`PoseTable`. Arrays of joint values have shape (n, B, K),
NaN where there are fewer than B configurations at one of K poses; positions have shape (K, 3),
rotations (K, 3, 3).
"""

from __future__ import annotations

from collections.abc import Callable
from math import tau

import numpy as np

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.joint_space import joint_box
from freefloat.dynamics.tasks import Task
from freefloat.ik.chain import SAME, Chain, wrapped
from freefloat.ik.newton import Newton, PoseTable, sampled_box
from freefloat.ik.numbering import sorted_joints
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, BoolArray, IntArray

_NEWTON_STEPS, _PATIENCE = 30, 3
"""Largest number of Newton's steps from one of many starts, and of consecutive steps that hardly
reduce the residual."""
_PASSES = ((48, 20), (160, 48))
"""Numbers of closest configurations, and of well-spread starts among them, for redundant arms."""
_ROUNDS = 16
"""Attempts to move configurations into the joint ranges."""
_INSET = 0.05
"""Fraction of the ranges, at both ends, that these attempts avoid."""
_STARTS = (96, 512)
"""Numbers of starts of square arms, the greater ones where fewer do not suffice."""
_HITS = 3
"""The search ends when each solution was found this often and their number is even."""


def isolated_configurations(
    model: FreeFloatingModel, task: Task, positions: Array, rotations: Array, most: int
) -> Array:
    """All configurations of a square arm that are found from many starts, in (-pi, pi]."""
    newton, prismatic = Newton.of(model, task), model.prismatic[:, None, None]

    def solved(poses: IntArray, starts: Array) -> Array:
        q = newton.solutions(
            positions[poses], rotations[poses], starts, _NEWTON_STEPS, patience=_PATIENCE
        )
        return np.where(prismatic, q, wrapped(q))

    return all_from_starts(model, _STARTS, len(positions), most, solved)


def all_from_starts(
    model: FreeFloatingModel, counts: tuple[int, ...], poses: int, most: int,
    solved: Callable[[IntArray, Array], Array],
) -> Array:  # fmt: skip
    """At most that many configurations at each of so many poses, from evenly distributed starts.

    Generic solutions come in pairs, which merge at singularities, and each is reached from many
    starts.

    Args:
        model: Robot.
        counts: Numbers of starts, greater ones where fewer do not suffice.
        poses: Number of poses.
        most: Largest number of configurations at a pose.
        solved: Gives the configurations to which starts (n, B, K) lead at K of the poses.
    """
    lower, upper = joint_box(model)
    starts = (lower + (upper - lower) * low_discrepancy(counts[-1], len(lower))).T
    found, pending = np.full((len(lower), most, poses), np.nan), np.arange(poses)
    q = np.empty((len(lower), 0, poses))
    for count in counts:
        following = np.repeat(starts[:, q.shape[1] : count, None], len(pending), axis=2)
        q = np.concatenate([q, solved(pending, following)], axis=1)
        found[..., pending], hits = distinct_solutions(model.prismatic, q, most)
        more = ~found_often(hits)
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
    chain, newton = Chain.of(model), Newton.of(model, task)
    q = np.full((model.dof, most, len(positions)), np.nan)
    unlimited = np.array_equal(sampled_box(model), joint_box(model))
    for inside in (True,) if unlimited else (True, False):
        table = PoseTable.of(model, task, inside=inside)
        few = np.isnan(q[0, most - 1]) & (inside | (_excess(chain, q) > 0.0).all(axis=0))
        (pending,) = np.nonzero(few)
        for candidates, count in _PASSES:
            target = positions[pending], rotations[pending]
            starts = _starts(table, *target, candidates, count)
            new = newton.solutions(*target, starts, _NEWTON_STEPS, patience=_PATIENCE)
            together = np.concatenate([q.take(pending, axis=2), chain.into_range(new)], axis=1)
            q[..., pending] = usable(chain, together, most)
            pending = pending[np.isnan(q[0, most - 1, pending]) & np.isfinite(q[0, 0, pending])]
    _move_inside(newton, positions, rotations, q)
    return usable(chain, sorted_joints(q), most)


def _starts(
    table: PoseTable, positions: Array, rotations: Array, candidates: int, count: int
) -> Array:
    """Well-spread configurations of a table's closest candidates."""
    chain = table.chain
    q = table.nearest(positions, rotations, candidates)
    inside = _excess(chain, chain.into_range(q)) == 0.0
    q = np.where(inside | (inside.sum(axis=0) < count), q, np.nan)
    return _well_spread(chain, q, count)


def usable(arm: Chain | FreeFloatingModel, q: Array, most: int) -> Array:
    """At most that many well-spread configurations, those inside the ranges if there are any."""
    inside = _excess(arm, q) == 0.0
    return _well_spread(arm, np.where(inside | ~inside.any(axis=0), q, np.nan), most)


def _excess(arm: Chain | FreeFloatingModel, q: Array) -> Array:
    """Largest distance of joint values from their ranges, infinite for NaN, shape (B, K)."""
    lower, upper = (ends[:, None, None] for ends in arm.joint_ranges)
    excess = np.maximum(lower - q, q - upper).max(axis=0)
    return np.where(np.isnan(excess), np.inf, np.maximum(excess, 0.0))


def _move_inside(newton: Newton, positions: Array, rotations: Array, q: Array) -> None:
    """Move configurations into the joint ranges at poses where none is inside, where possible."""
    chain = Chain.of(newton.model)
    lower, upper = (ends[:, None, None] for ends in sampled_box(newton.model))
    inset = _INSET * (upper - lower)
    excess = _excess(chain, q)
    (pending,) = np.nonzero(np.isfinite(excess).any(axis=0) & (excess > 0.0).all(axis=0))
    moved = q.take(pending, axis=2)
    for _ in range(_ROUNDS):
        if not len(pending):
            break
        first, last = (ends[:, None, None] for ends in chain.joint_ranges)
        outside = (moved < first) | (moved > last)
        starts = np.where(outside, np.clip(moved, lower + inset, upper - inset), moved)
        target = positions[pending], rotations[pending]
        moved = chain.into_range(
            newton.solutions(*target, starts, _NEWTON_STEPS, patience=_PATIENCE)
        )
        done = (_excess(chain, moved) == 0.0).any(axis=0)
        q[..., pending[done]] = moved[..., done]
        pending, moved = pending[~done], moved[..., ~done]


def _well_spread(arm: Chain | FreeFloatingModel, q: Array, most: int) -> Array:
    """At most that many configurations by farthest-point sampling from the first one."""
    from freefloat.ik.kernels import spread  # Numba imports slowly

    chosen = np.full((len(q), most, q.shape[2]), np.nan)
    spread(np.array(arm.prismatic), np.array(q, order="C"), SAME, chosen)
    return chosen


def distinct_solutions(prismatic: BoolArray, q: Array, most: int) -> tuple[Array, Array]:
    """At most that many different configurations, and how often each is there, (most, K)."""
    different = np.full((len(q), most, q.shape[2]), np.nan)
    total = np.zeros(different.shape[1:])
    remaining, poses = np.isfinite(q[0]), np.arange(q.shape[2])
    for column in range(most):
        first = np.argmax(remaining, axis=0)
        new = remaining[first, poses]
        if not new.any():
            break
        different[:, column, new] = q[:, first[new], poses[new]]
        difference = q - different[:, column, None]
        revolutions = np.where(prismatic[:, None, None], 0.0, np.rint(difference / tau))
        same = remaining & (np.abs(difference - tau * revolutions).max(axis=0) <= SAME)
        total[column] = same.sum(axis=0)
        remaining &= ~same
    return different, total


def found_often(hits: Array) -> BoolArray:
    """Whether solutions with hits (B, K) are all: each was found often, their number is even."""
    often = ((hits == 0) | (hits >= _HITS)).all(axis=0)
    return np.asarray(often & ((hits > 0).sum(axis=0) % 2 == 0))
