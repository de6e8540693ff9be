"""Ensembles of motions agree with single integration for all robots, paths and time laws."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.attitude_grids import attitude_grid
from freefloat.dynamics.generalized_jacobian import generalized_determinant
from freefloat.ensemble.endings import COMPLETED, MARGIN, SINGULAR
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.result import EnsembleResult
from freefloat.ensemble.systems import Systems
from freefloat.motion.margin import keeps_threshold
from freefloat.motion.motion import Ending
from freefloat.paths.curves import ArcCurve, Curve, PolynomialCurve, SplineCurve
from freefloat.paths.directed_orientation import DirectedOrientation
from freefloat.paths.orientation import OrientationLaw, OrientationSpline, SlerpOrientation
from freefloat.paths.timing import Stop, TimeLaw
from freefloat.so3 import angle_between, heading_quaternion
from tests.ensembles import FINE, both, dense, headings, random_attitudes, states
from tests.errors import error_key
from tests.motions import BAD, GOOD, bundled, from_here, problem_with, simulated
from tests.robots import planar_robot, random_robot


@pytest.mark.parametrize(("name", "seed", "count"), [
    ("spatial_6dof/line", 11, 1),
    ("ur5_servicer/arc", 12, 8),
    pytest.param("panda_servicer/line", 13, 8, marks=pytest.mark.slow),
])  # fmt: skip
def test_random_attitudes_of_the_bundled_arms(name: str, seed: int, count: int) -> None:
    """Elbow arm with the paper's measure, UR5 without spherical wrist, redundant Panda."""
    problem = bundled(name)
    attitudes, joints = states(problem, random_attitudes(count, seed))
    step = max(1, len(joints) // 5)
    cases = both(problem, attitudes[::step], joints[::step])
    assert len(cases) >= 5
    for case in cases:
        case.assert_same()


def rotated(vector: list[float]) -> np.ndarray:
    return Rotation.from_rotvec(vector).as_matrix()


def line_and_slerp(p: np.ndarray, R: np.ndarray) -> tuple[Curve, OrientationLaw]:
    line = PolynomialCurve.line(p, p + np.array([-0.25, 0.2, -0.2]))
    return line, SlerpOrientation(R, rotated([0.2, -0.3, 0.4]) @ R)


def arc_and_direction(p: np.ndarray, R: np.ndarray) -> tuple[Curve, OrientationLaw]:
    """A circle along which the end-effector rotates."""
    arc = ArcCurve(p - 0.6 * R[:, 0], p, R[:, 2], 0.7)
    return arc, DirectedOrientation.follow(arc, "y", R[:, 2])


def waypoints(p: np.ndarray, R: np.ndarray) -> tuple[Curve, OrientationLaw]:
    """A spline through points, its orientation sampled at them."""
    steps = np.array([[0, 0, 0], [-0.1, 0.05, 0], [-0.15, 0.2, -0.1], [-0.3, 0.2, -0.05]])
    curve = SplineCurve(p + steps)
    rotations = Rotation.from_rotvec(np.outer([0, 1, 2, 3], [0.05, -0.1, 0.08]))
    return curve, OrientationSpline((rotations * Rotation.from_matrix(R)).as_quat(), curve.knots)


LAWS = [
    (TimeLaw.QUINTIC, ()), (TimeLaw.CUBIC, ()), (TimeLaw.TRAPEZOIDAL, ()),
    (TimeLaw.TRAPEZOIDAL, (Stop(0.4, 22.0),)), (TimeLaw.CUBIC, (Stop(0.1, 3.0), Stop(0.9, 21.0))),
]  # fmt: skip
JOINTS, H = np.array([0.6, 0.7, -1.3, 0.4, 0.9, 0.2]), np.array([0.8, -1.5, 2.0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "law", "momentum"),
    [(line_and_slerp, LAWS[1], H), (line_and_slerp, LAWS[3], 0.0 * H),
     (arc_and_direction, LAWS[0], H), (arc_and_direction, LAWS[4], H), (waypoints, LAWS[2], H)],
)  # fmt: skip
def test_paths_and_laws(spatial, path, law, momentum) -> None:
    """The segments of the law and the path's cubics; both signs of the wrist."""
    attitude = random_attitudes(1, 5)[0]
    pose = spatial.model.end_effector_pose(attitude, JOINTS)
    curve, orientation = path(np.array(pose.position), np.array(pose.rotation))
    timing = ff.Timing(30.0, *law)
    problem = problem_with(spatial.model, ff.Task.POSE, momentum, curve, orientation, timing)
    attitudes, joints = states(problem, attitude)
    near = np.abs(joints - JOINTS).max(axis=1).argmin()
    assert np.abs(joints[near] - JOINTS).max() < 1e-6
    cases = both(problem, attitudes[[near, near - 1]], joints[[near, near - 1]])
    assert any(case.motion.completed for case in cases)
    for case in cases:
        case.assert_same()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("structure", "task", "name"),
    [("RRRRR", ff.Task.POSITION, "system"), ("CRRRRRRR", ff.Task.POSE, "system"),
     ("RPR", ff.Task.POSITION, "sigma"), ("RRRPRR", ff.Task.POSE, "gjm"),
     ("RRRPRRR", ff.Task.POSE, "sigma"), ("PRFRPRR", ff.Task.POSITION, "gjm")],
)  # fmt: skip
def test_random_arms(structure: str, task: ff.Task, name: str) -> None:
    """Position tasks, redundant arms, prismatic joints; a second, fixed arm."""
    completed = 0
    for trial in range(20):
        seed = int.from_bytes(f"{structure}{name}{trial}".encode(), "little")
        generator = np.random.default_rng(seed)
        robot = random_robot(generator, structure, "R")
        fixed = {robot.others[0]: 0.7}
        model = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector, fixed_joints=fixed)
        attitude = Rotation.random(rng=generator).as_quat()
        joints = generator.uniform(-1.5, 1.5, model.dof)
        step, vector = generator.uniform(-0.1, 0.1, 3), generator.uniform(-0.2, 0.2, 3)
        momentum = generator.normal(size=3) * model.total_mass / 500.0
        problem = from_here(model, task, momentum, attitude, joints, step, vector, ff.Timing(20.0))
        problem = replace(problem, margin=ff.Margin(ff.singularity_measure(model, task, name), 0.0))
        (case,) = both(problem, attitude[None], joints[None])
        case.assert_same()
        if case.motion.completed:
            completed += 1
            case.assert_same_extent()
        if trial > 1 and completed:
            return
    raise AssertionError("no motion completed")


