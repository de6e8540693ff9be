"""Pages in a browser show what motions and maps say."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, expect
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.motion.law import PathLaw
from freefloat.planning.space.map_sampling import sample_attitudes
from freefloat.so3 import heading_quaternion
from freefloat.visualization.page import pictures
from freefloat.visualization.scenes.map_scene import BACK, BALL, BEST_BRANCH, FRONT
from tests.browser import CONTRASTS, differing, opened
from tests.motions import BAD, GOOD


@pytest.mark.slow
def test_a_page_plays_motions(browser: Browser, spatial: ff.Problem, tmp_path: Path) -> None:
    """Example 2, feasible from one attitude and singular from the other."""
    motions = {
        "feasible": ff.simulate(spatial, GOOD, branch=0).chosen.motion,
        "singular": ff.simulate(spatial, BAD, branch=2).chosen.motion,
    }
    file = ff.playback(motions, "Example 2").save(tmp_path / "page.html")
    with opened(browser, file) as page:
        assert page.errors == []
        assert [url for url in page.requests if not url.startswith("data:")] == [file.as_uri()]
        for title, motion in motions.items():
            page.ask("title => freefloat.show(title)", title)
            for state in motion.sample(np.linspace(0.0, motion.final.time, 3)):
                page.ask("t => freefloat.seek(t)", state.time)
                bodies = spatial.model.body_poses(state.attitude, state.joints)
                for name, pose in zip(spatial.model.body_names, bodies, strict=True):
                    shown = page.position(f"{title}/Robot/{name}")
                    assert shown == pytest.approx(pose.position, abs=1e-4)
                position = spatial.path.pose(state.time).position
                axes = f"{title}/End-effector axes/{spatial.model.end_effector_link}"
                assert page.position(axes) == pytest.approx(position, abs=1e-4)
        mark = page.position("singular/Singularity/mark")
        assert mark == pytest.approx([0.120, 0.469, 0.194], abs=1e-3)  # the paper's C
        page.only("Trail")
        page.ask("title => freefloat.show(title)", "feasible")
        assert page.ask("document.getElementById('legend').textContent").startswith(
            "|in-plane factor| [m⁴ kg]"
        )
        pixels = []
        for time in (0.0, 50.0, 100.0):
            page.ask("t => freefloat.seek(t)", time)
            page.only()
            empty = page.picture()
            page.only("Trail")
            pixels.append(differing(page.picture(), empty))
        assert pixels[0] < pixels[1] < pixels[2]
        page.page.locator("#motion").select_option("side by side")
        assert page.visible("feasible")
        assert page.visible("singular")
        page.page.locator("#play").click()
        while page.ask("freefloat.state().time") <= 0.3:
            page.page.wait_for_timeout(50)
        assert page.errors == []


@pytest.mark.slow
def test_a_page_plays_phases_in_turn(browser: Browser, tmp_path: Path, monkeypatch) -> None:
    """The phase shown is that of the time; pictures, their names and the clock have its times."""
    problem = ff.load_scenario("planar_2dof/line").problem()
    phases = [
        ff.GoalPhase(ff.Goal(joints=joints, duration=duration), name)
        for joints, duration, name in (([0.2, -0.4], 20.0, "rest"), ([0.5, -0.1], 10.0, "berth"))
    ]
    manoeuvre = ff.plan_manoeuvre(problem, phases, limits=ff.Limits())
    assert manoeuvre.feasible, manoeuvre.reason
    earlier = [replace(phase, start=phase.start - 7.0) for phase in manoeuvre.phases]
    manoeuvre = replace(manoeuvre, phases=tuple(earlier))  # as after a reorientation
    playback = ff.playback(manoeuvre, "phases")
    file = playback.save(tmp_path / "page.html")
    with opened(browser, file) as page:
        assert page.ask("freefloat.about.duration") == pytest.approx(60.0)
        for title, phase in zip(("1 path", "2 rest", "3 berth"), manoeuvre.phases, strict=True):
            for t in (0.1, 9.9):
                page.ask("t => freefloat.seek(t)", phase.start + 7.0 + t)
                assert page.ask("freefloat.state().shown") == [title]
                lines = page.page.locator("#states p").all_inner_texts()
                assert lines[0] == f"t = {phase.start + t:.2f} s"
                assert ("s = " in lines[1], "margin" in " ".join(lines)) == 2 * (title == "1 path",)
                (state,) = phase.motion.sample([t])
                poses = problem.model.body_poses(state.attitude, state.joints)
                for name, pose in zip(problem.model.body_names, poses, strict=True):
                    shown = page.position(f"{title}/Robot/{name}")
                    assert shown == pytest.approx(pose.position, abs=1e-3)
        page.page.locator("#motion").select_option("2 rest")
        assert page.ask("freefloat.state().shown") == ["2 rest"]
        page.ask("freefloat.seek(0)")
        assert page.page.locator("#states p").first.inner_text() == "t = 23.00 s"
        assert page.errors == []
    shots: list[float] = []
    monkeypatch.setattr(pictures, "take_pictures", lambda _, times, *__, **___: (
        shots.append(time) or b"" for time in times))  # fmt: skip
    pictures.save_picture(playback, tmp_path / "p.png", scene="2 rest")
    files = pictures.save_snapshots(playback, 2, tmp_path, "m", scene="2 rest")
    assert shots == pytest.approx([30.0, 30.0, 50.0])
    assert [file.name for file in files] == ["m_1_23.00s.png", "m_2_43.00s.png"]


@pytest.mark.slow
def test_button_and_slider_show_the_state(browser, planar, tmp_path):
    """Whatever moves the time: a click, a key on the page, a key on the slider."""
    motion = ff.simulate(planar, heading_quaternion(np.radians(200.0))).chosen.motion
    with opened(browser, ff.playback(motion).save(tmp_path / "page.html")) as page:
        play, slider = page.page.locator("#play"), page.page.locator("#time")

        def shows(word: str, time: float | None = None) -> None:
            expect(play).to_have_text(word)
            if time is not None:
                expect(slider).to_have_js_property("value", f"{time:g}")
                assert page.ask("freefloat.state().time") == pytest.approx(time)

        play.click()
        shows("Pause")
        play.click()
        shows("Play")
        duration = motion.final.time
        for place in (page.page.locator("body"), slider):
            for key, word, time in (
                ("Home", "Play", 0.0), ("ArrowRight", "Play", duration / 100),
                ("End", "Play", duration), (" ", "Pause", None), (" ", "Play", None),
            ):  # fmt: skip
                place.press(key)
                shows(word, time)
        page.ask("t => freefloat.seek(t)", duration - 0.1)
        play.click()
        shows("Play", duration)  # the end
        assert page.errors == []


@pytest.mark.slow
def test_the_plot_seeks_keys_turn_the_view_and_joints_are_those_of_the_plan(
    browser: Browser, spatial: ff.Problem, tmp_path: Path
) -> None:
    motion = ff.simulate(spatial, GOOD, branch=0).chosen.motion
    with opened(browser, ff.playback(motion).save(tmp_path / "page.html")) as page:
        duration = motion.final.time
        sentence = f"The end-effector follows its path for {duration:g} s and keeps the margin."
        expect(page.page.locator("#states h2")).to_have_text(sentence)
        box = page.page.locator("#plot").bounding_box()
        assert box is not None
        mouse, middle = page.page.mouse, box["y"] + box["height"] / 2
        mouse.move(box["x"] + 0.2 * box["width"], middle)
        mouse.down()
        mouse.move(box["x"] + 0.7 * box["width"], middle)
        mouse.up()
        time = page.ask("freefloat.state().time")
        assert time == pytest.approx(0.7 * duration, rel=0.02)
        page.page.locator("#joints summary").click()
        expect(page.page.locator("#joints tr")).to_have_count(6)
        rows = [row.split("\t") for row in page.page.locator("#joints tr").all_inner_texts()]
        (state,) = motion.sample([time])
        assert [name for name, _, _ in rows] == list(spatial.model.joint_names)
        shown = [float(text.removesuffix("°")) for _, text, _ in rows]
        assert shown == pytest.approx(np.degrees(state.joints), abs=0.02)
        assert [float(text.split()[0]) for *_, text in rows] == pytest.approx(
            state.joints, abs=2e-4
        )
        eyes = {}
        for number in range(1, 10):
            page.page.locator("body").press(str(number))
            eyes[number] = np.array(page.ask("freefloat.eye()"))
        for key, axis in ((2, [1, 0, 0]), (4, [0, 0, -1]), (6, [0, 1, 0])):  # y up
            for eye, sign in ((eyes[key], 1.0), (eyes[key + 1], -1.0)):
                assert sign * eye / np.linalg.norm(eye) == pytest.approx(axis, abs=0.01)
        assert len({tuple(eye.round(3)) for eye in eyes.values()}) == 9
        page.page.locator("#view").select_option("1 first view")
        assert page.ask("freefloat.eye()") == pytest.approx(eyes[1])
        assert [found for found in page.ask(CONTRASTS) if found[1] < 4.5] == []
        assert page.errors == []


@pytest.mark.slow
def test_the_verdict_on_a_motion_below_the_margin_is_not_that_of_a_feasible_one(browser, tmp_path):
    problem = ff.load_scenario("planar_3dof/parabola_nonstop").problem()
    chosen = ff.simulate(problem, heading=np.radians(200.0), branch=0).chosen
    margin = replace(problem.margin, threshold=1.00001 * chosen.closest_approach.value)
    motion = replace(chosen.motion, law=PathLaw(problem.replace(margin=margin)))
    with opened(browser, ff.playback(motion).save(tmp_path / "page.html")) as page:
        page.ask("freefloat.seek(Infinity)")
        expect(page.page.locator("#states h2")).to_contain_text("falls below the margin")
        verdict = page.page.get_by_text("The whole path was followed.")
        expect(verdict).to_have_css("color", "rgb(255, 178, 122)")


@pytest.mark.slow
def test_a_page_shows_a_map(browser: Browser, spatial: ff.Problem, tmp_path: Path) -> None:
    result = sample_attitudes(FeasibilityEvaluator(spatial), 256)
    file = ff.playback(result).save(tmp_path / "map.html")
    with opened(browser, file) as page:
        assert page.ask("freefloat.state().shown") == [BEST_BRANCH]
        assert len(page.ask("freefloat.about.scenes")) == 5  # wrist-flipped branches share one
        page.only()
        empty = page.picture()
        for item in (FRONT, BACK, BALL):
            page.only(item)
            assert differing(page.picture(), empty) > 200
        page.only(BACK)
        for x in range(100, 540, 10):  # until a sample is below the pointer
            page.page.mouse.move(x, 240)
            if page.page.locator("#sample").is_visible():
                break
        page.page.mouse.click(x, 240)
        words = page.page.locator("#sample").inner_text().split()
        shown = np.array(words[words.index("w") + 1 :][:4], dtype=float)
        sample = int(np.argmax(np.abs(result.attitudes @ shown)))
        assert abs(result.attitudes[sample] @ shown) > 1.0 - 1e-6
        assert Rotation.from_quat(shown).as_rotvec()[1] > 0.0
        margin = result.margins[sample, 0]
        assert words[words.index("wrist±") + 1] == (f"{margin:.4g}" if margin > 0.0 else "ends")
        page.page.locator("#sample button").click()
        page.page.get_by_text("Copied").wait_for()
        assert page.errors == []
