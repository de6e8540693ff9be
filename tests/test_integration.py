"""Motions against the paper's printed numbers, against plain integrators and against physics."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.spatial.transform import Rotation

from freefloat.attitude_law import FixedAttitude, SlerpAttitude, follow_attitude
from freefloat.closeness import least
from freefloat.curve import ArcCurve, PolynomialCurve
from freefloat.dynamics import Task, generalized_jacobian
from freefloat.errors import InputError
from freefloat.integration import integrate_motion
from freefloat.model import FreeFloatingModel
from freefloat.motion import Ending
from freefloat.path import EndEffectorPath
from freefloat.problem import Margin, Problem
from freefloat.scenario import load_scenario
from freefloat.singularity import joint_space_extremes, measure
from freefloat.spatial import heading_of, heading_quaternion, rotation_matrix, turn_between
from freefloat.timing import Stop, TimedPath, TimeLaw, Timing

assert_close = partial(np.testing.assert_allclose, rtol=0)

GOOD = [0.46008, 0.09337, 0.73519, -0.48898]
BAD = [0.1, 0.5, 0.2, -0.8367]
C = [0.1214, 0.4686, 0.1943]


def chain(*joints, base=(400.0, 66.67, 0.0), tool=(0.4, 0.0, 0.0)):
    """URDF text of a spacecraft with an arm.

    A joint is (type, axis, place in the body before, mass, centre of mass, moments).
    """

    def link(name, mass, centre, moments):
        numbers = " ".join(
            f'{k}="{v}"' for k, v in zip(("ixx", "iyy", "izz"), moments, strict=True)
        )
        return (
            f'<link name="{name}"><inertial><origin xyz="{_(centre)}"/><mass value="{mass}"/>'
            f'<inertia {numbers} ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )

    def _(vector):
        return " ".join(str(x) for x in vector)

    mass, moment, shift = base
    parts = [link("link_0", mass, (shift, 0, 0), (moment, 1.2 * moment, 0.9 * moment))]
    for k, (kind, axis, place, mass, centre, moments) in enumerate(joints, start=1):
        limit = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'
        parts.append(
            f'<joint name="q{k}" type="{kind}"><parent link="link_{k - 1}"/>'
            f'<child link="link_{k}"/><origin xyz="{_(place)}"/><axis xyz="{_(axis)}"/>'
            f"{limit if kind == 'prismatic' else ''}</joint>"
        )
        parts.append(link(f"link_{k}", mass, centre, moments))
    parts.append(
        f'<joint name="t" type="fixed"><parent link="link_{len(joints)}"/><child link="tool"/>'
        f'<origin xyz="{_(tool)}"/></joint><link name="tool"/>'
    )
    return f'<robot name="chain">{"".join(parts)}</robot>'


X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
SEVEN = chain(
    ("continuous", Z, (0.3, 0.1, 0.5), 9.0, (0.0, 0.1, 0.1), (0.3, 0.2, 0.3)),
    ("continuous", Y, (0.0, 0.0, 0.3), 8.0, (0.1, 0.0, 0.0), (0.2, 0.3, 0.3)),
    ("continuous", X, (0.2, 0.0, 0.0), 22.0, (0.6, 0.05, 0.0), (0.3, 2.5, 2.4)),
    ("continuous", Y, (1.2, 0.1, 0.0), 18.0, (0.5, -0.05, 0.0), (0.2, 1.9, 2.0)),
    ("continuous", X, (1.1, 0.0, 0.0), 6.0, (0.1, 0.0, 0.05), (0.1, 0.1, 0.15)),
    ("continuous", Y, (0.2, 0.0, 0.0), 5.0, (0.1, 0.0, 0.0), (0.1, 0.1, 0.1)),
    ("continuous", Z, (0.2, 0.0, 0.0), 4.0, (0.15, 0.0, 0.0), (0.05, 0.1, 0.1)),
    base=(300.0, 60.0, 0.05),
)
SLIDING = chain(
    ("continuous", Z, (0.2, 0.1, 0.5), 10.0, (0.0, 0.0, 0.1), (0.3, 0.3, 0.2)),
    ("continuous", (0, -1, 0), (0.1, 0.0, 0.2), 20.0, (0.5, 0.0, 0.0), (0.2, 1.5, 1.5)),
    ("prismatic", X, (0.8, 0.0, 0.0), 15.0, (0.3, 0.0, 0.05), (0.1, 0.9, 0.9)),
)


def two(aside):
    """The 40/4/3 arm, links of 1 m, its hand held to the side of the second one."""
    return chain(
        ("continuous", Z, (0.5, 0, 0), 4.0, (0.5, 0, 0), (0.01, 0.333, 0.333)),
        ("continuous", Z, (1.0, 0, 0), 3.0, (0.5, 0, 0), (0.01, 0.25, 0.25)),
        base=(40.0, 6.667 / 0.9, 0.0), tool=(1.0, aside, 0),
    )  # fmt: skip


@cache
def bundled(name):
    return load_scenario(name).problem()


@pytest.fixture(scope="module")
def spatial():
    """Example 2."""
    return bundled("spatial_6dof/line")


@pytest.fixture(scope="module")
def planar():
    """Example 1, at rest at F on the way."""
    return bundled("planar_3dof/parabola")


def followed(problem, attitude, branch, **options):
    attitude = problem.attitude("attitude", attitude)
    return integrate_motion(problem, attitude, problem.branches(attitude)[branch].joints, **options)


def heading(degrees):
    return heading_quaternion(np.deg2rad(degrees))


def asked(model, task, momentum, curve, attitude, timing):
    """A problem without a margin."""
    path = TimedPath(EndEffectorPath(curve, attitude), timing)
    return Problem(model, path, task, momentum, Margin(measure(model, task, "gjm"), 0.0))


def from_here(model, task, momentum, attitude, joints, step, turn, timing):
    """A problem whose path begins where the end-effector is: straight on, turning evenly."""
    pose = model.end_effector_pose(attitude, joints)
    line = PolynomialCurve.line(pose.position, pose.position + step)
    end = Rotation.from_rotvec(turn).as_matrix() @ pose.rotation
    return asked(model, task, momentum, line, SlerpAttitude(pose.rotation, end), timing)


def tracking(motion, times):
    """Largest distance and angle between end-effector and path at given times, by Pinocchio."""
    model, worst = motion.problem.model.pin_model, np.zeros(2)
    data, tool = model.createData(), motion.problem.model.frame_id
    rows = [row for row in motion.problem.task.rows if row < 3]
    for state in motion.sample(times):
        q = np.concatenate([state.base_position, state.attitude, state.joints])
        pin.framesForwardKinematics(model, data, q)
        wanted = motion.problem.path.pose(state.time)
        off = (data.oMf[tool].translation - wanted.position)[rows]
        turn = turn_between(data.oMf[tool].rotation, wanted.rotation)
        worst = np.maximum(worst, [np.linalg.norm(off), np.linalg.norm(turn)])
    return worst


def plain(problem, attitude, joints, times, twist=None):
    """The same motion by a plain integrator in time: mass matrix, KKT system, base position too.

    The base rows of the joint-space inertia matrix give the momentum in the spacecraft's frame: no
    centroidal map, no elimination, no arc length.
    """
    model = problem.model.pin_model
    data, tool, n = model.createData(), problem.model.frame_id, problem.model.dof
    rows, twist = problem.task.rows, twist or problem.path.twist

    def rates(t, y):
        q = y.copy()
        q[3:7] /= np.linalg.norm(q[3:7])
        M = pin.crba(model, data, q)[:6]
        J = pin.computeFrameJacobian(model, data, q, tool, pin.LOCAL_WORLD_ALIGNED)[rows]
        R = Rotation.from_quat(q[3:7])
        G = np.vstack([M, J])
        W = np.diag([0.0] * 6 + [1.0] * n)
        K = np.block([[W, G.T], [G, np.zeros((len(G), len(G)))]])
        wanted = [*np.zeros(6 + n + 3), *R.inv().apply(np.array(problem.momentum)), *twist(t)[rows]]
        v = np.linalg.solve(K, wanted)[: 6 + n]
        x, w = q[3:6], q[6]
        turned = [*(w * v[3:6] + np.cross(x, v[3:6])) / 2.0, -x @ v[3:6] / 2.0]
        return np.concatenate([R.apply(v[:3]), turned, v[6:]])

    start = problem.model.configuration(attitude, joints)
    breaks = [times[0], *(e for e in problem.path.timing.ends if times[0] < e < times[-1])]
    found, y = [], start
    for low, high in zip(breaks, [*breaks[1:], times[-1]], strict=True):
        inside = [t for t in times if low <= t < high or t == high == times[-1]]
        answer = solve_ivp(
            rates, (low, high), y, "DOP853", dense_output=True, rtol=1e-11, atol=1e-12
        )
        assert answer.success
        found += [answer.sol(t) for t in inside]
        y = answer.y[:, -1]
    return np.array(found)


def assert_agrees(motion, reference, times, tolerance=1e-7):
    for state, y in zip(motion.sample(times), reference, strict=True):
        assert_close(state.joints, y[7:], atol=tolerance)
        assert_close(state.base_position, y[:3], atol=tolerance)
        turn = Rotation.from_quat(state.attitude).inv() * Rotation.from_quat(y[3:7])
        assert turn.magnitude() < tolerance


# --- Example 2 --------------------------------------------------------------------------------


def test_example_2_completes_from_the_printed_attitude(spatial):
    """The branch with q1 near 1.25 follows the line from A to B, between nodes, too."""
    attitude = spatial.attitude("attitude", GOOD)
    near = [b for b in spatial.branches(attitude) if abs(b.joints[0] - 1.25) < 0.05]
    assert len(near) == 4  # elbow and wrist either way
    for branch in near:
        motion = integrate_motion(spatial, attitude, branch.joints)
        assert motion.ending is Ending.COMPLETED
        assert motion.final.time == 100.0
        position, angle = tracking(motion, np.linspace(0.0, 100.0, 500))
        assert position < 1e-6
        assert angle < 1e-6
        residuals = motion.residuals()
        assert residuals.momentum < 1e-6
        assert residuals.end_effector_position < 1e-6
        assert residuals.end_effector_attitude < 1e-6


def test_example_2_becomes_singular_at_c_from_the_bad_attitude(spatial):
    """Exactly four of the eight branches fail, all within 3 mm of the printed C."""
    ends = [followed(spatial, BAD, k) for k in range(8)]
    singular = [motion for motion in ends if motion.ending is Ending.SINGULAR]
    assert len(singular) == 4
    for motion in singular:
        where = spatial.model.end_effector_pose(motion.final.attitude, motion.final.joints)
        assert np.linalg.norm(where.position - C) < 3e-3
    for motion in ends:
        if motion not in singular:
            assert motion.completed


def test_the_singular_end_is_a_singularity(spatial):
    """|det S*| there is less than a millionth of its largest, and was not before."""
    of = measure(spatial.model, spatial.task, "gjm")
    largest = joint_space_extremes(spatial.model, of, 1024).magnitude
    for branch in (2, 3, 4, 5):
        motion = followed(spatial, BAD, branch)
        assert abs(of.value(motion.final.joints)) < 1e-6 * largest
        sign = np.sign(of.value(motion.initial.joints))
        for q in motion.at_place(np.linspace(0.0, motion.panels - 1e-6, 300))[2]:
            assert sign * of.value(q) > 0.0


def test_the_singular_time_does_not_depend_on_the_tolerance(spatial):
    """A turning point of time along the arc is found, not approached: 1e-8 and 1e-12 agree."""
    for branch in (2, 3, 4, 5):
        rough, fine = (followed(spatial, BAD, branch, tolerance=e) for e in (1e-8, 1e-12))
        assert rough.ending is fine.ending is Ending.SINGULAR
        assert rough.final.time == pytest.approx(fine.final.time, abs=1e-6)
        assert_close(rough.final.joints, fine.final.joints, atol=1e-3)


def test_joint_rates_grow_beyond_bounds_towards_the_singularity(spatial):
    """Like one over the root of the time left: a hundredth of it, ten times the rate."""
    motion = followed(spatial, BAD, 2)
    rates = []
    for left in (1e-2, 1e-4):
        before, after = motion.sample(motion.final.time - left * np.array([1.01, 0.99]))
        rates.append(np.linalg.norm(after.joints - before.joints) / (0.02 * left))
    assert rates[1] / rates[0] == pytest.approx(10.0, rel=0.1)


def test_the_printed_touch_point_leads_back_to_the_printed_attitude(spatial):
    """From q_t, eps_t at tau_t = 0.4225 back to A: [0.46 0.0935 0.7352 -0.489] to 5e-4."""
    attitude = spatial.attitude("attitude", [0.4295, -0.147, 0.6898, -0.564])
    printed = [0.1, 2.0, 3.3076, -2.6104, 2.2981, 1.4288]
    gaps = {}
    for branch in spatial.branches(attitude, 42.25):
        gap = (branch.joints - printed + np.pi) % (2 * np.pi) - np.pi
        gaps[float(np.abs(gap).max())] = branch.joints
    assert min(gaps) < 3e-3  # four printed digits of the attitude, metres of arm
    joints = gaps[min(gaps)]
    assert spatial.margin.measure.value(joints) == pytest.approx(-5.0, abs=0.02)
    motion = integrate_motion(spatial, attitude, joints, start=42.25, end=0.0)
    assert motion.completed
    assert motion.final.time == 0.0
    assert_close(motion.final.attitude, [0.46, 0.0935, 0.7352, -0.489], atol=5e-4)
    where = spatial.model.end_effector_pose(motion.final.attitude, motion.final.joints).position
    assert_close(where, [1.0, 0.0, 0.0], atol=1e-8)


# --- Example 1 --------------------------------------------------------------------------------


def on_side(problem, degrees, sign):
    """The motion of the branch whose S begins with a sign."""
    attitude = heading(degrees)
    for branch in problem.branches(attitude):
        if problem.margin.measure.value(branch.joints) * sign > 0:
            return integrate_motion(problem, attitude, branch.joints)
    raise AssertionError("no branch of that sign")


def test_example_1_at_140_and_200_degrees(planar):
    """On the paper's branch, S > 0, 140 meets a singularity and 200 completes; both do on S < 0."""
    bad, good = on_side(planar, 140.0, 1), on_side(planar, 200.0, 1)
    assert bad.ending is Ending.SINGULAR
    assert 0.0 < bad.final.time < 69.73
    assert good.completed
    assert least(good, planar.margin.measure).value > 5.0
    for degrees in (140.0, 200.0):
        other = on_side(planar, degrees, -1)
        assert other.completed
        assert least(other, planar.margin.measure).sign == -1


