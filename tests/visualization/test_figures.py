"""Which figures a plan has; joint space and headings show its margins, ranges and motions."""

from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.motion.motion import Motion
from freefloat.planning.margin_map import HeadingMap
from freefloat.planning.plan import Plan
from freefloat.planning.plane.arcs import BranchRanges, HeadingRange
from freefloat.regions.planar_regions import PlanarArm, two_angles
from freefloat.so3 import heading_quaternion
from freefloat.visualization import figures as figures_module
from freefloat.visualization.figure_style import GREEN
from freefloat.visualization.planar_figures import headings_figure, joint_space_figure
from tests.figures import labels, line
from tests.maps import branch_results
from tests.robots import planar_robot
from tests.scenarios import PARABOLA

OF_A_MOTION = ["snapshots", "motion", "margin", "momentum"]
SCENARIO = PARABOLA.replace("0.5]\n", "1.5]\n", 1)


@pytest.fixture(autouse=True)
def few_headings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures_module, "_HEADINGS", 12)


@pytest.fixture
def folder(folder: Path) -> Path:
    """A working folder with a feasible scenario and one with a large margin."""
    (folder / "good.yaml").write_text(SCENARIO)
    (folder / "strict.yaml").write_text(SCENARIO.replace("value: 5", "value: 120"))
    return folder


@cache
def planned(name: str) -> Plan:
    """The plan of a scenario in the working folder; they are the same in all folders."""
    return ff.plan(ff.load_scenario(name).problem())


@pytest.mark.slow
def test_a_planar_plan_has_all_figures(folder: Path) -> None:
    """The chosen heading is marked on its branch; an infeasible motion is drawn beside it."""
    result = planned("good.yaml")
    assert result.chosen is not None
    fractions: list[float] = []
    drawings = ff.figures(result, progress=fractions.append)
    assert list(drawings) == ["workspace", "joint_space", "headings", *OF_A_MOTION]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    panels = drawings["headings"].axes
    marked = [axes for axes in panels if "chosen" in labels(axes)]
    assert [labels(axes)[0] for axes in marked] == [result.chosen.branch.label]
    attitude = result.chosen.motion.initial.attitude
    heading = np.degrees(2.0 * np.arctan2(attitude[2], attitude[3])) % 360.0
    assert line(marked[0], "chosen")[0, 0] == pytest.approx(heading)
    shaded = [len(axes.patches) for axes in panels]
    assert shaded == [
        sum(1 + (item.high > 2.0 * np.pi) for item in entry.ranges) for entry in result.ranges
    ]
    (axes,) = drawings["joint_space"].axes
    assert len([label for label in labels(axes) if label.startswith("heading")]) == 2
    assert [item.get_marker() for item in axes.lines].count("X") == 1


@pytest.mark.slow
def test_plans_that_are_not_feasible_show_what_there_is(folder: Path) -> None:
    result = planned("strict.yaml")
    assert not result.feasible
    drawings = ff.figures(result)
    assert list(drawings) == ["workspace", "joint_space", "headings"]
    assert all(len(axes.patches) == 0 for axes in drawings["headings"].axes)


PLANAR = ff.load_scenario("planar_3dof/parabola").problem()
BOTH = ("margin", "margin")


@pytest.fixture(scope="module")
def motions() -> list[Motion]:
    starts = [heading_quaternion(np.deg2rad(degrees)) for degrees in (200.0, 140.0)]
    return [ff.simulate(PLANAR, start, branch=0).chosen.motion for start in starts]


def test_s_is_what_the_curves_say(motions: list[Motion]) -> None:
    """(22): S = 0 and S = +-5 in joint space."""
    figure = joint_space_figure(PLANAR, motions)
    (axes,), arm = figure.axes, PlanarArm.of(PLANAR.model)
    for level, value in ((0.0, "0 (singular)"), (5.0, "5 m$^{4}$ kg"), (-5.0, "−5 m$^{4}$ kg")):
        curve = np.radians(line(axes, f"$S$ = {value}"))
        curve = curve[np.isfinite(curve).all(axis=1)]
        assert len(curve) > 500
        assert np.allclose(arm.determinant(two_angles(arm, curve)), level, atol=1e-6)


