"""Ensembles of motions agree with single integration for all robots, paths and time laws."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import Task, generalized_determinant
from freefloat.dynamics.resolved_rates import ResolvedRateSolver
from freefloat.ensemble.ensemble import EnsembleIntegrator, EnsembleResult, run_chunks
from freefloat.ensemble.kernels.integration import (
    COMPLETED,
    FAILED,
    MARGIN,
    SINGULAR,
)
from freefloat.errors import InputError
from freefloat.io.scenario import load_scenario
from freefloat.motion.extrema import closest_approach, first_crossing
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import Margin, Problem, is_kept
from freefloat.paths.curves import ArcCurve, Curve, PolynomialCurve, SplineCurve
from freefloat.paths.orientation import (
    DirectedOrientation,
    FixedOrientation,
    OrientationLaw,
    OrientationSpline,
    SlerpOrientation,
)
from freefloat.paths.path import EndEffectorPath
from freefloat.paths.timing import Stop, TimedPath, TimeLaw, Timing
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import angle_between, heading_quaternion
from tests.robots import planar_robot, random_robot

GOOD = [0.46008, 0.09337, 0.73519, -0.48898]
BAD = [0.1, 0.5, 0.2, -0.8367]
CODES = {Ending.COMPLETED: COMPLETED, Ending.SINGULAR: SINGULAR, Ending.MARGIN: MARGIN}


@cache
def bundled(name: str) -> Problem:
    return load_scenario(name).problem()


@pytest.fixture(scope="module")
def spatial() -> Problem:
    """Example 2."""
    return bundled("spatial_6dof/line")


@pytest.fixture(scope="module")
def planar() -> Problem:
    """Example 1, at rest at F on the way."""
    return bundled("planar_3dof/parabola")


def states(problem: Problem, attitudes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every arm branch at every attitude: attitudes (K, 4) and joints (K, n)."""
    sets = problem.many_branches(np.atleast_2d(attitudes), threads=1)
    where, _ = np.nonzero(sets.exist)
    return np.atleast_2d(attitudes)[where], sets.joints[sets.exist]


def headings(*degrees: float) -> np.ndarray:
    return np.array([heading_quaternion(np.deg2rad(one)) for one in degrees])


def random_attitudes(count: int, seed: int) -> np.ndarray:
    return Rotation.random(count, rng=np.random.default_rng(seed)).as_quat()


def asked(
    model: FreeFloatingModel, curve: Curve, law: OrientationLaw, timing: Timing,
    task: Task = Task.POSE, momentum: object = (0.0, 0.0, 0.0), name: str = "gjm",
) -> Problem:  # fmt: skip
    """A problem without a margin."""
    path = TimedPath(EndEffectorPath(curve, law), timing)
    return Problem(
        model, path, task, np.array(momentum), Margin(singularity_measure(model, task, name), 0.0)
    )


