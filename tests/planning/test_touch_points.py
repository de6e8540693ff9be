"""Touch points in space: states at which a motion has S = S0 as its minimum magnitude."""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import root
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.planning.touching.touch_points import (
    boundary_attitude,
    require_touch_points,
    touch_points,
)
from tests.errors import error_key
from tests.motions import bundled
from tests.robots import random_robot

MOMENTUM = (0.5, 0.3, 0.1)
STILL = (0.0, 0.0, 0.0)


def changed(problem, *, h=None, path=None, measure=None, value=None):
    """The same problem with some parts replaced."""
    margin = problem.margin
    if measure is not None:
        margin = ff.Margin(ff.singularity_measure(problem.model, problem.task, measure), value)
    h = problem.momentum if h is None else h
    return ff.Problem(problem.model, path or problem.path, problem.task, h, margin)


@pytest.fixture(scope="module")
def problem():
    return bundled("spatial_6dof/line")


def gap(a, b):
    """Largest difference of angles modulo 2 pi."""
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi).max()


CASES = [
    ("arm", 5.0, MOMENTUM, (0.1, 2.0)),
    ("arm", 5.0, STILL, (-1.0, 1.2)),
    pytest.param(("gjm", 0.004, MOMENTUM, (0.4, 2.2)), marks=pytest.mark.slow),
]


@cache
def computed(measure, value, h, pair):
    """A problem, q1 and q2, and their touch points."""
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


class BruteForce:
    """States from textbook formulas: Euler angles of the wrist, q3 by the law of cosines."""

    def __init__(self, problem, q1, q2):
        self.problem, self.virtual = problem, VirtualManipulator.of(problem.model)
        self.q = np.array([q1, q2, 0.0, 0.0, 0.0, 0.0])
        self.wrist_to_tool = np.linalg.norm(self.virtual.kinematics(self.q)[0][0] - self.wrist(0.0))
        square = [self.wrist(q3) @ self.wrist(q3) for q3 in (0.0, np.pi / 2, np.pi)]
        mean = (square[0] + square[2]) / 2
        self.form = mean, (square[0] - square[2]) / 2, square[1] - mean
        self.drift = ResolvedRateSolver(problem.system, problem.task)

    def wrist(self, q3):
        return self.virtual.kinematics([*self.q[:2], q3, 0, 0, 0])[2][3, 0]

    def states(self, t, rolls, elbow, flip):
        """Attitudes and joints at a time, for many rolls; None out of reach."""
        pose = self.problem.path.pose(t)
        point_3 = pose.position - self.wrist_to_tool * pose.rotation[:, 0]
        mean, cosine, sine = self.form
        fraction = (point_3 @ point_3 - mean) / np.hypot(cosine, sine)
        if abs(fraction) > 1.0:
            return None
        q3 = np.arctan2(sine, cosine) + elbow * np.arccos(fraction)
        w, a = self.wrist(q3), np.array([0.6, -0.48, 0.64])
        frames = []
        for v in (point_3, w):
            x, y = v / np.linalg.norm(v), np.cross(a, v) / np.linalg.norm(np.cross(a, v))
            frames.append(Rotation.from_matrix(np.column_stack([x, y, np.cross(x, y)])))
        spin = Rotation.from_rotvec(np.outer(rolls, [1.0, 0.0, 0.0]))
        attitudes = frames[0] * spin * frames[1].inv()
        forearm = Rotation.from_matrix(self.virtual.pose([*self.q[:2], q3, 0, 0, 0]).rotation)
        required = forearm.inv() * attitudes.inv() * Rotation.from_matrix(pose.rotation)
        wrist = required.as_euler("XYX") * [1.0, -1.0, 1.0]
        if flip:
            wrist = wrist * [1.0, -1.0, 1.0] + [np.pi, 0.0, np.pi]
        first = np.broadcast_to([*self.q[:2], q3], (len(rolls), 3))
        return attitudes.as_quat(), np.hstack([first, wrist])

    def slope(self, t, attitude, q):
        """dS per duration, without momentum per path, in the direction of the motion."""
        path, S = self.problem.path, self.problem.margin.measure
        if self.problem.momentum.any():
            rates = path.duration * self.drift.rates(attitude, q, path.twist(t))[1]
        else:
            rates = self.drift.rates(attitude, q, path.path.tangent(path.timing.s(t)))[1]
        step = 1e-6 / max(1.0, np.abs(rates).max())
        return (S(q + step * rates) - S(q - step * rates)) / (2 * step)

    def points(self, levels, times, rolls):
        """Times, attitudes and joints of common roots of S - S0 and dS/dt, from every cell."""
        for elbow in (1, -1):
            for flip in (False, True):
                rows = [self.states(t, rolls, elbow, flip) for t in times]
                S = np.array([self.measured(row, len(rolls)) for row in rows])
                corners = np.stack([S[:-1, :-1], S[1:, :-1], S[:-1, 1:], S[1:, 1:]])
                for level in levels:
                    mixed = np.abs(np.sign(corners - level).sum(axis=0)) < 4
                    for i, j in self.cells_where_slopes_differ(mixed, times, rows):
                        cell = times[i : i + 2], rolls[j : j + 2]
                        yield from self.root_in(*cell, elbow, flip, level)

    def cells_where_slopes_differ(self, mixed, times, rows):
        slopes = {}
        for i, j in np.argwhere(mixed).tolist():
            corners = [(k, m) for k in (i, i + 1) for m in (j, j + 1)]
            for k, m in corners:
                if (k, m) not in slopes:
                    slopes[k, m] = self.slope(times[k], rows[k][0][m], rows[k][1][m])
            if 0 < sum(slopes[corner] > 0.0 for corner in corners) < 4:
                yield i, j

    def measured(self, row, count):
        if row is None:
            return np.full(count, np.nan)
        measure = self.problem.margin.measure
        alike = measure.name == "arm"  # S is the same at every roll (40)
        return np.broadcast_to([measure(q) for q in (row[1][:1] if alike else row[1])], count)

    def root_in(self, times, rolls, elbow, flip, level):
        start = np.array([times.mean(), rolls.mean()])
        size = np.array([np.ptp(times), np.ptp(rolls)])

        def residuals(x):
            t, roll = start + size * x
            states = self.states(t, np.array([roll]), elbow, flip)
            if states is None:
                return [1.0, 1.0]
            S = self.problem.margin.measure(states[1][0])
            return [S / level - 1.0, self.slope(t, states[0][0], states[1][0]) / level]

        solution = root(residuals, [0.0, 0.0])
        if np.abs(solution.fun).max() < 1e-6 and np.abs(solution.x).max() < 2.0:
            t, roll = start + size * solution.x
            (attitude,), (q,) = self.states(t, np.array([roll]), elbow, flip)
            yield t, attitude, q


