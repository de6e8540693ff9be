"""Touch points in space: states through which a motion has S = S0 as its smallest magnitude."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import root
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.paths.curves import PolynomialCurve
from freefloat.paths.orientation import FixedOrientation
from freefloat.planning.states_on_path import StatesOnPath
from freefloat.planning.tangency import (
    _refined,
    boundary_attitude,
    integrate_to_start,
    tangency_family,
    tangency_points,
)
from freefloat.robot.names import models_folder
from freefloat.so3 import axes_rotation
from tests.robots import random_robot

MOMENTUM = (0.5, 0.3, 0.1)
STILL = (0.0, 0.0, 0.0)
PRINTED_JOINTS = np.array([0.1, 2.0, 3.3076, -2.6104, 2.2981, 1.4288])
PRINTED_ATTITUDE = np.array([0.4295, -0.147, 0.6898, -0.564])


def changed(problem, *, h=None, path=None, measure=None, value=None):
    """The same problem but for what is given."""
    margin = problem.margin
    if measure is not None:
        margin = ff.Margin(ff.singularity_measure(problem.model, problem.task, measure), value)
    h = problem.momentum if h is None else h
    return ff.Problem(problem.model, path or problem.path, problem.task, h, margin)


@pytest.fixture(scope="module")
def problem():
    return ff.load_scenario("spatial_6dof/line").problem()


@pytest.fixture(scope="module")
def printed(problem):
    """Example 2 with B in plane (41): its z is 0.3317 m, printed 0.33."""
    A, B = np.array([1.0, 0.0, 0.0]), np.array([-0.5, 0.8, 0.3317])
    axes = axes_rotation("attitude", ("x", [0.4683, 1.1683, -0.7]), ("z", A - B))
    path = ff.EndEffectorPath(PolynomialCurve.line(A, B), FixedOrientation(axes))
    return changed(problem, path=ff.TimedPath(path, problem.path.timing))


def gap(a, b):
    """Largest difference of angles, whole turns not counted."""
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi).max()


def nearest_to_printed(problem):
    return min(
        tangency_points(problem, 0.1, 2.0, -5.0), key=lambda t: gap(t.joints, PRINTED_JOINTS)
    )


def test_the_printed_touch_point_follows_from_q1_and_q2(printed):
    """Example 2, to two units of the last printed digit, both there and carried back to the start.

    For dS/dt = 0 with the first two components of h exchanged, and carried back by h as printed.
    """
    touch = nearest_to_printed(changed(printed, h=[0.3, 0.5, 0.1]))
    assert touch.tau == pytest.approx(0.4225, abs=2e-4)
    assert touch.time == pytest.approx(100.0 * touch.tau)
    assert gap(touch.joints, PRINTED_JOINTS) < 2e-4
    sign = np.sign(touch.attitude @ PRINTED_ATTITUDE)
    assert sign * touch.attitude == pytest.approx(PRINTED_ATTITUDE, abs=2e-4)
    start = integrate_to_start(printed, touch).final
    assert start.time == 0.0
    assert sign * start.attitude == pytest.approx([0.46, 0.0935, 0.7352, -0.489], abs=2e-4)


def test_by_the_printed_momentum_time_and_elbow_are_as_printed(printed):
    """(36) and (40) know no momentum; dS/dt = 0 does, and turns the rest 0.03 rad away."""
    touch = nearest_to_printed(printed)
    assert touch.tau == pytest.approx(0.4225, abs=2e-4)
    assert gap(touch.joints[:3], PRINTED_JOINTS[:3]) < 2e-4
    assert 0.02 < gap(touch.joints, PRINTED_JOINTS) < 0.03
    there = boundary_attitude(printed, touch)
    motion = ff.integrate_motion(printed, there.attitude, there.joints)
    least = ff.closest_approach(motion, printed.margin.measure)
    assert motion.completed
    assert least.sign * least.value == pytest.approx(-5.0, abs=1e-6)
    assert least.time == pytest.approx(touch.time, abs=1e-2)


CASES = [
    ("arm", 5.0, MOMENTUM, (0.1, 2.0)),
    ("arm", 5.0, STILL, (-1.0, 1.2)),
    ("arm", 5.0, (-2.0, 1.0, 3.0), (2.0, -2.3)),
    ("gjm", 0.004, MOMENTUM, (0.4, 1.7)),
    ("gjm", 0.004, STILL, (0.4, 1.7)),
]


@pytest.fixture(scope="module", params=CASES, ids=lambda case: f"{case[0]}{case[2]}")
def case(request, problem):
    """A problem, q1 and q2, and their touch points."""
    measure, value, h, (q1, q2) = request.param
    asked = changed(problem, h=h, measure=measure, value=value)
    return asked, q1, q2, tangency_points(asked, q1, q2)


def beside(problem, touch, step):
    """|S| - |S0| on the precise motion through a touch point, before and after."""
    ends = [
        ff.integrate_motion(
            problem, touch.attitude, touch.joints, start=touch.time, end=touch.time + sign * step
        ).final.joints
        for sign in (-1, 1)
    ]
    return np.array([abs(problem.margin.measure(q)) for q in ends]) - abs(touch.level)


def test_touches_are_on_the_path_and_on_the_margin_surface(case):
    """(35) and (34) with S = S0, at the angles asked for, on the branch told."""
    problem, q1, q2, touches = case
    assert touches
    assert {touch.level for touch in touches} <= {
        problem.margin.threshold,
        -problem.margin.threshold,
    }
    for touch in touches:
        pose = problem.model.end_effector_pose(touch.attitude, touch.joints)
        wanted = problem.path.pose(touch.time)
        assert pose.position == pytest.approx(wanted.position, abs=1e-9)
        assert pose.rotation == pytest.approx(wanted.rotation, abs=1e-9)
        assert gap(touch.joints[:2], np.array([q1, q2])) < 1e-7
        found = problem.margin.measure(touch.joints)
        assert found == pytest.approx(touch.level, rel=1e-8)
        branches = {one.index: one for one in problem.branches(touch.attitude, touch.time)}
        assert branches[touch.branch].label == touch.label
        assert gap(branches[touch.branch].joints, touch.joints) < 1e-9


def test_motions_through_touches_have_their_smallest_s_there(case):
    """(14): a moment before and after |S| is larger, by second order in the time between."""
    problem, _, _, touches = case
    assert touches
    for touch in touches[:: max(1, len(touches) // 8)]:
        far, near = beside(problem, touch, 0.1), beside(problem, touch, 0.05)
        assert near.min() > 0.0
        assert near == pytest.approx(far / 4.0, rel=0.15)


class BruteForce:
    """States by the textbook: the wrist as Euler angles, q3 from the law of cosines."""

    def __init__(self, problem, q1, q2):
        self.problem, self.virtual = problem, VirtualManipulator.of(problem.model)
        self.q = np.array([q1, q2, 0.0, 0.0, 0.0, 0.0])
        self.hand = np.linalg.norm(self.virtual.kinematics(self.q)[0][0] - self.wrist(0.0))
        square = [self.wrist(q3) @ self.wrist(q3) for q3 in (0.0, np.pi / 2, np.pi)]
        mean = (square[0] + square[2]) / 2
        self.form = mean, (square[0] - square[2]) / 2, square[1] - mean
        self.drift = ResolvedRateSolver(problem.model, problem.task, problem.momentum)

    def wrist(self, q3):
        return self.virtual.kinematics([*self.q[:2], q3, 0, 0, 0])[2][3, 0]

    def states(self, t, turns, elbow, flip):
        """Attitudes and joints at a time, for many turns; None out of reach."""
        pose = self.problem.path.pose(t)
        point_3 = pose.position - self.hand * pose.rotation[:, 0]
        mean, cosine, sine = self.form
        share = (point_3 @ point_3 - mean) / np.hypot(cosine, sine)
        if abs(share) > 1.0:
            return None
        q3 = np.arctan2(sine, cosine) + elbow * np.arccos(share)
        w, a = self.wrist(q3), np.array([0.6, -0.48, 0.64])
        frames = []
        for v in (point_3, w):
            x, y = v / np.linalg.norm(v), np.cross(a, v) / np.linalg.norm(np.cross(a, v))
            frames.append(Rotation.from_matrix(np.column_stack([x, y, np.cross(x, y)])))
        spin = Rotation.from_rotvec(np.outer(turns, [1.0, 0.0, 0.0]))
        attitudes = frames[0] * spin * frames[1].inv()
        forearm = Rotation.from_matrix(self.virtual.pose([*self.q[:2], q3, 0, 0, 0]).rotation)
        hand = forearm.inv() * attitudes.inv() * Rotation.from_matrix(pose.rotation)
        wrist = hand.as_euler("XYX") * [1.0, -1.0, 1.0]
        if flip:
            wrist = wrist * [1.0, -1.0, 1.0] + [np.pi, 0.0, np.pi]
        first = np.broadcast_to([*self.q[:2], q3], (len(turns), 3))
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

    def touches(self, levels, times, turns):
        """Times, attitudes and joints of common roots of S - S0 and dS/dt, from every cell."""
        for elbow in (1, -1):
            for flip in (False, True):
                rows = [self.states(t, turns, elbow, flip) for t in times]
                S = np.array([self.measured(row, len(turns)) for row in rows])
                corners = np.stack([S[:-1, :-1], S[1:, :-1], S[:-1, 1:], S[1:, 1:]])
                for level in levels:
                    mixed = np.abs(np.sign(corners - level).sum(axis=0)) < 4
                    for i, j in self.cells_where_slopes_differ(mixed, times, rows):
                        cell = times[i : i + 2], turns[j : j + 2]
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
        of = self.problem.margin.measure
        alike = of.name == "arm"  # S is the same at every turn (40)
        return np.broadcast_to([of(q) for q in (row[1][:1] if alike else row[1])], count)

    def root_in(self, times, turns, elbow, flip, level):
        start = np.array([times.mean(), turns.mean()])
        size = np.array([np.ptp(times), np.ptp(turns)])

        def misses(x):
            t, turn = start + size * x
            found = self.states(t, np.array([turn]), elbow, flip)
            if found is None:
                return [1.0, 1.0]
            S = self.problem.margin.measure(found[1][0])
            return [S / level - 1.0, self.slope(t, found[0][0], found[1][0]) / level]

        found = root(misses, [0.0, 0.0])
        if np.abs(found.fun).max() < 1e-6 and np.abs(found.x).max() < 2.0:
            t, turn = start + size * found.x
            (attitude,), (q,) = self.states(t, np.array([turn]), elbow, flip)
            yield t, attitude, q


def is_least_there(problem, t, attitude, joints):
    """Whether |S| is smallest at a state, by the precise motion through it."""
    values = [
        abs(problem.margin.measure(
            ff.integrate_motion(problem, attitude, joints, start=t, end=end).final.joints
        ))
        for end in (t - 0.02, t, t + 0.02)
    ]  # fmt: skip
    return values[1] < min(values[0], values[2])


def test_brute_force_finds_no_touch_that_was_missed(case):
    """A dense grid over time and turn, and another geometry."""
    problem, q1, q2, touches = case
    brute, seen = BruteForce(problem, q1, q2), 0
    times, turns = np.linspace(0.2, 99.8, 201), np.linspace(0.0, 2 * np.pi, 97)
    levels = problem.margin.threshold, -problem.margin.threshold
    for t, attitude, joints in brute.touches(levels, times, turns):
        known = any(
            abs(t - touch.time) < 1e-4 and gap(joints, touch.joints) < 1e-4 for touch in touches
        )
        assert known or not is_least_there(problem, t, attitude, joints), (t, joints)
        seen += known
    assert seen >= 0.5 * len(touches)


def test_the_first_joint_only_turns_the_spacecraft(problem):
    """(39): about the axis of a symmetric spacecraft q1 changes neither time nor other joints."""
    one, other = (tangency_points(problem, q1, 2.0) for q1 in (0.1, -2.5))
    assert len(one) == len(other) > 0
    for touch in one:
        assert any(
            abs(touch.tau - twin.tau) < 1e-7 and gap(touch.joints[1:], twin.joints[1:]) < 1e-6
            for twin in other
        )


def test_each_wrist_touches_where_the_other_one_does(problem):
    """Without mass in the wrist, bending it the other way only changes the sign of det S*.

    Six times as many samples find these 32 touches and no other; without the finer ones around
    extremes of S six are missed.
    """
    asked = changed(problem, measure="gjm", value=0.004)
    touches = tangency_points(asked, 0.4, 2.2)
    places = Counter(
        (round(t.tau, 6), round(t.joints[2], 4), round(abs(t.attitude[3]), 4)) for t in touches
    )
    assert len(touches) == 32
    assert set(places.values()) == {2}
    assert sum(touch.level > 0.0 for touch in touches) == 16


def test_without_momentum_places_do_not_depend_on_the_time_law(problem):
    """With h = 0 a motion is its path: slower, or by another law, it touches at the same s."""
    still = changed(problem, h=STILL)
    timing = ff.Timing(37.0, law=type(problem.path.timing.law)("cubic"))
    slow = changed(still, path=ff.TimedPath(problem.path.path, timing))
    places = [
        sorted(p.path.timing.s(t.time) for t in tangency_points(p, 0.3, 1.9)) for p in (still, slow)
    ]
    assert len(places[0]) > 0
    assert places[0] == pytest.approx(places[1], abs=1e-8)


def with_attitude(problem, there, turn):
    """How a motion that begins slightly turned keeps the margin."""
    attitude = (Rotation.from_quat(there.attitude) * Rotation.from_rotvec(turn)).as_quat()
    branch = problem.branch_near(attitude, there.joints, problem.branches(attitude))
    motion = ff.integrate_motion(problem, attitude, branch.joints)
    least = ff.closest_approach(motion, problem.margin.measure)
    return motion.completed and problem.margin.is_kept(least.value)


@pytest.mark.parametrize("h", [MOMENTUM, STILL])
def test_a_carried_back_attitude_is_a_boundary(problem, h):
    """0.2 degrees to one side the margin is kept, to the other it is not."""
    asked = changed(problem, h=h)
    for touch in tangency_points(asked, 0.1, 2.0)[:2]:
        there = boundary_attitude(asked, touch)
        assert there.touch is touch
        sides = [with_attitude(asked, there, side * np.deg2rad(0.2) * axis)
                 for axis in np.eye(3) for side in (-1, 1)]  # fmt: skip
        pairs = list(zip(sides[::2], sides[1::2], strict=True))
        assert (True, False) in pairs or (False, True) in pairs


def test_a_spoiled_touch_gives_no_boundary_attitude(problem):
    """None exactly where another part of the motion comes nearer to a singularity."""
    spoiled = []
    touches = tangency_points(problem, -2.5, 2.3656)
    for touch in touches[::2]:
        start = integrate_to_start(problem, touch).final
        motion = ff.integrate_motion(problem, start.attitude, start.joints)
        least = ff.closest_approach(motion, problem.margin.measure)
        spoiled.append(least.value < 4.9)
        assert (boundary_attitude(problem, touch) is None) == spoiled[-1]
    assert set(spoiled) == {True, False}


def test_the_smallest_s_is_that_of_the_touch_but_for_a_small_share(problem):
    """A thousandth of S0 less is another smallest S, also where S0 is far below one."""
    asked = changed(problem, measure="arm", value=0.1)
    touch = next(t for t in tangency_points(asked, -2.5, 2.3656) if boundary_attitude(asked, t))
    assert boundary_attitude(asked, replace(touch, level=1.00001 * touch.level))
    for share in (0.999, 1.001):
        assert boundary_attitude(asked, replace(touch, level=share * touch.level)) is None


def test_a_family_is_spread_and_repeatable(problem):
    """As many as asked for, from several pairs (q1, q2), the same for the same seed."""
    family = tangency_family(problem, 12, seed=1)
    again, other = tangency_family(problem, 12, seed=1), tangency_family(problem, 12, seed=2)
    assert len(family) == 12
    assert [t.time for t in family] == [t.time for t in again]
    assert [t.time for t in family] != [t.time for t in other]
    assert len({round(t.joints[1], 6) for t in family}) > 1


def test_a_family_looks_everywhere(problem, monkeypatch):
    """Fifty pairs (q1, q2) for each touch point that is wanted, as many from every quarter turn."""
    pairs = []
    nothing = lambda _, *pair: pairs.append(pair) or ()  # noqa: E731
    monkeypatch.setattr("freefloat.planning.tangency.tangency_points", nothing)
    assert tangency_family(problem, 20) == ()
    counts = np.histogram2d(*np.transpose(pairs), bins=4, range=[[-np.pi, np.pi]] * 2)[0]
    assert len(pairs) == counts.sum() == 1000
    assert counts == pytest.approx(1000 / 16, abs=8)
    first = pairs.copy()
    pairs.clear()
    tangency_family(problem, 20, seed=0)
    assert pairs == first


def test_every_start_goes_its_own_way(problem):
    """Newton's method ends where it does whatever else it is asked for in the same go."""
    through = StatesOnPath(problem, 0.1, 2.0)
    starts = np.random.default_rng(2).uniform([0.0, -3.0, -3.0], [100.0, 3.0, 3.0], (18, 3))
    alone = np.vstack([_refined(through, 1.0, -5.0, one[None], 1.0) for one in starts])
    together = _refined(through, 1.0, -5.0, starts, 1.0)
    assert len(alone) == len(together) > 3
    np.testing.assert_allclose(together, alone, rtol=0, atol=1e-9)


