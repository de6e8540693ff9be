"""Playback in a real browser: what is seen is what the motion says."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser

from freefloat.errors import InputError
from freefloat.io.scenario import load_scenario
from freefloat.motion.motion import Motion
from freefloat.motion.simulation import simulate
from freefloat.so3 import heading_quaternion
from freefloat.visualization.playback import Playback, play
from tests.browser import Shown, differing, shown

GOOD = [0.46008, 0.09337, 0.73519, -0.48898]
BAD = [0.1, 0.5, 0.2, -0.8367]
FEASIBLE, SINGULAR = "feasible attitude", "singular attitude"
ANGLES = 1e-5
"""Of what is drawn [rad]; positions hold to 1e-6 m."""


@pytest.fixture(scope="module")
def motions() -> dict[str, Motion]:
    """Example 2 from the attitude that serves and, with a failing branch, from the other."""
    problem = load_scenario("spatial_6dof/line").problem()
    return {
        FEASIBLE: simulate(problem, GOOD, branch=0).chosen.motion,
        SINGULAR: simulate(problem, BAD, branch=2).chosen.motion,
    }


@pytest.fixture(scope="module")
def played(motions: dict[str, Motion]) -> Playback:
    return play(motions, "Example 2")


@pytest.fixture(scope="module")
def example_2(played: Playback, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return played.save(tmp_path_factory.mktemp("page") / "example 2.html")


@pytest.fixture
def page(browser: Browser, example_2: Path) -> Iterator[Shown]:
    """A page that nobody has touched."""
    with shown(browser, example_2) as seen:
        yield seen


@pytest.fixture(scope="module")
def opened(browser: Browser, example_2: Path) -> Iterator[Shown]:
    with shown(browser, example_2) as seen:
        yield seen


@pytest.fixture
def scene(opened: Shown) -> Shown:
    """A page as it opens, for tests that use none of its controls."""
    opened.as_at_first()
    return opened


def turned_apart(first: np.ndarray, second: np.ndarray) -> float:
    """Angle between two attitudes [rad]."""
    return float(
        2.0 * np.arcsin(min(1.0, np.linalg.norm(first - np.sign(first @ second) * second) / 2))
    )


def test_the_page_loads_by_itself_and_soon(page: Shown, example_2: Path) -> None:
    assert page.errors == []
    assert [one for one in page.requests if not one.startswith(("data:", "blob:"))] == [
        example_2.as_uri()
    ]
    assert page.seconds < 3.0
    assert example_2.stat().st_size < 5e6


def test_the_viewer_is_the_one_the_page_was_written_for(scene: Shown) -> None:
    assert scene.ask("MeshCat.THREE.REVISION") == "132"


def test_bodies_and_gripper_are_where_the_motion_says(
    scene: Shown, motions: dict[str, Motion], rng: np.random.Generator
) -> None:
    for title, motion in motions.items():
        scene.ask("title => freefloat.show(title)", title)
        model = motion.problem.model
        for state in motion.sample([0.0, *rng.uniform(0.0, motion.times[-1], 6), motion.times[-1]]):
            scene.at(state.time)
            bodies = model.body_poses(state.attitude, state.joints)
            for name, pose in zip(model.body_names, bodies, strict=True):
                assert scene.position(f"{title}/Robot/{name}") == pytest.approx(
                    pose.position, abs=1e-6
                )
            assert scene.position(f"{title}/Robot/spacecraft") == pytest.approx(
                state.base_position, abs=1e-6
            )
            turn = turned_apart(scene.quaternion(f"{title}/Robot/spacecraft"), state.attitude)
            assert turn < ANGLES
            hand = model.end_effector_pose(state.attitude, state.joints).position
            assert scene.position(f"{title}/End-effector axes") == pytest.approx(hand, abs=1e-6)
            wanted = motion.problem.path.pose(state.time).position
            assert scene.position(f"{title}/End-effector axes") == pytest.approx(wanted, abs=2e-6)


def test_the_spacecraft_turns_on_screen(scene: Shown) -> None:
    scene.only("Robot")
    scene.at(0.0)
    before = scene.picture()
    scene.at(70.0)
    assert differing(before, scene.picture()) > 2000
    scene.at(0.0)
    assert (scene.picture() == before).all()


def test_the_robot_is_seen_and_stands_where_it_is(scene: Shown) -> None:
    scene.only("Robot")
    scene.at(30.0)
    with_robot = scene.picture()
    scene.only()
    without = scene.picture()
    assert differing(with_robot, without) > 5000
    x, y = scene.ask("freefloat.onScreen('meshcat/feasible attitude/Robot/spacecraft')")
    height, width, _ = with_robot.shape
    spot = np.s_[int(y * height) - 3 : int(y * height) + 4, int(x * width) - 3 : int(x * width) + 4]
    assert differing(with_robot[spot], without[spot]) == 49


@pytest.mark.parametrize("size", [(1280, 720), (400, 700)])
def test_everything_is_in_view_at_first(
    browser: Browser, example_2: Path, motions: dict[str, Motion], size: tuple[int, int]
) -> None:
    model = motions[FEASIBLE].problem.model
    tips = np.array([[x, y, -0.2] for x in (-0.4, 0.4) for y in (-2.05, 2.05)])  # of the panels
    with shown(browser, example_2, size) as seen:
        spots = []
        for state in motions[FEASIBLE].sample(np.linspace(0.0, 100.0, 11)):
            bus, *arm = model.body_poses(state.attitude, state.joints)
            hand = model.end_effector_pose(state.attitude, state.joints)
            points = [*(bus.position + tips @ bus.rotation.T), *(p.position for p in (*arm, hand))]
            spots += [seen.ask("p => freefloat.onScreen(p)", point.tolist()) for point in points]
        low, high = np.min(spots, axis=0), np.max(spots, axis=0)
        assert low.min() > 0.03
        assert high.max() < 0.97
        assert (high - low).max() > 0.6  # and not far away


def test_play_pause_and_the_slider(page: Shown) -> None:
    play_button = page.page.locator("#play")
    assert play_button.inner_text() == "Play"
    play_button.click()
    page.page.wait_for_timeout(600)
    assert play_button.inner_text() == "Pause"
    playing = page.ask("freefloat.state()")
    assert playing["playing"]
    assert playing["time"] > 0.5
    play_button.click()
    stopped = page.ask("freefloat.state().time")
    page.page.wait_for_timeout(300)
    assert page.ask("freefloat.state().time") == stopped
    box = page.page.locator("#time").bounding_box()
    assert box is not None
    page.page.mouse.click(box["x"] + 0.75 * box["width"], box["y"] + box["height"] / 2)
    page.page.wait_for_timeout(200)
    moved = page.ask("freefloat.state().time")
    assert moved == pytest.approx(75.0, abs=4.0)
    assert page.page.locator("#clock").inner_text() == f"{moved:.2f} / 100.00 s"


def test_the_speed_is_that_of_the_clock(page: Shown) -> None:
    page.page.locator("#speed").select_option("1")
    page.page.locator("#play").click()
    times = []
    for _ in range(2):
        times.append(page.ask("[performance.now() / 1000, freefloat.state().time]"))
        page.page.wait_for_timeout(1000)
    (first, t0), (last, t1) = times
    assert (t1 - t0) / (last - first) == pytest.approx(1.0, abs=0.25)


def test_it_plays_to_the_end_and_begins_again(page: Shown) -> None:
    page.page.locator("#speed").select_option("100")
    page.at(95.0)
    page.page.locator("#play").click()
    page.page.wait_for_timeout(500)
    assert page.ask("freefloat.state()")["time"] == 100.0
    assert not page.ask("freefloat.state()")["playing"]
    page.page.locator("#play").click()
    page.page.wait_for_timeout(100)
    assert page.ask("freefloat.state().time") < 90.0


def test_toggles_hide_and_show(page: Shown) -> None:
    page.page.locator("#items summary").click()
    before = page.picture()
    box = page.page.get_by_label("Robot", exact=True)
    box.uncheck()
    assert not page.visible(f"{FEASIBLE}/Robot")
    assert differing(before, page.picture()) > 5000
    box.check()
    assert page.visible(f"{FEASIBLE}/Robot")
    assert (page.picture() == before).all()


@pytest.mark.parametrize(
    "name",
    ["End-effector path", "Trail", "Areas", "Centre of mass", "Momentum", "Spacecraft axes",
     "End-effector axes", "Singularity"],
)  # fmt: skip
def test_every_item_is_seen_also_inside_the_spacecraft(scene: Shown, name: str) -> None:
    scene.ask("title => freefloat.show(title)", SINGULAR)
    scene.at(60.0)
    scene.only("Robot")
    without = scene.picture()
    scene.only("Robot", name)
    assert differing(scene.picture(), without) > 5


def test_only_items_that_there_are_can_be_switched(page: Shown) -> None:
    page.page.locator("#items summary").click()
    assert not page.page.get_by_label("Singularity", exact=True).is_visible()
    page.page.locator("#motion").select_option(SINGULAR)
    page.page.wait_for_timeout(200)
    assert page.page.get_by_label("Singularity", exact=True).is_visible()


def test_the_scene_tree_has_plain_names(scene: Shown) -> None:
    names = scene.page.locator(".dg li.title").all_inner_texts() + [
        text.strip() for text in scene.page.locator(".dg li.title").all_text_contents()
    ]
    for item in (
        "Robot",
        "End-effector path",
        "Trail",
        "Momentum",
        "Centre of mass",
        "Singularity",
    ):
        assert item in names


def test_no_floor_is_drawn(scene: Shown) -> None:
    for path in ("Grid", "Axes"):
        assert not scene.ask("p => freefloat.visible(p)", path)


def test_the_trail_grows(scene: Shown) -> None:
    scene.only()
    scene.at(60.0)
    empty = scene.picture()
    scene.only("Trail")
    lengths = []
    for time in (0.0, 40.0, 60.0, 100.0):
        scene.only()
        scene.at(time)
        empty = scene.picture()
        scene.only("Trail")
        lengths.append(differing(scene.picture(), empty))
    assert lengths[0] < 30
    assert lengths[0] < lengths[1] < lengths[2] < lengths[3]


def test_a_singular_motion_stops_and_says_when(page: Shown, motions: dict[str, Motion]) -> None:
    page.ask("title => freefloat.show(title)", SINGULAR)
    end = motions[SINGULAR].times[-1]
    page.at(end - 0.1)
    assert not page.visible(f"{SINGULAR}/Singularity/mark")
    page.page.wait_for_timeout(100)
    assert page.page.get_by_text("singular at t = 54.662 s").count() == 0
    page.at(80.0)
    assert page.visible(f"{SINGULAR}/Singularity/mark")
    assert page.page.get_by_text("singular at t = 54.662 s").count() == 1
    page.toggle("Singularity", False)
    page.page.wait_for_timeout(100)
    assert page.page.get_by_text("singular at t = 54.662 s").count() == 0
    assert "The arm became dynamically singular." in page.page.locator("#states").inner_text()
    stopped = motions[SINGULAR].final
    mark = page.position(f"{SINGULAR}/Singularity/mark")
    assert mark == pytest.approx([0.120, 0.469, 0.194], abs=1e-3)  # the paper's C, to its digits
    assert page.position(f"{SINGULAR}/Robot/spacecraft") == pytest.approx(
        stopped.base_position, abs=1e-6
    )


def test_the_panel_tells_the_measure(scene: Shown, motions: dict[str, Motion]) -> None:
    scene.at(40.0)
    scene.page.wait_for_timeout(100)
    told = re.search(r"\|arm\| = ([0-9.]+), to keep: 5", scene.page.locator("#states").inner_text())
    assert told is not None
    motion = motions[FEASIBLE]
    value = abs(motion.problem.margin.measure(motion.sample([40.0])[0].joints))
    assert float(told[1]) == pytest.approx(value, rel=2e-3)


def test_motions_are_switched_or_side_by_side(page: Shown) -> None:
    chooser = page.page.locator("#motion")
    chooser.select_option(SINGULAR)
    assert page.visible(SINGULAR)
    assert not page.visible(FEASIBLE)
    chooser.select_option("side by side")
    page.at(20.0)
    assert page.visible(FEASIBLE)
    assert page.visible(SINGULAR)
    across = [page.ask(f"freefloat.onScreen('meshcat/{one}/Robot/spacecraft')")[0]
              for one in (FEASIBLE, SINGULAR)]  # fmt: skip
    assert across[1] - across[0] > 0.3
    assert page.page.locator("#states h2").all_inner_texts() == [FEASIBLE, SINGULAR]


def test_a_page_opens_on_the_scene_asked_for(
    browser: Browser, played: Playback, tmp_path: Path
) -> None:
    file = played.save(tmp_path / "both.html", "side by side")
    with shown(browser, file) as seen:
        assert seen.visible(FEASIBLE)
        assert seen.visible(SINGULAR)
        assert seen.page.locator("#motion").input_value() == "side by side"


def test_planar_areas_are_drawn_around_the_centre(browser: Browser, tmp_path: Path) -> None:
    problem = load_scenario("planar_3dof/parabola").problem()
    motion = simulate(problem, heading_quaternion(np.deg2rad(200.0)), branch=0).chosen.motion
    file = play({"200 degrees": motion}).save(tmp_path / "planar.html")
    with shown(browser, file) as seen:
        seen.at(50.0)
        seen.only("Areas")
        areas = seen.picture()
        seen.only()
        assert differing(areas, seen.picture()) > 10_000
        corner = seen.position("200 degrees/Areas/last joint")
        wrist = 0.399575  # d, Table I's system
        hand = seen.position("200 degrees/End-effector axes")
        assert np.linalg.norm(corner - hand) == pytest.approx(wrist, abs=1e-5)


def test_hostile_names_stay_names(
    browser: Browser, motions: dict[str, Motion], tmp_path: Path
) -> None:
    name = "a/b </script><script>window.hacked = 1</script> <img src=x onerror='hacked=1'>"
    file = play({name: motions[FEASIBLE]}, title=name).save(tmp_path / "page.html")
    with shown(browser, file) as seen:
        assert seen.errors == []
        assert seen.ask("window.hacked || 0") == 0
        assert seen.page.title() == name
        assert seen.page.locator("#states h2").inner_text() == name


class Window:
    """Stands for the window of a MeshCat visualizer."""

    def __init__(self) -> None:
        self.sent: list[dict[str, object]] = []

    def send(self, command: object) -> None:
        self.sent.append(command.lower())  # type: ignore[attr-defined]


def test_it_goes_into_a_visualizer_of_the_users(
    played: Playback, motions: dict[str, Motion]
) -> None:
    from meshcat import Visualizer
    from meshcat.path import Path as ScenePath

    window = Window()
    visualizer = Visualizer.view_into(window, ScenePath(("meshcat", "mine")))
    played.into(visualizer)
    objects = [one["path"] for one in window.sent if one["type"] == "set_object"]
    for title in motions:
        shapes = [
            str(one) for one in objects if str(one).startswith(f"/meshcat/mine/{title}/Robot/")
        ]
        assert len(shapes) == 13  # the visuals of the URDF, also for the robot that is a copy
    last = window.sent[-1]
    assert last["type"] == "set_animation"
    paths = [clip["path"] for clip in last["animations"]]  # type: ignore[index,attr-defined]
    assert f"/meshcat/mine/{FEASIBLE}/Robot/spacecraft" in paths


def test_the_same_motions_give_the_same_page(motions: dict[str, Motion], example_2: Path) -> None:
    assert play(motions, "Example 2").html() == example_2.read_text(encoding="utf-8")


def test_what_is_shown_twice_is_told_once(played: Playback) -> None:
    copies = played.recording.copies
    robot = {target.split("/", 3)[3] for _, target in copies if f"/{SINGULAR}/Robot/" in target}
    assert len(robot) == 13
    again = {target for _, target in copies}
    assert f"meshcat/{SINGULAR}/End-effector path" in again
    assert f"meshcat/{SINGULAR}/Trail" not in again


def test_pages_with_every_arm_branch_stay_small() -> None:
    problem = load_scenario("spatial_6dof/line").problem()
    followed = simulate(problem, BAD).branches
    page = play({one.branch.label: one.motion for one in followed}).html()
    assert len(followed) == 8
    assert len(page) < 5e6


def test_the_measure_vanishes_where_a_motion_becomes_singular(motions: dict[str, Motion]) -> None:
    scene = play({SINGULAR: motions[SINGULAR]}).recording.about["scenes"][0]
    assert scene["trail"]["values"][-1] < 1e-6


def test_motions_with_other_margins_are_refused_on_one_page(motions: dict[str, Motion]) -> None:
    motion = motions[FEASIBLE]
    stricter = replace(motion.problem, margin=replace(motion.problem.margin, value=6.0))
    other = replace(motion, problem=stricter)
    with pytest.raises(InputError, match="a keeps arm 5 in space, b keeps arm 6 in space"):
        play({"a": motion, "b": other})


def test_nothing_to_play_is_refused() -> None:
    with pytest.raises(InputError, match="one motion or more"):
        play({})


def test_outside_a_notebook_a_page_is_opened(
    motions: dict[str, Motion], monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    play(motions[FEASIBLE]).show()
    assert len(opened) == 1
    assert opened[0].startswith("file://")
    assert opened[0].endswith(".html")


def test_a_notebook_gets_a_cell(motions: dict[str, Motion]) -> None:
    prepared: Playback = play(motions[FEASIBLE])
    cell = prepared._repr_html_()
    assert cell.startswith("<iframe")
    assert "<script" not in cell  # escaped inside srcdoc