def test_example_1_passes_the_stop_at_rest(planar):
    """At F nothing moves but the drift with h: the rates there are those of a held hand."""
    motion = on_side(planar, 200.0, 1)
    assert 69.73 in motion.times
    before, at, after = motion.sample([69.729, 69.73, 69.731])
    pose = planar.model.end_effector_pose(at.attitude, at.joints)
    assert_close(pose.position, [-0.5, 1.458333, 0.0], atol=1e-5)
    rates = (after.joints - before.joints) / 2e-3
    held = planar.path.twist(69.73)
    assert np.abs(held).max() < 1e-12
    A = np.abs(rates).max() + abs(heading_of(after.attitude) - heading_of(before.attitude)) / 2e-3
    assert 1e-4 < A < 5e-2


@pytest.mark.parametrize(("degrees", "limit"), [(160.5, "<"), (161.5, ">")])
def test_the_limit_at_161_degrees_is_where_it_was_printed(planar, degrees, limit):
    """Theta_AB = [0, 63] U [161, 360] at A: least S passes S0 = 5 at 161 degrees."""
    found = least(on_side(planar, degrees, 1), planar.margin.measure)
    assert found.sign == 1
    assert found.value < 5.0 if limit == "<" else found.value > 5.0


@pytest.mark.parametrize(("degrees", "kept"), [(62.0, True), (63.6, False), (0.0, True)])
def test_the_limit_at_63_degrees_is_where_it_was_printed(planar, degrees, kept):
    """Least S passes S0 = 5 near 63 degrees, coming from 0."""
    found = least(on_side(planar, degrees, 1), planar.margin.measure)
    assert (found.value >= 5.0) == kept