def test_what_meets_two_of_three_conditions_is_no_touch(problem, monkeypatch):
    """On the path and on the margin surface, but S goes on falling."""
    through = StatesOnPath(problem, 0.1, 2.0)
    starts = np.random.default_rng(2).uniform([0.0, -3.0, -3.0], [100.0, 3.0, 3.0], (18, 3))
    done = _refined(through, 1.0, -5.0, starts, 1.0)
    monkeypatch.setattr("freefloat.planning.tangency._ITERATIONS", 0)
    assert len(_refined(through, 1.0, -5.0, done, 1.0)) == len(done)
    turned = done + np.array([0.0, 0.0, 0.01])  # changes dS/dt alone
    assert len(_refined(through, 1.0, -5.0, turned, 1.0)) == 0


def test_states_that_are_touches_already_cost_one_look(problem, monkeypatch):
    """Newton's method ends as soon as nothing is left to mend."""
    through = StatesOnPath(problem, 0.1, 2.0)
    starts = np.random.default_rng(2).uniform([0.0, -3.0, -3.0], [100.0, 3.0, 3.0], (18, 3))
    done = _refined(through, 1.0, -5.0, starts, 1.0)
    looks, at = [], through.at
    monkeypatch.setattr(through, "at", lambda *told: looks.append(1) or at(*told))
    np.testing.assert_allclose(_refined(through, 1.0, -5.0, done, 1.0), done, rtol=0, atol=1e-9)
    assert len(looks) == 2  # there and to both sides of each unknown, and to judge


