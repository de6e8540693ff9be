"""Samples of SO(3) agree with simulations; the boundary by bisection and from tangency points."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.attitude_grids import grid_spacing
from freefloat.ensemble.endings import COMPLETED, UNREACHED
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.margin import keeps_threshold
from freefloat.planning.space import mapping
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.climbing import EXACT, bisect, edge
from freefloat.planning.space.mapping import boundary_points, sample_attitudes, tangent_boundary
from freefloat.so3 import angle_between, rotated

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


@pytest.mark.slow
def test_entries_of_a_map_are_those_of_simulations(samples: AttitudeMap) -> None:
    for k in (3, 300):
        simulation = ff.simulate(samples.problem, samples.attitudes[k])
        numbers = [entry.branch.index for entry in simulation.branches]
        assert np.flatnonzero(samples.results.motions.endings[k] != UNREACHED).tolist() == numbers
        for entry in simulation.branches:
            completed = samples.results.motions.endings[k, entry.branch.index] == COMPLETED
            assert completed == entry.motion.completed
            minimum = entry.closest_approach.value if completed else 0.0
            assert samples.margins[k, entry.branch.index] == pytest.approx(minimum, rel=1e-3)
            keeps = completed and keeps_threshold(entry.closest_approach.value, 30.0)
            assert samples.feasible[k, entry.branch.index] == keeps


def test_a_map_that_is_not_refined_has_the_same_samples(samples: AttitudeMap) -> None:
    coarse = mapping.attitude_map(samples.problem, samples.samples, refine=False)
    np.testing.assert_array_equal(coarse.margins, samples.margins)
    assert [coarse.best, coarse.robust, coarse.regions] == [None, None, ()]


@pytest.mark.slow
def test_fractions_are_those_of_random_attitudes(
    samples: AttitudeMap, evaluator: FeasibilityEvaluator
) -> None:
    """Within four standard errors of both, for any branch and for all motions."""
    count = 1000
    attitudes = Rotation.random(count, rng=np.random.default_rng(12)).as_quat()
    keeps = evaluator.evaluate(attitudes).margins >= 30.0
    fraction = keeps.any(axis=1).mean()
    error = np.hypot(samples.feasible_fraction_error, np.sqrt(fraction * (1 - fraction) / count))
    assert abs(samples.feasible_fraction - fraction) < 4.0 * error
    assert 0.4 < fraction < 0.8
    assert samples.motion_fraction == pytest.approx(keeps.mean(), abs=0.05)
    assert samples.motions == samples.results.exist.sum() == 8 * 512


def test_blocks_and_threads_change_nothing(
    margin_30: ff.Problem, evaluator: FeasibilityEvaluator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the bit; the last block may be smaller, progress ends at 1."""
    whole = sample_attitudes(evaluator, 101)
    monkeypatch.setattr(mapping, "_BLOCK", 16)
    fractions: list[float] = []
    blocks = sample_attitudes(FeasibilityEvaluator(margin_30, 2), 101, progress=fractions.append)
    for values, other in zip(blocks.results.motions, whole.results.motions, strict=True):
        np.testing.assert_array_equal(values, other)
    np.testing.assert_array_equal(blocks.results.joints, whole.results.joints)
    assert fractions == sorted(fractions)
    assert fractions[0] > 0.0
    assert fractions[-1] == pytest.approx(1.0)


# bisection


@pytest.mark.parametrize(("rounds", "fraction"), [(EXACT, 8.0**-6), (1, 1 / 8)])
def test_bisection_ends_just_inside(rounds: int, fraction: float) -> None:
    """On geodesics that leave a ball around the identity."""
    radius, rng = 0.7, np.random.default_rng(3)
    axes = rng.normal(size=(50, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    within = rotated(IDENTITY, rng.uniform(0.0, 0.69, (50, 1)) * axes)
    beyond = rotated(IDENTITY, rng.uniform(0.71, 2.3, (50, 1)) * axes)
    whole = angle_between(within, beyond)
    edges = bisect(lambda q: angle_between(q, IDENTITY) < radius, within, beyond, rounds)
    short = radius - angle_between(edges, IDENTITY)
    assert (short > 0.0).all()
    assert (short <= fraction * whole * (1.0 + 1e-9)).all()
    np.testing.assert_allclose(
        angle_between(within, edges) + angle_between(edges, beyond), whole, atol=1e-7
    )


def test_bisection_finds_the_first_exit() -> None:
    """A gap in the set ends it, though the set is entered again behind it."""

    def inside(attitudes: np.ndarray) -> np.ndarray:
        angle = angle_between(attitudes, IDENTITY)
        return (angle < 0.5) | ((angle > 1.1) & (angle < 1.6))

    (end,) = bisect(inside, IDENTITY[None], rotated(IDENTITY, [2.0, 0.0, 0.0]))
    assert angle_between(end, IDENTITY) == pytest.approx(0.5, abs=1e-5)


def test_points_of_an_edge_lie_between_neighbours(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap
) -> None:
    """Feasible, near an infeasible sample, apart; signs of quaternions do not matter."""
    attitudes, keeps = samples.attitudes, samples.feasible[:, 2]

    def inside(attitudes: np.ndarray) -> np.ndarray:
        return evaluator.keeps(attitudes, 2)

    near = 1.5 * grid_spacing(len(attitudes))
    points = edge(inside, attitudes, keeps, 20, EXACT, near / 1.5)
    assert len(points) == 20
    assert inside(points).all()
    for point in points:
        assert angle_between(attitudes[~keeps], point).min() < near
        assert angle_between(attitudes[keeps], point).min() < near
    apart = angle_between(points[:, None], points) + np.pi * np.eye(len(points))
    assert apart.min() > 1e-3
    margins = evaluator.margins(points, 2)
    signs = np.random.default_rng(2).choice([-1.0, 1.0], (len(attitudes), 1))
    rough = edge(inside, attitudes * signs, keeps, 20, 3, near / 1.5)
    np.testing.assert_allclose(angle_between(points, rough), 0.0, atol=2e-3 * near)
    assert margins == pytest.approx(30.0, rel=1e-3)
    assert np.abs(evaluator.margins(rough, 2) - 30.0).max() > np.abs(margins - 30.0).max()


# the boundary of the feasible set


@pytest.mark.slow
def test_precise_motions_from_the_boundary_just_keep_the_margin(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, margin_30: ff.Problem
) -> None:
    points = boundary_points(evaluator, samples, 3)
    assert [point.branch for point in points] == [b for b in (0, 2, 4, 6) for _ in range(3)]
    for point in points[::2]:
        assert point.gap is None
        chosen = ff.simulate(margin_30, point.attitude, branch=point.branch).chosen
        assert chosen.motion.completed
        assert chosen.closest_approach.value == pytest.approx(30.0, rel=1e-3)


@pytest.mark.slow
def test_tangency_points_lie_where_bisection_finds_the_boundary(
    evaluator: FeasibilityEvaluator, margin_30: ff.Problem
) -> None:
    """To a tenth of a degree; precise motions from there just keep the margin."""
    points = tangent_boundary(evaluator, 6)
    assert len(points) == 6
    assert max(point.gap for point in points) < np.radians(0.1)
    assert min(point.gap for point in points) >= 0.0
    for point in points[:3]:
        chosen = ff.simulate(margin_30, point.attitude, branch=point.branch).chosen
        assert chosen.motion.completed
        assert chosen.closest_approach.value == pytest.approx(30.0, rel=2e-4)
