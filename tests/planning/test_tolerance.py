"""Tolerated deviations of momentum and duration, compared with precise motions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.attitude_grids import attitude_grid
from freefloat.dynamics.generalized_jacobian import generalized_determinant
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.systems import Systems
from freefloat.planning.candidates import SearchEffort, Tolerance
from freefloat.planning.space import deepest_ball, tolerated_deviations
from freefloat.planning.space.tolerated_deviations import tolerance
from tests.motions import bundled


def with_margin(name: str, value: float | None = None) -> ff.Problem:
    problem = bundled(name)
    if value is None:
        return problem
    return replace(problem, margin=ff.Margin(problem.margin.measure, value))


def best_attitude(problem: ff.Problem) -> np.ndarray:
    attitudes = attitude_grid(64)
    return attitudes[int(np.argmax(FeasibilityEvaluator(problem, 1).margins(attitudes, None)))]


class Case:
    """A motion and its tolerance."""

    def __init__(self, problem: ff.Problem, attitude: object) -> None:
        self.problem = problem
        chosen = ff.simulate(problem, attitude).chosen
        assert problem.margin.keeps(chosen.closest_approach.value)
        self.minimum = chosen.closest_approach.value
        self.attitude, self.joints = chosen.motion.initial.attitude, chosen.branch.joints
        evaluator = FeasibilityEvaluator(problem, 1)
        self.integrator = evaluator.integrator
        self.tolerance: Tolerance = tolerance(evaluator, chosen)

    def keeps(self, momenta: np.ndarray) -> np.ndarray:
        """Whether compiled motions with other momenta keep the rule of tolerances, shape (K,)."""
        K = len(momenta)
        ensemble = self.integrator.integrate(
            np.tile(self.attitude, (K, 1)),
            np.tile(self.joints, (K, 1)),
            Systems.of(self.problem, momenta),
        )
        keeps = ensemble.keeps(self.problem.margin.threshold)
        return keeps & (ensemble.determinant_ratios > 0.01)

    def precisely(self, *, momentum: object = None, duration: float | None = None) -> float:
        """Minimum margin of a precise motion with another momentum or duration."""
        path = self.problem.path
        if duration is not None:
            path = ff.TimedPath(path.path, replace(path.timing, duration=duration))
        h = self.problem.momentum if momentum is None else momentum
        problem = replace(self.problem, path=path, momentum=np.asarray(h))
        motion = ff.integrate_motion(problem, self.attitude, self.joints)
        return (
            ff.closest_approach(motion, problem.margin.measure).value if motion.completed else 0.0
        )

    def regular_precisely(self, momentum: np.ndarray) -> bool:
        """Whether a precise motion keeps the margin, and |det S*| a hundredth of its maximum."""
        problem = replace(self.problem, momentum=momentum)
        motion = ff.integrate_motion(problem, self.attitude, self.joints)
        sizes = [
            abs(generalized_determinant(problem.model, q, problem.task)) for q in motion.joints
        ]
        margin = ff.closest_approach(motion, problem.margin.measure).value
        kept = motion.completed and margin >= problem.margin.threshold
        return kept and min(sizes) > 0.01 * max(sizes)


@pytest.fixture(scope="module")
def drifting() -> Case:
    """Example 2, margin 30: with momentum."""
    problem = with_margin("spatial_6dof/line", 30.0)
    return Case(problem, best_attitude(problem))


@pytest.fixture(scope="module")
def still() -> Case:
    problem = replace(with_margin("spatial_6dof/line", 30.0), momentum=np.zeros(3))
    return Case(problem, best_attitude(problem))


def directions(count: int, seed: int) -> np.ndarray:
    drawn = np.random.default_rng(seed).normal(size=(count, 3))
    return drawn / np.linalg.norm(drawn, axis=1)[:, None]


@pytest.mark.slow
@pytest.mark.parametrize("which", ["drifting", "still"])
def test_margin_is_kept_with_momentum_off_in_any_direction(which, request):
    """At fractions of the tolerance; ten percent beyond it some direction violates the margin."""
    case: Case = request.getfixturevalue(which)
    tolerated, h = case.tolerance, case.problem.momentum
    assert 0.0 < tolerated.momentum < tolerated.momentum_limit
    tried = directions(100, 5)
    for fraction in (0.25, 0.5, 0.75, 0.99):
        assert case.keeps(h + fraction * tolerated.momentum * tried).all(), fraction
    assert not case.keeps(h + 1.1 * tolerated.momentum * directions(5000, 5)).all()


@pytest.mark.slow
def test_a_precise_motion_agrees_with_the_worst_direction(drifting: Case) -> None:
    """Just inside, the margin is kept; ten percent beyond, it is not."""
    tolerated, h, tried = drifting.tolerance, drifting.problem.momentum, directions(5000, 6)
    beyond = 1.1 * tolerated.momentum * tried
    (failing,) = np.nonzero(~drifting.keeps(h + beyond))
    worst = tried[failing[0]]
    assert not drifting.regular_precisely(h + 1.1 * tolerated.momentum * worst)
    assert drifting.regular_precisely(h + 0.99 * tolerated.momentum * worst)


@pytest.mark.slow
def test_durations_inside_keep_the_margin_and_those_outside_do_not(drifting: Case) -> None:
    """With the path retimed and integrated precisely."""
    tolerated, planned = drifting.tolerance, drifting.problem.path.duration
    assert planned / 10.0 * (1 - 1e-9) <= tolerated.shortest < planned < tolerated.longest
    assert tolerated.longest < 10.0 * planned
    for duration in (tolerated.shortest / 0.99, 0.5 * (tolerated.shortest + tolerated.longest),
                     0.99 * tolerated.longest):  # fmt: skip
        assert drifting.precisely(duration=duration) >= 30.0, duration
    assert drifting.precisely(duration=1.01 * tolerated.longest) < 30.0
    if tolerated.shortest > planned / 10.0 * 1.001:
        assert drifting.precisely(duration=tolerated.shortest / 1.01) < 30.0


def test_scaling_duration_and_momentum_is_equivalent(drifting: Case) -> None:
    h = drifting.problem.momentum
    slow = drifting.precisely(duration=150.0)
    much = drifting.precisely(momentum=1.5 * h)
    assert slow == pytest.approx(much, rel=1e-6)


@pytest.mark.slow
@pytest.mark.usefixtures("smaller")
def test_the_attitude_tolerance_of_a_redundant_arm_is_that_of_its_chosen_motion(monkeypatch):
    for search in (tolerated_deviations, deepest_ball):
        monkeypatch.setattr(search, "EFFORT", SearchEffort(256, 6))
    problem = bundled("panda_servicer/line")
    plan = ff.plan(problem, ff.Search("robust", samples=8))
    start = plan.chosen.motion.initial
    axes = attitude_grid(128)[:, :3]
    for fraction, all_keep in ((0.98, True), (1.3, False)):
        turns = plan.robust_radius * fraction * axes / np.linalg.norm(axes, axis=1)[:, None]
        around = Rotation.from_quat(start.attitude) * Rotation.from_rotvec(turns)
        near = ff.simulate_many(problem, around.as_quat(), joints=start.joints)
        assert bool(near.feasible.all()) is all_keep


def test_a_plan_may_leave_tolerances_out() -> None:
    problem, search = bundled("spatial_6dof/line"), ff.Search("nearest", [0, 0, 0, 1], samples=128)
    whole, quick = (ff.plan(problem, search, tolerances=wanted) for wanted in (True, False))
    assert (quick.tolerance, quick.radius_effort) == (None, None)
    assert whole.motion is not None
    assert quick.motion is not None
    first, second = whole.motion.initial.attitude, quick.motion.initial.attitude
    np.testing.assert_array_equal(first, second)
    assert ff.check(quick).passed