TOUCH = [
    # segment, tau_t, theta_0t, q_t, where printed, degrees there
    ("FB", 0.9495, -0.7463, [-3.6512, 0.1762, 1.7885], 100.0, 318.9),
    ("FB", 0.9495, -0.7463, [-3.6512, 0.1762, 1.7885], 69.73, 354.2),
    ("AF", 0.4895, 0.9158, [-0.6074, 2.9265, 0.9617], 69.73, 335.3),
    ("AF", 0.6413, 1.5922, [-0.7348, 2.9014, 0.2833], 69.73, 60.9),
    ("AF", 0.6413, 1.5922, [-0.7348, 2.9014, 0.2833], 0.0, 161.0),
]


@pytest.mark.parametrize(("segment", "tau", "theta", "joints", "t", "printed"), TOUCH)
def test_printed_touch_points_lead_to_the_printed_headings(
    planar, segment, tau, theta, joints, t, printed
):
    """S = 5 at the printed touch point, and the motion through it ends at the printed degrees."""
    begin, length = (0.0, 69.73) if segment == "AF" else (69.73, 30.27)
    t_touch, attitude = begin + tau * length, heading_quaternion(theta)
    gaps = {}
    for branch in planar.branches(attitude, t_touch):
        gap = (branch.joints - joints + np.pi) % (2 * np.pi) - np.pi
        gaps[float(np.abs(gap).max())] = branch.joints
    assert min(gaps) < 1e-3
    assert planar.margin.measure.value(gaps[min(gaps)]) == pytest.approx(5.0, abs=0.03)
    motion = integrate_motion(planar, attitude, gaps[min(gaps)], start=t_touch, end=t)
    assert motion.completed
    found = np.degrees(heading_of(motion.final.attitude))
    assert found == pytest.approx(printed, abs=0.06)


def test_the_touch_at_the_end_leads_to_the_printed_heading_at_f(planar):
    """End touch at B: S = 5 at 259.4 degrees, which is 298.7 degrees at F."""
    attitude = heading(259.4)
    values = {planar.margin.measure.value(b.joints): b for b in planar.branches(attitude, 100.0)}
    nearest = min(values, key=lambda value: abs(value - 5.0))
    assert nearest == pytest.approx(5.0, abs=0.1)
    motion = integrate_motion(planar, attitude, values[nearest].joints, start=100.0, end=69.73)
    assert np.degrees(heading_of(motion.final.attitude)) == pytest.approx(298.7, abs=0.06)


