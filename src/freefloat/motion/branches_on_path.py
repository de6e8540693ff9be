"""Arm branches with the end-effector on a path, at attitudes of the spacecraft."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from freefloat.errors import InputError
from freefloat.ik.branches import ArmBranch, BranchSets, arm_branches, many_arm_branches
from freefloat.ik.nearest import GIVEN, closest_branches, newton_solutions
from freefloat.ik.numbering import MAX_BRANCHES
from freefloat.ik.several_arms import several_arm_branches
from freefloat.motion.setting import Setting
from freefloat.paths.timed_path import TimedPath
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, IntArray, frozen

_NEAR_BRANCH, _SAME_JOINTS = 0.05, 1e-6
"""Largest differences of joint values from a near branch, and from the same branch [rad, m]."""


class BranchesOnPath(Setting):
    """What a :class:`.Problem` knows of the arm configurations on its path."""

    path: TimedPath
    start_joints: Array | None

    def branches(self, attitude: npt.ArrayLike, t: float = 0.0) -> tuple[ArmBranch, ...]:
        """All arm configurations with the end-effector on the path; see also ``start_joints``.

        There are none where the path is out of reach.

        Args:
            attitude: Attitude of the spacecraft at that time, unit quaternion x, y, z, w.
            t: Time [s].
        """
        attitude = self.attitude(attitude)
        if self.start_joints is not None or len(self.path.by_arm) > 1:
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
        """Arm configurations for many attitudes (K, 4); ``offsets`` as of :meth:`poses_seen_from`.

        With the number of an arm branch, or one for each attitude (K,), others may be missing.
        """
        at = self.model_at(t), *self.poses_seen_from(attitudes, t, offsets), self.task
        if self.start_joints is not None and t == 0.0:
            return closest_branches(*at, self.start_joints)
        if len(self.path.by_arm) == 1:
            return many_arm_branches(*at)
        only = None if branch is None else np.broadcast_to(branch, len(attitudes))
        return several_arm_branches(*at, only)

    def poses_seen_from(
        self, attitudes: Array, t: float = 0.0, offsets: Array | None = None
    ) -> tuple[Array, Array]:
        """Positions (K, 3) and rotations (K, 3, 3) of the path relative to attitudes (K, 4).

        Where E arms follow paths, the arrays of all paths, (E, K, 3) and (E, K, 3, 3). A single
        path may have an offset in the inertial frame for each attitude [m], shape (K, 3).
        """
        seen = [pose.seen_from_each(attitudes) for pose in self.path.poses(t)]
        if len(seen) > 1:
            positions, rotations = zip(*seen, strict=True)
            return np.array(positions), np.array(rotations)
        if offsets is None:
            return seen[0]
        back = rotation_matrix(attitudes).swapaxes(1, 2)
        return seen[0][0] + np.einsum("kij,kj->ki", back, offsets), seen[0][1]

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
        values = self.solved_joints(self.model.joint_vector(joints))
        near = self.nearest(values, branches)
        if self.redundant:
            poses = self.poses_seen_from(np.asarray(attitude)[None])
            (q,) = newton_solutions(self.model_at(), *poses, self.task, values)
            start = ArmBranch(MAX_BRANCHES, GIVEN, frozen(q))
            if np.isfinite(q).all() and self.nearest(values, [start]):
                near = self.nearest(q, branches, _SAME_JOINTS) or start
        if near is not None:
            return near
        problem = f"{values.tolist()} is near no arm branch at this attitude"
        listed = "; ".join(f"{b.index} {np.round(b.joints, 4).tolist()}" for b in branches)
        raise InputError("joints", problem, f"within {_NEAR_BRANCH} rad each of: {listed}")
