"""Touch points of spatial arms: Section VI, states through which a motion touches S = S0.

At given first two joint angles the states on the path and on the margin surface form lines; the
motion through a state of them touches the surface where dS/dt = 0 (14).

Only touches on the way, with a tangent, are meant: the paper's Case I. A smallest value at an end
of the path needs no dS/dt = 0, and end touches are not looked for. With momentum the system drifts
while the end-effector rests, and a touch there is one like any other. Without it everything stands
still at a rest, where dS/dt = 0 says nothing, and the speed of travel does not matter to where S is
smallest: then rates are per unit of s instead of time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.dynamics.momentum import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.motion.closest_approach import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.margin_lines import margin_lines
from freefloat.planning.planar_tangency import roots_between
from freefloat.planning.states_on_path import StatesOnPath
from freefloat.so3 import Array, frozen, low_discrepancy

_STEP = 1e-5
"""Of differences in Newton's method [share of the duration, rad, rad]."""
_ITERATIONS = 20
_LONGEST = 0.2
"""Newton's step is cut to this length, in the same units."""
_EXACT, _CONVERGED = 1e-8, 1e-12
_SAME = 1e-6
_ON_BOUNDARY = 1e-4
"""Share of S0 by which the smallest value of a motion through a touch point may differ from S0."""
_PAIRS = 50
"""Pairs (q1, q2) looked at for each touch point that a family is to have."""


@dataclass(frozen=True, eq=False)
class TangencyPoint:
    """A state through which a motion has S = S0 as a smallest magnitude.

    Attributes:
        time: [s].
        tau: Dimensionless time (19).
        attitude: Of the spacecraft, unit quaternion x, y, z, w, shape (4,).
        joints: Joint values, shape (6,).
        level: Signed value of S.
        branch: Number of the arm branch there.
        label: Of that branch, e.g. ``"shoulder+ elbow- wrist+"``.
    """

    time: float
    tau: float
    attitude: Array
    joints: Array
    level: float
    branch: int
    label: str


@dataclass(frozen=True, eq=False)
class BoundaryAttitude:
    """An initial state on the boundary of those that keep the margin.

    Attributes:
        attitude: Of the spacecraft at the start, unit quaternion x, y, z, w, shape (4,).
        joints: Joint values at the start, shape (6,).
        touch: Where the motion from there has its smallest S.
    """

    attitude: Array
    joints: Array
    touch: TangencyPoint


def tangency_points(
    problem: Problem, q1: float, q2: float, level: float | None = None
) -> tuple[TangencyPoint, ...]:
    """Every touch point with given first two joint angles, in the order of time.

    Touches at largest magnitudes of S are left out: no margin is kept beside them. Whether a motion
    through a touch point keeps the margin elsewhere is for :func:`boundary_attitude` to say.

    What lies nearer together than samples of time (1/200 of the duration), q3 (2 degrees) and turn
    (2.5 degrees) may be missed. So may be, where S does not split, a margin line that is a smaller
    loop than that: with a small S0 there is one around each nearly straight wrist.

    Args:
        problem: A pose task of an elbow arm with a spherical wrist.
        q1: First joint angle [rad].
        q2: Second joint angle [rad].
        level: Signed S0; both signs of the problem's margin when left out.

    Raises:
        InputError: For other tasks or arms, or a level of zero, where S has no margin surface.
    """
    require_tangency_arm(problem)
    if not np.isfinite([q1, q2]).all():
        raise InputError("joints", f"q1 = {q1}, q2 = {q2} was given", "two finite angles in rad")
    levels = _levels(problem, level)
    through = StatesOnPath(problem, float(q1), float(q2))
    found = [
        touch
        for bend in (1.0, -1.0)
        for each, line in margin_lines(through, bend, levels)
        for touch in _touches_on(through, bend, each, line)
    ]
    return tuple(_distinct(problem, found))


def tangency_family(problem: Problem, count: int, seed: int = 0) -> tuple[TangencyPoint, ...]:
    """Touch points of both signs from all over the first two joint angles.

    Args:
        problem: As for :func:`tangency_points`.
        count: How many. Fewer are found only where 50 times as many pairs (q1, q2) have no more.
        seed: Shifts the evenly spread pairs.

    Raises:
        InputError: As :func:`tangency_points`, and for a count below 1 or a seed below 0.
    """
    for key, number, smallest in (("count", count, 1), ("seed", seed, 0)):
        if number < smallest:
            raise InputError(key, f"{number} was given", f"{smallest} or more")
    shift = np.random.default_rng(seed).random(2)
    found: list[TangencyPoint] = []
    for pair in low_discrepancy(_PAIRS * count, 2):
        q1, q2 = np.pi * (2.0 * ((pair + shift) % 1.0) - 1.0)
        found += tangency_points(problem, q1, q2)
        if len(found) >= count:
            break
    return tuple(found[:count])


def integrate_to_start(problem: Problem, touch: TangencyPoint) -> Motion:
    """The reverse motion (Appendix A) from a touch point to the start of the path."""
    return integrate_motion(problem, touch.attitude, touch.joints, start=touch.time, end=0.0)


def boundary_attitude(problem: Problem, touch: TangencyPoint) -> BoundaryAttitude | None:
    """The initial state from which a motion has the touch point as its smallest S.

    Returns:
        None where the motion through the touch point becomes singular or comes nearer to a
        singularity elsewhere.
    """
    back = integrate_to_start(problem, touch)
    if not back.completed:
        return None
    attitude, joints = back.final.attitude, back.final.joints
    motion = integrate_motion(problem, attitude, joints)
    off = closest_approach(motion, problem.margin.measure).value - abs(touch.level)
    if not motion.completed or abs(off) > _ON_BOUNDARY * abs(touch.level):
        return None
    return BoundaryAttitude(attitude, joints, touch)


