"""The paper's two examples and what several numbers and findings share of them, computed once."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

import freefloat as ff
from freefloat.dynamics.measures import SingularityMeasure
from freefloat.motion.motion import Motion
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from freefloat.planning.plan import Plan
from freefloat.planning.plane.ranges import RangeLimit
from freefloat.planning.touch_point import TouchPoint
from freefloat.planning.touch_points import touch_points
from freefloat.so3 import Array, axes_rotation

TABLE_1 = {
    "l": np.array([0.5, 1.0, 0.5, 0.2]),
    "r": np.array([0.5, 1.0, 0.5, 0.2]),
    "m": np.array([400.0, 40.0, 30.0, 1.0]),
}
"""Lengths [m] and masses [kg]; l of the spacecraft has no meaning, and no mass is before it."""
NORMAL, OFFSET = np.array([0.4683, 1.1683, -0.7000]), 0.4683
"""The plane (41): ``NORMAL @ position == OFFSET``."""
H_PRINTED, H_EXCHANGED = (0.5, 0.3, 0.1), (0.3, 0.5, 0.1)
TOUCH_JOINTS = np.array([0.1, 2.0, 3.3076, -2.6104, 2.2981, 1.4288])
TOUCH_ATTITUDE = np.array([0.4295, -0.147, 0.6898, -0.564])
TOUCH_TAU = 0.4225
INITIAL_ATTITUDE = np.array([0.46, 0.0935, 0.7352, -0.489])
BAD_ATTITUDE = np.array([0.1, 0.5, 0.2, -0.8367])
PLANAR_TOUCH_JOINTS = {
    "FB": np.array([-3.6512, 0.1762, 1.7885]),
    "AF, first": np.array([-0.6074, 2.9265, 0.9617]),
    "AF, second": np.array([-0.7348, 2.9014, 0.2833]),
}
"""The printed touch points of Example 1, by segment."""


@cache
def example_1(name: str = "parabola") -> ff.Problem:
    """Example 1, resting at F, or ``parabola_nonstop``."""
    return ff.load_scenario(f"planar_3dof/{name}").problem()


@cache
def plan_of_example_1(name: str = "parabola") -> Plan:
    return ff.plan(example_1(name))


def limits(segment: int) -> list[RangeLimit]:
    """The range limits of AF (0) or FB (1) with S > 0, in the order of time."""
    found = plan_of_example_1().segments[segment].limits
    return sorted(
        (limit for limit in found if limit.touch_point.level > 0.0),
        key=lambda limit: limit.touch_point.time,
    )


@cache
def example_2(momentum: tuple[float, ...] = H_PRINTED, *, moved: bool = True) -> ff.Problem:
    """Example 2 with B moved along z into the plane (41), or as printed and bundled."""
    problem = ff.load_scenario("spatial_6dof/line").problem().replace(momentum=momentum)
    if not moved:
        return problem
    A, B = (problem.path.path.curve(s) for s in (0.0, 1.0))
    B = np.array([*B[:2], (OFFSET - NORMAL[:2] @ B[:2]) / NORMAL[2]])
    axes = axes_rotation("attitude", ("x", NORMAL), ("z", A - B))
    path = ff.EndEffectorPath(PolynomialCurve.line(A, B), FixedOrientation(axes))
    return problem.replace(path=ff.TimedPath(path, problem.path.timing))


@cache
def touch_point_of_example_2(momentum: tuple[float, ...]) -> TouchPoint:
    """The touch point at the printed q1 and q2 that comes nearest to the printed one."""
    points = touch_points(example_2(momentum), *TOUCH_JOINTS[:2].tolist(), level=-5.0)
    return min(
        points, key=lambda point: np.abs(near(point.joints, TOUCH_JOINTS) - TOUCH_JOINTS).max()
    )


def spatial_motion() -> Motion:
    """The motion of Example 2 from the printed attitude, of the arm branch with the touch point."""
    problem, point = example_2(), touch_point_of_example_2(H_EXCHANGED)
    back = ff.integrate_motion(problem, point.attitude, point.joints, start=point.time, end=0.0)
    branches = problem.branches(INITIAL_ATTITUDE)
    branch = min(branches, key=lambda b: problem.model.joint_distance(b.joints, back.final.joints))
    return ff.integrate_motion(problem, INITIAL_ATTITUDE, branch.joints)


def planar_motion(degrees: float) -> Motion:
    """The motion of Example 1 with S > 0 from a heading."""
    return ff.simulate(example_1(), heading=np.radians(degrees), branch=0).chosen.motion


def initial_attitude(momentum: tuple[float, ...]) -> Array:
    """Back from the touch point with exchanged momentum to A, with this momentum."""
    point = touch_point_of_example_2(H_EXCHANGED)
    back = ff.integrate_motion(
        example_2(momentum), point.attitude, point.joints, start=point.time, end=0.0
    )
    return same_side(back.final.attitude, INITIAL_ATTITUDE)


@cache
def points_c(*, moved: bool) -> tuple[Array, ...]:
    """Where the branches of Example 2 from the bad attitude become singular [m]."""
    problem = example_2(moved=moved)
    motions = [branch.motion for branch in ff.simulate(problem, BAD_ATTITUDE).branches]
    ends = [motion.final for motion in motions if not motion.completed]
    return tuple(problem.model.end_effector_pose(x.attitude, x.joints).position for x in ends)


def near(angles: ArrayLike, printed: ArrayLike) -> Array:
    """Angles [rad], less whole revolutions, nearest to printed ones."""
    difference = np.asarray(angles) - np.asarray(printed)
    return np.asarray(printed + np.angle(np.exp(1j * difference)))


def same_side(quaternion: Array, printed: ArrayLike) -> Array:
    """Of a quaternion and its opposite the one on the side of a printed one."""
    return np.asarray(quaternion * np.sign(quaternion @ np.asarray(printed)))


def rounding(measure: SingularityMeasure, joints: Array) -> float:
    """How far the rounding of joints to four decimals alone may change a measure."""
    step = 1e-6
    changes = [measure(joints + d) - measure(joints - d) for d in step * np.eye(len(joints))]
    return float(np.abs(changes).sum() / (2.0 * step) * 0.5e-4)
