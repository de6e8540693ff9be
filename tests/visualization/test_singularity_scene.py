"""The surface det A = 0 of scenes, by Pinocchio's matrices, and pages with it."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser

import freefloat as ff
from freefloat.beyond.joint_space import scene as scenes
from freefloat.beyond.joint_space.figures import influential_joints, section
from freefloat.beyond.joint_space.singularity_map import SingularityMap
from freefloat.visualization.page.playback import Playback
from tests.browser import differing, opened
from tests.motions import bundled


@cache
def mapped(name: str) -> SingularityMap:
    problem = bundled(name)
    return ff.singularity_map(problem.model, problem.task, np.radians(20.0))


@pytest.mark.slow
def test_the_determinant_vanishes_on_the_surface_and_is_positive_in_front() -> None:
    problem, found = bundled("spatial_6dof/line"), mapped("spatial_6dof/line")
    measure = ff.singularity_measure(problem.model, problem.task, "system")
    part = section(found, influential_joints(found, 3))
    assert part.joints == (1, 2, 4)
    largest = abs(measure(part.at))
    vertices, faces = scenes.surface(part)
    for q in part.configurations(vertices[:: len(vertices) // 300]):
        assert abs(measure(q)) < 1e-3 * largest
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normals, edges = np.cross(b - a, c - a), np.linalg.norm(b - a, axis=1)
    sizes = np.linalg.norm(normals, axis=1)
    chosen = np.flatnonzero((sizes > 0.3 * edges**2) & (edges > 0.05))[::40]
    assert len(chosen) > 200
    steps = 0.02 * normals[chosen] / sizes[chosen, None]
    centres = (a + b + c)[chosen] / 3.0
    fronts, backs = (part.configurations(centres + side * steps) for side in (1.0, -1.0))
    differences = [
        measure(front) - measure(back) for front, back in zip(fronts, backs, strict=True)
    ]
    assert np.mean(np.array(differences) > 0.0) > 0.97  # where sheets cross, either may be


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "items"),
    [("planar_3dof/parabola", "det A, det A = 0, Axes"), ("spatial_6dof/line", "det A = 0, Axes")],
)
def test_a_page_shows_the_singularities(
    name: str, items: str, browser: Browser, tmp_path: Path
) -> None:
    file = ff.playback(mapped(name)).save(tmp_path / "page.html")
    with opened(browser, file) as page:
        assert [item["name"] for item in page.ask("freefloat.about.items")] == items.split(", ")
        page.only()
        empty = page.picture()
        for item in items.split(", "):
            page.only(item)
            assert differing(page.picture(), empty) > 200
        legend = page.ask("document.getElementById('legend').innerText")
        assert ["det A > 0" in legend, "det A = 0" in legend] == [True, items.startswith("det A,")]
        assert page.errors == []


@pytest.mark.slow
def test_joints_are_chosen_by_name() -> None:
    found = mapped("spatial_6dof/line")
    scene = scenes.singularity_scene(found, joints=["q3", "q4", "q5"], at=np.full(6, 0.5))
    (shown,) = Playback(scene).scene.description.scenes
    texts = [label.text for label in shown.labels]
    assert texts == [text for name in ("q3", "q4", "q5") for text in ("−180°", name, "180°")]
    assert shown.lines[0] == "at q2 = 28.65°"
    for names in (["q3"], ["q3", "q3"], ["q3", "q9"]):
        with pytest.raises(ff.InputError):
            scenes.singularity_scene(found, joints=names)
