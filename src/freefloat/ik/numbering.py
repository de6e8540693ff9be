"""Order, numbers, names and labels of the arm branches at many poses."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.tasks import Task, task_rows
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ik.chain import Chain, cross, dot
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray

MAX_BRANCHES = 16
"""Maximum number of branches at a pose: an arm with six revolute joints can have as many."""
_ROUNDING = 1e-9
"""Magnitude of what decides an elbow's or a wrist's sign that is a rounding error [m^2 or 1]."""


def numbered_branches(model: FreeFloatingModel, task: Task, q: Array) -> tuple[Array, IntArray]:
    """The branches at each pose in columns by number.

    Branches of square arms are numbered in lexicographic order of their first six decimals, by the
    sign pattern of six revolute joints, otherwise by the sign of the Jacobian's determinant.
    Branches of redundant arms keep their order.

    Args:
        model: Robot.
        task: Part of the poses that is prescribed.
        q: Joint values of B branches at K poses, revolute joints in (-pi, pi], NaN where there are
            fewer, shape (n, B, K).

    Returns:
        Joint values in the joint ranges, NaN where a branch does not exist, shape
        (K, MAX_BRANCHES, n), and names, -1 where it does not, shape (K, MAX_BRANCHES).
    """
    square = len(q) == len(task.rows)
    if square:
        q = sorted_joints(q)
    exist = np.asarray(np.isfinite(q).all(axis=0))
    names = np.where(exist, np.arange(len(exist))[:, None], -1)
    columns = names
    if square:
        virtual = VirtualManipulator.of(model)
        placed = virtual.kinematics(q[:, exist].T)
        velocities = virtual.velocities(q[:, exist].T, placed)
        negative = np.linalg.det(_jacobians(model, task, placed[1], *velocities)) < 0.0
        if len(q) == 6 and not virtual.prismatic.any():
            names[exist] = sign_patterns(*placed[2:], negative)
        else:
            names = numbers_by_sign(exist, negative)
        columns = columns_by_name(names)
    joints = np.full((q.shape[2], MAX_BRANCHES, len(q)), np.nan)
    names_by_column = np.full(joints.shape[:2], -1)
    place = np.nonzero(exist)[1], columns[exist]
    joints[place], names_by_column[place] = Chain.of(model).into_range(q[:, exist]).T, names[exist]
    return joints, names_by_column


def sorted_joints(q: Array) -> Array:
    """Joint values (n, B, K) in lexicographic order of their first six decimals."""
    return np.take_along_axis(q, np.lexsort(np.rint(1e6 * q[::-1]), axis=0)[None], axis=1)


def _jacobians(
    model: FreeFloatingModel, task: Task, rotations: Array, linear: Array, angular: Array
) -> Array:
    """The task's rows of the virtual manipulator's Jacobians (N, m, n).

    Arguments are rotations of the end-effector (N, 3, 3), and what
    :meth:`.VirtualManipulator.velocities` returns.
    """
    if task is Task.POINTING:  # along the end-effector's axes
        angular = np.einsum("nki,kij->nkj", angular, rotations)
    twists = np.moveaxis(np.concatenate([linear, angular], axis=-1), -1, 0)
    return task_rows(model, task, twists).transpose(2, 0, 1)


def sign_patterns(points: Array, axes: Array, negative: npt.NDArray[np.bool_]) -> IntArray:
    """Numbers (N,) of the signs (shoulder, elbow, wrist) of six revolute joints.

    Points and axes of the joints have shape (6, N, 3). The elbow sign is the sign of the elbow
    angle, the wrist sign the sign of the fifth joint, positive for arms that have none, such as an
    arm whose third joint turns the upper arm about its length; the shoulder sign makes the product
    of all three the sign of the Jacobian's determinant, so that signs change at singularities only.
    """
    p, h = np.moveaxis(points, -1, 1), np.moveaxis(axes, -1, 1)
    elbow = dot(h[2], cross(p[2] - p[1], p[3] - p[2])) < -_ROUNDING
    wrist = dot(h[4], cross(h[3], h[5])) < -_ROUNDING
    return np.asarray(4 * (negative ^ elbow ^ wrist) + 2 * elbow + wrist)


def numbers_by_sign(exist: npt.NDArray[np.bool_], negative: npt.NDArray[np.bool_]) -> IntArray:
    """Names (B, K) of branches that exist, even ones for positive determinants, else -1.

    A branch keeps its sign up to a singularity.
    """
    names = np.full(exist.shape, -1)
    for sign in (False, True):
        same = exist.copy()
        same[exist] = negative == sign
        names[same] = (2 * np.cumsum(same, axis=0) - 2 + sign)[same] % MAX_BRANCHES
    return names


def columns_by_name(names: IntArray) -> IntArray:
    """Columns of branches (B, K): the number of their name or, if occupied, from 8 on."""
    exist = names >= 0
    earlier = np.tri(len(names), k=-1, dtype=bool)[..., None]
    repeated = exist & ((names == names[:, None]) & earlier).any(axis=1)
    first = exist & ~repeated
    occupied = np.zeros((MAX_BRANCHES, names.shape[1]), dtype=bool)
    occupied[names[first], np.nonzero(first)[1]] = True
    following = np.roll(np.arange(MAX_BRANCHES), -8)
    free = following[np.argsort(occupied[following], axis=0, kind="stable")]
    rank = np.maximum(np.cumsum(repeated, axis=0) - 1, 0)
    return np.where(repeated, np.take_along_axis(free, rank, axis=0), names)


def branch_name(label: str) -> str:
    """The label of an arm branch; ``branch 1`` where that is a number."""
    return f"branch {label}" if label.isdigit() else label


def short_label(label: str) -> str:
    """``s+ e- w+`` for ``shoulder+ elbow- wrist+``; nothing for numbers and words."""
    arms = []
    for arm in label.split(", "):
        words = [word for word in arm.split() if word[-1] in "+-" or re.fullmatch("[a-z]", word)]
        arms.append(" ".join(word[0] + word[1:][-1:] for word in words))
    return ", ".join(filter(None, arms))