@pytest.mark.parametrize("name", ["planar_3dof/parabola", "planar_3dof/parabola_nonstop"])
def test_every_heading_has_an_ending(name):
    """All around the circle, on both branches: completed, or singular where det S* vanishes."""
    problem = bundled(name)
    of = measure(problem.model, problem.task, "gjm")
    singular = 0
    for degrees in [*range(0, 360, 15), 8, 12, 23, 61, 66, 77, 81, 88, 95, 99, 103, 107, 124, 131]:
        attitude = heading(degrees)
        for branch in problem.branches(attitude):
            motion = integrate_motion(problem, attitude, branch.joints)
            if motion.ending is Ending.SINGULAR:
                singular += 1
                assert abs(of.value(motion.final.joints)) < 1e-8
                assert motion.final.time < 100.0
            else:
                assert motion.completed
                assert motion.final.time == 100.0
    assert 15 < singular < 60


# --- there and back ---------------------------------------------------------------------------


def there_and_back(problem, attitude, branch):
    there = followed(problem, attitude, branch)
    assert there.completed
    final = there.final
    back = integrate_motion(
        problem, final.attitude, final.joints, start=problem.path.duration, end=0.0
    )
    return there, back


@pytest.mark.parametrize(
    ("name", "attitude", "branch"),
    [("spatial_6dof/line", GOOD, 2), ("spatial_6dof/line", BAD, 0),
     ("planar_3dof/parabola", heading(200.0), 0),
     ("planar_3dof/parabola_nonstop", heading(330.0), 0)],
)  # fmt: skip
def test_out_and_back_returns_the_start(name, attitude, branch):
    """Appendix A: the reverse motion with -h retraces the forward one, stops included."""
    there, back = there_and_back(bundled(name), attitude, branch)
    assert back.completed
    assert back.final.time == 0.0
    assert_close(back.final.joints, there.initial.joints, atol=1e-7)
    assert_close(back.final.attitude, there.initial.attitude, atol=1e-7)
    assert_close(back.final.base_position, there.initial.base_position, atol=1e-7)


class Reversed:
    """A curve from its end to its start."""

    def __init__(self, curve):
        self.curve = curve

    def __call__(self, s, order=0):
        return (-1.0) ** order * self.curve(1.0 - s, order)


def test_reversal_is_a_forward_motion_with_opposite_momentum(spatial):
    """(47): from x2, the path from B to A with -h, forwards in time, ends at x1."""
    there, back = there_and_back(spatial, GOOD, 2)
    path = spatial.path.path
    reverse = EndEffectorPath(Reversed(path.curve), path.attitude)
    problem = replace(
        spatial, path=TimedPath(reverse, spatial.path.timing), momentum=-spatial.momentum
    )
    again = integrate_motion(problem, there.final.attitude, there.final.joints)
    assert again.completed
    assert_close(again.final.joints, there.initial.joints, atol=1e-7)
    assert_close(again.final.attitude, there.initial.attitude, atol=1e-7)
    for t in (13.0, 50.0, 80.0):
        (forward,), (backward,) = again.sample(100.0 - t), back.sample(t)
        assert_close(forward.joints, backward.joints, atol=1e-7)
    wrong = replace(problem, momentum=spatial.momentum)
    off = integrate_motion(wrong, there.final.attitude, there.final.joints).final.joints
    assert np.abs(off - there.initial.joints).max() > 1e-2


def test_a_motion_may_begin_and_end_anywhere_on_its_way(spatial):
    """In two parts, forwards or backwards, it is the motion in one."""
    whole = followed(spatial, GOOD, 2)
    first = integrate_motion(spatial, whole.initial.attitude, whole.initial.joints, end=37.0)
    assert first.final.time == 37.0
    second = integrate_motion(spatial, first.final.attitude, first.final.joints, start=37.0)
    assert_close(second.final.joints, whole.final.joints, atol=1e-7)
    back = integrate_motion(
        spatial, second.final.attitude, second.final.joints, start=100.0, end=37.0
    )
    assert_close(back.final.joints, first.final.joints, atol=1e-7)


def test_stops_are_passed_in_both_directions(planar):
    """From before F to after F and back again, over the rest and over its exact time."""
    start = on_side(planar, 200.0, 1)
    (state,) = start.sample(60.0)
    for t in (69.73, 80.0):
        on = integrate_motion(planar, state.attitude, state.joints, start=60.0, end=t)
        back = integrate_motion(planar, on.final.attitude, on.final.joints, start=t, end=60.0)
        assert (np.diff(on.times) > 0.0).all()
        assert (np.diff(back.times) < 0.0).all()
        assert_close(back.final.joints, state.joints, atol=1e-8)
        (expected,) = start.sample(t)
        assert_close(on.final.joints, expected.joints, atol=1e-8)


# --- time does not matter unless there is momentum ---------------------------------------------


def timed(problem, momentum, timing):
    """Example 2 from the good attitude with other timing and momentum."""
    path = TimedPath(problem.path.path, timing)
    motion = followed(replace(problem, path=path, momentum=momentum), GOOD, 2)
    assert motion.completed
    return motion.final


LAWS = [
    Timing(100.0, TimeLaw.CUBIC),
    Timing(100.0, TimeLaw.TRAPEZOIDAL),
    Timing(100.0, TimeLaw.QUINTIC, (Stop(0.3, 45.0), Stop(0.7, 75.0))),
    Timing(3.0),
    Timing(1e4),
]


@pytest.mark.parametrize("timing", LAWS)
def test_without_momentum_the_end_does_not_depend_on_time(spatial, timing):
    """h = 0: the motion of the base is geometric, whatever the law, the stops, the duration."""
    usual = timed(spatial, [0, 0, 0], Timing(100.0))
    other = timed(spatial, [0, 0, 0], timing)
    assert_close(other.attitude, usual.attitude, atol=1e-8)
    assert_close(other.joints, usual.joints, atol=1e-8)
    assert_close(other.base_position, usual.base_position, atol=1e-8)


@pytest.mark.parametrize("timing", LAWS[:4])
def test_with_momentum_the_end_depends_on_time(spatial, timing):
    """h != 0: the system drifts while the hand follows, and longer drifts differ."""
    usual = timed(spatial, [0.5, 0.3, 0.1], Timing(100.0))
    other = timed(spatial, [0.5, 0.3, 0.1], timing)
    turn = Rotation.from_quat(other.attitude).inv() * Rotation.from_quat(usual.attitude)
    assert turn.magnitude() > 5e-3


# --- the closed loop of the 40/4/3 arm ---------------------------------------------------------


