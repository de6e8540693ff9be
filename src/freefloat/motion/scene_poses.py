"""The bodies of a scene along a motion."""

from __future__ import annotations

from freefloat.motion.motion import Motion
from freefloat.scene.scene_body import EndEffectorPoses
from freefloat.so3 import Array, Pose


def scene_poses(
    motion: Motion, t: float | Array, attitude: Array, joints: Array
) -> tuple[Pose, ...]:
    """Frames of the bodies of the scene in a state, from the centre of mass, inertial axes.

    A state has a time [s], the attitude of the spacecraft, a unit quaternion x, y, z, w, shape
    (4,), and joints (n,); in K states each body has K poses.
    """
    poses = _end_effector_poses(motion, t, attitude, joints)
    return motion.setting.scene.poses(t, motion.setting, poses)


def corridor_pose(motion: Motion, t: float | Array, attitude: Array, joints: Array) -> Pose:
    """The frame of the corridor; arguments are as for :func:`scene_poses`."""
    poses = _end_effector_poses(motion, t, attitude, joints)
    return motion.setting.scene.corridor_pose(t, motion.setting, poses)


def _end_effector_poses(
    motion: Motion, t: float | Array, attitude: Array, joints: Array
) -> EndEffectorPoses | None:
    """Poses of the end-effector, where bodies move with it."""
    if not motion.setting.scene.follows:
        return None
    actual = motion.model.end_effector_pose(attitude, joints)
    return EndEffectorPoses(motion.law.target(t, attitude, joints), actual)