def dense(motion: Motion, count: int = 3000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, attitudes and joints all along a motion."""
    return motion.evaluate(np.linspace(0.0, motion.panels, count))


def sampled_minimum(motion: Motion) -> float:
    """The smallest magnitude of the problem's measure on a dense sample, signs as at the start."""
    values = np.array([motion.problem.margin.measure(q) for q in dense(motion)[2]])
    return float((np.sign(values[0]) * values).min())


def joint_rates(motion: Motion, count: int = 400) -> np.ndarray:
    """Largest magnitudes of the joint rates on a dense sample in time."""
    problem = motion.problem
    equation = ResolvedRateSolver(problem.model, problem.task, problem.momentum)
    times, attitudes, joints = dense(motion, count)
    twists = [problem.path.twist(float(t)) for t in times]
    rows = zip(attitudes, joints, twists, strict=True)
    return np.abs([equation.rates(*row)[1] for row in rows]).max(axis=0)


FINE = 1e-8
"""Tolerance at which only systematic errors remain."""


@dataclass
class Case:
    """A motion by single integration, and by the ensemble at two tolerances."""

    motion: Motion
    rollout: EnsembleResult
    fine: EnsembleResult
    k: int

    def assert_same(self) -> None:
        """All results of a motion.

        Near a singularity relative errors of the measure are large: errors are compared with its
        initial value.
        """
        motion, k = self.motion, self.k
        of = motion.problem.margin.measure
        wanted, first = closest_approach(motion, of), abs(of(motion.joints[0]))
        for roll, exact in ((self.rollout, 3e-4), (self.fine, 1e-5)):
            assert roll.endings[k] == CODES[motion.ending]
            late = abs(roll.ended_at[k] - motion.final.time) / motion.problem.path.duration
            if motion.ending is Ending.SINGULAR:
                assert late < (1e-4 if roll is self.rollout else 2e-6)
                assert roll.minimum[k] == 0.0
                assert roll.minimum_at[k] == roll.ended_at[k]
                continue
            assert late == 0.0
            assert roll.minimum[k] == pytest.approx(
                wanted.value, rel=max(10 * exact, 2e-4), abs=exact * first
            )
            assert angle_between(roll.attitudes[k], motion.final.attitude) < exact
            np.testing.assert_allclose(roll.joints[k], motion.final.joints, rtol=0, atol=2 * exact)
            there = motion.sample([roll.minimum_at[k]])[0].joints
            assert abs(of(there)) == pytest.approx(wanted.value, rel=2e-3, abs=exact * first)

    def assert_same_extent(self) -> None:
        """Rates and ranges at the steps, which never exceed the true ones."""
        rates, (_, _, joints) = joint_rates(self.motion), dense(self.motion)
        low, high = joints.min(axis=0), joints.max(axis=0)
        quick, width = float(rates.max()), float((high - low).max())
        for roll, share in ((self.rollout, 0.2), (self.fine, 0.05)):
            found = roll.rates[self.k], roll.lower[self.k], roll.upper[self.k]
            np.testing.assert_allclose(found[0], rates, rtol=share, atol=0.3 * share * quick)
            np.testing.assert_allclose(found[1], low, rtol=0, atol=0.6 * share * width)
            np.testing.assert_allclose(found[2], high, rtol=0, atol=0.6 * share * width)
            assert (found[0] <= rates + 0.005 * quick).all()
            assert (found[1] >= low - 1e-3 * width).all()
            assert (found[2] <= high + 1e-3 * width).all()


def both(problem: Problem, attitudes: np.ndarray, joints: np.ndarray) -> list[Case]:
    """Integrate every state by both methods."""
    quick, fine = (
        EnsembleIntegrator(problem, 1).integrate(attitudes, joints, tolerance=tolerance)
        for tolerance in (1e-6, FINE)
    )
    motions = [integrate_motion(problem, *state) for state in zip(attitudes, joints, strict=True)]
    return [Case(motion, quick, fine, k) for k, motion in enumerate(motions)]


# ------------------------------------------------------------------------------ the examples


@pytest.mark.parametrize("attitude", [GOOD, BAD], ids=["good", "bad"])
def test_every_branch_of_example_2(spatial: Problem, attitude: list[float]) -> None:
    """From the bad attitude four of eight branches end at C, the others complete."""
    cases = both(spatial, *states(spatial, spatial.attitude("attitude", attitude)))
    assert len(cases) == 8
    for case in cases:
        case.assert_same()
        if case.motion.completed:
            case.assert_same_extent()
    assert sum(not case.motion.completed for case in cases) == (4 if attitude is BAD else 0)


@pytest.mark.parametrize("name", ["planar_3dof/parabola", "planar_3dof/parabola_nonstop"])
def test_example_1_all_around(name: str) -> None:
    """Both branches at every tenth degree, with the rest at F and without."""
    problem = bundled(name)
    cases = both(problem, *states(problem, headings(*range(3, 363, 10))))
    assert len(cases) == 72
    for case in cases:
        case.assert_same()
    for case in [case for case in cases if case.motion.completed][::6]:
        case.assert_same_extent()
    singular = sum(not case.motion.completed for case in cases)
    assert 5 < singular < 40


@pytest.mark.parametrize(
    ("name", "seed", "count"),
    [("spatial_6dof/line", 11, 8), ("ur5_servicer/arc", 12, 12), ("panda_servicer/line", 13, 8)],
)
def test_random_attitudes_of_the_bundled_arms(name: str, seed: int, count: int) -> None:
    """Elbow arm with the paper's measure, UR5 without spherical wrist, redundant Panda."""
    problem = bundled(name)
    attitudes, joints = states(problem, random_attitudes(count, seed))
    step = 1 if problem.model.dof == 6 else max(1, len(joints) // 8)
    cases = both(problem, attitudes[::step], joints[::step])
    assert len(cases) >= 8
    for case in cases:
        case.assert_same()


# ------------------------------------------------------------ made-up problems of all kinds


def start_of(
    model: FreeFloatingModel, attitude: np.ndarray, joints: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    pose = model.end_effector_pose(attitude, joints)
    return np.array(pose.position), np.array(pose.rotation)


def turn(vector: list[float]) -> np.ndarray:
    return Rotation.from_rotvec(vector).as_matrix()


def line_and_slerp(p: np.ndarray, R: np.ndarray) -> tuple[Curve, OrientationLaw]:
    """Straight on, turning evenly."""
    line = PolynomialCurve.line(p, p + np.array([-0.25, 0.2, -0.2]))
    return line, SlerpOrientation(R, turn([0.2, -0.3, 0.4]) @ R)


def arc_and_follow(p: np.ndarray, R: np.ndarray) -> tuple[Curve, OrientationLaw]:
    """A circle with the hand turning along, from the hand's own first attitude."""
    centre = p - 0.6 * R[:, 0]
    arc = ArcCurve(centre, p, R[:, 2], 0.7)
    return arc, DirectedOrientation.follow(arc, "y", R[:, 2])


def waypoints(p: np.ndarray, R: np.ndarray) -> tuple[Curve, OrientationLaw]:
    """A spline through points, its attitude sampled at them."""
    steps = np.array([[0, 0, 0], [-0.1, 0.05, 0], [-0.15, 0.2, -0.1], [-0.3, 0.2, -0.05]])
    curve = SplineCurve(p + steps)
    turns = Rotation.from_rotvec(np.outer([0, 1, 2, 3], [0.05, -0.1, 0.08]))
    return curve, OrientationSpline((turns * Rotation.from_matrix(R)).as_quat(), curve.knots)


PATHS = {"line, slerp": line_and_slerp, "arc, follow": arc_and_follow, "waypoints": waypoints}
LAWS = [
    (TimeLaw.QUINTIC, ()), (TimeLaw.CUBIC, ()), (TimeLaw.TRAPEZOIDAL, ()),
    (TimeLaw.TRAPEZOIDAL, (Stop(0.4, 22.0),)), (TimeLaw.CUBIC, (Stop(0.1, 3.0), Stop(0.9, 21.0))),
]  # fmt: skip
JOINTS = np.array([0.6, 0.7, -1.3, 0.4, 0.9, 0.2])


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("law", LAWS, ids=[f"{law}-{len(stops)} stops" for law, stops in LAWS])
@pytest.mark.parametrize("momentum", [(0.0, 0.0, 0.0), (0.8, -1.5, 2.0)], ids=["rest", "drift"])
def test_paths_and_laws(
    spatial: Problem, path: str, law: tuple[TimeLaw, tuple[Stop, ...]], momentum: tuple[float, ...]
) -> None:
    """The pieces of the law and the path's cubics; both bends of the wrist."""
    attitude = random_attitudes(1, 5)[0]
    curve, hand = PATHS[path](*start_of(spatial.model, attitude, JOINTS))
    problem = asked(spatial.model, curve, hand, Timing(30.0, *law), momentum=momentum)
    attitudes, joints = states(problem, attitude)
    near = np.abs(joints - JOINTS).max(axis=1).argmin()
    assert np.abs(joints[near] - JOINTS).max() < 1e-6
    cases = both(problem, attitudes[[near, near - 1]], joints[[near, near - 1]])
    assert any(case.motion.completed for case in cases)
    for case in cases:
        case.assert_same()


@pytest.mark.parametrize(
    ("structure", "task"),
    [("RRR", Task.POSITION), ("RRRRR", Task.POSITION), ("RRRRRR", Task.POSITION),
     ("RRRRRRR", Task.POSE), ("CRRRRRRR", Task.POSE), ("RPR", Task.POSITION),
     ("RRRPRR", Task.POSE), ("RRRPRRR", Task.POSE), ("PRFRPRR", Task.POSITION)],
)  # fmt: skip
@pytest.mark.parametrize("name", ["gjm", "system", "sigma"])
def test_random_arms(structure: str, task: Task, name: str) -> None:
    """Position tasks, redundant arms, prismatic joints; a second, fixed arm."""
    completed = 0
    for trial in range(20):
        seed = int.from_bytes(f"{structure}{name}{trial}".encode(), "little")
        generator = np.random.default_rng(seed)
        robot = random_robot(generator, structure, "R")
        model = FreeFloatingModel.from_urdf(robot.text, robot.tip, held={robot.others[0]: 0.7})
        attitude = Rotation.random(rng=generator).as_quat()
        joints = generator.uniform(-1.5, 1.5, model.dof)
        p, R = start_of(model, attitude, joints)
        line = PolynomialCurve.line(p, p + generator.uniform(-0.1, 0.1, 3))
        hand = SlerpOrientation(R, turn(generator.uniform(-0.2, 0.2, 3)) @ R)
        momentum = generator.normal(size=3) * model.total_mass / 500.0
        problem = asked(model, line, hand, Timing(20.0), task, momentum, name)
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
    """Position tasks of planar arms, with one answer or many, pulled out until they end."""
    m = [60.0, 6.0, 5.0, 4.0, 3.0, 2.0][: joints + 1]
    size = [0.4] * (joints + 1)
    text = planar_robot(m, [0.2 * one for one in m], size[1:], size)
    model = FreeFloatingModel.from_urdf(text, "end_effector")
    attitude, q = headings(40.0), np.array([[0.5, 1.1, 0.6, -0.8, 0.9][:joints]])
    p, R = start_of(model, attitude[0], q[0])
    endings = []
    for step in ([-0.05, -0.1, 0.0], [0.4, 0.1, 0.0], [3.0, 2.0, 0.0]):
        line = PolynomialCurve.line(p, p + step)
        problem = asked(
            model, line, FixedOrientation(R), Timing(30.0, TimeLaw.CUBIC), Task.PLANAR_POSITION,
            [0.0, 0.0, momentum],
        )  # fmt: skip
        (case,) = both(problem, attitude, q)
        case.assert_same()
        endings.append(case.motion.ending)
    assert endings[0] is Ending.COMPLETED
    assert endings[-1] is Ending.SINGULAR


# ---------------------------------------------------------------------------------- the minimum


def test_minima_between_steps(spatial: Problem, planar: Problem) -> None:
    """Against dense samples of many precise motions: where steps end a dip is not seen as deep.

    That it takes the steps' insides shows from stopping at the steps' ends: the smallest value
    there, of a motion ended a little after the minimum, lies clearly higher.
    """
    shallow = 0
    for problem, attitudes in (
        (spatial, random_attitudes(4, 21)), (planar, headings(*range(0, 360, 18)))
    ):  # fmt: skip
        attitudes, joints = states(problem, attitudes)
        roll = EnsembleIntegrator(problem, 1).integrate(attitudes, joints, tolerance=FINE)
        of = problem.margin.measure
        for k in np.flatnonzero(roll.endings == COMPLETED):
            motion = integrate_motion(problem, attitudes[k], joints[k])
            lowest = sampled_minimum(motion)
            assert roll.minimum[k] == pytest.approx(lowest, rel=1e-3)
            assert roll.minimum[k] <= lowest * (1.0 + 1e-4)
            inside = 0.0 < roll.minimum_at[k] < problem.path.duration
            if inside and roll.minimum[k] < 0.9 * abs(of(joints[k])):
                ends = np.linspace(0.0, problem.path.duration, 30)
                nodes = [abs(of(state.joints)) for state in motion.sample(ends)]
                shallow += min(nodes) > 1.01 * roll.minimum[k]
    assert shallow > 10


@pytest.mark.parametrize("tolerance", [1e-4, 1e-5, 1e-6, 1e-7])
def test_minima_do_not_depend_on_the_steps(spatial: Problem, tolerance: float) -> None:
    """The same dips with steps of four different lengths, in both directions of time."""
    attitudes, joints = states(spatial, random_attitudes(10, 22))
    roller = EnsembleIntegrator(spatial, 1)
    fine = roller.integrate(attitudes, joints, tolerance=1e-10)
    done = fine.endings == COMPLETED
    assert done.sum() > 60
    rough = roller.integrate(attitudes, joints, tolerance=tolerance)
    np.testing.assert_array_equal(rough.endings, fine.endings)
    np.testing.assert_allclose(
        rough.minimum, fine.minimum, rtol=1e-4, atol=30.0 * tolerance * fine.minimum.max()
    )
    ends, zeros = np.full(done.sum(), spatial.path.duration), np.zeros(done.sum())
    back = roller.integrate(
        fine.attitudes[done], fine.joints[done], starts=ends, ends=zeros, tolerance=tolerance
    )
    np.testing.assert_allclose(
        back.minimum, fine.minimum[done], rtol=1e-4, atol=30.0 * tolerance * fine.minimum.max()
    )


def test_skewed_minimum_between_nodes() -> None:
    """Before it the measure falls twenty times as steeply as it rises behind, near the end."""
    line = bundled("spatial_6dof/line")
    curve = ArcCurve(
        np.array([1.0, 0.0, 0.3]), np.array([1.3, 0.0, 0.3]), np.array([0.0, 0.0, 1.0]), 2.0 * np.pi
    )
    path = EndEffectorPath(curve, line.path.path.orientation)
    problem = replace(line, path=TimedPath(path, Timing(60.0, TimeLaw.QUINTIC)))
    attitude = np.array(
        [-0.5258695578591587, -0.774324080597602, -0.1540999826222065, -0.3164437101279262]
    )
    start = next(one.joints for one in problem.branches(attitude) if one.index == 2)
    found = EnsembleIntegrator(problem, 1).integrate(attitude[None], start[None])
    precise = closest_approach(integrate_motion(problem, attitude, start), problem.margin.measure)
    assert found.minimum[0] == pytest.approx(precise.value, rel=2e-5)
    assert found.minimum_at[0] == pytest.approx(precise.time, abs=0.1)


@pytest.mark.parametrize("end", ["first", "last"])
def test_minimum_beside_an_end(spatial: Problem, end: str) -> None:
    """A motion cut a little before or after the minimum of the whole: no node stands beyond it.

    What a small part of a step hides is a small part of the dip.
    """
    attitudes, joints = states(spatial, random_attitudes(10, 22))
    roller, duration = EnsembleIntegrator(spatial, 1), spatial.path.duration
    whole = roller.integrate(attitudes, joints, tolerance=FINE)
    inner = (whole.endings == COMPLETED) & (abs(whole.minimum_at - 50.0) < 30.0)
    assert inner.sum() > 10
    attitudes, joints, when = attitudes[inner], joints[inner], whole.minimum_at[inner]
    for gap, hidden in ((0.1, 2e-4), (0.6, 4e-3), (1.0, 2e-3), (3.0, 1e-4), (8.0, 1e-4)):
        if end == "last":
            part = roller.integrate(attitudes, joints, ends=when + gap)
        else:
            before = roller.integrate(attitudes, joints, ends=when - gap, tolerance=FINE)
            part = roller.integrate(
                before.attitudes, before.joints, starts=when - gap,
                ends=np.full(len(when), duration),
            )  # fmt: skip
        np.testing.assert_allclose(part.minimum, whole.minimum[inner], rtol=hidden)
        assert (part.minimum > whole.minimum[inner] * (1.0 - 1e-4)).all()


def test_wrists_that_barely_reach_the_singularity(spatial: Problem) -> None:
    """The end-effector pitches in the arm's plane; q5 approaches zero at finite rates."""
    pitch = np.array([0.0, 0.6, -1.3, 0.0, 0.3, 0.0])
    attitude = np.array([0.0, 0.0, 0.0, 1.0])
    p, R = start_of(spatial.model, attitude, pitch)
    line = PolynomialCurve.line(p, p + np.array([-0.3, 0.0, 0.3]))
    endings = []
    for amplitude in np.linspace(0.1, 0.4, 25):
        law = PitchOrientation(R, float(amplitude))
        problem = asked(spatial.model, line, law, Timing(20.0), momentum=(0.0, 0.2, 0.0))
        (case,) = both(problem, attitude[None], pitch[None])
        assert case.rollout.endings[0] == CODES[case.motion.ending]
        if case.motion.completed:
            case.assert_same()
        else:
            late = case.rollout.ended_at[0] - case.motion.final.time
            assert abs(late) < 1e-2 * problem.path.duration
            assert case.rollout.minimum[0] == 0.0
        endings.append(case.motion.ending)
    assert endings[0] is Ending.COMPLETED
    assert endings[-1] is Ending.SINGULAR


@dataclass
class PitchOrientation:
    """Pitch of the end-effector about the inertial y axis by the angle 4 a s (1 - s)."""

    start: np.ndarray
    amplitude: float

    def rotation(self, s: float) -> np.ndarray:
        return turn([0.0, 4.0 * self.amplitude * s * (1.0 - s), 0.0]) @ self.start

    def rate(self, s: float) -> np.ndarray:
        return np.array([0.0, 4.0 * self.amplitude * (1.0 - 2.0 * s), 0.0])


# ------------------------------------------------------------------------- beginnings and ends


@pytest.mark.parametrize(
    ("name", "attitude"),
    [("spatial_6dof/line", GOOD), ("planar_3dof/parabola", heading_quaternion(3.5)),
     ("planar_3dof/parabola_nonstop", heading_quaternion(5.76)),
     ("panda_servicer/line", [0.0, 0.0, 0.0, 1.0])],
)  # fmt: skip
def test_backward_integration_retraces(name: str, attitude: object) -> None:
    """An end before its start retraces the motion, stops included, least and ranges as well."""
    problem = bundled(name)
    attitudes, joints = states(problem, problem.attitude("attitude", attitude))
    roller, T = EnsembleIntegrator(problem, 1), problem.path.duration
    there = roller.integrate(attitudes, joints, tolerance=FINE)
    done = there.endings == COMPLETED
    assert done.any()
    count = int(done.sum())
    back = roller.integrate(
        there.attitudes[done], there.joints[done], starts=np.full(count, T), ends=np.zeros(count),
        tolerance=FINE,
    )  # fmt: skip
    assert (back.endings == COMPLETED).all()
    np.testing.assert_array_equal(back.ended_at, 0.0)
    np.testing.assert_allclose(back.joints, joints[done], rtol=0, atol=2e-5)
    assert angle_between(back.attitudes, attitudes[done]).max() < 1e-5
    np.testing.assert_allclose(back.minimum, there.minimum[done], rtol=2e-4)
    np.testing.assert_allclose(back.lower, there.lower[done], rtol=0, atol=0.02)
    np.testing.assert_allclose(back.upper, there.upper[done], rtol=0, atol=0.02)


@pytest.mark.parametrize(
    ("name", "attitude", "branch"),
    [("spatial_6dof/line", GOOD, 2), ("planar_3dof/parabola", heading_quaternion(3.5), 0)],
)
def test_motions_between_any_two_times(name: str, attitude: object, branch: int) -> None:
    """Between, before and exactly at rests on the way, forwards and backwards."""
    problem = bundled(name)
    start = problem.attitude("attitude", attitude)
    joints = problem.branches(start)[branch].joints
    motion = integrate_motion(problem, start, joints)
    spans = [(0.0, 30.0), (30.0, 69.73), (69.73, 100.0), (69.73, 10.0), (100.0, 69.73),
             (80.0, 20.0), (20.0, 80.0), (45.0, 45.0), (100.0, 100.0), (69.73, 69.73)]  # fmt: skip
    starts, ends = np.array(spans).T
    first, last = motion.sample(starts), motion.sample(ends)
    roll = EnsembleIntegrator(problem, 1).integrate(
        np.array([one.attitude for one in first]), np.array([one.joints for one in first]),
        starts=starts, ends=ends, tolerance=FINE,
    )  # fmt: skip
    assert (roll.endings == COMPLETED).all()
    np.testing.assert_array_equal(roll.ended_at, ends)
    np.testing.assert_allclose(roll.joints, [one.joints for one in last], rtol=0, atol=2e-5)
    assert angle_between(roll.attitudes, np.array([one.attitude for one in last])).max() < 1e-5
    of = problem.margin.measure
    for k, (low, high) in enumerate(spans):
        times = np.linspace(low, high, 2000)
        _, _, between = motion.evaluate(motion.parameter_at(times))
        values = np.abs([of(q) for q in between])
        assert roll.minimum[k] == pytest.approx(values.min(), rel=1e-3)
        assert min(low, high) <= roll.minimum_at[k] <= max(low, high)


@pytest.mark.parametrize("when", [0.0, 35.0])
def test_rates_at_the_start_count(spatial: Problem, when: float) -> None:
    """Where a motion is at its fastest when it begins, and only slows down from there."""
    start = spatial.attitude("attitude", GOOD)
    motion = integrate_motion(spatial, start, spatial.branches(start)[2].joints)
    (state,) = motion.sample([when])
    momenta = 200.0 * spatial.momentum if when == 0.0 else spatial.momentum
    equation = ResolvedRateSolver(spatial.model, spatial.task, momenta)
    first = equation.rates(state.attitude, state.joints, spatial.path.twist(when))[1]
    roll = EnsembleIntegrator(spatial, 1).integrate(
        state.attitude[None], state.joints[None], momenta=momenta, starts=np.array([when]),
        ends=np.array([when + 1e-3]),
    )  # fmt: skip
    np.testing.assert_allclose(roll.rates[0], np.abs(first), rtol=1e-2)
    later = EnsembleIntegrator(spatial, 1).integrate(
        state.attitude[None], state.joints[None], momenta=momenta, starts=np.array([when])
    )
    assert (later.rates[0] >= np.abs(first) * (1.0 - 1e-9)).all()


def test_momenta_are_those_of_problems_with_them(spatial: Problem) -> None:
    """One momentum for all, or one for each motion."""
    momenta = np.array([[0.5, 0.3, 0.1], [0.0, 0.0, 0.0], [-1.0, 0.4, 0.9], [0.5, 0.3, 0.1]])
    start = spatial.attitude("attitude", GOOD)
    attitudes, joints = np.tile(start, (4, 1)), np.tile(spatial.branches(start)[2].joints, (4, 1))
    roller = EnsembleIntegrator(spatial, 1)
    mixed = roller.integrate(attitudes, joints, momenta=momenta)
    for k, momentum in enumerate(momenta):
        alone = replace(spatial, momentum=momentum)
        own = EnsembleIntegrator(alone, 1).integrate(attitudes[k : k + 1], joints[k : k + 1])
        np.testing.assert_array_equal(mixed.joints[k], own.joints[0])
        assert mixed.minimum[k] == own.minimum[0]
        (case,) = both(alone, attitudes[k : k + 1], joints[k : k + 1])
        case.assert_same()
    assert np.abs(mixed.joints[1] - mixed.joints[0]).max() > 0.01
    everyone = roller.integrate(attitudes, joints, momenta=momenta[2])
    np.testing.assert_array_equal(everyone.joints, np.tile(mixed.joints[2], (4, 1)))


def test_stop_below_changes_no_other_motion(spatial: Problem) -> None:
    """Motions that pass the value end soon after they do; the others are the same to the bit."""
    attitudes, joints = states(spatial, random_attitudes(12, 31))
    roller, of = EnsembleIntegrator(spatial, 1), spatial.margin.measure
    whole = roller.integrate(attitudes, joints)
    level = float(np.quantile(whole.minimum, 0.4))
    stopping = roller.integrate(attitudes, joints, stop_below=level)
    below = whole.minimum < level
    assert 20 < below.sum() < len(below) - 20
    np.testing.assert_array_equal(stopping.endings[below], MARGIN)
    assert (stopping.minimum[below] < level).all()
    assert (stopping.ended_at[below] <= whole.ended_at[below]).all()
    assert stopping.evaluations[below].sum() < 0.9 * whole.evaluations[below].sum()
    for name in ("endings", "ended_at", "minimum", "joints", "attitudes", "evaluations"):
        np.testing.assert_array_equal(
            getattr(stopping, name)[~below], getattr(whole, name)[~below], err_msg=name
        )
    for k in np.flatnonzero(below)[::6]:
        motion = integrate_motion(spatial, attitudes[k], joints[k])
        place = first_crossing(motion, of, level)
        assert place is not None
        crossing = motion.evaluate(place)[0][0]
        assert crossing - 1e-3 <= stopping.ended_at[k] <= crossing + 15.0
    kept_there = stopping.keeps(level)
    np.testing.assert_array_equal(kept_there, ~below)


def test_margin_violations_precede_singularities(spatial: Problem) -> None:
    """From the bad attitude: used up before it is singular, and it starts below a larger one."""
    attitudes, joints = states(spatial, spatial.attitude("attitude", BAD))
    roller = EnsembleIntegrator(spatial, 1)
    plain, stopped = (
        roller.integrate(attitudes, joints),
        roller.integrate(attitudes, joints, stop_below=5),
    )
    singular = plain.endings == SINGULAR
    assert singular.sum() == 4
    np.testing.assert_array_equal(stopped.endings[singular], MARGIN)
    assert (stopped.ended_at[singular] < plain.ended_at[singular]).all()
    at_once = roller.integrate(attitudes, joints, stop_below=1e6)
    np.testing.assert_array_equal(at_once.endings, MARGIN)
    np.testing.assert_array_equal(at_once.ended_at, 0.0)
    np.testing.assert_array_equal(at_once.joints, joints)
    first = np.abs([spatial.margin.measure(q) for q in joints])
    np.testing.assert_allclose(at_once.minimum, first, rtol=1e-10)


@pytest.mark.parametrize("wrist", [0.0, 1e-15, -1e-12])
def test_a_straight_wrist_at_the_start_is_singular(spatial: Problem, wrist: float) -> None:
    """At once, as for the precise motion: nothing is followed."""
    attitude = random_attitudes(1, 5)[0]
    joints = JOINTS.copy()
    joints[4] = wrist
    p, R = start_of(spatial.model, attitude, joints)
    problem = asked(spatial.model, *line_and_slerp(p, R), Timing(20.0), momentum=(0.3, 0.1, 0.2))
    roll = EnsembleIntegrator(problem, 1).integrate(attitude[None], joints[None])
    assert integrate_motion(problem, attitude, joints).ending is Ending.SINGULAR
    assert roll.endings[0] == SINGULAR
    assert roll.ended_at[0] == pytest.approx(0.0, abs=1e-3)
    assert roll.minimum[0] == 0.0
    np.testing.assert_allclose(roll.joints[0], joints, rtol=0, atol=0.05)


def test_a_stretched_redundant_arm_at_the_start_is_singular() -> None:
    """S S^T of a planar arm of three equal links, straight, without a spacecraft to speak of."""
    text = planar_robot([1e9, 1, 1, 1], [1e9, 0.1, 0.1, 0.1], [0.5] * 3, [0.5] * 4)
    model = FreeFloatingModel.from_urdf(text, "end_effector")
    attitude, q = headings(0.0), np.zeros((1, 3))
    p, R = start_of(model, attitude[0], q[0])
    line = PolynomialCurve.line(p, p + np.array([-0.5, 0.1, 0.0]))
    problem = asked(model, line, FixedOrientation(R), Timing(20.0), Task.PLANAR_POSITION)
    assert integrate_motion(problem, attitude[0], q[0]).ending is Ending.SINGULAR
    roll = EnsembleIntegrator(problem, 1).integrate(attitude, q)
    assert roll.endings[0] == SINGULAR
    assert roll.ended_at[0] < 1e-2
    assert roll.minimum[0] == 0.0


# ------------------------------------------------------------------------------- many at once


def many(problem: Problem, count: int = 300) -> tuple[np.ndarray, np.ndarray]:
    attitudes, joints = states(problem, headings(*np.linspace(0.0, 359.0, count)))
    return attitudes, joints


def test_threads_do_not_matter(planar: Problem) -> None:
    """To the last bit, in any number, whatever the order in which the work is done."""
    attitudes, joints = many(planar)
    assert len(joints) > 500
    one, two, three = (
        EnsembleIntegrator(planar, k).integrate(attitudes, joints) for k in (1, 2, 3)
    )
    for name in EnsembleResult._fields:
        for other in (two, three):
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name), err_msg=name)
    again = np.arange(len(joints))[::-1]
    turned = EnsembleIntegrator(planar, 2).integrate(attitudes[again], joints[again])
    np.testing.assert_array_equal(turned.joints[again], one.joints)
    assert set(one.endings) == {COMPLETED, SINGULAR}
    assert FAILED not in one.endings


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_progress_rises_to_one(planar: Problem, threads: int) -> None:
    shares: list[float] = []
    attitudes, joints = many(planar)
    EnsembleIntegrator(planar, threads).integrate(attitudes, joints, progress=shares.append)
    assert len(shares) >= 3
    assert shares == sorted(set(shares))
    assert shares[0] > 0.0
    assert shares[-1] == 1.0


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_an_interruption_ends_everything(planar: Problem, threads: int) -> None:
    """Ctrl-C while waiting: it comes through, and no thread goes on."""
    attitudes, joints = many(planar)
    calls: list[float] = []

    def interrupt(share: float) -> None:
        calls.append(share)
        raise KeyboardInterrupt

    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        EnsembleIntegrator(planar, threads).integrate(attitudes, joints, progress=interrupt)
    assert len(calls) == 1
    assert threading.active_count() == before


@pytest.mark.parametrize("threads", [1, 2])
def test_an_interruption_cancels_pending_chunks(threads: int) -> None:
    begun: list[int] = []

    def work(chunk: int) -> None:
        begun.append(chunk)
        time.sleep(0.01)

    def interrupt(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_chunks(work, range(100), threads, interrupt)
    assert len(begun) < 10
    now = list(begun)
    time.sleep(0.05)
    assert begun == now


@pytest.mark.parametrize("threads", [0, -1])
def test_zero_threads_raise(planar: Problem, threads: int) -> None:
    with pytest.raises(InputError) as caught:
        EnsembleIntegrator(planar, threads)
    assert caught.value.key == "threads"
    assert str(threads) in caught.value.problem


def test_results_are_frozen_and_inputs_left_alone(planar: Problem) -> None:
    """Read-only and strided inputs; read-only results."""
    attitudes, joints = many(planar, 5)
    wide = np.asfortranarray(joints)
    before = joints.copy()
    for array in (attitudes, joints):
        array.setflags(write=False)
    roll = EnsembleIntegrator(planar, 1).integrate(attitudes, joints)
    strided = EnsembleIntegrator(planar, 1).integrate(np.asfortranarray(attitudes), wide)
    np.testing.assert_array_equal(joints, before)
    for name in EnsembleResult._fields:
        values = getattr(roll, name)
        np.testing.assert_array_equal(values, getattr(strided, name))
        assert len(values) == len(joints)
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0


def test_no_motions(planar: Problem) -> None:
    roll = EnsembleIntegrator(planar, 2).integrate(np.zeros((0, 4)), np.zeros((0, 3)))
    assert roll.joints.shape == (0, 3)
    assert roll.keeps(1.0).shape == (0,)


def test_the_length_of_a_quaternion_does_not_matter(spatial: Problem) -> None:
    """Nor its sign: last attitudes are of unit length and turn the same way."""
    attitudes, joints = states(spatial, spatial.attitude("attitude", GOOD))
    one = EnsembleIntegrator(spatial, 1).integrate(attitudes, joints)
    other = EnsembleIntegrator(spatial, 1).integrate(-attitudes, joints)
    np.testing.assert_allclose(np.linalg.norm(one.attitudes, axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(other.attitudes, -one.attitudes, rtol=0, atol=1e-12)
    np.testing.assert_allclose(other.minimum, one.minimum, rtol=1e-12)


def test_kept_margins_allow_for_rounding_and_not_for_zero() -> None:
    values = np.array([0.0, 4.99, 5.0 * (1 - 2e-6), 5.0 * (1 - 0.5e-6), 5.0, 6.0])
    assert is_kept(values, 5.0).tolist() == [False, False, False, True, True, True]
    assert is_kept(values, 0.0).tolist() == [False, True, True, True, True, True]


def test_determinant_ratios(spatial: Problem) -> None:
    """Smallest over largest magnitude of det S*, as far as steps see them; zero where singular."""
    attitudes, joints = states(spatial, spatial.attitude("attitude", BAD))
    roll = EnsembleIntegrator(spatial, 1).integrate(attitudes, joints, tolerance=FINE)
    np.testing.assert_array_equal(roll.determinant_ratios[roll.endings == SINGULAR], 0.0)
    for k in np.flatnonzero(roll.endings == COMPLETED):
        way = dense(integrate_motion(spatial, attitudes[k], joints[k]), 500)[2]
        sizes = np.abs([generalized_determinant(spatial.model, q) for q in way])
        assert roll.determinant_ratios[k] == pytest.approx(sizes.min() / sizes.max(), rel=0.1)


def test_only_completed_motions_keep_a_margin(spatial: Problem) -> None:
    attitudes, joints = states(spatial, spatial.attitude("attitude", BAD))
    roll = EnsembleIntegrator(spatial, 1).integrate(attitudes, joints)
    np.testing.assert_array_equal(roll.keeps(0.0), roll.endings == COMPLETED)
    half = EnsembleIntegrator(spatial, 1).integrate(attitudes, joints, stop_below=1e6)
    assert (half.minimum > 5.0).any()
    assert not half.keeps(5.0).any()