def require_tangency_arm(problem: Problem) -> None:
    """Raise an InputError unless touch points can be looked for; see :func:`tangency_points`."""
    arm = "six turning joints, the second and third parallel, the last three meeting in a point"
    if problem.task is not Task.POSE:
        raise InputError(
            "task", f"{problem.task}: touch points are looked for where the whole pose counts",
            f"pose, with {arm}; for planar tasks the plan has touch points and ranges",
        )  # fmt: skip
    if not VirtualManipulator.of(problem.model).has_elbow_and_spherical_wrist:
        raise InputError("robot", "its arm has no elbow under a spherical wrist", arm)


def require_tangency_points(problem: Problem) -> None:
    """Raise an InputError unless a problem can have tangency points of its margin."""
    require_tangency_arm(problem)
    if problem.margin.threshold == 0.0:
        raise InputError(
            "touch", "the margin is zero, no motion is tangent to it", "a margin other than zero"
        )


def _levels(problem: Problem, level: float | None) -> tuple[float, ...]:
    value = problem.margin.threshold if level is None else level
    if not np.isfinite(value) or value == 0.0:
        key = "margin.value" if level is None else "level"
        raise InputError(key, f"{value} was given", "a value of S other than zero")
    return (value, -value) if level is None else (value,)


def _touches_on(
    through: StatesOnPath, bend: float, level: float, line: Array
) -> Iterator[TangencyPoint]:
    """Where dS/dt changes sign along a line, and the magnitude of S is least."""
    slopes = through.slopes(line[:, 0], *through.at(line, bend))
    near = np.array(roots_between(slopes), dtype=int)
    if not len(near):
        return
    steepness = float(np.nanmax(np.abs(slopes)))
    states = _refined(through, bend, level, (line[near] + line[near + 1]) / 2.0, steepness)
    if not len(states):
        return
    attitudes, joints = through.at(states, bend)
    for t, attitude, q in zip(states[:, 0].tolist(), attitudes, joints, strict=True):
        if through.is_least(t, attitude, q, level):
            yield _told(through.problem, t, attitude, q, level)


def _refined(
    through: StatesOnPath, bend: float, level: float, starts: Array, steepness: float
) -> Array:
    """Solve the distance of point 3, S = S0 and dS/dt = 0 by Newton's method from many starts.

    Returns:
        Time, q3 and turn of those that converged on the way, shape (K, 3).
    """
    units = np.array([through.problem.path.duration, 1.0, 1.0])
    steps = np.vstack([np.zeros(3), _STEP * np.eye(3), -_STEP * np.eye(3)])

    def misses(x: Array) -> Array:
        states = units * x
        t, q3, _ = states.T
        attitudes, joints = through.at(states, bend)
        wrist, point_3 = through.wrist(q3), through.travel(t)[0]
        off = np.linalg.norm(wrist, axis=1) - np.linalg.norm(point_3, axis=1)
        S = through.measured(joints)
        slopes = through.slopes(t, attitudes, joints)
        return np.column_stack([off / through.reach, S / level - 1.0, slopes / steepness])

    x = starts / units
    for _ in range(_ITERATIONS):
        now, *moved = np.split(misses(np.vstack(x + steps[:, None])), 7)
        known = np.isfinite(np.hstack([now, *moved])).all(axis=1)
        change = np.stack(moved[:3], axis=1) - np.stack(moved[3:], axis=1)
        J = change / (2.0 * _STEP)  # transposed
        x, now, J = x[known], now[known], J[known]
        if not len(x):
            return starts[:0]
        if np.abs(now).max() < _CONVERGED:
            break
        normal = J @ J.transpose(0, 2, 1) + 1e-14 * np.eye(3)
        step = np.linalg.solve(normal, J @ now[:, :, None])[:, :, 0]
        x = x - step / np.maximum(1.0, np.abs(step).max(axis=1, keepdims=True) / _LONGEST)
    met = np.abs(misses(x)).max(axis=1) < _EXACT
    return np.asarray((units * x)[met & (x[:, 0] > 0.0) & (x[:, 0] < 1.0)])


def _told(
    problem: Problem, t: float, attitude: Rotation, joints: Array, level: float
) -> TangencyPoint:
    """The record of a touch, its joints those of the arm branch that it lies on."""
    quaternion = attitude.as_quat()
    branches = problem.branches(quaternion, t)
    nearest = min(branches, key=lambda one: problem.model.joint_distance(one.joints, joints))
    return TangencyPoint(t, t / problem.path.duration, frozen(quaternion), nearest.joints, level,
                      nearest.index, nearest.label)  # fmt: skip


def _distinct(problem: Problem, touches: list[TangencyPoint]) -> Iterator[TangencyPoint]:
    kept: list[TangencyPoint] = []
    for touch in sorted(touches, key=lambda touch: touch.time):
        same = (
            abs(touch.tau - other.tau) < _SAME
            and abs(abs(touch.attitude @ other.attitude) - 1.0) < _SAME**2
            and problem.model.joint_distance(touch.joints, other.joints) < _SAME
            for other in kept
        )
        if not any(same):
            kept.append(touch)
            yield touch