@pytest.mark.parametrize("joints", [2, 3, 5])
@pytest.mark.parametrize("momentum", [0.0, 0.3])
def test_planar_arms(joints: int, momentum: float) -> None:
    """Position tasks of planar arms, redundant or not, pulled out until they become singular."""
    m = [60.0, 6.0, 5.0, 4.0, 3.0, 2.0][: joints + 1]
    size = [0.4] * (joints + 1)
    text = planar_robot(m, [0.2 * mass for mass in m], size[1:], size)
    model = ff.FreeFloatingModel.from_urdf(text, "end_effector")
    attitude, q = headings(40.0), np.array([[0.5, 1.1, 0.6, -0.8, 0.9][:joints]])
    endings = []
    for step in ([-0.05, -0.1, 0.0], [0.4, 0.1, 0.0], [3.0, 2.0, 0.0]):
        problem = from_here(
            model, ff.Task.PLANAR_POSITION, [0.0, 0.0, momentum], attitude[0], q[0], step,
            [0, 0, 0], ff.Timing(30.0, TimeLaw.CUBIC),
        )  # fmt: skip
        (case,) = both(problem, attitude, q)
        case.assert_same()
        endings.append(case.motion.ending)
    assert endings[0] is Ending.COMPLETED
    assert endings[-1] is Ending.SINGULAR


@pytest.mark.parametrize("end", ["first", "last"])
def test_minimum_near_an_end(spatial: ff.Problem, end: str) -> None:
    """A motion cut a little before or after the minimum of the whole: no node stands beyond it."""
    attitudes, joints = states(spatial, random_attitudes(10, 22))
    integrator, duration = EnsembleIntegrator(spatial, 1), spatial.path.duration
    fine = EnsembleIntegrator(spatial, 1, tolerance=FINE)
    whole = fine.integrate(attitudes, joints)
    inner = (whole.endings == COMPLETED) & (abs(whole.minimum_at - 50.0) < 30.0)
    assert inner.sum() > 10
    attitudes, joints, when = attitudes[inner], joints[inner], whole.minimum_at[inner]
    for gap, hidden in ((0.1, 2e-4), (0.6, 4e-3), (1.0, 2e-3), (3.0, 1e-4), (8.0, 1e-4)):
        if end == "last":
            part = integrator.integrate(attitudes, joints, ends=when + gap)
        else:
            before = fine.integrate(attitudes, joints, ends=when - gap)
            part = integrator.integrate(
                before.attitudes, before.joints, starts=when - gap,
                ends=np.full(len(when), duration),
            )  # fmt: skip
        np.testing.assert_allclose(part.minimum, whole.minimum[inner], rtol=hidden)
        assert (part.minimum > whole.minimum[inner] * (1.0 - 1e-4)).all()