def test_states_that_cannot_be_bent_to_are_given_up(problem, tmp_path):
    """Axes 4 and 5 at 53 degrees bend the hand by 106 at most; touches within that are found."""
    text = (models_folder() / "spatial_6dof" / "spatial_6dof.urdf").read_text()
    first, joint_5 = text.split('<joint name="q5"')
    skew = first + '<joint name="q5"' + joint_5.replace("0 -1 0", "0.6 -0.8 0", 1)
    (tmp_path / "skew.urdf").write_text(skew)
    model = ff.FreeFloatingModel.from_urdf(tmp_path / "skew.urdf")
    margin = ff.Margin(ff.singularity_measure(model, problem.task, "arm"), 5.0)
    asked = ff.Problem(model, problem.path, problem.task, MOMENTUM, margin)
    through = StatesOnPath(asked, 0.1, 2.0)
    starts = np.random.default_rng(2).uniform([0.0, -3.0, -3.0], [100.0, 3.0, 3.0], (120, 3))
    reached = np.isfinite(through.at(starts, 1.0)[1]).all(axis=1)
    assert 30 < np.count_nonzero(reached) < 90
    assert len(_refined(through, 1.0, 5.0, starts[~reached][:5], 1.0)) == 0
    assert len(tangency_points(asked, 0.1, 2.0)) > 0
    both = np.vstack([starts[~reached][:5], starts[reached]])
    assert len(_refined(through, 1.0, -5.0, both, 1.0)) > 0


