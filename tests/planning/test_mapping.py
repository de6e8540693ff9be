"""Samples of SO(3) agree with simulations; the boundary by bisection and from touch points."""

from __future__ import annotations

import numpy as np
import pytest

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.mapping import boundary_points, tangent_boundary


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
