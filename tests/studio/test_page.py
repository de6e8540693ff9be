"""The studio in a browser: drag, choose, play, undo, save; what survives a reload and a crash."""

import json
import re
import statistics
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import yaml
from playwright.sync_api import Browser, Page, expect

import freefloat as ff
from freefloat.planning.plan import Plan
from tests.browser import CONTRASTS
from tests.commands import run
from tests.studio.conftest import Studio

Show = Callable[[str], Page]
DRAGS = 5
OPEN = """async scenario => {
  const pause = () => new Promise(resume => setTimeout(resume, 5));
  const { state } = studio;
  studio.showState = opened => {
    studio.constructor.prototype.showState.call(studio, opened);
    if (opened.outlined) return;
    studio.set = studio.newest = null; // what arrived before is not of this opening
    delete studio.showState;
  };
  studio.connection.send({ type: "open", scenario });
  while (Object.hasOwn(studio, "showState")) await pause();
  if (studio.player && scenario !== state.scenario) throw new Error("the old scene is shown");
  while (!studio.known || !studio.player || !studio.newest) await pause();
}"""
"""Opens a scenario and waits for its first motion."""
NEXT_SET = """() => {
  const place = () => String(studio.handles.buttons[1].position);
  const before = place(), start = performance.now();
  let number = Infinity;
  window.next = new Promise(resolve => {
    const poll = () => {
      const arrived = String(studio.outline.handles[1].position) === place() && place() !== before;
      if (arrived && number === Infinity) number = studio.set.number;
      if (studio.set.number > number) resolve(performance.now() - start); else setTimeout(poll, 1);
    };
    poll();
  });
}"""
"""Starts a clock; it stops at a set of attitudes of the path with the handle that is dragged."""


@pytest.fixture(scope="module")
def studio(kernels: None, start_studio: Callable[..., Studio]) -> Studio:
    return start_studio("spatial_6dof/line")


@pytest.fixture(scope="module")
def errors() -> list[str]:
    return []


@pytest.fixture(scope="module")
def tab(browser: Browser, studio: Studio, errors: list[str]) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": 800, "height": 600}, has_touch=True)
    page = context.new_page()
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda m: m.type == "error" and errors.append(m.text))
    page.goto(studio.told())
    page.wait_for_url(studio.address)
    wait(page, "Boolean(studio.player)")
    yield page
    context.close()


@pytest.fixture
def opened(tab: Page, errors: list[str]) -> Iterator[Show]:
    """Open a scenario in the page, which must log no error."""

    def show(scenario: str) -> Page:
        tab.evaluate(OPEN, scenario)
        return tab

    yield show
    assert errors == []


