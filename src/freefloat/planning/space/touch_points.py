"""Touch points of spatial arms: Section VI, states at which a motion is tangent to S = S0.

At given first two joint angles the states on the path and on the margin surface form lines; the
motion through a state of them is tangent to the surface where
dS/dt = 0 (14).

Only tangency inside the path is computed: the paper's Case I. A minimum at an end of the path needs
no dS/dt = 0 and is not looked for. With momentum or drift the system moves while the end-effector
rests, and tangency there is found like any other. Without them everything is at rest there,
dS/dt = 0 is no condition, and the minimum of S does not depend on the speed: rates are then per
unit of s.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import root

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.tasks import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import State
from freefloat.motion.problem import Problem
from freefloat.planning.plane.touch_points import distinct, roots_between
from freefloat.planning.space.margin_lines import StatesOnPath, margin_lines
from freefloat.so3 import Array, frozen

_EXACT = 1e-8
_SAME = 1e-6
_ON_BOUNDARY = 1e-4
"""Fraction of S0 by which the minimum of a motion through a touch point may differ from S0."""
_PAIRS = 50
"""Pairs (q1, q2) tried for each touch point requested."""


@dataclass(frozen=True, eq=False)
class TouchPoint:
    """A state at which a motion has S = S0 as a minimum of the magnitude.

    Attributes:
        time: Time [s].
        tau: Dimensionless time (19).
        attitude: Attitude of the spacecraft, unit quaternion x, y, z, w, shape (4,).
        joints: Joint values, shape (6,).
        level: Signed value of S.
        branch: Number of the arm branch there.
        label: Name of that branch, e.g. ``"shoulder+ elbow- wrist+"``.
    """

    time: float
    tau: float
    attitude: Array = field(repr=False)
    joints: Array = field(repr=False)
    level: float
    branch: int
    label: str


def touch_points(
    problem: Problem, q1: float, q2: float, level: float | None = None
) -> tuple[TouchPoint, ...]:
    """Every touch point with given first two joint angles, in the order of time.

    Maxima of the magnitude of S are left out. Whether a motion through a touch point keeps the
    margin elsewhere is decided by :func:`boundary_attitude`.

    Points closer together than the samples of time (1/200 of the duration), q3 (2 degrees) and
    roll about the wrist centre (2.5 degrees) may be missed, and for measures other than ``arm``
    also margin lines that are smaller loops: with a small S0 there is one around each nearly
    straight wrist.

    Args:
        problem: A pose task of an elbow arm with a spherical wrist.
        q1: First joint angle [rad].
        q2: Second joint angle [rad].
        level: Signed S0; both signs of the problem's margin when left out.

    Raises:
        InputError: For other tasks or arms, or a level of zero, where S has no margin surface.
    """
    require_touch_point_arm(problem)
    value = problem.margin.threshold if level is None else level
    if not np.isfinite(value) or value == 0.0:
        key = "margin.value" if level is None else "level"
        raise InputError(key, f"{value} was given", "a value of S other than zero")
    levels = (value, -value) if level is None else (value,)
    on_path = StatesOnPath(problem, float(q1), float(q2))
    points = [
        point
        for wrist in (1.0, -1.0)
        for value, line in margin_lines(on_path, wrist, levels)
        for point in _points_on_line(on_path, wrist, value, line)
    ]

    def same(point: TouchPoint, other: TouchPoint) -> bool:
        distance = float(problem.model.joint_distance(point.joints, other.joints))
        return max(abs(point.tau - other.tau), distance) < _SAME

    return distinct(points, same)


def sample_touch_points(problem: Problem, count: int, seed: int) -> tuple[TouchPoint, ...]:
    """Touch points of both signs at evenly spread first two joint angles.

    There are fewer than ``count`` where 50 times as many pairs (q1, q2) have no more; the seed
    shifts the pairs.

    Raises:
        InputError: As :func:`touch_points`.
    """
    shift = np.random.default_rng(seed).random(2)
    points: list[TouchPoint] = []
    for pair in low_discrepancy(_PAIRS * count, 2):
        q1, q2 = np.pi * (2.0 * ((pair + shift) % 1.0) - 1.0)
        points += touch_points(problem, q1, q2)
        if len(points) >= count:
            break
    return tuple(points[:count])


def boundary_attitude(problem: Problem, point: TouchPoint) -> State | None:
    """The initial state from which a motion has a touch point as its closest approach.

    The motion is integrated backward (Appendix A) from the touch point to the path's start.

    Returns:
        None where the motion through the touch point becomes singular or comes closer to a
        singularity elsewhere.
    """
    backward = integrate_motion(problem, point.attitude, point.joints, start=point.time, end=0.0)
    if not backward.completed:
        return None
    start = backward.final
    motion = integrate_motion(problem, start.attitude, start.joints)
    smallest = closest_approach(motion, problem.margin.measure).value
    on_boundary = math.isclose(smallest, abs(point.level), rel_tol=_ON_BOUNDARY)
    return start if motion.completed and on_boundary else None


def require_touch_point_arm(problem: Problem) -> None:
    """Raise an InputError unless the task and arm suit :func:`touch_points`."""
    arm = "six revolute joints, the second and third parallel, the last three intersecting"
    problem.model.require_one_arm("touch points")
    if problem.task is not Task.POSE:
        raise InputError(
            "task", f"{problem.task} has no touch points in space",
            f"pose, with {arm}; the plan of a planar task has its touch points",
        )  # fmt: skip
    if not VirtualManipulator.of(problem.model).has_elbow_and_spherical_wrist:
        raise InputError("robot", "the arm has no elbow and spherical wrist", arm)


def require_touch_points(problem: Problem) -> None:
    """Raise an InputError unless a problem can have touch points of its margin."""
    require_touch_point_arm(problem)
    if problem.margin.threshold == 0.0:
        raise InputError(
            "touch", "the margin is zero, no motion is tangent to it", "a margin other than zero"
        )


def _points_on_line(
    on_path: StatesOnPath, wrist: float, level: float, line: Array
) -> Iterator[TouchPoint]:
    """Minima of the magnitude of S where dS/dt changes sign along a line."""
    slopes = on_path.slopes(line[:, 0], *on_path.configurations(line, wrist))
    for i in roots_between(slopes):
        steepness = float(np.nanmax(np.abs(slopes)))
        point = _refined(on_path, wrist, level, (line[i] + line[i + 1]) / 2.0, steepness)
        if point is not None:
            yield point


def _refined(
    on_path: StatesOnPath, wrist: float, level: float, start: Array, steepness: float
) -> TouchPoint | None:
    """Solve the distance of point 3, S = S0 and dS/dt = 0 to rounding.

    Returns:
        None where there is no minimum inside the path near the start, a state of
        :meth:`StatesOnPath.configurations`.
    """
    problem, duration = on_path.problem, on_path.problem.path.duration

    def errors(x: Array) -> Array:
        """Three numbers, NaN where the wrist has no solution."""
        state = np.array([[duration * x[0], *x[1:]]])
        t, q3, _ = state.T
        attitudes, joints = on_path.configurations(state, wrist)
        radii, point_3 = on_path.wrist(q3), on_path.point_3_at(t)[0]
        distance = np.linalg.norm(radii) - np.linalg.norm(point_3)
        (S,), (slope,) = on_path.measures(joints), on_path.slopes(t, attitudes, joints)
        return np.array([distance / on_path.reach, S / level - 1.0, slope / steepness])

    solution = root(errors, [start[0] / duration, *start[1:]], tol=1e-12)
    tau, q3, roll = solution.x.tolist()
    if not np.abs(solution.fun).max() < _EXACT or not 0.0 < tau < 1.0:
        return None
    t = duration * tau
    attitudes, joints = on_path.configurations(np.array([[t, q3, roll]]), wrist)
    attitude, q = attitudes[0], joints[0]
    if not on_path.is_minimum(t, attitude, q, level):
        return None
    quaternion = attitude.as_quat()
    branches = problem.branches(quaternion, t)
    branch = min(branches, key=lambda b: problem.model.joint_distance(b.joints, q))
    return TouchPoint(t, tau, frozen(quaternion), branch.joints, level, branch.index, branch.label)
