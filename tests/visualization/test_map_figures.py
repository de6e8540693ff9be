"""Figures of maps: bars and colours carry the map's numbers, words and units with them."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_rgba

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.options import Objective
from freefloat.planning.plan import Plan
from freefloat.planning.sampling import sample_attitudes
from freefloat.planning.slices import Mark, map_slices
from freefloat.visualization.figure_style import BLUE, GREY, save_figures
from freefloat.visualization.map_figures import histogram_figure, slices_figure

BRANCHES = 4  # the others are wrist-flipped


def drawn(problem, marks, samples=300):
    outlook = FeasibilityEvaluator(problem)
    found = sample_attitudes(outlook, samples)
    slices = map_slices(outlook, marks, side=15)
    return (
        found,
        slices,
        {
            "map_slices": slices_figure(found, slices),
            "map_histogram": histogram_figure(found),
        },
    )


@pytest.fixture(scope="module")
def problem():
    return ff.load_scenario("spatial_6dof/line").problem()


@pytest.fixture(scope="module")
def shown(problem):
    marks = [Mark("best", np.array([0.1, 0.2, 0.3, 0.9]) / np.sqrt(0.95), 0),
             Mark("robust", np.array([0.7, 0.0, 0.7, 0.1]) / np.sqrt(0.99), 2)]  # fmt: skip
    return drawn(problem, marks)


def meshes(axes):
    return [one for one in axes.collections if isinstance(one, QuadMesh)]


def test_colours_are_the_margins_kept(shown):
    """Where the margin is broken the colour mesh has a hole, filled by the grey one."""
    _, slices, figures = shown
    panels = figures["map_slices"].axes[:6]
    assert len(slices) == 6
    for axes, plane in zip(panels, slices, strict=True):
        below, kept = (np.ma.filled(mesh.get_array(), np.nan) for mesh in meshes(axes))
        inside = np.isfinite(plane.least)
        assert (np.isfinite(kept) == (inside & (plane.least > 0.0))).all()
        assert (np.isfinite(below) == (inside & plane.reached & (plane.least == 0.0))).all()
        np.testing.assert_allclose(kept[np.isfinite(kept)], plane.least[plane.least > 0.0])


def test_marks_are_where_their_attitudes_are(shown):
    """Components in degrees, in each of the planes; one entry for each mark in the legend."""
    _, slices, figures = shown
    for axes, plane in zip(figures["map_slices"].axes, slices, strict=False):
        (line,) = axes.get_lines()
        vector = np.degrees(ff_vector(plane.mark.attitude))
        right, up = plane.across
        assert (line.get_xdata()[0], line.get_ydata()[0]) == pytest.approx(vector[[right, up]])
        assert "xyz"[right] in axes.get_xlabel()
        assert "xyz"[up] in axes.get_ylabel()
        assert "[deg]" in axes.get_xlabel()
    words = [text.get_text() for text in figures["map_slices"].legends[0].get_texts()]
    assert words[:2] == ["best", "robust"]


def ff_vector(attitude):
    """A rotation vector by its definition: axis times angle."""
    axis, angle = attitude[:3], 2.0 * np.arctan2(np.linalg.norm(attitude[:3]), attitude[3])
    return axis / np.linalg.norm(axis) * angle


def test_the_colour_scale_begins_at_the_margin_and_has_its_unit(shown, problem):
    found, _, figures = shown
    bar = figures["map_slices"].axes[-1]
    low, high = bar.get_ylim()
    assert low == problem.margin.threshold
    assert high >= found.margins.max()
    assert "[m$^{4}$ kg]" in bar.get_ylabel()


def test_bars_add_up_to_the_shares(shown, problem):
    """Blue ones to the share that keeps the margin, grey ones to what completes below it."""
    found, _, figures = shown
    panels = figures["map_histogram"].axes
    assert len(panels) == BRANCHES
    for axes, (branch, values) in zip(panels, found.branch_margins(), strict=True):
        heights = {
            colour: sum(bar.get_height() for bar in axes.patches
                        if bar.get_facecolor() == to_rgba(colour))
            for colour in (BLUE, GREY)
        }  # fmt: skip
        kept = 100.0 * found.feasible[:, branch].mean()
        assert heights[BLUE] == pytest.approx(kept)
        assert heights[BLUE] + heights[GREY] == pytest.approx(100.0 * (values > 0.0).mean())
        assert f"{kept:.1f} % keep the margin" in axes.get_title(loc="left")
        assert axes.get_title(loc="left").startswith("shoulder")
        (line,) = axes.get_lines()
        assert set(line.get_xdata()) == {problem.margin.threshold}


def test_a_map_with_nothing_feasible_is_drawn(problem, tmp_path):
    """A margin that nobody has: grey all over, no colours, and files all the same."""
    margin = ff.Margin(problem.margin.measure, 1e6)
    hopeless = ff.Problem(problem.model, problem.path, problem.task, problem.momentum, margin)
    _, _, figures = drawn(hopeless, [], 50)
    for axes in figures["map_slices"].axes[:3]:
        assert axes.get_title().startswith("centre")
        assert not np.isfinite(np.ma.filled(meshes(axes)[1].get_array(), np.nan)).any()
    assert len(save_figures(tmp_path, figures)) == 4


def test_plans_in_space_show_their_map_and_where_the_spacecraft_is_now(problem):
    """Also infeasible ones, which have no motion to show."""
    found = sample_attitudes(FeasibilityEvaluator(problem), 50)
    search = ff.Search(Objective.NEAREST, np.array([0.0, 0.0, 0.0, 1.0]))
    figures = ff.figures(Plan(problem, search, False, "for a test", map=found))
    assert list(figures) == ["workspace", "map_slices", "map_histogram"]
    assert figures["map_slices"].axes[0].get_title().startswith("now")


@pytest.mark.slow
def test_a_redundant_arm_has_one_panel_for_all_its_configurations():
    problem = ff.load_scenario("panda_servicer/line").problem()
    found, _, figures = drawn(problem, [], 60)
    (axes,) = figures["map_histogram"].axes
    assert axes.get_title(loc="left").startswith("any\n")
    assert f"{100.0 * found.feasible_fraction:.1f} % keep" in axes.get_title(loc="left")