def wait(page: Page, expression: str, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not page.evaluate(expression):
        assert time.monotonic() < end, expression
        page.wait_for_timeout(20)


def content(page: Page) -> dict[str, Any]:
    return dict(yaml.safe_load(page.evaluate("studio.state.text")))


def centre(page: Page, selector: str) -> tuple[float, float]:
    """Of an element, where it comes to rest: the view is framed anew when panels change."""
    before, box = None, page.locator(selector).bounding_box()
    while box != before:
        page.wait_for_timeout(200)
        before, box = box, page.locator(selector).bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


@pytest.mark.slow
def test_the_ball_changes_within_a_second_of_a_drag(opened: Show) -> None:
    page = opened("spatial_6dof/line")
    before = page.evaluate("studio.state.text")
    colours = page.evaluate("studio.set.colours")
    x, y = centre(page, ".handle >> nth=1")
    page.mouse.move(x, y)
    page.mouse.down()
    delays = []
    for step in range(1, DRAGS + 1):
        page.evaluate(NEXT_SET)
        page.mouse.move(x - 4.0 * step, y + 2.0 * step)
        delays.append(page.evaluate("window.next") / 1000.0)
        assert page.evaluate("studio.set.colours") != colours
        colours = page.evaluate("studio.set.colours")
    page.mouse.up()
    assert statistics.median(delays) < 1.0
    place = page.evaluate("studio.handles.buttons[1].position")
    wait(page, f"String(studio.outline.handles[1].position) === String({place})")
    assert content(page)["path"]["line"]["to"] == pytest.approx(place, abs=1e-6)
    page.keyboard.press("Control+z")  # all moves of a drag are one step
    wait(page, f"studio.state.text === {json.dumps(before)}")


@pytest.mark.slow
def test_an_attitude_is_chosen_played_and_saved(opened: Show, studio: Studio) -> None:
    page = opened("spatial_6dof/line")
    before = page.evaluate("studio.newest.attitude")
    wait(page, "studio.set && studio.set.finest")  # a finer map has other samples
    x, y = centre(page, "#ball")
    said = page.locator("#reason").inner_text  # which may be late
    while not all(page.wait_for_timeout(50) or said().startswith("feasible") for _ in range(3)):
        x += 2.0
        page.mouse.move(x, y)
    page.touchscreen.tap(x, y)
    wait(page, "studio.player && studio.player.playing && studio.player.time > 0")
    page.keyboard.press("Space")
    assert not page.evaluate("studio.player.playing")
    page.locator("#save").click()
    page.get_by_text(re.compile("^Saved ")).wait_for()
    chosen = page.evaluate("studio.newest.attitude")
    assert chosen != before
    (file,) = studio.folder.glob("*.h5")
    plan = ff.load(file)
    assert isinstance(plan, Plan)
    assert plan.chosen is not None
    attitude = plan.chosen.motion.initial.attitude
    assert abs(attitude @ chosen) == pytest.approx(1.0, abs=1e-9)
    assert run("check", file).exit_code == 0


@pytest.mark.slow
def test_the_page_says_what_is_under_way_and_what_its_colours_mean(opened: Show) -> None:
    page = opened("spatial_6dof/line")
    page.evaluate("""() => {
      const status = document.getElementById("status");
      window.said = [];
      const note = new MutationObserver(() => window.said.push(status.textContent));
      note.observe(status, { childList: true });
    }""")
    page.locator("input[name='duration']").fill("90")
    wait(page, "studio.outline.duration === 90 && window.said.at(-1) === 'ready'")
    said = set(page.evaluate("window.said"))
    assert said == {
        "computing attitudes and a motion", "checking limits", "computing more attitudes", "ready",
    }  # fmt: skip
    legend = page.locator("#key").inner_text().replace("\xa0", " ")
    for words in ("below the margin 5", "start of the path not reached", "attitude now"):
        assert words in legend
    box = page.locator("#plot").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert page.evaluate("studio.player.time") == pytest.approx(45.0, abs=1.0)
    assert [found for found in page.evaluate(CONTRASTS) if found[1] < 4.5] == []
    page.locator("#undo").click()


@pytest.mark.slow
def test_nothing_moves_by_itself_where_motion_is_reduced(browser: Browser, studio: Studio) -> None:
    context = browser.new_context(reduced_motion="reduce")
    page = context.new_page()
    page.goto(studio.address)
    wait(page, "Boolean(studio.player)")
    choice = page.evaluate("studio.newest.choice")
    page.locator("#best").click()
    wait(page, f"studio.played > {choice} && Boolean(studio.player)")
    assert not page.evaluate("studio.player.playing")
    context.close()


@pytest.mark.slow
def test_without_a_motion_no_attitude_is_marked_and_keys_do_nothing(opened: Show) -> None:
    page = opened("spatial_6dof/line")
    wait(page, "studio.ball.now")
    far = "{ type: 'handle', handle: 0, position: [9, 0, 0] }"
    page.evaluate(f"studio.connection.edit({far}, true)")
    wait(page, "studio.newest && !studio.newest.about && !studio.player")
    for key in ("Space", "3", "ArrowRight"):
        page.keyboard.press(key)
    assert page.evaluate("studio.ball.now") is None
    page.keyboard.press("Control+z")
    wait(page, "Boolean(studio.player)")


@pytest.mark.slow
@pytest.mark.parametrize("key", ["margin", "duration"])
def test_the_outcome_of_an_infeasible_motion_has_its_colour(opened: Show, key: str) -> None:
    page = opened("spatial_6dof/above")
    outcome = page.locator("#outcome")
    wait(page, "studio.plot.marks.length && !studio.busy")
    assert not outcome.get_attribute("style")
    slider = page.locator(f"input[name='{key}']")
    slider.fill(str(slider.evaluate(f"row => row.{'max' if key == 'margin' else 'min'}")))
    orange: Any = {"name": "color", "value": "rgb(255, 178, 122)", "timeout": 60_000}
    expect(outcome).to_have_css(**orange)
    page.keyboard.press("Control+z")
    expect(outcome).not_to_have_css(**orange)


@pytest.mark.slow
def test_a_goal_is_dragged_reached_and_saved(opened: Show, studio: Studio) -> None:
    page = opened("spatial_6dof/around")
    x, y = centre(page, ".handle")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 3.0, y)
    page.get_by_text(re.compile("a sketch")).wait_for()
    assert page.locator("#initial").is_hidden()
    page.mouse.up()
    page.get_by_text(re.compile("^goal: the goal is reached")).wait_for()
    page.locator("#save").click()
    page.get_by_text(re.compile("^Saved .*around.h5")).wait_for()
    motion = ff.load(studio.folder / "around.h5").phases[0].motion
    pose = motion.model.end_effector_pose(motion.final.attitude, motion.final.joints)
    assert pose.position == pytest.approx(content(page)["goal"]["pose"]["position"], abs=1e-8)