def grid_states(problem: ff.Problem, *numbers: int) -> tuple[np.ndarray, np.ndarray]:
    """The states of all branches from a grid of 1,500 attitudes that have these numbers."""
    attitudes = attitude_grid(1500)
    branches = problem.many_branches(attitudes)
    where, _ = np.nonzero(branches.exist)
    chosen = list(numbers)
    return attitudes[where][chosen], branches.joints[branches.exist][chosen]


def test_motions_may_pass_a_singularity_closely(spatial: ff.Problem) -> None:
    """Det S* falls to 1e-8 to 1e-13 of its largest value and rises again; ``arm`` stays large."""
    attitudes, joints = grid_states(spatial, 8504, 8511, 3871, 3720, 1013, 858, 570)
    result = EnsembleIntegrator(spatial, 1).integrate(attitudes, joints)
    assert (result.endings == COMPLETED).all()
    assert (result.determinant_ratios < 1e-7).all()
    for k in (0, 2):
        motion = ff.integrate_motion(spatial, attitudes[k], joints[k])
        precise = ff.closest_approach(motion, spatial.margin.measure).value
        assert result.minimum[k] == pytest.approx(precise, rel=1e-4)


@pytest.mark.parametrize("tolerance", [0.0, np.nan])
def test_tolerances_that_are_no_use_are_refused(spatial: ff.Problem, tolerance: float) -> None:
    assert error_key(lambda: EnsembleIntegrator(spatial, tolerance=tolerance)) == "tolerance"


@pytest.mark.parametrize(("key", "value"), [
    ("ends", [150.0]), ("ends", [np.nan]), ("joints", np.zeros((1, 3))),
    ("momenta", [[0.0, np.inf, 0.0]]),
])  # fmt: skip
def test_states_that_kernels_could_not_read_are_refused(spatial, key, value):
    attitudes, joints = states(spatial, spatial.attitude(GOOD))
    given = {"attitudes": attitudes[:1], "joints": joints[:1], key: np.array(value)}
    if key == "momenta":
        given["systems"] = Systems.of(spatial, given.pop("momenta"))
    integrator = EnsembleIntegrator(spatial, 1)
    assert error_key(lambda: integrator.integrate(**given)) in {key, "attitudes"}


@pytest.mark.parametrize(
    ("name", "attitude", "branch"),
    [("spatial_6dof/line", GOOD, 2), ("planar_3dof/parabola", heading_quaternion(3.5), 0)],
)
def test_motions_between_any_two_times(name: str, attitude: object, branch: int) -> None:
    """Between, before and exactly at stops on the way, forward and backward."""
    motion = simulated(bundled(name), attitude, branch)
    spans = [(0.0, 30.0), (30.0, 69.73), (69.73, 100.0), (69.73, 10.0), (100.0, 69.73),
             (80.0, 20.0), (20.0, 80.0), (45.0, 45.0), (100.0, 100.0), (69.73, 69.73)]  # fmt: skip
    starts, ends = np.array(spans).T
    first, last = motion.sample(starts), motion.sample(ends)
    result = EnsembleIntegrator(motion.problem, 1, tolerance=FINE).integrate(
        np.array([state.attitude for state in first]), np.array([state.joints for state in first]),
        starts=starts, ends=ends,
    )  # fmt: skip
    assert (result.endings == COMPLETED).all()
    np.testing.assert_array_equal(result.ended_at, ends)
    np.testing.assert_allclose(result.joints, [state.joints for state in last], rtol=0, atol=2e-5)
    final = np.array([state.attitude for state in last])
    assert angle_between(result.attitudes, final).max() < 1e-5
    for k, (low, high) in enumerate(spans):
        _, _, between = motion.evaluate(motion.coordinates_at(np.linspace(low, high, 400)))
        values = np.abs([motion.problem.margin.measure(q) for q in between])
        assert result.minimum[k] == pytest.approx(values.min(), rel=1e-3)
        assert min(low, high) <= result.minimum_at[k] <= max(low, high)


@pytest.mark.parametrize("when", [0.0, 35.0])
def test_rates_at_the_start_count(spatial: ff.Problem, when: float) -> None:
    """Where a motion is at its fastest when it begins, and only slows down from there."""
    (state,) = simulated(spatial, GOOD, 2).sample([when])
    momentum = 200.0 * spatial.momentum if when == 0.0 else spatial.momentum
    solver = replace(spatial, momentum=momentum).resolved_rate_solver()
    first = solver.rates(state.attitude, state.joints, spatial.path.twist(when))[1]
    start = state.attitude[None], state.joints[None]
    options = {"systems": Systems.of(spatial, momentum), "starts": np.array([when])}
    integrator = EnsembleIntegrator(spatial, 1)
    result = integrator.integrate(*start, ends=np.array([when + 1e-3]), **options)
    np.testing.assert_allclose(result.rates[0], np.abs(first), rtol=1e-2)
    later = integrator.integrate(*start, **options)
    assert (later.rates[0] >= np.abs(first) * (1.0 - 1e-9)).all()


