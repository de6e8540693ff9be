"""Newton's method from many starts at many poses at once, and a table of starts by pose.

A revolute first joint rotates the end-effector about an axis that is fixed to the spacecraft, a
revolute last joint about one that is fixed to the end-effector. Both angles follow from the other
joints, so that only those are sampled, and poses are compared in the frame that is rotated about
the first axis until the end-effector lies in its x-z plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.joint_space import joint_box
from freefloat.dynamics.tasks import Task, required_plane
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.ik.chain import Chain, cross, dot, product, times, wrapped
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray, axis_frame

if TYPE_CHECKING:
    from freefloat.dynamics.kernels.robot import Robot


CONVERGED = 1e-9
"""Largest residual of a solution [m, rad]."""
_PATIENCE = 4
"""Largest number of consecutive steps that hardly reduce the residual."""
_CONFIGURATIONS = 32768
_PROBES = 512
"""Configurations from whose distances to the samples the spacing of the samples follows."""
_NEARBY, _CAUTION = 0.05, 2.0
"""Poses are out of reach whose distance exceeds both this and the largest of all probes, times this
factor."""


@dataclass(frozen=True, eq=False)
class Newton:
    """Newton's method for the joints of a robot, all moving arms of which reach poses."""

    model: FreeFloatingModel
    task: Task

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, model: FreeFloatingModel, task: Task) -> Newton:
        """The method for a robot.

        Raises:
            InputError: If it has more arms than there is room for.
        """
        from freefloat.dynamics.kernels.robot import MOST_ARMS  # Numba imports slowly

        if len(model.single_arms) > MOST_ARMS:
            problem = f"{len(model.single_arms)} arms follow paths"
            raise InputError("robot.arms", problem, f"up to {MOST_ARMS} arms on paths")
        return cls(model, task)

    def solved(
        self, positions: Array, rotations: Array, pose: IntArray, q: Array, steps: int,
        *, patience: int = _PATIENCE, robots: Array | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Joint values (N, n) after the last step, and their residuals [m, rad], shape (N,).

        Args:
            positions: Positions of the end-effector at K poses, or of E end-effectors, from the
                centre of mass, spacecraft frame [m], shape (K, 3) or (E, K, 3).
            rotations: Rotations of the end-effectors, shape (K, 3, 3) or (E, K, 3, 3).
            pose: Numbers of the poses, shape (N,).
            q: Joint values at the start, shape (N, n).
            steps: Largest number of steps.
            patience: Largest number of consecutive steps that hardly reduce the residual.
            robots: Properties of the robots of the poses, see :class:`.Robot`, shape (K, C).
        """
        from freefloat.ik.kernels import make_workspace, solve_all

        axes = required_plane(self.model, self.task).axes if self.task.planar else np.eye(3)
        rows = np.concatenate([positions[..., None, :], np.swapaxes(rotations, -1, -2)], axis=-2)
        arms, poses = len(self.model.single_arms), positions.shape[-2]
        targets = (rows @ axes).reshape(arms, poses, 12).swapaxes(0, 1)
        q, residuals = np.array(q, order="C"), np.empty(len(q))
        if not len(q):
            return q, residuals
        wanted = np.ascontiguousarray(targets), np.ascontiguousarray(pose)
        work = make_workspace(self._robot, 0 if robots is None else robots.shape[1])
        solve_all(self._robot, robots, *wanted, q, residuals, steps, patience, work)
        return q, residuals

    def solutions(
        self, positions: Array, rotations: Array, q: Array, steps: int, patience: int = _PATIENCE
    ) -> Array:
        """Joint values (n, B, K) to which it converges from others at K poses, else NaN.

        Starts are NaN where they are missing; other arguments are as for :meth:`solved`.
        """
        solutions, starts = np.full(q.shape, np.nan), np.isfinite(q).all(axis=0)
        joints, residuals = self.solved(
            positions, rotations, np.nonzero(starts)[1], q[:, starts].T, steps, patience=patience
        )
        joints[~(residuals <= CONVERGED)] = np.nan
        solutions[:, starts] = joints.T
        return solutions

    @cached_property
    def _robot(self) -> Robot:
        """The arrays that the kernel reads."""
        from freefloat.dynamics.robot_arrays import kernel_robot

        return kernel_robot(self.model, self.task)


class _Features(NamedTuple):
    """End-effector poses as they are compared.

    Attributes:
        values: Shape (F, K).
        angle: Rotation about the first axis from the frame of comparison [rad], shape (K,).
        axis: The last axis in that frame, of the task ``pointing`` the end-effector's z axis, shape
            (3, K).
        across: A direction normal to that axis that the last joint rotates, shape (3, K).
    """

    values: Array
    angle: Array
    axis: Array
    across: Array


@dataclass(frozen=True, eq=False)
class PoseTable:
    """Configurations of an arm, evenly distributed in a box of joint values."""

    chain: Chain  # arm
    task: Task  # part of the poses that is prescribed
    length: float  # distance that counts as much as one radian [m]
    joints: Array  # configurations, zero for joints whose angle follows from a pose, (n, M)
    features: _Features  # end-effector poses of the configurations
    tree: scipy.spatial.cKDTree  # search tree of the features
    spacing: float  # poses that are reached are closer to some in the table

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, model: FreeFloatingModel, task: Task, *, inside: bool) -> PoseTable:
        """The configurations inside the joint ranges, or of all revolutions."""
        chain, virtual = Chain.of(model), VirtualManipulator.of(model)
        length = virtual.reach
        lower, upper = sampled_box(model) if inside else joint_box(model)
        probes = np.random.default_rng(0).random((_PROBES, model.dof))
        points = np.concatenate([low_discrepancy(_CONFIGURATIONS, model.dof), probes])
        joints = (lower + (upper - lower) * points).T
        if chain.swings:
            joints[0] = 0.0
        if _last_follows(chain, task):
            joints[-1] = 0.0
        p, R, _, _ = virtual.kinematics(joints.T)
        features = _features(chain, task, length, p.T, R.transpose(1, 2, 0))
        tree = scipy.spatial.cKDTree(features.values[:, :_CONFIGURATIONS].T)
        distance, _ = tree.query(features.values[:, _CONFIGURATIONS:].T)
        spacing = max(_NEARBY, _CAUTION * float(distance.max()))
        return cls(chain, task, length, joints, features, tree, spacing)

    def nearest(self, positions: Array, rotations: Array, count: int) -> Array:
        """The configurations with the poses closest to K others.

        Args:
            positions: End-effector positions, shape (K, 3).
            rotations: End-effector rotations, shape (K, 3, 3).
            count: Number of configurations for each pose.

        Returns:
            Joint values, the closest first, NaN where there are fewer at most ``spacing`` away,
            shape (n, count, K).
        """
        poses = positions.T, rotations.transpose(1, 2, 0)
        wanted = _features(self.chain, self.task, self.length, *poses)
        distance, index = self.tree.query(
            np.nan_to_num(wanted.values.T, nan=np.inf), k=count, distance_upper_bound=self.spacing
        )
        index = np.minimum(index.T, _CONFIGURATIONS - 1)
        q: Array = self.joints.take(index, axis=1)
        if self.chain.swings:
            q[0] = wrapped(wanted.angle - self.features.angle[index])
        if _last_follows(self.chain, self.task):
            start, end = self.features.across.take(index, axis=1), wanted.across
            quarter = cross(end, wanted.axis)[:, None]
            q[-1] = np.arctan2(dot(start, quarter), dot(start, end[:, None]))
        q[:, np.isinf(distance.T)] = np.nan
        return q


def sampled_box(model: FreeFloatingModel) -> tuple[Array, Array]:
    """Ends of the joint ranges (n,); of wide ranges, the ends of a full revolution."""
    (first, last), (lower, upper) = model.joint_ranges, joint_box(model)
    narrow = last - first < upper - lower
    return np.where(narrow, first, lower), np.where(narrow, last, upper)


def _last_follows(chain: Chain, task: Task) -> bool:
    """Whether the last joint's angle follows from a pose and the other joints."""
    whole = task.prescribes_orientation and task is not Task.POINTING
    return whole and not bool(chain.prismatic[-1])


def _features(
    chain: Chain, task: Task, length: float, positions: Array, rotations: Array
) -> _Features:
    """End-effector positions (3, K) and rotations (3, 3, K) in the frame of comparison."""
    change = product(rotations, chain.rotation.T[..., None])
    last = _last_follows(chain, task)
    if last:
        offsets = times(change, chain.last[:, None])
        offsets[2] = times(change, chain.last_upright[:, None])[2]
        positions = positions - offsets
    pointing = task is Task.POINTING
    last_axis = chain.rotation[:, 2] if pointing else chain.axes[:, -1]
    axis, across = (times(change, v[:, None]) for v in axis_frame(last_axis)[:, [2, 0]].T)
    frame = axis_frame(chain.axes[:, 0])
    p, axis, across = (frame.T @ v for v in (positions - chain.points[:, :1], axis, across))
    angle = np.zeros(p.shape[1])
    if chain.swings:
        angle = np.arctan2(p[1], p[0])
        c, s = np.cos(angle), np.sin(angle)
        p, axis, across = (
            np.stack([c * x + s * y, c * y - s * x, z]) for x, y, z in (p, axis, across)
        )
    values = [p / length]
    if task.prescribes_orientation:
        values += [axis] if last or pointing else [axis, across]
    if task.planar:
        values = [v[:2] for v in values[: 1 if last else None]]
    return _Features(np.concatenate(values), angle, axis, across)