def sliders(page: Page) -> list[str]:
    rows = page.locator("#sliders input").all()
    return [str(row.get_attribute("name")) for row in rows if row.is_visible()]


def assert_every_slider_is_answered(page: Page) -> None:
    for name in sliders(page):
        slider = page.locator(f"input[name='{name}']")
        low, value = (float(slider.evaluate(f"row => row.{end}")) for end in ("min", "value"))
        wanted = str(low + 0.9 * (value - low) if value > low else 0.9 * low)
        page.evaluate("window.shown = studio.outline")
        slider.fill(wanted)
        wait(page, "studio.outline !== window.shown")
        assert float(slider.input_value()) == pytest.approx(float(wanted), rel=1e-4), name
    assert page.locator("#notice:not(.good)").is_hidden()


@pytest.mark.slow
def test_every_slider_of_a_spatial_scenario_is_answered(opened: Show) -> None:
    page = opened("spatial_6dof/line")
    axes = ["x", "y", "z"]
    momentum, ends = [f"h {axis}" for axis in axes], ["end roll", "end pitch", "end yaw"]
    assert sliders(page) == [*momentum, "duration", "margin", *ends]
    assert_every_slider_is_answered(page)


@pytest.mark.slow
def test_a_reload_and_a_killed_worker_lose_nothing(opened: Show, studio: Studio) -> None:
    page = opened("spatial_6dof/line")
    page.locator("input[name='h x']").fill("0.9")
    wait(page, "studio.outline.momentum[0] === 0.9")
    number = page.evaluate("studio.set.number")
    studio.worker().kill()
    page.get_by_text("was started again").wait_for()
    wait(page, f"studio.set.number > {number}")
    assert content(page)["momentum"] == [0.9, 0.3, 0.1]
    page.reload()
    wait(page, "Boolean(studio.player)")
    assert content(page)["momentum"] == [0.9, 0.3, 0.1]
    page.locator("#undo").click()
    wait(page, "studio.outline.momentum[0] === 0.5")
    page.locator("#redo").click()
    wait(page, "studio.outline.momentum[0] === 0.9")


@pytest.mark.slow
def test_a_planar_scenario_has_a_dial(opened: Show) -> None:
    page = opened("planar_3dof/parabola")
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    degrees = [low for entry in ff.plan(problem).ranges for low, _ in entry.degrees]
    wait(page, "studio.set.finest")
    shown = page.evaluate("studio.set.branches.flatMap(b => b.ranges.map(range => range[0]))")
    assert shown == pytest.approx(degrees, abs=1e-6)
    x, y = centre(page, "#dial")
    page.mouse.click(x - 60.0, y)
    wait(page, "Math.abs(studio.newest.heading_deg - 180) < 2 && Boolean(studio.player)")
    with page.context.expect_page() as other:
        page.locator("#page").click()
    wait(other.value, "Boolean(window.freefloat)")
