"""Largest rates and ranges of compiled motions are those of precise ones, also between steps."""

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.redundancy import Metric, Toward
from freefloat.ensemble.endings import step_tolerance
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.result import EnsembleResult
from freefloat.motion.motion import Motion
from tests.motions import GOOD, bundled, first_motion, simulated
from tests.redundant import redundant
from tests.two_arms import random_case
from tests.validation.test_plain_integration import plain

INSTANTS = 2001
NULL_SPACE = ff.Redundancy(Metric.ENERGY, Toward.MIDDLE, 0.8, 2.0)
EXTENTS = "rates", "base_rate", "lower", "upper"


def highest(samples: np.ndarray) -> np.ndarray:
    """Maxima of columns of evenly spaced samples, by parabolas through the highest three."""
    i = np.clip(samples.argmax(axis=0), 1, len(samples) - 2)
    a, b, c = (samples[i + k, np.arange(samples.shape[1])] for k in (-1, 0, 1))
    place = 0.5 * (a - c) / np.minimum(a - 2.0 * b + c, -1e-300)
    inside = np.where(np.abs(place) <= 1.0, b + 0.25 * (c - a) * place, -np.inf)
    return np.maximum(samples.max(axis=0), inside)


def extents(joints: np.ndarray, rates: np.ndarray, turn: np.ndarray) -> EnsembleResult:
    """The extents of a motion, of evenly spaced samples, as those of an ensemble."""
    base = highest(np.linalg.norm(turn, axis=1)[:, None])
    found = highest(np.abs(rates))[None], base, -highest(-joints)[None], highest(joints)[None]
    empty = EnsembleResult.empty((1,), joints.shape[1])
    return empty._replace(**dict(zip(EXTENTS, found, strict=True)))


def precise(motion: Motion) -> EnsembleResult:
    """Those of a precise motion, with the rates of (4)."""
    n = motion.problem.dof
    times = np.linspace(0.0, motion.problem.path.duration, INSTANTS)
    states = motion.sample(times)
    rates = [motion.law.rates(s.time, s.attitude, s.joints) for s in states]
    return extents(
        np.array([s.joints[:n] for s in states]), np.array([r[1][:n] for r in rates]),
        np.array([r[0] for r in rates]),
    )  # fmt: skip


def assert_same(found: EnsembleResult, expected: EnsembleResult, rate: float, value: float) -> None:
    """Rates, relative to the largest of a motion's, and values [rad, m]."""
    for name in EXTENTS[:2]:
        size = np.abs(getattr(expected, name)).max()
        np.testing.assert_allclose(
            getattr(found, name), getattr(expected, name), rtol=rate, atol=1e-3 * rate * size
        )
    for name in EXTENTS[2:]:
        np.testing.assert_allclose(
            getattr(found, name), getattr(expected, name), rtol=0, atol=value
        )


def assert_precise(motion: Motion) -> None:
    """At the tolerance of maps, where errors of the motion are as large, and at a fine one."""
    assert motion.completed
    problem, first, expected = motion.problem, motion.initial, precise(motion)
    coarse = 1e-8 if problem.robot_varies else step_tolerance(problem)  # joint curves have knots
    for tolerance, rate, value in ((coarse, 1e-5, 5e-6), (1e-9, 1e-5, 1e-6)):
        integrator = EnsembleIntegrator(problem, 1, tolerance=tolerance)
        state = first.attitude[None], first.joints[None]
        assert_same(integrator.integrate(*state, extremes=True), expected, rate, value)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["planar_3dof/parabola_nonstop", "spatial_6dof/line"])
def test_examples(name: str) -> None:
    assert_precise(first_motion(bundled(name)))


@pytest.mark.slow
@pytest.mark.parametrize(("redundancy", "seed"), [(None, 1), (NULL_SPACE, 2)])
@pytest.mark.parametrize(
    ("structure", "task"),
    [("RRRPRRRR", ff.Task.POSE), ("5", ff.Task.PLANAR_POSITION)],
)  # fmt: skip
def test_random_arms(structure: str, task: ff.Task, redundancy: object, seed: int) -> None:
    start = redundant(structure, task, redundancy, seed)
    assert_precise(ff.integrate_motion(start.problem, start.attitude, start.joints))


@pytest.mark.slow
@pytest.mark.parametrize("both", [False, True])
def test_two_arms(both: bool, rng: np.random.Generator) -> None:
    """One arm on a path and one on a joint curve, and both on paths."""
    for _ in range(20):
        case = random_case(rng, both=both)
        motion = ff.integrate_motion(case.problem, case.attitude, case.joints)
        if motion.completed:
            return assert_precise(motion)
    raise AssertionError("none completes its path")


@pytest.mark.slow
def test_plain_integration() -> None:
    """SciPy's integration of Pinocchio's matrices, differentiated."""
    problem = bundled("spatial_6dof/line")
    motion = simulated(problem, GOOD, 0)
    times, step = np.linspace(0.0, problem.path.duration, INSTANTS, retstep=True)
    states = plain(problem, motion.initial.attitude, motion.initial.joints, times)
    slopes = (8.0 * (states[3:-1] - states[1:-3]) - (states[4:] - states[:-4])) / (12.0 * step)
    expected = extents(states[:, 7:], slopes[:, 7:], 2.0 * slopes[:, 3:7])
    integrator = EnsembleIntegrator(problem, 1)
    first = motion.initial
    result = integrator.integrate(first.attitude[None], first.joints[None], extremes=True)
    assert_same(result, expected, 1e-5, 5e-6)