class JointLoop:
    """The curve of the hand while q = (0.3 + 0.6 cos u, 0.7 + 0.6 sin u), h = 0, u = 2 pi s.

    In the plane as complex numbers, from masses and lengths alone: what moves with the spacecraft,
    with joint 1 and with joint 2 gives the angular momentum about the centre of mass.
    """

    MASSES, MOMENTS = np.array([40.0, 4.0, 3.0]), np.array([6.667, 0.333, 0.25])

    def __init__(self, aside, turns=1):
        self.hand, self.turns = 1.0 + 1j * aside, turns
        count = 256
        u = 2.0 * np.pi * np.arange(count) / count
        rates = np.fft.rfft([self.drift(x) for x in u]) / count
        self.mean, self.waves = rates[0].real, 2.0 * rates[1:60]

    def bodies(self, q):
        """Centres of mass, joints and hand, with the spacecraft at heading zero."""
        a, b = np.exp(1j * q[0]), np.exp(1j * (q[0] + q[1]))
        points = np.array(
            [0.0, 0.5 + 0.5 * a, 0.5 + a + 0.5 * b, 0.5, 0.5 + a, 0.5 + a + self.hand * b]
        )
        return points - self.MASSES @ points[:3] / self.MASSES.sum()

    def rows(self, q):
        """Angular momentum and hand velocity per rate of heading, q1 and q2."""
        p, m = self.bodies(q), self.MASSES
        momentum, hand = [], []
        for first in range(3):
            pivot = 0.0 if first == 0 else p[2 + first]
            v = np.where(np.arange(3) >= first, 1j * (p[:3] - pivot), 0.0)
            drift = m @ v / m.sum()
            spin = self.MOMENTS[first:].sum()
            momentum.append(float((m * (p[:3].conj() * (v - drift)).imag).sum() + spin))
            hand.append(1j * (p[5] - pivot) - drift)
        return np.array(momentum), np.array(hand)

    def joints(self, u):
        q = np.array([0.3 + 0.6 * np.cos(u), 0.7 + 0.6 * np.sin(u)])
        return q, 0.6 * np.array([-np.sin(u), np.cos(u)])

    def drift(self, u):
        """d heading / du by conservation of momentum."""
        q, rate = self.joints(u)
        h, _ = self.rows(q)
        return -(h[1:] @ rate) / h[0]

    def heading(self, u):
        k = np.arange(1, len(self.waves) + 1)
        return self.mean * u + float((self.waves / (1j * k) * (np.exp(1j * k * u) - 1)).sum().real)

    def __call__(self, s, order=0):
        u = 2.0 * np.pi * self.turns * s
        (q, rate), turn = self.joints(u), np.exp(1j * self.heading(u))
        if order == 0:
            value = self.bodies(q)[5]
        else:
            value = self.rows(q)[1] @ [self.drift(u), *rate] * 2.0 * np.pi * self.turns
        return np.array([(turn * value).real, (turn * value).imag, 0.0])


def looping(aside, turns, law=TimeLaw.QUINTIC):
    model, upright = FreeFloatingModel.from_urdf(two(aside), "tool"), FixedAttitude(np.eye(3))
    loop, timing = JointLoop(aside, turns), Timing(30.0 * turns, law)
    problem = asked(model, Task.PLANAR_POSITION, [0, 0, 0], loop, upright, timing)
    return integrate_motion(problem, [0, 0, 0, 1], [0.9, 0.7])


@pytest.mark.parametrize("law", TimeLaw)
def test_a_closed_joint_loop_turns_the_spacecraft_by_the_golden_angle(law):
    """40/4/3: once round, the base has turned by -2.35462974398 degrees, the joints are back."""
    angle, _ = quad(JointLoop(1.5).drift, 0.0, 2.0 * np.pi, epsabs=1e-13)
    assert np.degrees(angle) == pytest.approx(-2.35462974398, abs=1e-10)
    motion = looping(1.5, 1, law)
    assert motion.completed
    assert_close(motion.final.joints, [0.9, 0.7], atol=1e-8)
    turned = np.degrees(Rotation.from_quat(motion.final.attitude).as_rotvec()[2])
    assert turned == pytest.approx(-2.35462974398, abs=1e-7)
    (half,) = motion.sample(15.0)
    assert_close(half.joints, [-0.3, 0.7], atol=1e-8)


def test_ten_closed_loops_turn_the_spacecraft_ten_times_as_far():
    """Holonomy adds up: nothing is remembered but the attitude."""
    motion = looping(1.5, 10)
    assert_close(motion.final.joints, [0.9, 0.7], atol=1e-7)
    turned = np.degrees(Rotation.from_quat(motion.final.attitude).as_rotvec()[2])
    assert turned == pytest.approx(-23.5462974398, abs=1e-6)


# --- independent integration, other arms -------------------------------------------------------


def seven(task, momentum):
    model = FreeFloatingModel.from_urdf(SEVEN, "tool")
    attitude = Rotation.from_rotvec([0.4, -0.3, 0.9]).as_quat()
    joints = np.array([0.3, -0.9, 0.4, 1.5, -0.3, 0.8, 0.5])
    step, turn = [-0.4, 0.3, -0.3], [0.2, -0.3, 0.4]
    problem = from_here(model, task, momentum, attitude, joints, step, turn, Timing(40.0))
    return problem, attitude, joints


def sliding(momentum):
    model = FreeFloatingModel.from_urdf(SLIDING, "tool")
    attitude = Rotation.from_rotvec([-0.2, 0.5, 0.3]).as_quat()
    joints = np.array([0.4, 0.7, 0.6])
    timing = Timing(25.0, TimeLaw.TRAPEZOIDAL)
    step = [0.3, 0.5, -0.4]
    problem = from_here(
        model, Task.POSITION, momentum, attitude, joints, step, [0, 0, 0], timing
    )  # fmt: skip
    return problem, attitude, joints


def example_2():
    problem = bundled("spatial_6dof/line")
    attitude = problem.attitude("attitude", GOOD)
    return problem, attitude, problem.branches(attitude)[2].joints


def example_1(task=Task.PLANAR_POSE):
    problem = replace(bundled("planar_3dof/parabola"), task=task)
    attitude = heading(200.0)
    return problem, attitude, bundled("planar_3dof/parabola").branches(attitude)[0].joints


def wrist_free(momentum):
    problem, attitude, joints = example_2()
    return replace(problem, task=Task.POSITION, momentum=momentum), attitude, joints


