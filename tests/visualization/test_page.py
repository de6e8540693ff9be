"""Pages in a browser show what motions and maps say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.errors import InputError
from freefloat.motion.problem import Problem
from freefloat.planning.mapping import sample_attitudes
from freefloat.planning.plan import Plan
from freefloat.visualization.map_scene import BACK, BALL, BEST_BRANCH, FRONT
from tests.browser import differing, opened

GOOD, BAD = [0.46008, 0.09337, 0.73519, -0.48898], [0.1, 0.5, 0.2, -0.8367]


@pytest.mark.slow
def test_a_page_plays_motions(browser: Browser, spatial: Problem, tmp_path: Path) -> None:
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
                tip = spatial.path.pose(state.time).position
                assert page.position(f"{title}/End-effector axes") == pytest.approx(tip, abs=1e-4)
        mark = page.position("singular/Singularity/mark")
        assert mark == pytest.approx([0.120, 0.469, 0.194], abs=1e-3)  # the paper's C
        page.only("Trail")
        page.ask("title => freefloat.show(title)", "feasible")
        assert page.ask("document.getElementById('legend').textContent").startswith("|arm| [m⁴ kg]")
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
        page.page.wait_for_timeout(500)
        assert page.ask("freefloat.state().time") > 0.3
        assert page.errors == []


@pytest.mark.slow
def test_a_page_shows_a_map(browser: Browser, spatial: Problem, tmp_path: Path) -> None:
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
        assert page.errors == []


@pytest.mark.slow
def test_a_page_shows_a_map_over_headings(browser: Browser, tmp_path: Path) -> None:
    problem = ff.load_scenario("planar_2dof/line").problem()
    file = ff.playback(ff.attitude_map(problem, 24)).save(tmp_path / "map.html")
    with opened(browser, file) as page:
        page.only()
        empty = page.picture()
        for item in ("Circle", "Best heading", "branch 0", "branch 1"):
            page.only(item)
            assert differing(page.picture(), empty) > 50
        assert page.errors == []


def test_what_cannot_be_shown_is_refused(spatial: Problem) -> None:
    infeasible = Plan(spatial, ff.Search(), False, "for a test")
    for result in (infeasible, spatial, {"name": spatial}, {}):
        with pytest.raises(InputError):
            ff.playback(result)  # type: ignore[arg-type]