def test_a_given_level_is_signed(problem):
    """Both signs of the margin when left out; else the one given, whatever the margin."""
    both = tangency_points(problem, -2.5, 2.3656)
    assert {t.level for t in both} == {5.0, -5.0}
    positive = tangency_points(problem, -2.5, 2.3656, 5.0)
    assert sorted(t.time for t in positive) == sorted(t.time for t in both if t.level > 0.0)
    assert {t.level for t in tangency_points(problem, 0.1, 2.0, -4.0)} == {-4.0}


def test_problems_without_touch_points_are_refused_with_a_way_out(problem, tmp_path):
    """Planar tasks, other arms, no margin surface, no angles, no family."""
    planar = ff.load_scenario("planar_3dof/parabola").problem()
    with pytest.raises(ff.InputError, match=r"^task: planar-pose.*accepted: pose"):
        tangency_points(planar, 0.1, 2.0)
    robot = random_robot(np.random.default_rng(5))
    (tmp_path / "robot.urdf").write_text(robot.text)
    model = ff.FreeFloatingModel.from_urdf(tmp_path / "robot.urdf", robot.tip)
    margin = ff.Margin(ff.singularity_measure(model, ff.Task.POSE, "gjm"), 0.1)
    other = ff.Problem(model, problem.path, ff.Task.POSE, STILL, margin)
    with pytest.raises(ff.InputError, match="spherical wrist; accepted: six turning joints"):
        tangency_points(other, 0.1, 2.0)
    bare = changed(problem, measure="arm", value=0.0)
    with pytest.raises(ff.InputError, match=r"margin\.value: 0\.0 was given"):
        tangency_points(bare, 0.1, 2.0)
    for level in (0.0, float("nan"), float("inf")):
        with pytest.raises(ff.InputError, match=r"level: .* was given"):
            tangency_points(problem, 0.1, 2.0, level)
    with pytest.raises(ff.InputError, match="two finite angles"):
        tangency_points(problem, float("nan"), 2.0)
    with pytest.raises(ff.InputError, match="count: 0 was given; accepted: 1 or more"):
        tangency_family(problem, 0)
