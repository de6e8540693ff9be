"""Further paths of a manoeuvre: in its frame or that of a body, from where the end-effector is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from freefloat.dynamics.tasks import Task
from freefloat.errors import InputError
from freefloat.motion.problem import Problem
from freefloat.paths.orientation import RotatedOrientation
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.relative_path import RelativePath
from freefloat.paths.timed_path import TimedPath
from freefloat.rotations import Rotation
from freefloat.scene.scene_body import SceneBody
from freefloat.so3 import Array, Pose, rotation_vector_between

JUMP = 1e-6
"""Largest jump of the end-effector between phases [m, rad], of its twist [m/s, rad/s] and of joint
rates [rad/s, m/s]."""
_AS_BEFORE = "as the phase before ends, or a path to a pose"


def prescribed_path(
    given: TimedPath | RelativePath, bodies: Sequence[SceneBody], centre: Array, drift: Array
) -> TimedPath:
    """A path in the frame of a manoeuvre or of a body, from the present centre of mass.

    Args:
        given: The path.
        bodies: Bodies of the scene now, from the present centre of mass.
        centre: Centre of mass in the frame of the manoeuvre [m], shape (3,).
        drift: Its velocity [m/s], shape (3,).
    """
    if isinstance(given, RelativePath):
        body = next(body for body in bodies if body.name == given.body.name)
        return replace(given, body=body).timed(drift)
    curve = given.path.curve.moved(Pose(-centre, np.eye(3)))
    return TimedPath(EndEffectorPath(curve, given.path.orientation), given.timing, drift)


def require_continuous(path: TimedPath, pose: Pose, twist: Array | None, problem: Problem) -> None:
    """Raise an InputError unless a path begins with a pose and a twist of the end-effector.

    Args:
        path: The path.
        pose: Pose of the end-effector, in the frame of the path.
        twist: Twist in that frame [m/s; rad/s], shape (6,); None where it is not known.
        problem: Its task is the part of both that counts.
    """
    jump = float(np.abs(_offset(path, pose, problem)).max())
    if jump > JUMP:
        raise InputError("path", f"it begins {jump:.3g} m or rad away", _AS_BEFORE)
    if twist is None:
        return
    difference = path.twist(0.0) + path.drift_twist - twist
    change = float(np.abs(_prescribed(difference, pose, problem)).max())
    if change > JUMP:
        given = f"the end-effector's twist would change by {change:.3g} m/s or rad/s"
        raise InputError("path", given, _AS_BEFORE)


def moved_to_begin_at(path: TimedPath, pose: Pose, problem: Problem) -> TimedPath:
    """The path, moved and turned by the little by which it does not begin at a pose.

    Joints need no correction then, and errors of paths before are not those of this one.
    """
    offset = -_offset(path, pose, problem)
    curve, orientation = path.path.curve, path.path.orientation
    moved = curve.moved(Pose(offset[:3], np.eye(3)))
    if problem.task.prescribes_orientation:
        turn = Rotation.from_rotvec(offset[3:]).as_matrix()
        orientation = RotatedOrientation(orientation, turn)
    return replace(path, path=EndEffectorPath(moved, orientation))


def _offset(path: TimedPath, pose: Pose, problem: Problem) -> Array:
    """From a pose to the first one of a path [m; rad], inertial axes; zero what is free, (6,)."""
    start = path.pose(0.0)
    turn = rotation_vector_between(pose.rotation, start.rotation)
    if problem.task is Task.POINTING:
        turn = _between(pose.rotation[:, 2], start.rotation[:, 2], pose.rotation[:, 0])
    return _prescribed(np.concatenate([start.position - pose.position, turn]), pose, problem)


def _between(first: Array, second: Array, across: Array) -> Array:
    """The shortest rotation vector between unit vectors; ``across`` the axis of opposite ones."""
    normal = np.cross(first, second)
    sine = float(np.linalg.norm(normal))
    axis = normal / sine if sine else across
    return np.asarray(np.arctan2(sine, first @ second) * axis)


def _prescribed(vector: Array, pose: Pose, problem: Problem) -> Array:
    """The part of a pair of vectors (6,) in inertial axes that the task prescribes at a pose."""
    task, axes = problem.task, np.eye(3)
    if task is Task.POINTING:
        axes = pose.rotation
    elif task.planar:
        axes = problem.plane.axes
    kept = np.zeros(6)
    kept[task.rows] = (vector.reshape(2, 3) @ axes).ravel()[task.rows]
    return np.asarray((kept.reshape(2, 3) @ axes.T).ravel())