CASES = {
    "spatial pose": example_2,
    "planar pose with a stop": example_1,
    "three joints, planar position": lambda: example_1(Task.PLANAR_POSITION),
    "six joints, position": lambda: wrist_free([0.5, 0.3, 0.1]),
    "seven joints, pose": lambda: seven(Task.POSE, [0.4, -0.2, 0.3]),
    "seven joints, no momentum": lambda: seven(Task.POSE, [0, 0, 0]),
    "seven joints, position": lambda: seven(Task.POSITION, [0.4, -0.2, 0.3]),
    "sliding joint": lambda: sliding([0.2, 0.1, -0.3]),
    "sliding joint, no momentum": lambda: sliding([0, 0, 0]),
}


@pytest.mark.parametrize("case", CASES)
def test_a_plain_integration_agrees(case):
    """In time, from the mass matrix, redundant rates by a KKT system: the same to 1e-7."""
    problem, attitude, joints = CASES[case]()
    motion = integrate_motion(problem, attitude, joints)
    assert motion.completed
    times = np.linspace(0.0, problem.path.duration, 12)
    assert_agrees(motion, plain(problem, attitude, joints, times), times)
    position, angle = tracking(motion, np.linspace(0.0, problem.path.duration, 150))
    assert position < 1e-8
    assert angle < 1e-8 or not problem.task.turns
    assert motion.residuals().momentum < 1e-6


def test_a_plain_integration_of_the_printed_path_agrees():
    """Example 2 with line, quintic (18b) and twist written out by hand."""
    problem, attitude, joints = example_2()
    A, B = np.array([1.0, 0.0, 0.0]), np.array([-0.5, 0.8, 0.33])

    def twist(t):
        tau = t / 100.0
        return np.concatenate([(B - A) * 30 * tau**2 * (1 - tau) ** 2 / 100.0, np.zeros(3)])

    times = np.linspace(0.0, 100.0, 9)
    motion = integrate_motion(problem, attitude, joints)
    assert_agrees(motion, plain(problem, attitude, joints, times, twist), times)


@pytest.mark.parametrize("case", ["spatial pose", "seven joints, pose", "sliding joint"])
def test_the_centre_of_mass_stays_put(case):
    """No force from outside: it rests at the origin, and what turns the base keeps it there."""
    problem, attitude, joints = CASES[case]()
    motion = integrate_motion(problem, attitude, joints)
    model, T = problem.model.pin_model, problem.path.duration
    data, h = model.createData(), 1e-4 * problem.path.duration
    for t in np.linspace(0.1, 0.9, 9) * T:
        states = motion.sample([t - h, t, t + h])
        q = [np.concatenate([s.base_position, s.attitude, s.joints]) for s in states]
        assert_close(pin.centerOfMass(model, data, q[1]), 0.0, atol=1e-13)
        v = pin.difference(model, q[0], q[2]) / (2 * h)
        momentum = pin.computeCentroidalMomentum(model, data, q[1], v)
        assert_close(momentum.linear, 0.0, atol=1e-4)
        assert_close(momentum.angular, problem.momentum, atol=1e-4)


def test_redundant_joints_move_as_little_as_they_can():
    """Of all joint rates that do the task those of least Euclidean norm are taken."""
    problem, attitude, joints = seven(Task.POSE, [0.0, 0.0, 0.0])
    motion, h = integrate_motion(problem, attitude, joints), 1e-3
    model = problem.model
    for t in (10.0, 20.0, 30.0):
        before, now, after = motion.sample([t - h, t, t + h])
        rates = (after.joints - before.joints) / (2 * h)
        q = np.concatenate([np.zeros(3), now.attitude, now.joints])
        Ag = pin.computeCentroidalMap(model.pin_model, model.scratch, q)
        J = pin.computeFrameJacobian(
            model.pin_model, model.scratch, q, model.frame_id, pin.LOCAL_WORLD_ALIGNED
        )
        S = J[:, 6:] - J[:, :6] @ np.linalg.solve(Ag[:, :6], Ag[:, 6:])
        idle = np.linalg.svd(S)[2][-1]
        assert np.linalg.norm(rates) > 1e-3
        assert abs(idle @ rates) < 1e-6 * np.linalg.norm(rates)


def test_a_redundant_arm_is_singular_where_it_is_stretched():
    """Pulled beyond its reach, seven joints or not, S* loses rank and the motion ends exactly."""
    problem, attitude, joints = seven(Task.POSE, [0.4, -0.2, 0.3])
    far = from_here(
        problem.model, Task.POSE, problem.momentum, attitude, joints, [1.5, 1.5, 1.0], [0, 0, 0],
        Timing(40.0),
    )  # fmt: skip
    ends = [integrate_motion(far, attitude, joints, tolerance=e) for e in (1e-8, 1e-11)]
    assert ends[0].final.time == pytest.approx(ends[1].final.time, abs=1e-6)
    for motion in ends:
        assert motion.ending is Ending.SINGULAR
        values = np.linalg.svd(generalized_jacobian(far.model, motion.final.joints))[1]
        assert values[-1] < 1e-5 * values[0]


def test_a_redundant_arm_does_not_creep_along_a_singularity(spatial, monkeypatch):
    """Where S* loses rank the motion ends, as for any other arm, after some tens of steps.

    Position along the line of Example 2, six joints: the least-norm rates of this configuration
    lead into a rank loss, where time stands still.
    """
    monkeypatch.setattr("freefloat.integration._MAX_STEPS", 600)
    problem = replace(spatial, task=Task.POSITION)
    attitude = problem.attitude("attitude", GOOD)
    joints = [-1.3803, 2.2726, 1.971, 1.7142, -2.9989, -0.8725]
    joints = problem.branch_near(attitude, joints, ()).joints
    motion = integrate_motion(problem, attitude, joints)
    assert motion.ending is Ending.SINGULAR
    values = np.linalg.svd(generalized_jacobian(problem.model, motion.final.joints, problem.task))[
        1
    ]
    assert values[-1] < 1e-4 * values[0]


def test_without_momentum_an_idle_hand_means_an_idle_robot(spatial):
    """h = 0 and a rest at a stop: nothing moves there."""
    timing = Timing(100.0, TimeLaw.QUINTIC, (Stop(0.5, 50.0),))
    problem = replace(
        spatial, momentum=[0, 0, 0], path=TimedPath(spatial.path.path, timing)
    )  # fmt: skip
    before, after = followed(problem, GOOD, 2).sample([49.99, 50.01])
    assert_close(after.joints, before.joints, atol=1e-8)
    assert_close(after.attitude, before.attitude, atol=1e-8)


# --- long and short ----------------------------------------------------------------------------


