"""Motions of spacecraft and arm for prescribed joints."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from freefloat.motion.joint_spline import JointSpline
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import DEGREE, NODES
from freefloat.motion.problem import Problem
from freefloat.so3 import Array

_TOLERANCE = 1e-12
_PANELS = 4
"""Panels of a motion in a span: their polynomials are exact to 1e-10."""


def integrate_spline(problem: Problem, spline: JointSpline, attitude: Array) -> Motion:
    """The motion of spacecraft and arm along a spline, with the momentum of the problem.

    Args:
        problem: Robot and momentum; the joints have the timing of its path, which itself is not
            followed.
        spline: The joints.
        attitude: Attitude of the spacecraft at the start, unit quaternion x, y, z, w.
    """
    problem.model.require_one_arm("joint motions")
    timing, system = problem.path.timing, problem.system
    times = node_times(problem, spline)

    def change(t: float, quaternion: Array) -> Array:
        s, speed = timing.s(t), timing.s(t, 1)
        unit = quaternion / np.linalg.norm(quaternion)
        x, y, z = system.base_rate(unit, spline.at(s), spline.at(s, 1) * speed).tolist()
        by_rate = [[0, z, -y, x], [-z, 0, x, y], [y, -x, 0, z], [-x, -y, -z, 0]]  # (8c)
        return np.asarray(np.array(by_rate) @ quaternion / 2.0)

    state, rows, size = attitude, list[Array](), (len(times) - 1) // spline.spans
    for first in range(0, len(times) - 1, size):
        chosen = times[first : first + size + 1]
        solution = solve_ivp(
            change, (chosen[0], chosen[-1]), state, method="DOP853", t_eval=chosen,
            rtol=_TOLERANCE, atol=_TOLERANCE,
        )  # fmt: skip
        state = solution.y[:, -1]
        rows.append(solution.y.T[: size + (first + size == len(times) - 1)])
    quaternions = np.vstack(rows)
    attitudes = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    joints = spline.at([float(timing.s(t)) for t in times])
    return Motion(problem, Ending.COMPLETED, times, attitudes, joints, spline)


def node_times(problem: Problem, spline: JointSpline) -> Array:
    """Times of the nodes of the motion along a spline in the duration of a problem's path [s]."""
    panels = _PANELS * spline.spans
    inner = (np.arange(panels)[:, None] + (NODES[:DEGREE] + 1.0) / 2.0) / panels
    return np.asarray(problem.path.duration * np.append(inner.ravel(), 1.0))
