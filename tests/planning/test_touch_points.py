"""Touch points in space: states at which a motion has S = S0 as its minimum magnitude."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import root
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.planning.touch_points import boundary_attitude, require_touch_points, touch_points
from tests.errors import error_key
from tests.motions import bundled
from tests.robots import random_robot

MOMENTUM = (0.5, 0.3, 0.1)
STILL = (0.0, 0.0, 0.0)


def changed(problem, *, h=None, path=None, measure=None, value=None):
    margin = problem.margin
    if measure is not None:
        margin = ff.Margin(ff.singularity_measure(problem.model, problem.task, measure), value)
    h = problem.momentum if h is None else h
    return ff.Problem(problem.model, path or problem.path, problem.task, h, margin)


@pytest.fixture(scope="module")
def problem():
    return bundled("spatial_6dof/line")


def gap(a, b):
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi).max()


CASES = [
    ("arm", 5.0, MOMENTUM, (0.1, 2.0)),
    ("arm", 5.0, STILL, (-1.0, 1.2)),
    pytest.param(("gjm", 0.004, MOMENTUM, (0.4, 2.2)), marks=pytest.mark.slow),
]


@cache
def computed(measure, value, h, pair):
    problem = changed(bundled("spatial_6dof/line"), h=h, measure=measure, value=value)
    return problem, *pair, touch_points(problem, *pair)


@pytest.fixture(params=CASES, ids=lambda case: f"{case[0]}{case[2]}")
def case(request):
    return computed(*request.param)


def increase(problem, point, step):
    """|S| - |S0| on the precise motion through a touch point, before and after it."""
    ends = [
        ff.integrate_motion(
            problem, point.attitude, point.joints, start=point.time, end=point.time + sign * step
        ).final.joints
        for sign in (-1, 1)
    ]
    return np.array([abs(problem.margin.measure(q)) for q in ends]) - abs(point.level)


@pytest.mark.slow
def test_touch_points_are_on_the_path_and_on_the_margin_surface(case):
    """(35) and (34) with S = S0, at the requested angles, on the reported branch."""
    problem, q1, q2, points = case
    assert points
    assert {point.level for point in points} <= {
        problem.margin.threshold,
        -problem.margin.threshold,
    }
    for point in points:
        pose = problem.model.end_effector_pose(point.attitude, point.joints)
        required = problem.path.pose(point.time)
        assert pose.position == pytest.approx(required.position, abs=1e-9)
        assert pose.rotation == pytest.approx(required.rotation, abs=1e-9)
        assert gap(point.joints[:2], np.array([q1, q2])) < 1e-7
        S = problem.margin.measure(point.joints)
        assert pytest.approx(point.level, rel=1e-8) == S
        assert problem.nearest(point.joints, problem.branches(point.attitude, point.time))


@pytest.mark.slow
def test_motions_have_their_minimum_at_touch_points(case):
    """(14): before and after |S| is larger, to second order in the time between."""
    problem, _, _, points = case
    assert points
    for point in points[:: max(1, len(points) // 8)]:
        far, near = (increase(problem, point, step) for step in (0.1, 0.05))
        assert near.min() > 0.0
        assert near == pytest.approx(far / 4.0, rel=0.15)


def pose_errors(problem, t, attitude, joints):
    """How far the end-effector is from the path, by Pinocchio: three lengths, three angles."""
    pose, reached = problem.path.pose(t), problem.model.end_effector_pose(attitude, joints)
    turn = Rotation.from_matrix(pose.rotation.T @ reached.rotation).as_rotvec()
    return [*(reached.position - pose.position), *turn]


def touch_equations(problem, q1, q2, level):
    """(31), S = S0 and dS/dt = 0: ten equations of rotation, joints and time."""
    path, S = problem.path, problem.margin.measure
    solver = ResolvedRateSolver(problem.system, problem.task)

    def equations(x):
        t, attitude, q = path.duration * x[9], Rotation.from_rotvec(x[:3]).as_quat(), x[3:9]
        twist = path.twist(t) if problem.momentum.any() else path.path.tangent(path.timing.s(t))
        rates = solver.rates(attitude, q, twist)[1]
        step = 1e-6 / np.abs(rates).max()
        slope = (S(q + step * rates) - S(q - step * rates)) / (2e-6 * level)
        errors = pose_errors(problem, t, attitude, q)
        return [*errors, S(q) / level - 1.0, slope, np.sin(q[0] - q1), np.sin(q[1] - q2)]

    return equations


@pytest.mark.slow
def test_no_touch_point_is_missing(case):
    """What SciPy finds from random states is known, or no minimum of |S|, or beyond the path."""
    problem, q1, q2, points = case
    rng, duration, seen = np.random.default_rng(1), problem.path.duration, 0
    for level in (problem.margin.threshold, -problem.margin.threshold):
        equations = touch_equations(problem, q1, q2, level)
        for _ in range(25):
            start = [*Rotation.random(random_state=rng).as_rotvec(), q1, q2,
                     *rng.uniform(-np.pi, np.pi, 4), rng.uniform(0.05, 0.95)]  # fmt: skip
            x = (solution := root(equations, start, tol=1e-12)).x
            attitude, joints, t = Rotation.from_rotvec(x[:3]).as_quat(), x[3:9], duration * x[9]
            fits = np.abs(solution.fun).max() < 1e-8 and gap(joints[:2], np.array([q1, q2])) < 0.1
            if not fits or not 0.1 < t < duration - 0.1:
                continue
            known = any(
                abs(t - point.time) < 1e-3 and gap(joints, point.joints) < 1e-3 for point in points
            )
            reached = SimpleNamespace(time=t, attitude=attitude, joints=joints, level=level)
            assert known or increase(problem, reached, 0.02).min() < 0.0, (t, joints)
            seen += known
    assert seen >= 2


def unit(v):
    return v / np.linalg.norm(v)


def random_line(seed):
    """A line that begins or ends on the margin at some states: a path, q1 and a roll."""
    rng = np.random.default_rng(seed)
    problem = bundled("spatial_6dof/line")
    curve = ff.paths.PolynomialCurve.line(
        *(rng.uniform(0.7, 1.6) * unit(rng.normal(size=3)) for _ in range(2))
    )
    orientation = ff.paths.FixedOrientation(Rotation.random(random_state=seed).as_matrix())
    path = ff.TimedPath(ff.EndEffectorPath(curve, orientation), ff.Timing(rng.uniform(20, 200)))
    measure, level = ("arm", rng.uniform(0.5, 8.0)) if seed % 2 else ("gjm", 0.004)
    h = rng.normal(size=3) * (seed % 3)
    changed_problem = changed(problem, h=h, path=path, measure=measure, value=level)
    return changed_problem, *rng.uniform(-3.0, 3.0, 2)


def joint_2_axis(problem, attitude, joints):
    return attitude.apply(VirtualManipulator.of(problem.model).kinematics(joints)[3][1, 0])


def end_equations(problem, point):
    """(31), (15), q1, and the roll about point 3, as nine equations of a rotation and joints."""
    pose = problem.path.pose(point.time)
    zero = VirtualManipulator.of(problem.model)
    to_wrist = zero.pose(np.zeros(6)).rotation.T @ (
        zero.wrist_centre - zero.pose(np.zeros(6)).position
    )
    point_3 = pose.position + pose.rotation @ to_wrist
    axis = joint_2_axis(problem, Rotation.from_quat(point.attitude), point.joints)
    across = np.cross(point_3, axis)

    def equations(x):
        attitude, q = Rotation.from_rotvec(x[:3]), x[3:]
        errors = pose_errors(problem, point.time, attitude.as_quat(), q)
        around = across @ joint_2_axis(problem, attitude, q)
        S = problem.margin.measure(q) / point.level - 1.0
        return [*errors, S, np.sin(q[0] - point.joints[0]), around]

    return equations


END_PATHS = [4, 9]
"""Even ones have the measure gjm, odd ones arm."""


@pytest.mark.slow
@pytest.mark.parametrize("seed", END_PATHS)
def test_touch_points_at_ends_of_paths_solve_the_equations(seed):
    """Case II, (15) and (16): SciPy finds them from Pinocchio's poses and S, to 1e-8."""
    problem, q1, roll = random_line(seed)
    points = ff.touch_points(problem, q1, roll=roll)
    rng = np.random.default_rng(seed)
    for point in points[:: max(1, len(points) // 3)]:
        state = [*Rotation.from_quat(point.attitude).as_rotvec(), *point.joints]
        start = state + rng.uniform(-1e-2, 1e-2, 9)
        solution = root(end_equations(problem, point), start, tol=1e-14)
        assert np.abs(solution.fun).max() < 1e-11
        turn = Rotation.from_rotvec(solution.x[:3]).inv() * Rotation.from_quat(point.attitude)
        assert turn.magnitude() < 1e-8
        assert gap(solution.x[3:], point.joints) < 1e-8
    chosen = next(point for point in points if boundary_attitude(problem, point) is not None)
    start = boundary_attitude(problem, chosen)
    motion = ff.integrate_motion(problem, start.attitude, start.joints)
    closest = ff.closest_approach(motion, problem.margin.measure)
    end = 0.0 if chosen.kind == "start" else problem.path.duration
    assert closest.time == pytest.approx(end, abs=1e-4 * problem.path.duration)
    assert closest.value == pytest.approx(abs(chosen.level), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [9, 2])
def test_no_touch_point_at_an_end_is_missing(seed):
    """What SciPy finds from random states at the same q1, roll, end and level is known."""
    problem, q1, roll = random_line(seed)
    points = ff.touch_points(problem, q1, roll=roll)
    equations, rng, seen = end_equations(problem, points[0]), np.random.default_rng(seed), 0
    axis = joint_2_axis(problem, Rotation.from_quat(points[0].attitude), points[0].joints)
    for start in rng.uniform(-np.pi, np.pi, (40, 9)):
        solution = root(equations, start, tol=1e-13)
        attitude, q = Rotation.from_rotvec(solution.x[:3]), solution.x[3:]
        same_roll = axis @ joint_2_axis(problem, attitude, q) > 0.0
        if np.abs(solution.fun).max() > 1e-9 or not same_roll or np.cos(q[0] - q1) < 0.0:
            continue
        known = any(gap(q, point.joints) < 1e-6 for point in points)
        inside = 0.05 if points[0].kind == "start" else points[0].time - 0.05
        motion = ff.integrate_motion(
            problem, attitude.as_quat(), q, start=points[0].time, end=inside
        )
        assert known or abs(problem.margin.measure(motion.final.joints)) < abs(points[0].level)
        seen += known
    assert seen >= 2


def test_problems_without_touch_points_are_refused(problem, tmp_path):
    planar = bundled("planar_3dof/parabola")
    assert error_key(require_touch_points, planar) == "task"
    robot = random_robot(np.random.default_rng(5))
    (tmp_path / "robot.urdf").write_text(robot.text)
    model = ff.FreeFloatingModel.from_urdf(tmp_path / "robot.urdf", robot.end_effector)
    margin = ff.Margin(ff.singularity_measure(model, ff.Task.POSE, "gjm"), 0.1)
    other = ff.Problem(model, problem.path, ff.Task.POSE, STILL, margin)
    assert error_key(touch_points, other, 0.1, 2.0) == "robot"
    bare = changed(problem, measure="arm", value=0.0)
    assert error_key(touch_points, bare, 0.1, 2.0) == "margin.value"
    assert error_key(ff.attitude_map, bare, 64, touch=4) == "touch"
    assert error_key(touch_points, problem, 0.1, 2.0, level=0.0) == "level"