def test_names_of_curves_stand_apart_and_the_legend_inside_the_figure(tmp_path: Path) -> None:
    """Curves I to IV of this arm turn back; the margin has more digits than the paper's."""
    (robot := tmp_path / "robot.urdf").write_text(
        planar_robot([2.84, 2.48, 4.65], [0.66, 0.57, 0.69], [0.11, 0.51], [1.57, 0.1, 0.43])
    )
    path = ff.paths.PolynomialCurve.line([0.5, 0.0, 0.0], [0.6, 0.1, 0.0])
    problem = ff.Problem(
        str(robot), "end_effector", task="planar-position", path=path, duration=20.0,
        margin=("system", 0.05),
    )  # fmt: skip
    figure = joint_space_figure(problem, [])
    (axes,) = figure.axes
    names = [text.get_window_extent() for text in axes.texts]
    assert len(names) == 4
    assert not any(one.overlaps(other) for one, other in combinations(names, 2))
    assert axes.get_legend().get_window_extent().width <= figure.bbox.width


@pytest.mark.slow
def test_motions_of_the_segments_touch_where_the_plan_says() -> None:
    """Each touch point is drawn on the motion through it, as C inside the path or E at its end."""
    plan = ff.plan(PLANAR)
    (axes,) = ff.figures(plan)["joint_space"].axes
    points = [limit.touch_point for segment in plan.segments for limit in segment.limits]
    touching = [
        item.get_xydata() for item in axes.lines
        if item.get_color() == GREEN and item.get_linestyle() == "-"
    ]  # fmt: skip
    for marker, inside in (("D", True), ("s", False)):
        marks = [item.get_xydata()[0] for item in axes.lines if item.get_marker() == marker]
        wanted = [point.joints[:2] for point in points if (point.kind == "tangent") is inside]
        assert np.allclose(np.exp(1j * np.radians(marks)), np.exp(1j * np.array(wanted)))
        for mark in marks:
            gaps = [np.nanmin(np.linalg.norm(curve - mark, axis=1)) for curve in touching]
            assert min(gaps) < 3.0
    assert len(touching) == len(points) == 8
    names = [text.get_text() for text in axes.texts]
    assert {"C", "E", "$R_A$", "$R_B$"} <= set(names)
    assert sorted(set(names) & {"I", "II", "III", "IV"}) == ["I", "II", "III", "IV"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$q_1$ [deg]", "$q_2$ [deg]")


def some_map() -> HeadingMap:
    """Two branches from eight headings, a margin of 5; one branch does not always reach."""
    margins = np.array([[0, 2, 6, 8, 9, 7, 4, 0], [9, 9, 9, np.nan, 0, 1, 5, 9]], dtype=float)
    headings = np.arange(8) * np.pi / 4
    results = branch_results(heading_quaternion(headings), margins.T, 3)
    return HeadingMap(PLANAR, results, headings, (0, 3))


def spans(axes: object) -> list[tuple[float, float]]:
    patches = axes.patches  # type: ignore[attr-defined]
    return [(item.get_x(), item.get_x() + item.get_width()) for item in patches]


def test_shaded_spans_are_the_ranges() -> None:
    ranges = (
        BranchRanges(0, "elbow+", (HeadingRange(1.0, 4.5, BOTH),), (1.0, 4.5)),
        BranchRanges(3, "elbow-", (HeadingRange(5.0, 2.0 * np.pi + 1.0, BOTH),), (1.0, 5.0)),
    )
    figure = headings_figure(some_map(), ranges, (3, 6.0))
    first, second = figure.axes
    assert np.allclose(spans(first), np.degrees([(1.0, 4.5)]))
    assert np.allclose(sorted(spans(second)), [(0.0, np.degrees(1.0)), (np.degrees(5.0), 360.0)])
    assert labels(first) == ["elbow+", "feasible", "margin 5"]
    reached_in_part = ["elbow-", "feasible", "start out of reach", "margin 5", "chosen"]
    assert labels(second) == reached_in_part
    assert np.allclose(line(second, "chosen")[:, 0], np.degrees(6.0))
    for axes, row in zip(figure.axes, some_map().results.existing_margins.T, strict=True):
        (curve,) = [item for item in axes.lines if len(item.get_xdata()) == 8]
        assert np.array_equal(curve.get_ydata(), row, equal_nan=True)
        assert line(axes, "margin 5")[:, 1].tolist() == [5.0, 5.0]


@pytest.mark.slow
def test_where_only_a_limit_is_violated_figures_show_the_margin_and_name_the_limit() -> None:
    sun = ff.PointingLimit("spacecraft", [0.0, 1.0, 0.0], 1.4, "outside", direction=[1.0, 0.5, 0.3])
    drawn = ff.figures(ff.plan(PLANAR, limits=ff.Limits(pointing=(sun,))))
    assert labels(drawn["joint_space"].axes[0])[-1].endswith("violates pointing")
    first = ff.simulate(PLANAR, heading=0.0, branch=0).chosen.closest_approach
    assert line(drawn["headings"].axes[0], "elbow+")[0] == pytest.approx([0.0, first.value])
