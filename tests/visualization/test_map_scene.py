"""Maps in the viewer: points are the samples, colours their margins, each branch by itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import umsgpack
from playwright.sync_api import Browser
from scipy.spatial.transform import Rotation

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.io.scenario import load_scenario
from freefloat.planning.attitude_map import AttitudeMap
from freefloat.planning.sampling import sample_attitudes
from freefloat.visualization.colours import MarginColours
from freefloat.visualization.map_scene import (
    ANY,
    AXES,
    BACK,
    BALL,
    BOUNDARY,
    BROKEN,
    FRONT,
    MARKS,
    map_recording,
)
from freefloat.visualization.playback import Playback
from freefloat.visualization.scene import Recording
from tests.browser import Shown, differing, shown

SECOND = "shoulder+ elbow- wrist±"
LABELS = [f"shoulder{a} elbow{b} wrist{c}" for a in "+-" for b in "+-" for c in "+-"]
BEST, ROBUST = [1.2, -0.5, 0.9], [0.2, 2.0, -0.4]
EDGE = [-0.3, 0.4, 2.5]


def place(vector: list[float], branch: int) -> dict[str, Any]:
    return {"attitude": Rotation.from_rotvec(vector).as_quat().tolist(), "branch": branch}


DOCUMENT: dict[str, Any] = {
    "branches": [{"branch": number, "label": label} for number, label in enumerate(LABELS)],
    "best": {**place(BEST, 0), "value": 53.25},
    "robust": {**place(ROBUST, 3), "radius_deg": 12.5},
    "boundary": [place(EDGE, 2)],
    "touch": {"points": [place([0.0, 0.0, 3.0], 0)]},
}


@pytest.fixture(scope="module")
def found() -> AttitudeMap:
    return sample_attitudes(FeasibilityEvaluator(load_scenario("spatial_6dof/line").problem()), 600)


@pytest.fixture(scope="module")
def recording(found: AttitudeMap) -> Recording:
    return map_recording(found.problem, found.attitudes, found.margins, DOCUMENT, "a map")


def points(recording: Recording, title: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Positions and colours of the points of a scene, by item."""
    found = {}
    for command in map(umsgpack.unpackb, recording.objects):
        _, _, *path = command["path"].split("/")
        if command["type"] == "set_object" and path[0] == title and len(path) == 2:
            attributes = command["object"]["geometries"][0]["data"]["attributes"]
            found[path[1]] = tuple(
                np.frombuffer(attributes[key]["array"].data, dtype="<f4").reshape(-1, 3)
                for key in ("position", "color")
            )
    return found


@pytest.mark.parametrize(("title", "columns"), [(ANY, slice(None)), (SECOND, [2])])
def test_points_are_rotation_vectors_coloured_by_the_margin(
    recording: Recording, found: AttitudeMap, title: str, columns: Any
) -> None:
    """In two halves where the margin is kept, in one colour where it is not."""
    drawn, margins = points(recording, title), found.margins[:, columns].max(axis=1)
    vectors = Rotation.from_quat(found.attitudes).as_rotvec()
    good, front = margins >= found.problem.margin.threshold, vectors[:, 1] < 0.0
    colours = MarginColours.over(found.problem.margin, [found.margins.ravel()])
    for name, part in ((FRONT, good & front), (BACK, good & ~front), (BROKEN, ~good)):
        positions, shades = drawn[name]
        assert positions == pytest.approx(vectors[part], abs=1e-6)
        assert shades == pytest.approx(colours(np.where(good, margins, 0.0)[part]), abs=1e-6)


def test_there_is_a_scene_for_every_branch_and_twins_share_one(recording: Recording) -> None:
    titles = [scene["title"] for scene in recording.about["scenes"]]
    assert titles == [ANY, *(f"{label[:-1]}±" for label in LABELS[::2])]


