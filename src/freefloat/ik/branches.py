"""Inverse kinematics: all arm branches that reach a pose at a given spacecraft attitude.

Elbow arms with a spherical wrist, arms whose second to fourth axes are parallel and planar elbow
arms are solved in closed form, every other arm by Newton's method from many starts. Of the
infinitely many configurations of a redundant arm a reproducible, well-spread set is returned, which
lies inside the joint ranges where any is found there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from itertools import product
from string import ascii_lowercase
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.tasks import Task, require_task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ik.analytic import solve_elbow_and_wrist, solve_planar_elbow
from freefloat.ik.configurations import isolated_configurations, spread_configurations
from freefloat.ik.numbering import MAX_BRANCHES, numbered_branches
from freefloat.ik.parallel_axes import solve_parallel_axes
from freefloat.records import Joints
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, Pose, frozen

_SLICE = 1024
"""Number of poses that are solved at once."""
_Solved = TypeVar("_Solved")


ELBOWS = ("elbow+", "elbow-")
_SIGNS = tuple(
    f"shoulder{shoulder} elbow{elbow} wrist{wrist}"
    for shoulder, elbow, wrist in product("+-", repeat=3)
)
_NUMBERS = tuple(str(number) for number in range(MAX_BRANCHES))


@dataclass(frozen=True, eq=False)
class ArmBranch:
    """An arm configuration that reaches a pose.

    Attributes:
        index: Number of the branch. Branches identified by signs have the same number at every
            attitude; other branches, except of redundant arms, an even number where the determinant
            of the fixed-base Jacobian is positive.
        label: Signs of the branch, e.g. ``"shoulder+ elbow- wrist+"``, otherwise its number.
        joints: Joint values, revolute joints within their URDF range where possible, else in
            (-pi, pi], shape (n,).
    """

    index: int
    label: str
    joints: Joints


@dataclass(frozen=True, eq=False)
class BranchSets:
    """The arm branches at K poses, in columns by branch number.

    Attributes:
        joints: Joint values as in :class:`ArmBranch`, NaN where a branch does not exist, shape
            (K, B, n).
        names: Indices into ``labels``, shape (K, B); -1 where a branch does not exist. Column i
            has name i, except that of two branches without closed form that have the same signs
            the second is in column 8 or beyond.
        labels: Labels of the branches.
    """

    joints: Array = field(repr=False)
    names: npt.NDArray[np.int64] = field(repr=False)
    labels: tuple[str, ...]

    def __post_init__(self) -> None:
        self.joints.setflags(write=False)
        self.names.setflags(write=False)

    @property
    def exist(self) -> npt.NDArray[np.bool_]:
        """Which branches exist, shape (K, B)."""
        return np.asarray(self.names >= 0)

    def __len__(self) -> int:
        return len(self.joints)

    def __getitem__(self, pose: int) -> tuple[ArmBranch, ...]:
        """The branches at a pose."""
        return tuple(
            ArmBranch(int(index), self._label(pose, int(index)), frozen(self.joints[pose, index]))
            for index in np.flatnonzero(self.exist[pose])
        )

    def _label(self, pose: int, index: int) -> str:
        name = int(self.names[pose, index])
        previous = int((self.names[pose, :index] == name).sum())
        return self.labels[name] + (f" {ascii_lowercase[previous]}" if previous else "")


class ClosedForm(Enum):
    """Arms and tasks whose branches have a closed form."""

    ELBOW_AND_WRIST = "elbow arm with a spherical wrist"
    PLANAR_ELBOW = "planar elbow arm"
    PARALLEL_AXES = "six revolute joints, the second to fourth parallel"


def closed_form(model: FreeFloatingModel, task: Task) -> ClosedForm | None:
    """The closed form of an arm's branches for a task, None where they are searched for."""
    if not model.has_one_arm or (model.on_table and not task.planar):
        return None
    virtual = VirtualManipulator.of(model)
    if task is Task.POSE and virtual.has_elbow_and_spherical_wrist:
        return ClosedForm.ELBOW_AND_WRIST
    if task.planar and len(task.rows) == model.dof and not virtual.prismatic.any():
        return ClosedForm.PLANAR_ELBOW
    if task is Task.POSE and virtual.has_three_parallel_axes:
        return ClosedForm.PARALLEL_AXES
    return None


