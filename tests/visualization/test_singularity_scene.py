"""The surface det A = 0 of scenes, pages and figures, by Pinocchio's matrices."""

from functools import cache

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.joint_space import scene as scenes
from freefloat.beyond.joint_space.figures import (
    influential_joints,
    reference_configuration,
    section,
    singularity_figures,
)
from freefloat.beyond.joint_space.singularity_map import SingularityMap
from freefloat.visualization.page.playback import Playback
from tests.browser import differing, opened
from tests.motions import bundled


@cache
def mapped(name: str, resolution: float = 20.0) -> SingularityMap:
    problem = bundled(name)
    return ff.singularity_map(problem.model, problem.task, np.radians(resolution))


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
def test_a_page_shows_the_singularities(name, items, browser, tmp_path):
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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "resolution"), [("planar_3dof/parabola", 1.0), ("spatial_6dof/line", 8.0)]
)
def test_curves_and_colours_agree_with_the_determinant(name: str, resolution: float) -> None:
    problem, found = bundled(name), mapped(name, resolution)
    measure = ff.singularity_measure(problem.model, problem.task, "system")
    at = reference_configuration(found)
    largest = abs(measure(at))
    (figure,) = singularity_figures(found).values()
    pairs = [(a, b) for a in found.joints for b in found.joints if a < b]
    assert len(figure.axes) == len(pairs)
    for axes, pair in zip(figure.axes, pairs, strict=True):

        def determinant(degrees: np.ndarray, pair: tuple[int, int] = pair) -> float:
            q = at.copy()
            q[list(pair)] = np.radians(degrees)
            return float(measure(q))

        for path in axes.collections[0].get_paths():
            vertices = path.vertices[:: max(1, len(path.vertices) // 50)]
            assert max(map(abs, map(determinant, vertices))) < 1e-3 * largest
        classes = np.asarray(axes.images[0].get_array())
        rows, columns = np.random.default_rng(2).integers(0, len(classes), (2, 300))
        for row, column in zip(rows, columns, strict=True):
            centre = np.array([column, row]) + 0.5 - 180.0  # a cell has one degree
            if classes[row, column] < 2:
                assert np.sign(determinant(centre)) == (1.0, -1.0)[classes[row, column]]
        assert axes.get_xlabel() == f"{found.model.joint_names[pair[0]]} [deg]"
