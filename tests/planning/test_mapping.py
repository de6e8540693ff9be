"""Samples of SO(3) agree with simulations; the boundary by bisection and from touch points."""

from __future__ import annotations

import numpy as np
import pytest

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.mapping import bisect, boundary_points, tangent_boundary
from freefloat.so3 import angle_between, rotated

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


# bisection


def test_bisection_ends_just_inside() -> None:
    """On geodesics that leave a ball around the identity."""
    radius, rng = 0.7, np.random.default_rng(3)
    axes = rng.normal(size=(50, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    within = rotated(IDENTITY, rng.uniform(0.0, 0.69, (50, 1)) * axes)
    beyond = rotated(IDENTITY, rng.uniform(0.71, 2.3, (50, 1)) * axes)
    whole = angle_between(within, beyond)
    edges = bisect(lambda q: angle_between(q, IDENTITY) < radius, within, beyond)
    short = radius - angle_between(edges, IDENTITY)
    assert (short > 0.0).all()
    assert (short <= 8.0**-6 * whole * (1.0 + 1e-9)).all()
    np.testing.assert_allclose(
        angle_between(within, edges) + angle_between(edges, beyond), whole, atol=1e-7
    )


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
def test_touch_points_lie_where_bisection_finds_the_boundary(
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
