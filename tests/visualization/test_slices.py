"""Slices through the ball of rotation vectors: their margins are those of the evaluator."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.visualization.slices import Mark, map_slices

SIDE = 15
ATTITUDE = Rotation.from_rotvec([1.2, -0.5, 0.9]).as_quat()


@pytest.fixture(scope="module")
def evaluator():
    return FeasibilityEvaluator(ff.load_scenario("spatial_6dof/line").problem())


@pytest.fixture(scope="module")
def slices(evaluator):
    return map_slices(evaluator, [Mark("best", ATTITUDE, 0)], side=SIDE)


def placed(plane, row, column):
    """The rotation vector at a place of a slice."""
    vector = np.zeros(3)
    vector[plane.normal] = plane.offset
    right, up = plane.across
    vector[right], vector[up] = plane.ticks[column], plane.ticks[row]
    return vector


def test_three_planes_pass_through_the_mark(slices):
    assert [plane.normal for plane in slices] == [0, 1, 2]
    assert np.array([plane.offset for plane in slices]) == pytest.approx([1.2, -0.5, 0.9])


def test_every_place_has_the_margin_of_its_attitude(evaluator, slices):
    """This also fixes which component is horizontal and which vertical."""
    value = evaluator.problem.margin.threshold
    for plane in slices:
        rows, columns = np.nonzero(np.isfinite(plane.margins))
        picked = np.random.default_rng(1).choice(len(rows), 12, replace=False)
        vectors = [
            placed(plane, *place) for place in zip(rows[picked], columns[picked], strict=True)
        ]
        margins = evaluator.margins(Rotation.from_rotvec(vectors).as_quat(), None)
        shown = plane.margins[rows[picked], columns[picked]]
        assert shown == pytest.approx(np.where(margins >= value, margins, 0.0))
        assert shown.max() > value


def test_places_outside_the_ball_are_nan(slices):
    step = slices[0].ticks[1] - slices[0].ticks[0]
    for plane in slices:
        lengths = np.array([
            [np.linalg.norm(placed(plane, row, column)) for column in range(SIDE)]
            for row in range(SIDE)
        ])  # fmt: skip
        assert (np.isnan(plane.margins) == (lengths > np.pi + step)).all()
        assert np.isfinite(plane.margins[plane.reached]).all()


@pytest.mark.slow
def test_unreached_attitudes_differ_from_infeasible_ones():
    """The UR5 reaches the start of its path from less than half of all attitudes."""
    evaluator = FeasibilityEvaluator(ff.load_scenario("ur5_servicer/arc").problem())
    fractions = []
    slices = map_slices(evaluator, [], fractions.append, side=19)
    assert len(slices[0].ticks) == 19
    reached = np.concatenate([plane.reached[np.isfinite(plane.margins)] for plane in slices])
    margins = np.concatenate([plane.margins[np.isfinite(plane.margins)] for plane in slices])
    assert 0.05 < reached.mean() < 0.6
    assert (margins[~reached] == 0.0).all()
    assert (margins[reached] == 0.0).any()
    assert fractions[-1] == 1.0