def test_a_day_of_drift_in_the_path_independent_workspace():
    """1e5 s with h = 0.1: the spacecraft turns time and again under a hand that hardly moves.

    The wrist stays where S cannot vanish (PIW, 1.26 m to 2.32 m), so nothing ends the motion.
    """
    model = bundled("planar_3dof/parabola").model
    line, upright = PolynomialCurve.line([2.1, 0, 0], [2.1, 0.2, 0]), FixedAttitude(np.eye(3))
    problem = asked(model, Task.PLANAR_POSE, [0, 0, 0.1], line, upright, Timing(1e5))
    motion = followed(problem, heading(10.0), 0)
    assert motion.completed
    residuals = motion.residuals()
    assert residuals.end_effector_position < 1e-6
    assert residuals.end_effector_attitude < 1e-6
    assert residuals.momentum < 1e-6
    headings = np.unwrap([heading_of(attitude) for attitude in motion.attitudes])
    assert headings[-1] - headings[0] > 4 * 2 * np.pi
    assert (np.diff(headings) > 0.0).all()


@pytest.mark.parametrize("momentum", [[0, 0, 0], [0.5, 0.3, 0.1]])
def test_a_motion_of_ten_milliseconds(spatial, momentum):
    """In 1e-2 s momentum has no time to matter: the end is that of h = 0 (to the drift, 1e-4)."""
    problem = replace(
        spatial, momentum=momentum, path=TimedPath(spatial.path.path, Timing(1e-2))
    )  # fmt: skip
    motion = followed(problem, GOOD, 2)
    assert motion.completed
    assert motion.final.time == 1e-2
    assert max(tracking(motion, np.linspace(0.0, 1e-2, 100))) < 1e-8
    rest = timed(spatial, [0, 0, 0], Timing(100.0))
    tolerance = 1e-4 if any(momentum) else 1e-8
    assert_close(motion.final.joints, rest.joints, atol=tolerance)
    swing = 100.0 / 1e-2  # rates are this much larger than in the same motion of 100 s
    assert motion.residuals().momentum < 1e-6 * swing


@pytest.mark.parametrize("duration", [1e-2, 1e5])
def test_where_an_arm_becomes_singular_does_not_depend_on_time_without_momentum(spatial, duration):
    """h = 0: fast or slow, det S* vanishes at the same place of the path."""
    places = []
    for T in (100.0, duration):
        problem = replace(
            spatial, momentum=[0, 0, 0], path=TimedPath(spatial.path.path, Timing(T))
        )  # fmt: skip
        motion = followed(problem, BAD, 2)
        assert motion.ending is Ending.SINGULAR
        places.append(problem.path.timing.s(motion.final.time))
    assert places[0] == pytest.approx(places[1], abs=1e-8)


# --- the integrator ----------------------------------------------------------------------------


def test_the_error_shrinks_with_the_tolerance(spatial):
    """Each hundredth of the tolerance takes the end-effector's error down at least tenfold."""
    errors, ends = [], []
    exact = followed(spatial, GOOD, 2, tolerance=1e-13).final.joints
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        motion = followed(spatial, GOOD, 2, tolerance=tolerance)
        errors.append(tracking(motion, np.linspace(0.0, 100.0, 200))[0])
        ends.append(np.abs(motion.final.joints - exact).max())
    for found in (errors, ends):
        assert (np.array(found[1:]) < 0.1 * np.array(found[:-1])).all()
        assert found[-1] < 1e-8
        assert found[0] > 1e-6  # it was not exact to begin with


def test_the_sign_of_a_quaternion_does_not_matter(spatial):
    """q and -q are one attitude and lead to one motion."""
    attitude = spatial.attitude("attitude", GOOD)
    joints = spatial.branches(attitude)[2].joints
    ends = [integrate_motion(spatial, sign * attitude, joints).final for sign in (1.0, -1.0)]
    assert_close(ends[0].joints, ends[1].joints, atol=1e-9)
    assert_close(ends[0].attitude, -ends[1].attitude, atol=1e-9)


def test_turning_the_whole_problem_turns_the_motion(spatial):
    """Space has no preferred direction: path, momentum and attitude turned, joints the same."""
    turn = Rotation.from_rotvec([0.7, -1.1, 0.4])
    R = turn.as_matrix()
    path = spatial.path.path
    line = PolynomialCurve(path.curve.coefficients @ R.T)
    law = FixedAttitude(R @ path.attitude.rotation(0.0))
    problem = replace(
        spatial, momentum=R @ spatial.momentum,
        path=TimedPath(EndEffectorPath(line, law), spatial.path.timing),
    )  # fmt: skip
    attitude = spatial.attitude("attitude", GOOD)
    joints = spatial.branches(attitude)[2].joints
    here = integrate_motion(spatial, attitude, joints)
    there = integrate_motion(problem, (turn * Rotation.from_quat(attitude)).as_quat(), joints)
    for t in (25.0, 60.0, 100.0):
        (a,), (b,) = here.sample(t), there.sample(t)
        assert_close(a.joints, b.joints, atol=1e-8)
        assert_close(R @ a.base_position, b.base_position, atol=1e-8)
        assert_close(R @ rotation_matrix(a.attitude), rotation_matrix(b.attitude), atol=1e-8)


def test_scaling_every_mass_and_the_momentum_changes_nothing(spatial):
    """Twice the mass with twice the momentum drifts alike."""
    model = FreeFloatingModel.from_urdf(
        spatial.model.description.text, "end_effector", scale_mass=2.0
    )
    problem = replace(spatial, model=model, momentum=2.0 * spatial.momentum)
    joints = followed(spatial, GOOD, 2).final.joints
    assert_close(followed(problem, GOOD, 2).final.joints, joints, atol=1e-8)


def test_whole_turns_of_a_joint_do_not_matter(spatial):
    """A joint that starts a turn further ends a turn further."""
    attitude = spatial.attitude("attitude", GOOD)
    joints, turns = spatial.branches(attitude)[2].joints, 2 * np.pi * np.array([0, 0, 1, -1, 0, 2])
    usual = integrate_motion(spatial, attitude, joints).final.joints
    found = integrate_motion(spatial, attitude, joints + turns).final.joints
    assert_close(found - turns, usual, atol=1e-8)


