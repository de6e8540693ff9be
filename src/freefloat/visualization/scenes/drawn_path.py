"""The path of the end-effector in pictures of motions whose joints are prescribed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from freefloat.motion.motion import Motion
from freefloat.paths.curves import SplineCurve
from freefloat.paths.orientation import OrientationSpline
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timed_path import TimedPath
from freefloat.rotations import Rotation


def with_drawn_path(motion: Motion) -> Motion:
    """The motion, whose problem has the path that the end-effector takes.

    That of prescribed joints is a spline through its poses at the nodes.
    """
    if motion.curve is None:
        return motion
    problem, states = motion.problem, zip(motion.attitudes, motion.joints, strict=True)
    poses = [problem.model.end_effector_pose(*state) for state in states]
    timing, drift = problem.path.timing, problem.path.drift
    points = np.array([pose.position for pose in poses]) + np.outer(motion.times, drift)
    rotations = Rotation.from_matrix([pose.rotation for pose in poses])
    s = np.array([timing.s(float(t)) for t in motion.times])
    path = EndEffectorPath(SplineCurve(points, s), OrientationSpline(rotations.as_quat(), s))
    if not path.moves:
        return motion
    return replace(motion, problem=replace(problem, path=TimedPath(path, timing, drift)))
