"""Touch points of planar and spatial arms, and the initial states from which motions have them.

In space (Section VI), Case I, inside the path: at given first two joint angles the states on the
path and on the margin surface form lines; the motion through a state of them is tangent to the
surface where dS/dt = 0 (14). Case II, at an end: the time is given and dS/dt = 0 is no condition.
At given first joint angle and roll about point 3 the distance of point 3, (16), leaves curves of
(q2, q3), and S = S0 (15) selects states on them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy
from contourpy import contour_generator

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.tasks import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError, finite_number
from freefloat.motion.extrema import closest_approach
from freefloat.motion.motion import State
from freefloat.motion.problem import Problem, require_problem
from freefloat.planning.margin_lines import StatesOnPath, margin_lines, path_of_point_3
from freefloat.planning.planar_touch_points import planar_touch_points
from freefloat.planning.touch_point import (
    TouchKind,
    TouchPoint,
    distinct,
    motion_through,
    roots_between,
    touches,
)
from freefloat.regions.planar_regions import has_two_angle_form
from freefloat.rotations import Rotation
from freefloat.so3 import Array

_PAIRS = 50
"""Pairs of angles tried for each touch point requested."""
_EXACT = 1e-8
_ANGLES = np.linspace(-np.pi, np.pi * (1.0 + 2.0 / 180), 182)
"""Angles at which the distance is computed; one step more than a revolution, so that a root at its
ends is found."""


def touch_points(
    problem: Problem,
    q1: float | None = None,
    q2: float | None = None,
    *,
    roll: float | None = None,
    level: float | None = None,
) -> tuple[TouchPoint, ...]:
    """States at which motions have S = S0 as their smallest magnitude, in the order of time.

    Inside the path the motion is tangent to the margin surface (Case I: (14) and (15), for planar
    arms (27)); at an end it begins or ends on it (Case II: (15) and (16)). A planar arm has
    finitely many touch points. Touch points of a spatial arm (Section VI) form surfaces; two angles
    select from them: ``q1`` and ``q2`` in Case I, ``q1`` and ``roll`` in Case II. Maxima of the
    magnitude are left out. Whether a motion through a touch point keeps the margin elsewhere is
    decided by :func:`boundary_attitude`.

    In space, points closer together than the samples of time (1/200 of the duration), joint angles
    (2 degrees) and roll (2.5 degrees) may be missed, and in Case I for measures other than ``arm``
    also margin lines that are smaller loops: with a small S0 there is one around each nearly
    straight wrist.

    Args:
        problem: A planar problem whose S depends on two joint angles, or a pose task of an elbow
            arm with a spherical wrist.
        q1: First joint angle of a spatial arm [rad].
        q2: Second joint angle of a spatial arm [rad].
        roll: Rotation of the spacecraft about the direction of point 3 (36) [rad], from an
            arbitrary zero.
        level: Signed S0; both signs of the problem's margin when left out.

    Raises:
        InputError: For other tasks or arms, a level of zero, where S has no margin surface, or
            angles that are missing or too many.

    Example:
        >>> problem = ff.load_scenario("planar_3dof/parabola").problem()  # Example 1
        >>> [str(point.kind) for point in ff.touch_points(problem, level=5.0)][:2]
        ['tangent', 'tangent']
    """
    require_problem(problem)
    levels = _levels(problem, level)
    given = {"q1": q1, "q2": q2, "roll": roll}
    angles = {k: finite_number(k, v, "an angle [rad]") for k, v in given.items() if v is not None}
    if problem.task.planar:
        if angles or not has_two_angle_form(problem.model, problem.task):
            key = next(iter(angles), "robot")
            accepted = "no angles; a planar arm of two joints, or of three with an orientation"
            raise InputError(key, "the touch points of a planar arm are finitely many", accepted)
        points = planar_touch_points(problem, abs(levels[0]), (0.0, problem.path.duration))
        return tuple(point for point in points if point.level in levels)
    require_touch_point_arm(problem)
    if q1 is not None and q2 is not None and roll is None:
        return tangent_points(problem, angles["q1"], angles["q2"], levels)
    if q1 is not None and roll is not None and q2 is None:
        return end_points(problem, angles["q1"], angles["roll"], levels)
    raise InputError(
        "q1", f"{' and '.join(angles) or 'nothing'} given", "q1 and q2, or q1 and roll"
    )


def _levels(problem: Problem, level: float | None) -> tuple[float, ...]:
    """Signed values of S0."""
    key, accepted = "margin.value" if level is None else "level", "a value of S other than zero"
    value = finite_number(key, problem.margin.threshold if level is None else level, accepted)
    if value == 0.0:
        raise InputError(key, f"{value} was given", accepted)
    return (value, -value) if level is None else (value,)


def sample_touch_points(problem: Problem, count: int, seed: int) -> tuple[TouchPoint, ...]:
    """Touch points of a spatial arm, of both signs and cases, at evenly spread pairs of angles.

    There are fewer than ``count`` where 50 times as many pairs have no more; the seed shifts the
    pairs.

    Raises:
        InputError: As :func:`touch_points`.
    """
    shift = np.random.default_rng(seed).random(2)
    points: list[TouchPoint] = []
    for pair in low_discrepancy(_PAIRS * count, 2):
        q1, angle = np.pi * (2.0 * ((pair + shift) % 1.0) - 1.0)
        points += touch_points(problem, q1, angle)
        points += touch_points(problem, q1, roll=angle)
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
    motion = motion_through(problem, point, (0.0, problem.path.duration))
    if motion is None:
        return None
    smallest = closest_approach(motion, problem.margin.measure).value
    return motion.initial if motion.completed and touches(smallest, point.level) else None


def require_touch_point_arm(problem: Problem) -> None:
    """Raise an InputError unless the task and arm suit :func:`touch_points`."""
    arm = "six revolute joints, the second and third parallel, the last three intersecting"
    problem.model.require_supported("touch points")
    if problem.task is not Task.POSE:
        accepted = f"pose, with {arm}; the plan of a planar task has its touch points"
        raise InputError("task", f"{problem.task} has no touch points in space", accepted)
    if not VirtualManipulator.of(problem.model).has_elbow_and_spherical_wrist:
        raise InputError("robot", "the arm has no elbow and spherical wrist", arm)


def require_touch_points(problem: Problem) -> None:
    """Raise an InputError unless a problem can have touch points of its margin."""
    require_touch_point_arm(problem)
    if problem.margin.threshold == 0.0:
        reason = "the margin is zero, no motion is tangent to it"
        raise InputError("touch", reason, "a margin other than zero")


def tangent_points(
    problem: Problem, q1: float, q2: float, levels: tuple[float, ...]
) -> tuple[TouchPoint, ...]:
    """Every touch point of Case I with given first two joint angles [rad] and signed S0."""
    on_path = StatesOnPath(problem, q1, q2)
    points = [
        point
        for wrist in (1.0, -1.0)
        for value, line in margin_lines(on_path, wrist, levels)
        for point in _points_on_line(on_path, wrist, value, line)
    ]
    return distinct(problem, points)


def _points_on_line(
    on_path: StatesOnPath, wrist: float, level: float, line: Array
) -> Iterator[TouchPoint]:
    """Minima of the magnitude of S where dS/dt changes sign along a line.

    From states of :meth:`StatesOnPath.configurations` the distance of point 3, S = S0 and dS/dt = 0
    are solved to rounding.
    """
    problem, duration = on_path.problem, on_path.problem.path.duration
    slopes = on_path.slopes(line[:, 0], *on_path.configurations(line, wrist))
    steepness = np.abs(slopes[np.isfinite(slopes)]).max(initial=0.0)

    def errors(x: Array) -> Array:
        """Three numbers, NaN where the wrist has no solution."""
        state = np.array([[duration * x[0], *x[1:]]])
        t, q3, _ = state.T
        attitudes, joints = on_path.configurations(state, wrist)
        radii, point_3 = on_path.wrist(q3), on_path.path.at(t)[0]
        distance = np.linalg.norm(radii) - np.linalg.norm(point_3)
        (S,), (slope,) = on_path.measures(joints), on_path.slopes(t, attitudes, joints)
        return np.array([distance / on_path.reach, S / level - 1.0, slope / steepness])

    for i in roots_between(slopes):
        start = (line[i] + line[i + 1]) / 2.0
        solution = scipy.optimize.root(errors, [start[0] / duration, *start[1:]], tol=1e-12)
        tau, q3, roll = solution.x.tolist()
        if not np.abs(solution.fun).max() < _EXACT or not 0.0 < tau < 1.0:
            continue
        t = duration * tau
        attitudes, joints = on_path.configurations(np.array([[t, q3, roll]]), wrist)
        if on_path.is_minimum(t, attitudes[0], joints[0], level):
            state = attitudes[0].as_quat(), joints[0]
            yield TouchPoint.in_space(problem, TouchKind.TANGENT, t, level, *state)


def end_points(
    problem: Problem, q1: float, roll: float, levels: tuple[float, ...]
) -> tuple[TouchPoint, ...]:
    """Every touch point of Case II with given first joint angle, roll [rad] and signed S0."""
    ends = (TouchKind.START, 0.0), (TouchKind.END, problem.path.duration)
    return distinct(problem, [
        point
        for kind, t in ends
        for wrist in (1.0, -1.0)
        for point in _points_at_end(problem, (kind, t), (q1, roll, wrist), levels)
    ])  # fmt: skip


def _points_at_end(
    problem: Problem,
    end: tuple[TouchKind, float],
    given: tuple[float, float, float],
    levels: tuple[float, ...],
) -> Iterator[TouchPoint]:
    """Touch points; (15) and (16) are solved from where S - S0 changes sign on a curve.

    States belong to places (q2, q3), shape (K, 2), at the time of an end and with first joint
    angle, roll and sign of the wrist as given.
    """
    (kind, t), (q1, roll, wrist) = end, given
    reach = VirtualManipulator.of(problem.model).reach
    point_3, _ = path_of_point_3(problem).at(np.array([t]))

    def on_path(places: Array) -> StatesOnPath:
        return StatesOnPath(problem, q1, places[:, 0])

    def configurations(places: Array) -> tuple[Rotation, Array]:
        time, rolls = np.broadcast_to([[t], [roll]], (2, len(places)))
        states = np.column_stack([time, places[:, 1], rolls])
        return on_path(places).configurations(states, wrist)

    def off(places: Array) -> Array:
        """Distance of the wrist from the centre of mass, less the distance of point 3 [m], (K,)."""
        radii = np.linalg.norm(on_path(places).wrist(places[:, 1]), axis=1)
        return np.asarray(radii - np.linalg.norm(point_3))

    def measures(places: Array) -> Array:
        """S, (K,); NaN where the wrist has no solution."""
        return on_path(places).measures(configurations(places)[1])

    def refined(start: Array, level: float) -> Iterator[TouchPoint]:
        """The touch point near a place, unless the magnitude of S falls inside the path."""
        solution = scipy.optimize.root(
            lambda x: np.append(measures(x[None]) / level - 1.0, off(x[None]) / reach),
            start, tol=1e-13,
        )  # fmt: skip
        if not np.abs(solution.fun).max() < _EXACT:
            return
        attitudes, joints = configurations(solution.x[None])
        (slope,) = on_path(solution.x[None]).slopes(np.array([t]), attitudes, joints)
        inward = -1.0 if kind is TouchKind.END else 1.0
        if inward * level * slope >= 0.0:
            yield TouchPoint.in_space(problem, kind, t, level, attitudes.as_quat()[0], joints[0])

    q2, q3 = np.meshgrid(_ANGLES, _ANGLES)
    distances = off(np.column_stack([q2.ravel(), q3.ravel()])).reshape(q2.shape)
    for line in contour_generator(_ANGLES, _ANGLES, distances).lines(0.0):
        places = np.asarray(line)
        S = measures(places)
        for level in levels:
            for i in roots_between(S - level):
                yield from refined((places[i] + places[i + 1]) / 2.0, level)