def test_joints_off_the_path_are_refused(spatial):
    """A micrometre is the limit; the message says how far off they are."""
    attitude = spatial.attitude("attitude", GOOD)
    joints = spatial.branches(attitude)[2].joints
    integrate_motion(spatial, attitude, joints + 1e-8, end=1.0)
    with pytest.raises(InputError, match="off the path at t = 0") as caught:
        integrate_motion(spatial, attitude, joints + 0.01 * np.eye(6)[1])
    assert caught.value.key == "joints"
    with pytest.raises(InputError, match="off the path at t = 30"):
        integrate_motion(spatial, attitude, joints, start=30.0)
    free = replace(spatial, task=Task.POSITION)
    integrate_motion(free, attitude, joints + 0.5 * np.eye(6)[5], end=1.0)


@pytest.mark.parametrize("times", [{"start": -1.0}, {"end": 100.5}, {"end": np.nan}, {"end": -0.1}])
def test_times_outside_the_path_are_refused(spatial, times):
    """From 0 to the duration."""
    attitude = spatial.attitude("attitude", GOOD)
    with pytest.raises(InputError, match="a time from 0 to 100") as caught:
        integrate_motion(spatial, attitude, spatial.branches(attitude)[0].joints, **times)
    assert caught.value.key == next(iter(times))


# --- singularities passed at finite rates ------------------------------------------------------


PITCH = np.array([0.0, 0.6, -1.3, 0.0, 0.3, 0.0])


class Nod:
    """Pitch of the hand about the inertial y axis that comes back: angle 4 a s (1 - s)."""

    def __init__(self, start, amplitude):
        self.start, self.amplitude = start, amplitude

    def rotation(self, s):
        turn = Rotation.from_rotvec([0.0, 4.0 * self.amplitude * s * (1.0 - s), 0.0])
        return turn.as_matrix() @ self.start

    def rate(self, s):
        return np.array([0.0, 4.0 * self.amplitude * (1.0 - 2.0 * s), 0.0])


def in_plane(model, law, momentum=(0.0, 0.2, 0.0)):
    """A motion in the x-z plane, to which spacecraft and arm are symmetric: q1, q4, q6 rest."""
    pose = model.end_effector_pose([0, 0, 0, 1], PITCH)
    line = PolynomialCurve.line(pose.position, pose.position + np.array([-0.3, 0.0, 0.3]))
    problem = asked(model, Task.POSE, momentum, line, law(pose.rotation), Timing(20.0))
    return problem, integrate_motion(problem, [0, 0, 0, 1], PITCH)


def pitched(angle):
    end = Rotation.from_rotvec([0.0, angle, 0.0]).as_matrix()
    return lambda start: SlerpAttitude(start, end @ start)


def test_a_singularity_passed_at_finite_rates_ends_the_motion(spatial):
    """sin q5 changes sign while the plane motion stays smooth: det S* = 0, no way out of plane."""
    problem, motion = in_plane(spatial.model, pitched(0.9))
    of = problem.margin.measure.value
    assert motion.ending is Ending.SINGULAR
    assert 1.0 < motion.final.time < 19.0
    assert abs(motion.final.joints[4]) < 1e-9
    assert abs(of(motion.final.joints)) < 1e-12
    before, end = motion.sample(motion.final.time - np.array([1e-3, 0.0]))
    rates = (end.joints - before.joints) / 1e-3
    assert np.abs(rates).max() < 1.0  # no blow-up gave it away
    assert np.abs(rates[[1, 2, 4]]).min() > 1e-3
    assert_close(motion.joints[:, [0, 3, 5]], 0.0, atol=1e-9)
    assert all(of(q) * of(PITCH) > 0.0 for q in motion.at_place(np.arange(motion.panels))[2])


def test_the_same_motion_the_other_way_round_completes(spatial):
    """Pitching away from the straight wrist, nothing vanishes."""
    problem, motion = in_plane(spatial.model, pitched(-0.9))
    assert motion.completed
    assert np.abs(problem.momentum).max() > 0.0
    assert motion.residuals().momentum < 1e-6


def test_a_wrist_that_just_straightens_is_told_from_one_that_does_not(spatial):
    """q5 dips to a hair below zero and comes back: singular; to a hair above: completed."""

    def lowest(amplitude):
        _, motion = in_plane(spatial.model, lambda start: Nod(start, amplitude))
        return motion, motion.at_place(np.linspace(0, motion.panels, 4001))[2][:, 4].min()

    low, high = 0.1, 0.4
    assert lowest(low)[0].completed
    assert lowest(high)[0].ending is Ending.SINGULAR
    while high - low > 1e-7:
        middle = (low + high) / 2.0
        if lowest(middle)[0].completed:
            low = middle
        else:
            high = middle
    above, below = lowest(low), lowest(high)
    assert 0.0 < above[1] < 2e-7  # what completes does not straighten, what nearly does completes
    assert below[0].final.joints[4] == pytest.approx(0.0, abs=1e-9)
    assert below[0].final.time > 5.0


@pytest.mark.parametrize("name", ["gjm", "system"])
def test_no_margin_left_at_a_singularity_is_still_a_singularity(spatial, planar, name):
    """With a margin of zero, stopping at the margin does not hide that the arm became singular."""
    for problem, attitudes in ((spatial, [BAD]), (planar, [heading(d) for d in range(95, 160, 5)])):
        margin = Margin(measure(problem.model, problem.task, name), 0.0)
        asked_for = replace(problem, margin=margin)
        for attitude in attitudes:
            for branch in asked_for.branches(asked_for.attitude("attitude", attitude)):
                plainly, stopping = (
                    followed(asked_for, attitude, branch.index, stop_at_margin=stop)
                    for stop in (False, True)
                )
                assert stopping.ending is plainly.ending


def test_a_circle_is_followed_with_the_hand_looking_along_it(spatial):
    """An arc, an attitude that turns with it, no momentum: 1e-8 m and rad all the way round."""
    attitude = spatial.attitude("attitude", GOOD)
    arc = ArcCurve([0.9, 0.0, 0.0], [1.3, 0.0, 0.0], [0.0, 0.0, 1.0], 1.5)
    law = follow_attitude(arc, "y", [0.0, 0.0, 1.0])
    problem = asked(spatial.model, Task.POSE, [0, 0, 0], arc, law, Timing(50.0))
    motions = [
        integrate_motion(problem, attitude, branch.joints) for branch in problem.branches(attitude)
    ]
    completed = [motion for motion in motions if motion.completed]
    assert completed
    for motion in completed:
        assert max(tracking(motion, np.linspace(0.0, 50.0, 200))) < 1e-8