def test_marks_and_boundary_belong_to_their_branch(recording: Recording) -> None:
    """The boundary of one branch is not that of all of them; twins have the same."""
    labels = {
        scene["title"]: [label["text"] for label in scene["labels"] if label["item"] == MARKS]
        for scene in recording.about["scenes"]
    }
    assert labels[ANY] == ["best", "robust"]
    assert labels["shoulder+ elbow+ wrist±"] == ["best"]
    assert labels[SECOND] == ["robust"]
    assert labels["shoulder- elbow- wrist±"] == []
    assert points(recording, SECOND)[BOUNDARY][0] == pytest.approx(np.array([EDGE]), abs=1e-6)
    assert BOUNDARY not in points(recording, ANY)


def test_lines_tell_shares_and_marks(recording: Recording, found: AttitudeMap) -> None:
    first, *_, last = recording.about["scenes"]
    share = 100.0 * found.feasible_fraction
    assert f"{share:.2f} % of 600 attitudes keep |arm|" in first["lines"]
    assert "best: |arm| 53.25" in first["lines"]
    assert "robust: 12.5° around keep the margin" in first["lines"]
    assert not any(line.startswith("best") for line in last["lines"])


def test_very_many_samples_are_thinned_evenly(found: AttitudeMap) -> None:
    attitudes = np.tile(found.attitudes, (100, 1))
    margins = np.tile(found.margins, (100, 1))
    thinned = map_recording(found.problem, attitudes, margins, DOCUMENT)
    drawn = points(thinned, ANY)
    assert sum(len(drawn[name][0]) for name in (FRONT, BACK, BROKEN)) == 40_000
    share = len(drawn[BROKEN][0]) / 40_000
    assert share == pytest.approx(1.0 - found.feasible_fraction, abs=0.005)


@pytest.fixture(scope="module")
def opened(
    browser: Browser, recording: Recording, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Shown]:
    file = tmp_path_factory.mktemp("page") / "map.html"
    with shown(browser, Playback(recording).save(file)) as seen:
        yield seen


@pytest.fixture
def page(opened: Shown) -> Shown:
    opened.as_at_first()
    return opened


def test_the_page_shows_a_ball_with_marks_where_they_belong(page: Shown) -> None:
    assert page.errors == []
    assert page.ask("freefloat.state().shown") == [ANY]
    for name, vector in (("best", BEST), ("robust", ROBUST)):
        assert page.position(f"{ANY}/{MARKS}/{name}") == pytest.approx(vector, abs=1e-6)
        across, down = page.ask("p => freefloat.onScreen(p)", f"meshcat/{ANY}/{MARKS}/{name}")
        assert 0.0 < across < 1.0
        assert 0.0 < down < 1.0
    assert not page.visible(f"{ANY}/{FRONT}")
    assert page.visible(f"{ANY}/{BACK}")


def test_the_whole_ball_is_in_view_at_first(page: Shown) -> None:
    """The ends of the axes, on its surface, have their labels inside the window."""
    placed = page.ask(
        "[...document.querySelectorAll('.label')].map(one => "
        "[one.textContent, parseFloat(one.style.left), parseFloat(one.style.top)])"
    )
    ends = [place for place in placed if place[0].endswith("180°")]
    assert [end[0][0] for end in ends] == ["x", "y", "z"]
    for name, left, top in ends:
        assert 0.0 < left < 640.0, name
        assert 0.0 < top < 480.0, name


def test_items_are_seen_and_hidden(page: Shown) -> None:
    """Each of them is on the picture: hiding it changes pixels."""
    for name, least in (
        (FRONT, 500),
        (BACK, 500),
        (BROKEN, 5),
        (MARKS, 20),
        (BALL, 200),
        (AXES, 50),
    ):
        page.only(name)
        with_it = page.picture()
        page.toggle(name, False)
        assert differing(with_it, page.picture()) > least, name


def test_branches_are_switched_between(page: Shown) -> None:
    page.only(BACK, BROKEN)
    best = page.picture()
    page.ask("title => freefloat.show(title)", SECOND)
    assert page.visible(SECOND)
    assert not page.visible(ANY)
    assert differing(best, page.picture()) > 500
