"""Arm branches with the end-effector on a path, at attitudes of the spacecraft."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.plane import Plane
from freefloat.dynamics.tasks import Task, prescribed_rows, required_plane
from freefloat.errors import InputError, finite_number
from freefloat.ik.branches import ArmBranch, BranchSets, arm_branches, many_arm_branches
from freefloat.ik.nearest import GIVEN, closest_branches, newton_solutions
from freefloat.ik.numbering import MAX_BRANCHES
from freefloat.ik.several_arms import several_arm_branches
from freefloat.motion.joint_curves import ArmCurves
from freefloat.paths.timed_path import TimedPath
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, IntArray, frozen, unit_quaternion

_NEAR_BRANCH, _SAME_JOINTS = 0.05, 1e-6
"""Largest differences of joint values from those of a near branch, and of the same [rad, m]."""


class BranchesOnPath:
    """What a :class:`.Problem` knows of the arm configurations on its path."""

    model: FreeFloatingModel
    path: TimedPath
    task: Task
    start_joints: Array | None
    arms: ArmCurves

    @property
    def has_headings(self) -> bool:
        """Whether the spacecraft turns in a plane: of planar tasks, and on a table."""
        return self.task.planar or self.model.on_table

    @cached_property
    def plane(self) -> Plane:
        """The plane in which the spacecraft turns, common to its frame and the inertial frame.

        Raises:
            InputError: If the robot does not stay in one.
        """
        if self.model.on_table and not self.task.planar:
            return Plane.of_normal(np.eye(3)[2])
        return required_plane(self.model, self.task)

    @property
    def redundant(self) -> bool:
        """Whether the arms that follow paths have more joints than the task has rows."""
        return self.model.arm_dof > len(prescribed_rows(self.model, self.task))

    def model_at(self, t: float = 0.0) -> FreeFloatingModel:
        """The robot with the arms that follow paths, further arms fixed as at a time [s]."""
        if not self.arms:
            return self.model
        if t not in self._chains:
            self._chains[t] = self._model_at(t)
        return self._chains[t]

    def _model_at(self, t: float) -> FreeFloatingModel:
        return self.model.with_arms_at(self.arms.at(t)) if self.arms else self.model

    @cached_property
    def _chains(self) -> dict[float, FreeFloatingModel]:
        return {}

    def attitude(
        self,
        values: npt.ArrayLike | None = None,
        *,
        heading: float | None = None,
        key: str = "attitude",
    ) -> Array:
        """A checked, normalized attitude of the spacecraft.

        Args:
            values: Quaternion x, y, z, w.
            heading: For planar tasks and on a table, in its place: the angle about the normal of
                the plane [rad].
            key: Named in errors.

        Returns:
            The unit quaternion, shape (4,).

        Raises:
            InputError: If it is no unit quaternion or, where the spacecraft turns in a plane, not a
                rotation about its normal; if both or neither are given, or a heading elsewhere.
        """
        plane, accepted = self.plane if self.has_headings else None, "an attitude x, y, z, w"
        if plane is not None:
            accepted += f" or a heading about {plane.axis} [rad]"
        if heading is not None:
            if values is not None or plane is None:
                beside = (
                    f"for the task {self.task}" if values is None else "together with an attitude"
                )
                raise InputError("heading", f"it was given {beside}", accepted)
            return frozen(plane.attitudes(finite_number("heading", heading, "a finite angle")))
        if values is None:
            raise InputError(key, "it is missing", accepted)
        return unit_quaternion(key, values) if plane is None else plane.checked(key, values)

    def branches(self, attitude: npt.ArrayLike, t: float = 0.0) -> tuple[ArmBranch, ...]:
        """All arm configurations with the end-effector on the path; see also ``start_joints``.

        Args:
            attitude: Attitude of the spacecraft at that time, unit quaternion x, y, z, w.
            t: Time [s].

        Returns:
            The branches; none where the path is out of reach.
        """
        attitude = self.attitude(attitude)
        if self.start_joints is not None or self.path.arms:
            return self.many_branches(attitude[None], t)[0]
        R0 = rotation_matrix(attitude)
        return arm_branches(self.model_at(t), self.path.pose(t).seen_from(R0), self.task)

    def many_branches(
        self,
        attitudes: Array,
        t: float = 0.0,
        branch: int | IntArray | None = None,
        offsets: Array | None = None,
    ) -> BranchSets:
        """The same for many attitudes (K, 4); ``offsets`` as of :meth:`poses_seen_from`.

        With the number of an arm branch, or of one for each attitude (K,), others may be missing.
        """
        at = self.model_at(t), *self.poses_seen_from(attitudes, t, offsets), self.task
        if self.start_joints is not None and t == 0.0:
            return closest_branches(*at, self.start_joints)
        if not self.path.arms:
            return many_arm_branches(*at)
        only = None if branch is None else np.broadcast_to(branch, len(attitudes))
        return several_arm_branches(*at, only)

    def poses_seen_from(
        self, attitudes: Array, t: float = 0.0, offsets: Array | None = None
    ) -> tuple[Array, Array]:
        """Positions (K, 3) and rotations (K, 3, 3) of the path relative to attitudes (K, 4).

        Where E arms follow paths, those of all, (E, K, 3) and (E, K, 3, 3). With one path, it may
        have an offset in the inertial frame for each attitude [m], shape (K, 3).
        """
        seen = [pose.seen_from_each(attitudes) for pose in self.path.poses(t)]
        if not self.path.arms:
            if offsets is None:
                return seen[0]
            back = rotation_matrix(attitudes).swapaxes(1, 2)
            return seen[0][0] + np.einsum("kij,kj->ki", back, offsets), seen[0][1]
        positions, rotations = zip(*seen, strict=True)
        return np.array(positions), np.array(rotations)

    def closest_start(self, attitude: npt.ArrayLike) -> Array | None:
        """Joints (n,) at the start closest to ``start_joints``; None without, or out of reach."""
        if self.start_joints is None:
            return None
        return next((branch.joints for branch in self.branches(attitude)), None)

    def nearest(
        self, joints: Array, branches: Sequence[ArmBranch], within: float = _NEAR_BRANCH
    ) -> ArmBranch | None:
        """The branch nearest to joint values (n,), None if all are farther away [rad, m]."""
        distances = [float(self.model.joint_distance(b.joints, joints)) for b in branches]
        least = min(distances, default=np.inf)
        return branches[distances.index(least)] if branches and least <= within else None

    def branch_near(
        self, attitude: npt.ArrayLike, joints: npt.ArrayLike, branches: Sequence[ArmBranch]
    ) -> ArmBranch:
        """The arm branch near joint values.

        Args:
            attitude: Attitude of the spacecraft at the start, unit quaternion x, y, z, w.
            joints: Joint values within 0.05 rad each, modulo 2 pi, of a branch; for a redundant
                arm, of any configuration on the path.
            branches: The result of :meth:`branches`.

        Raises:
            InputError: Listing the branches when the joints lie near none.
        """
        values = self.model.joint_vector(joints)[: self.model.arm_dof]
        near = self.nearest(values, branches)
        if self.redundant:
            poses = self.poses_seen_from(np.asarray(attitude)[None])
            (q,) = newton_solutions(self.model_at(), *poses, self.task, values)
            given = ArmBranch(MAX_BRANCHES, GIVEN, frozen(q))
            if np.isfinite(q).all() and self.nearest(values, [given]):
                near = self.nearest(q, branches, _SAME_JOINTS) or given
        if near is not None:
            return near
        raise InputError(
            "joints",
            f"{values.tolist()} is near no arm branch at this attitude",
            f"within {_NEAR_BRANCH} rad each of: "
            + "; ".join(f"{b.index} {np.round(b.joints, 4).tolist()}" for b in branches),
        )
