"""How soon the arm is estimated to be at the start of a path, by straight ways of its joints."""

from __future__ import annotations

import numpy as np

from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.rotations import Rotation
from freefloat.so3 import Array, angle_between

_INTERVALS = 4
"""Intervals of the quadrature of attitudes in an eighth of a way."""
_SHORTEST = 1e-6
"""Duration of a way that ends where it begins [s]."""
_TURN = 20.0
"""Time for a turn of the spacecraft by loops over that of a joint for the same angle."""


def times_to_start(
    problem: Problem, present: Array, limits: Limits | None, attitudes: Array
) -> Array:
    """Estimated times in which a resting arm gets to the starts of a path [s], shape (K,).

    The spacecraft turns while the joints move on straight ways, as fast as limits of their rates
    and of its own permit; what is left of the turn takes loops. It is infinite where no arm branch
    exists, and in units of radians where no rate is limited.

    Args:
        problem: Its ``start_joints`` are those at present.
        present: Present attitude of the spacecraft, quaternion x, y, z, w.
        limits: Limits of rates.
        attitudes: Attitudes in which the path may begin, shape (K, 4).
    """
    from freefloat.planning.goals.joint_paths import Ends, JointPaths  # compiled kernels
    from freefloat.planning.goals.placements import Arm

    begin, sets = np.array(problem.start_joints), problem.many_branches(attitudes)
    fastest, base_rate = np.ones_like(begin), np.inf
    if limits is not None and limits.joint_rate is not None:
        fastest = np.asarray(limits.joint_rate)
    if limits is not None and limits.base_rate is not None:
        base_rate = limits.base_rate
    paths = JointPaths(Ends(begin, 0.0 * begin, None, 0.0 * begin), fineness=_INTERVALS)
    arm, steepest = Arm.of(problem.model), float((paths.gauss[1] @ paths.straight).max())
    momenta = np.array([problem.momentum, problem.wheel_momentum])
    R = Rotation.from_quat(present).as_matrix()
    unknowns, times = np.zeros(paths.size), np.full(len(attitudes), np.inf)
    for k, branch in zip(*np.nonzero(sets.exist), strict=True):
        end = sets.joints[k, branch]
        duration = steepest * float((np.abs(end - begin) / fastest).max())
        unknowns[-len(end) - 1 :] = *end, max(duration, _SHORTEST)
        course = paths.course(arm, unknowns, R, momenta, 0)
        turning = float(np.linalg.norm(course.omega, axis=1).max()) / base_rate
        left = angle_between(Rotation.from_matrix(course.attitudes[-1]).as_quat(), attitudes[k])
        times[k] = max(course.duration, turning) + _TURN * float(left) / float(fastest.min())
    return times
