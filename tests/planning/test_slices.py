"""Cuts through the ball of rotation vectors: what they show is what the outlook says there."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.slices import Mark, map_slices, rotation_vectors, told_marks

SIDE = 15
ATTITUDE = Rotation.from_rotvec([1.2, -0.5, 0.9]).as_quat()


@pytest.fixture(scope="module")
def outlook():
    return FeasibilityEvaluator(ff.load_scenario("spatial_6dof/line").problem())


@pytest.fixture(scope="module")
def slices(outlook):
    return map_slices(outlook, [Mark("best", ATTITUDE, 0)], side=SIDE)


def placed(one, row, column):
    """The rotation vector at a place of a slice."""
    vector = np.zeros(3)
    vector[one.normal] = one.offset
    right, up = one.across
    vector[right], vector[up] = one.ticks[column], one.ticks[row]
    return vector


def test_the_three_planes_go_through_the_mark(slices):
    assert [one.normal for one in slices] == [0, 1, 2]
    assert np.array([one.offset for one in slices]) == pytest.approx([1.2, -0.5, 0.9])


def test_every_place_tells_the_margin_of_its_attitude(outlook, slices):
    """Also which component runs to the right and which upwards."""
    value = outlook.problem.margin.threshold
    for one in slices:
        rows, columns = np.nonzero(np.isfinite(one.least))
        picked = np.random.default_rng(1).choice(len(rows), 12, replace=False)
        vectors = [placed(one, *place) for place in zip(rows[picked], columns[picked], strict=True)]
        margins = outlook.margins(Rotation.from_rotvec(vectors).as_quat(), None)
        shown = one.least[rows[picked], columns[picked]]
        assert shown == pytest.approx(np.where(margins >= value, margins, 0.0))
        assert shown.max() > value


def test_places_beyond_the_ball_are_blank(slices):
    step = slices[0].ticks[1] - slices[0].ticks[0]
    for one in slices:
        lengths = np.array([
            [np.linalg.norm(placed(one, row, column)) for column in range(SIDE)]
            for row in range(SIDE)
        ])  # fmt: skip
        assert (np.isnan(one.least) == (lengths > np.pi + step)).all()
        assert np.isfinite(one.least[one.reached]).all()


def test_opposite_ends_of_a_diameter_are_the_same_attitude(outlook):
    """Half a turn forward is one backward; without marks cuts go through the centre."""
    slices = map_slices(outlook, [], side=SIDE)
    middle = SIDE // 2
    for one in slices:
        assert one.mark is None
        assert one.offset == 0.0
        assert one.least[middle, 0] == pytest.approx(one.least[middle, -1], rel=1e-4)
        assert one.least[0, middle] == pytest.approx(one.least[-1, middle], rel=1e-4)


def test_what_the_arm_cannot_reach_is_told_from_what_breaks_the_margin():
    """The UR5 reaches the start of its path from less than half of all attitudes."""
    outlook = FeasibilityEvaluator(ff.load_scenario("ur5_servicer/arc").problem())
    shares = []
    slices = map_slices(outlook, [], shares.append, side=19)
    assert len(slices[0].ticks) == 19
    reached = np.concatenate([one.reached[np.isfinite(one.least)] for one in slices])
    least = np.concatenate([one.least[np.isfinite(one.least)] for one in slices])
    assert 0.05 < reached.mean() < 0.6
    assert (least[~reached] == 0.0).all()
    assert (least[reached] == 0.0).any()
    assert shares[-1] == 1.0


def test_slices_are_coarser_where_arm_branches_have_to_be_searched_for():
    outlook = FeasibilityEvaluator(ff.load_scenario("panda_servicer/line").problem())
    assert outlook.sample_reduction > 1
    assert len(map_slices(outlook, [], side=7)[0].ticks) < 7


def test_rotation_vectors_are_no_longer_than_half_a_turn():
    attitudes = Rotation.from_rotvec([[0.0, 0.0, 3.5], [0.3, 0.0, 0.0]]).as_quat()
    vectors = rotation_vectors(attitudes)
    assert vectors[0] == pytest.approx([0.0, 0.0, 3.5 - 2.0 * np.pi])
    assert vectors[1] == pytest.approx([0.3, 0.0, 0.0])
    assert rotation_vectors(-attitudes) == pytest.approx(vectors)


def test_marks_come_from_what_a_map_tells():
    document = {"best": {"attitude": [0.0, 0.0, 0.0, 1.0], "branch": 3}, "robust": None}
    (mark,) = told_marks(document)
    assert (mark.name, mark.branch) == ("best", 3)
    assert mark.attitude.tolist() == [0.0, 0.0, 0.0, 1.0]
