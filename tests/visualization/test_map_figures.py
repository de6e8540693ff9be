"""Figures of maps show the numbers of the map with names and units."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_rgba

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.space.mapping import sample_attitudes
from freefloat.visualization.figure_style import BLUE, GREY
from freefloat.visualization.figures.map_figures import histogram_figure, slices_figure
from freefloat.visualization.slices import Mark, map_slices

BRANCHES = 4  # the others are wrist-flipped


@pytest.fixture(scope="module")
def problem():
    return ff.load_scenario("spatial_6dof/line").problem()


@pytest.fixture(scope="module")
def shown(problem):
    marks = [Mark("best", np.array([0.1, 0.2, 0.3, 0.9]) / np.sqrt(0.95), 0),
             Mark("robust", np.array([0.7, 0.0, 0.7, 0.1]) / np.sqrt(0.99), 2)]  # fmt: skip
    evaluator = FeasibilityEvaluator(problem)
    result = sample_attitudes(evaluator, 60)
    slices = map_slices(evaluator, marks, side=11)
    return result, slices, slices_figure(result, slices), histogram_figure(result)


@pytest.mark.slow
def test_colours_are_the_margins_of_feasible_motions(shown):
    """Below the margin the colour mesh is masked and the grey mesh is drawn."""
    _, slices, figure, _ = shown
    panels = figure.axes[:6]
    assert len(slices) == 6
    for axes, plane in zip(panels, slices, strict=True):
        meshes = [item for item in axes.collections if isinstance(item, QuadMesh)]
        below, feasible = (np.ma.filled(mesh.get_array(), np.nan) for mesh in meshes)
        inside = np.isfinite(plane.margins)
        assert (np.isfinite(feasible) == (inside & (plane.margins > 0.0))).all()
        assert (np.isfinite(below) == (inside & plane.reached & (plane.margins == 0.0))).all()
        np.testing.assert_allclose(
            feasible[np.isfinite(feasible)], plane.margins[plane.margins > 0.0]
        )


def test_bars_add_up_to_the_percentages(shown, problem):
    """Blue bars: feasible motions; grey bars: motions completed below the margin."""
    result, _, _, figure = shown
    panels = figure.axes
    assert len(panels) == BRANCHES
    for axes, (branch, values) in zip(panels, result.branch_margins(), strict=True):
        heights = {
            colour: sum(bar.get_height() for bar in axes.patches
                        if bar.get_facecolor() == to_rgba(colour))
            for colour in (BLUE, GREY)
        }  # fmt: skip
        percentage = 100.0 * result.feasible[:, branch].mean()
        assert heights[BLUE] == pytest.approx(percentage)
        assert heights[BLUE] + heights[GREY] == pytest.approx(100.0 * (values > 0.0).mean())
        assert f"{percentage:.1f} % keep the margin" in axes.get_title(loc="left")
        assert axes.get_title(loc="left").startswith("shoulder")
        (line,) = axes.get_lines()
        assert set(line.get_xdata()) == {problem.margin.threshold}


@pytest.mark.slow
def test_motions_from_touch_points_touch_the_margin(problem):
    """S of (21b) is S0 at every marked point, its magnitude never less; maps without have none."""
    result = ff.attitude_map(problem, 60, touch=3)
    (axes,) = ff.figures(result)["touch_points"].axes
    threshold = problem.margin.threshold
    marks = [item.get_xydata()[0] for item in axes.lines if item.get_marker() in "Ds"]
    assert len(marks) == len(result.touch) == 3
    assert np.allclose(np.abs(marks)[:, 1], threshold, rtol=1e-4)
    curves = [item.get_ydata() for item in axes.lines if len(item.get_xdata()) > 100]
    assert len(curves) == 3
    assert all(np.abs(S).min() == pytest.approx(threshold, rel=1e-2) for S in curves)
    assert axes.get_ylabel() == "$S$ (in-plane factor) [m$^{4}$ kg]"
    assert "touch_points" not in ff.figures(ff.attitude_map(problem, 60))
