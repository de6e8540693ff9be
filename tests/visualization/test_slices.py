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