def is_minimum_there(problem, t, attitude, joints):
    """Whether |S| has a minimum at a state, by the precise motion through it."""
    values = [
        abs(problem.margin.measure(
            ff.integrate_motion(problem, attitude, joints, start=t, end=end).final.joints
        ))
        for end in (t - 0.02, t, t + 0.02)
    ]  # fmt: skip
    return values[1] < min(values[0], values[2])


@pytest.mark.slow
def test_brute_force_finds_no_other_touch_point(case):
    """A dense grid over time and roll, with other formulas."""
    problem, q1, q2, points = case
    brute, seen = BruteForce(problem, q1, q2), 0
    times, rolls = np.linspace(0.2, 99.8, 101), np.linspace(0.0, 2 * np.pi, 61)
    levels = problem.margin.threshold, -problem.margin.threshold
    for t, attitude, joints in brute.points(levels, times, rolls):
        known = any(
            abs(t - point.time) < 1e-4 and gap(joints, point.joints) < 1e-4 for point in points
        )
        assert known or not is_minimum_there(problem, t, attitude, joints), (t, joints)
        seen += known
    assert seen >= 0.5 * len(points)


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
    """The direction of the second joint's axis in inertial space."""
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
        reached = problem.model.end_effector_pose(attitude.as_quat(), q)
        turn = Rotation.from_matrix(pose.rotation.T @ reached.rotation).as_rotvec()
        S = problem.margin.measure(q) / point.level - 1.0
        return [*(reached.position - pose.position), *turn, S, np.sin(q[0] - point.joints[0]),
                across @ joint_2_axis(problem, attitude, q)]  # fmt: skip

    return equations


END_PATHS = [0, 2, 4, 9, 11, 13]
"""Even ones have the measure gjm, odd ones arm; every third one has no momentum."""


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
    for start in rng.uniform(-np.pi, np.pi, (80, 9)):
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
    """Planar tasks, other arms, zero margins."""
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
