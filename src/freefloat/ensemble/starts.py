"""Arm configurations at the starts of many motions, of all arm branches or the requested one."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from freefloat.ensemble.feasibility import has_wrist_flipped_branches
from freefloat.ensemble.robots import Robots
from freefloat.ensemble.systems import Systems
from freefloat.errors import InputError
from freefloat.ik.chain import Chain
from freefloat.ik.nearest import closest_branches
from freefloat.ik.newton import CONVERGED, Newton
from freefloat.motion.problem import Problem
from freefloat.rotations import Rotation
from freefloat.so3 import Array, BoolArray, IntArray

_REQUESTED = 0.3
"""Distance of an arm branch from requested joints up to which other robots have it, too [rad]."""
_NEWTON_STEPS = 12
"""Largest number of Newton's steps."""
_FAR = 0.3
"""Distance from the start beyond which a configuration may belong to another branch [rad, m]."""


@dataclass(frozen=True, eq=False)
class Starts:
    """Candidates for the arm at the start of each of K motions.

    Attributes:
        joints: Joint values [rad or m], NaN where there is no candidate, shape (K, B, n).
        branches: Numbers of their arm branches, shape (K, B); -1 where there is no candidate.
    """

    joints: Array = field(repr=False)
    branches: IntArray = field(repr=False)

    @property
    def exist(self) -> BoolArray:
        """Where there is a candidate, shape (K, B)."""
        return np.asarray(self.branches >= 0)


def starts_at(
    problem: Problem,
    attitudes: Array,
    branch: int | None = None,
    joints: Array | None = None,
    systems: Systems | None = None,
) -> Starts:
    """The arm at the starts of motions from attitudes.

    Args:
        problem: Robot and path.
        attitudes: Unit quaternions x, y, z, w, shape (K, 4).
        branch: Only the arm branch with this number.
        joints: Only the arm branch nearest to these joint values, shape (n,) or (K, n); of a
            redundant arm, see :func:`~freefloat.ik.nearest.closest_branches`. With neither
            argument all arm branches are candidates.
        systems: Robots and paths of the motions; the problem's when left out.
    """
    if systems is not None and systems.robots is not None:
        return _starts_of_robots(problem, systems, systems.robots, attitudes, branch, joints)
    if branch is not None and joints is not None:
        raise InputError("branch", f"{branch} was given together with joints", "branch or joints")
    offsets = None if systems is None else systems.start_offsets
    return _starts_of_robot(problem, attitudes, branch, joints, offsets)


def _starts_of_robot(
    problem: Problem,
    attitudes: Array,
    branch: int | None,
    joints: Array | None,
    offsets: Array | None = None,
) -> Starts:
    """The arm of the problem's robot at the starts; paths may have offsets, shape (K, 3)."""
    same = offsets is None and len(attitudes) > 1 and bool((attitudes == attitudes[0]).all())
    same &= joints is None or joints.ndim == 1
    if same:
        starts = _starts_of_robot(problem, attitudes[:1], branch, joints)
        every = np.zeros(len(attitudes), dtype=int)
        return Starts(starts.joints[every], starts.branches[every])
    if joints is None:
        sets = problem.many_branches(attitudes, offsets=offsets)
        numbers = np.where(sets.exist, np.arange(sets.names.shape[1]), -1)
        if branch is None:
            if has_wrist_flipped_branches(problem):  # the same motions: the first counts
                numbers[:, 1::2] = np.where(sets.exist[:, ::2], -1, numbers[:, 1::2])
            return Starts(sets.joints, numbers)
        column = slice(branch, branch + 1)
        if not numbers[:, column].size:
            return _none(len(attitudes), problem.dof)
        return Starts(sets.joints[:, column], numbers[:, column])
    poses = problem.poses_seen_from(attitudes, offsets=offsets)
    sets = closest_branches(problem.model_at(), *poses, problem.task, joints)
    rows, columns = np.arange(len(attitudes)), sets.exist.argmax(axis=1)
    numbers = np.where(sets.exist.any(axis=1), columns, -1)
    return Starts(sets.joints[rows, columns][:, None], numbers[:, None])


def _starts_of_robots(
    problem: Problem,
    systems: Systems,
    robots: Robots,
    attitudes: Array,
    branch: int | None,
    joints: Array | None,
) -> Starts:
    """Starts near the starts of the problem's robot; where these lead to none, starts of a model.

    A redundant arm without joints has starts of a model, too: its arm branches are others with
    another robot.
    """
    count, offsets = len(attitudes), systems.start_offsets
    if joints is None and problem.redundant:
        certain, found = np.zeros(count, dtype=bool), _none(count, problem.dof)
    else:
        found = _starts_of_robot(problem, attitudes, branch, joints, offsets)
        begun = found.joints
        if joints is not None and problem.redundant:
            begun = np.broadcast_to(joints[..., None, :], begun.shape)
        q, certain = _near_starts(problem, robots, offsets, attitudes, begun)
        if joints is not None:  # an arm branch that the problem's robot does not have
            certain &= problem.model.joint_distance(begun[:, 0], joints) <= _REQUESTED
        if problem.redundant:
            lower, upper = problem.model.joint_ranges
            certain &= ((q >= lower) & (q <= upper)).all(axis=(1, 2))
        else:
            q = Chain.of(problem.model).into_range(q.T).T
        found = Starts(q, np.where(certain[:, None], found.branches, -1))
    exact = {}
    for k in np.flatnonzero(~certain).tolist():
        near = joints if joints is None or joints.ndim == 1 else joints[k]
        exact[k] = starts_at(systems.path_of(problem, k), attitudes[k : k + 1], branch, near)
    parts = [(slice(count), found), *((slice(k, k + 1), starts) for k, starts in exact.items())]
    width = max(starts.branches.shape[1] for _, starts in parts)
    every = np.full((count, width, problem.dof), np.nan), np.full((count, width), -1)
    for rows, starts in parts:
        columns = starts.branches.shape[1]
        every[0][rows, :columns], every[1][rows, :columns] = starts.joints, starts.branches
    return Starts(*every)


def _near_starts(
    problem: Problem, robots: Robots, offsets: Array | None, attitudes: Array, joints: Array
) -> tuple[Array, BoolArray]:
    """The configurations of robots near joint values (K, B, n), and which robots have all, (K,)."""
    pose = problem.path.pose(0.0)
    rows, columns = np.nonzero(np.isfinite(joints).all(axis=2))
    begun = joints[rows, columns]
    back = Rotation.from_quat(attitudes).as_matrix().swapaxes(1, 2)
    position = np.broadcast_to(pose.position, (len(joints), 3))
    for moved in (robots.offsets, offsets):
        position = position if moved is None else position + moved
    q, near = np.full(joints.shape, np.nan), np.zeros(joints.shape[:2], dtype=bool)
    newton, targets = Newton.of(problem.model, problem.task), (back @ position[..., None])[..., 0]
    posed, properties = (targets, back @ pose.rotation, rows, begun), robots.properties(problem)
    q[rows, columns], residuals = newton.solved(*posed, _NEWTON_STEPS, robots=properties)
    far = np.abs(q[rows, columns] - begun).max(axis=1, initial=0.0) > _FAR
    near[rows, columns] = (residuals < CONVERGED) & ~far
    return q, np.asarray(near.all(axis=1))


def _none(count: int, n: int) -> Starts:
    return Starts(np.full((count, 1, n), np.nan), np.full((count, 1), -1))
