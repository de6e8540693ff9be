"""Maps in the viewer: points are the samples, colours their margins, each branch by itself."""

from dataclasses import replace

import numpy as np
import pytest
import umsgpack
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.ensemble.endings import UNREACHED
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.candidates import Ball, BoundaryPoint, Peak
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.map_sampling import sample_attitudes
from freefloat.visualization.scenes import map_scene as maps
from freefloat.visualization.scenes.description import MarginColours
from freefloat.visualization.scenes.scene_builder import PageScene
from tests.maps import with_motions

SECOND = "shoulder+ elbow- wrist±"
LABELS = [f"shoulder{a} elbow{b} wrist{c}" for a in "+-" for b in "+-" for c in "+-"]
BEST, ROBUST, EDGE = [1.2, -0.5, 0.9], [0.2, 2.0, -0.4], [-0.3, 0.4, 2.5]


def quaternion(vector: list[float]) -> np.ndarray:
    return np.asarray(Rotation.from_rotvec(vector).as_quat())


@pytest.fixture(scope="module")
def result(spatial: ff.Problem) -> AttitudeMap:
    sampled = sample_attitudes(FeasibilityEvaluator(spatial), 600)
    return replace(
        sampled,
        best=Peak(quaternion(BEST), 0, 53.25),
        robust=Ball(quaternion(ROBUST), 3, 0.2),
        boundary=(BoundaryPoint(quaternion(EDGE), 2),),
        touch=(BoundaryPoint(quaternion([0.0, 0.0, 3.0]), 0),),
    )


@pytest.fixture(scope="module")
def scene(result: AttitudeMap) -> PageScene:
    return maps.map_scene(result, "a map")


def points(scene: PageScene, title: str) -> dict[str, list[np.ndarray]]:
    """Positions and colours of the points of a scene, by item."""
    drawn = {}
    for command in map(umsgpack.unpackb, scene.objects):
        _, _, *path = command["path"].split("/")
        if command["type"] == "set_object" and path[0] == title and len(path) == 2:
            attributes = command["object"]["geometries"][0]["data"]["attributes"]
            arrays = [attributes[key]["array"].data for key in ("position", "color")]
            drawn[path[1]] = [np.frombuffer(array, "<f4").reshape(-1, 3) for array in arrays]
    return drawn


@pytest.mark.parametrize(("title", "columns"), [(maps.BEST_BRANCH, slice(None)), (SECOND, [2])])
def test_points_are_rotation_vectors_coloured_by_the_margin(scene, result, title, columns):
    drawn, margins = points(scene, title), result.margins[:, columns].max(axis=1)
    vectors = Rotation.from_quat(result.attitudes).as_rotvec()
    feasible, front = margins >= result.problem.margin.threshold, vectors[:, 1] < 0.0
    colours = MarginColours.over(result.problem.margin, [result.margins.ravel()])
    parts = {maps.FRONT: feasible & front, maps.BACK: feasible & ~front, maps.INFEASIBLE: ~feasible}
    for name, part in parts.items():
        positions, shades = drawn[name]
        assert positions == pytest.approx(vectors[part], abs=1e-6)
        assert shades == pytest.approx(colours(np.where(feasible, margins, 0.0)[part]), abs=1e-6)


def test_marks_and_boundary_belong_to_their_branch(scene: PageScene) -> None:
    """Wrist-flipped branches share a scene."""
    labels = {
        item.title: [label.text for label in item.labels if label.item == maps.MARKS]
        for item in scene.description.scenes
    }
    assert list(labels) == [maps.BEST_BRANCH, *(f"{label[:-1]}±" for label in LABELS[::2])]
    assert labels[maps.BEST_BRANCH] == ["best", "robust"]
    assert labels["shoulder+ elbow+ wrist±"] == ["best"]
    assert labels[SECOND] == ["robust"]
    assert labels["shoulder- elbow- wrist±"] == []
    assert points(scene, SECOND)[maps.BOUNDARY][0] == pytest.approx(np.array([EDGE]), abs=1e-6)
    assert maps.BOUNDARY not in points(scene, maps.BEST_BRANCH)


def test_attitudes_that_do_not_reach_the_path_are_distinguished(result: AttitudeMap) -> None:
    endings = result.results.motions.endings.copy()
    endings[7] = UNREACHED
    scene = maps.map_scene(replace(result, results=with_motions(result.results, endings=endings)))
    positions, _ = points(scene, maps.BEST_BRANCH)[maps.UNREACHED]
    wanted = Rotation.from_quat(result.attitudes[7:8]).as_rotvec()
    assert positions == pytest.approx(wanted, abs=1e-6)
    samples = scene.description.samples
    assert samples is not None
    assert samples.columns == tuple(f"{label[:-1]}±" for label in LABELS[::2])
    assert (samples.margins[7] < 0.0).all()
    others = np.arange(result.samples) != 7
    assert samples.margins[others] == pytest.approx(result.margins[others, ::2])
