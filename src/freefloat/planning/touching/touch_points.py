"""Touch points of planar and spatial arms, and the initial states from which motions have them."""

from __future__ import annotations

import numpy as np

from freefloat.attitude_grids import low_discrepancy
from freefloat.dynamics.tasks import Task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import InputError
from freefloat.motion.extrema import closest_approach
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Motion, State
from freefloat.motion.problem import Problem
from freefloat.planning.touching.planar_points import planar_touch_points
from freefloat.planning.touching.spatial_points import end_points, tangent_points
from freefloat.planning.touching.touch_point import TouchPoint, touches
from freefloat.regions.planar_regions import has_two_angle_form

_PAIRS = 50
"""Pairs of angles tried for each touch point requested."""


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
    finitely many touch points. Those of a spatial arm (Section VI) form surfaces, and two angles
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
        q2: Its second joint angle [rad].
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
    levels = _levels(problem, level)
    given = [name for name, angle in (("q1", q1), ("q2", q2), ("roll", roll)) if angle is not None]
    if problem.task.planar:
        if given or not has_two_angle_form(problem.model, problem.task):
            key = given[0] if given else "robot"
            accepted = "no angles; a planar arm of two joints, or of three with an orientation"
            raise InputError(key, "the touch points of a planar arm are finitely many", accepted)
        duration = problem.path.duration
        points = planar_touch_points(problem, abs(levels[0]), (0.0, duration))
        return tuple(point for point in points if point.level in levels)
    require_touch_point_arm(problem)
    if q1 is not None and q2 is not None and roll is None:
        return tangent_points(problem, float(q1), float(q2), levels)
    if q1 is not None and roll is not None and q2 is None:
        return end_points(problem, float(q1), float(roll), levels)
    raise InputError("q1", f"{' and '.join(given) or 'nothing'} given", "q1 and q2, or q1 and roll")


def _levels(problem: Problem, level: float | None) -> tuple[float, ...]:
    """Signed values of S0."""
    value = problem.margin.threshold if level is None else level
    if not np.isfinite(value) or value == 0.0:
        key = "margin.value" if level is None else "level"
        raise InputError(key, f"{value} was given", "a value of S other than zero")
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


def motion_through(problem: Problem, point: TouchPoint, span: tuple[float, float]) -> Motion | None:
    """The motion that passes a touch point, from the first to the last time of a span [s].

    Returns:
        None where it is singular before the touch point.
    """
    attitude, joints, (start, end) = point.attitude, point.joints, span
    if point.time > start:
        backward = integrate_motion(problem, attitude, joints, start=point.time, end=start)
        if not backward.completed:
            return None
        attitude, joints = backward.final.attitude, backward.final.joints
    return integrate_motion(problem, attitude, joints, start=start, end=end)


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