def arm_branches(model: FreeFloatingModel, target: Pose, task: Task | str) -> tuple[ArmBranch, ...]:
    """All arm branches at an end-effector pose.

    Args:
        model: Robot.
        target: End-effector pose from the system's centre of mass, spacecraft frame.
        task: Task or its value, such as ``"position"``: what of the pose is prescribed.

    Returns:
        The branches; none where the pose is out of reach. Joint ranges are not enforced.

    Raises:
        InputError: If the robot cannot have the task.
    """
    task = require_task(model, task)
    return many_arm_branches(model, target.position[None], target.rotation[None], task)[0]


def many_arm_branches(
    model: FreeFloatingModel, positions: Array, rotations: Array, task: Task
) -> BranchSets:
    """All arm branches at each of K end-effector poses.

    Args:
        model: Robot.
        positions: End-effector positions from the system's centre of mass, spacecraft frame [m],
            shape (K, 3).
        rotations: Rotations from the end-effector frame into the spacecraft frame, (K, 3, 3).
        task: Part of the poses that is prescribed.

    Returns:
        The branches at each pose, as in :func:`arm_branches`.
    """
    model.require_supported("reach and regions")
    form = closed_form(model, task)
    if form is None:
        return search_arm_branches(model, positions, rotations, task)
    if form is ClosedForm.PARALLEL_AXES:
        solved = _in_slices(partial(solve_parallel_axes, model), positions, rotations)
        q, well_conditioned = (
            np.concatenate(parts, axis=-1) for parts in zip(*solved, strict=True)
        )
        joints, names = numbered_branches(model, task, q)
        (others,) = np.nonzero(~well_conditioned)
        if len(others):
            searched = search_arm_branches(model, positions[others], rotations[others], task)
            joints[others], names[others] = searched.joints, searched.names
        return BranchSets(joints, names, _SIGNS)
    if form is ClosedForm.ELBOW_AND_WRIST:
        labels, solve = _SIGNS, partial(solve_elbow_and_wrist, model)
    else:
        labels, solve = ELBOWS, partial(solve_planar_elbow, model)
    joints = np.concatenate(_in_slices(solve, positions, rotations), axis=2).transpose(2, 1, 0)
    exist = np.asarray(np.isfinite(joints).all(axis=2))
    joints = np.where(exist[..., None], joints, np.nan)
    return BranchSets(joints, np.where(exist, np.arange(len(labels)), -1), labels)


def search_arm_branches(
    model: FreeFloatingModel, positions: Array, rotations: Array, task: Task
) -> BranchSets:
    """:func:`many_arm_branches` by Newton's method, also for arms with a closed form."""
    m = len(task.rows)
    configurations = spread_configurations if model.dof > m else isolated_configurations
    slices = [slice(first, first + _SLICE) for first in range(0, max(1, len(positions)), _SLICE)]
    solutions = [
        configurations(model, task, positions[few], rotations[few], MAX_BRANCHES) for few in slices
    ]
    q = np.concatenate(solutions, axis=2)
    joints, names = numbered_branches(model, task, q)
    return BranchSets(joints, names, searched_labels(model, task))


def has_signs(model: FreeFloatingModel, task: Task) -> bool:
    """Whether signs identify the branches of an arm that are searched for."""
    return model.dof == len(task.rows) == 6 and not model.prismatic.any()


def searched_labels(model: FreeFloatingModel, task: Task) -> tuple[str, ...]:
    """The labels of the branches of an arm that are searched for."""
    return _SIGNS if has_signs(model, task) else _NUMBERS


def _in_slices(solve: Callable[[Array, Array], _Solved], p: Array, R: Array) -> list[_Solved]:
    """What a solver gives for slices of K poses whose arrays fit into the processor's cache."""
    slices = [slice(first, first + _SLICE) for first in range(0, max(1, len(p)), _SLICE)]
    p, R = (np.ascontiguousarray(np.moveaxis(values, 0, -1)) for values in (p, R))
    return [solve(p[..., chosen], R[..., chosen]) for chosen in slices]
