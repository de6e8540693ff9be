"""Figures and slices of maps show the numbers of the map with names and units."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_rgb, to_rgba
from scipy.ndimage import minimum_filter
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.space.map_sampling import sample_attitudes
from freefloat.visualization.figure_style import BLUE, LIGHT, PALE
from freefloat.visualization.map_figures import histogram_figure, slices_figure
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
def test_the_label_of_the_colours_is_on_the_page(shown):
    result, slices, _, _ = shown
    figure = slices_figure(result, slices[:3])
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    box = figure.axes[-1].yaxis.label.get_window_extent()
    assert min(box.x0, box.y0) >= 0.0
    assert box.y1 <= figure.bbox.height


@pytest.mark.slow
def test_colours_are_the_margins_of_feasible_motions(shown):
    """Pixels at samples: the colour of the margin, grey below it, white or hatched elsewhere."""
    _, slices, figure, _ = shown
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[::-1, :, :3] / 255.0
    assert len(slices) == 6
    for axes, plane in zip(figure.axes, slices, strict=False):
        ticks = np.degrees(plane.ticks)
        columns, rows = axes.transData.transform(np.column_stack([ticks, ticks])).astype(int).T
        seen = pixels[np.ix_(rows, columns)]
        feasible = plane.margins > 0.0
        alike = minimum_filter(feasible, 3) | minimum_filter(~feasible & plane.reached, 3)
        radius = np.sqrt(np.pi**2 - plane.offset**2) - 0.2
        certain = alike & (np.hypot(plane.ticks, plane.ticks[:, None]) < radius)
        mesh = [item for item in axes.collections if isinstance(item, QuadMesh)][-1]
        expected = np.where(feasible[..., None], mesh.to_rgba(plane.margins)[..., :3], to_rgb(PALE))
        marked = np.abs(seen - expected).max(axis=2) > 0.1  # the marker of the attitude
        assert np.count_nonzero(marked[certain]) <= 2 < np.count_nonzero(certain)


def test_bars_add_up_to_the_percentages(shown, problem):
    """Blue bars: feasible motions; grey bars: motions completed below the margin."""
    result, _, _, figure = shown
    panels = figure.axes
    assert len(panels) == BRANCHES
    for axes, (branch, values) in zip(panels, result.branch_margins(), strict=True):
        heights = {
            colour: sum(bar.get_height() for bar in axes.patches
                        if bar.get_facecolor() == to_rgba(colour))
            for colour in (BLUE, LIGHT)
        }  # fmt: skip
        percentage = 100.0 * result.feasible[:, branch].mean()
        assert heights[BLUE] == pytest.approx(percentage)
        assert heights[BLUE] + heights[LIGHT] == pytest.approx(100.0 * (values > 0.0).mean())
        assert f"{percentage:.1f} % keep the margin" in axes.get_title(loc="left")
        assert axes.get_title(loc="left").startswith("shoulder")
        (line,) = axes.get_lines()
        assert set(line.get_xdata()) == {problem.margin.threshold}


@pytest.mark.slow
def test_motions_from_touch_points_touch_the_margin(problem):
    """S of (21b) is S0 at every marked point, its magnitude never less; maps without have none."""
    result = ff.attitude_map(problem, 60, touch=3, refine=False)
    (axes,) = ff.figures(result)["touch_points"].axes
    threshold = problem.margin.threshold
    marks = [item.get_xydata()[0] for item in axes.lines if item.get_marker() in "Ds"]
    assert len(marks) == len(result.touch) == 3
    assert np.allclose(np.abs(marks)[:, 1], threshold, rtol=1e-4)
    curves = [item.get_ydata() for item in axes.lines if len(item.get_xdata()) > 100]
    assert len(curves) == 3
    assert all(np.abs(S).min() == pytest.approx(threshold, rel=1e-2) for S in curves)
    assert axes.get_ylabel() == "$S$ (in-plane factor) [m$^{4}$ kg]"
    assert "touch_points" not in ff.figures(ff.attitude_map(problem, 60, refine=False))


def placed(plane, row, column):
    """The rotation vector at a place of a slice."""
    vector = np.zeros(3)
    vector[plane.normal] = plane.offset
    right, up = plane.across
    vector[right], vector[up] = plane.ticks[column], plane.ticks[row]
    return vector


def test_every_place_has_the_margin_of_its_attitude(shown, problem):
    """This also fixes which component is horizontal and which vertical."""
    _, slices, *_ = shown
    evaluator, value = FeasibilityEvaluator(problem), problem.margin.threshold
    for plane in slices:
        rows, columns = np.nonzero(np.isfinite(plane.margins))
        picked = np.random.default_rng(1).choice(len(rows), 12, replace=False)
        vectors = [
            placed(plane, *place) for place in zip(rows[picked], columns[picked], strict=True)
        ]
        margins = evaluator.margins(Rotation.from_rotvec(vectors).as_quat(), None)
        found = plane.margins[rows[picked], columns[picked]]
        assert found == pytest.approx(np.where(margins >= value, margins, 0.0))
        assert found.max() > value