def test_margin_violations_precede_singularities(spatial: ff.Problem) -> None:
    """From the bad attitude; a larger margin is violated at the start."""
    attitudes, joints = states(spatial, spatial.attitude(BAD))
    integrator = EnsembleIntegrator(spatial, 1)
    plain = integrator.integrate(attitudes, joints)
    stopped = integrator.integrate(attitudes, joints, stop_below=5.0)
    singular = plain.endings == SINGULAR
    assert singular.sum() == 4
    np.testing.assert_array_equal(plain.keeps(0.0), plain.endings == COMPLETED)
    np.testing.assert_array_equal(stopped.endings[singular], MARGIN)
    assert (stopped.ended_at[singular] < plain.ended_at[singular]).all()
    at_once = integrator.integrate(attitudes, joints, stop_below=1e6)
    np.testing.assert_array_equal(at_once.endings, MARGIN)
    np.testing.assert_array_equal(at_once.ended_at, 0.0)
    np.testing.assert_array_equal(at_once.joints, joints)
    first = np.abs([spatial.margin.measure(q) for q in joints])
    np.testing.assert_allclose(at_once.minimum, first, rtol=1e-10)
    assert not at_once.keeps(5.0).any()


def many(problem: ff.Problem, count: int = 300) -> tuple[np.ndarray, np.ndarray]:
    return states(problem, headings(*np.linspace(0.0, 359.0, count)))


def test_results_do_not_depend_on_threads_and_order(planar: ff.Problem) -> None:
    """To the last bit, nor on the motions integrated beside."""
    attitudes, joints = many(planar)
    assert len(joints) > 500
    several = (EnsembleIntegrator(planar, k).integrate(attitudes, joints) for k in (1, 2, 4))
    single, two, four = several
    for name in EnsembleResult._fields:
        for other in (two, four):
            np.testing.assert_array_equal(getattr(other, name), getattr(single, name), err_msg=name)
    order = np.arange(len(joints))[::-1]
    reversed_ = EnsembleIntegrator(planar, 2).integrate(attitudes[order], joints[order])
    alone = [
        EnsembleIntegrator(planar, 1).integrate(attitudes[k : k + 1], joints[k : k + 1])
        for k in range(0, len(joints), 100)
    ]
    for name in EnsembleResult._fields:
        expected = getattr(single, name)
        np.testing.assert_array_equal(getattr(reversed_, name)[order], expected, err_msg=name)
        ones = np.concatenate([getattr(result, name) for result in alone])
        np.testing.assert_array_equal(ones, expected[::100], err_msg=name)
    assert set(single.endings) == {COMPLETED, SINGULAR}


def test_progress_rises_to_one(planar: ff.Problem) -> None:
    fractions: list[float] = []
    starts = (np.tile(values, (4, 1)) for values in many(planar))  # many chunks, one at a time
    EnsembleIntegrator(planar, 1).integrate(*starts, progress=fractions.append)
    assert len(fractions) >= 2
    assert fractions == sorted(set(fractions))
    assert fractions[0] > 0.0
    assert fractions[-1] == 1.0


def test_no_motions(planar: ff.Problem) -> None:
    result = EnsembleIntegrator(planar, 2).integrate(np.zeros((0, 4)), np.zeros((0, 3)))
    assert result.joints.shape == (0, 3)
    assert result.keeps(1.0).shape == (0,)


def test_margins_allow_for_rounding_and_not_for_zero() -> None:
    values = np.array([0.0, 4.99, 5.0 * (1 - 2e-6), 5.0 * (1 - 0.5e-6), 5.0, 6.0])
    assert keeps_threshold(values, 5.0).tolist() == [False, False, False, True, True, True]
    assert keeps_threshold(values, 0.0).tolist() == [False, True, True, True, True, True]


def test_determinant_ratios(spatial: ff.Problem) -> None:
    """Smallest over largest magnitude of det S*, as far as steps see them; zero where singular."""
    attitudes, joints = states(spatial, spatial.attitude(BAD))
    result = EnsembleIntegrator(spatial, 1, tolerance=FINE).integrate(attitudes, joints)
    np.testing.assert_array_equal(result.determinant_ratios[result.endings == SINGULAR], 0.0)
    for k in np.flatnonzero(result.endings == COMPLETED):
        along = dense(ff.integrate_motion(spatial, attitudes[k], joints[k]), 500)[2]
        sizes = np.abs([generalized_determinant(spatial.model, q) for q in along])
        assert result.determinant_ratios[k] == pytest.approx(sizes.min() / sizes.max(), rel=0.1)
