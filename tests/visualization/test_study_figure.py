"""Figure of a study."""

from pathlib import Path

import numpy as np

from freefloat.visualization.study_figure import study_figure

TABLE = {
    "timing.duration": np.array([50.0, 60.0, 70.0]), "fixed": np.ones(3),
    "robot.urdf": np.array(["planar_3dof", "a$_{b", "c" * 99], dtype=object),
    "verdict": np.array(["feasible", "infeasible", "error"], dtype=object),
    "margin": np.array([7.5, 2.5, np.nan]), "margin_required": np.array([5.0, 5.0, np.nan]),
    "measure": np.array(["system", "system", None]),
}  # fmt: skip


def test_the_figure_has_a_panel_for_every_parameter_that_varies(tmp_path: Path) -> None:
    figure = study_figure(
        TABLE, {"timing.duration": "T [s]", "fixed": "fixed", "robot.urdf": "robot.urdf"}, "m^2 kg"
    )
    quantity = "minimum |det A| [m$^{2}$ kg]"
    panels = {axes.get_xlabel(): axes for axes in figure.axes}
    assert list(panels) == [quantity, "runs", "T [s]", "robot.urdf"]
    assert panels["T [s]"].get_ylabel() == quantity
    assert sum(bar.get_height() > 0 for bar in panels[quantity].patches) == 2  # have a margin
    lines = {line.get_label(): line for line in panels["T [s]"].lines}
    assert lines["feasible (1)"].get_xydata().tolist() == [[50.0, 7.5]]
    assert lines["infeasible (1)"].get_xydata().tolist() == [[60.0, 2.5]]
    assert lines["error (1)"].get_xydata().tolist() == [[70.0, 0.0]]
    labels = [label.get_text() for label in panels["robot.urdf"].get_xticklabels()]
    assert labels[2] == "planar_3dof"
    assert len(labels[1]) < 40
    assert panels["runs"].lines[0].get_ydata().tolist() == [1.0, 0.5]
    figure.savefig(tmp_path / "summary.png")  # no name is read as mathematics


def test_many_runs_are_drawn_as_density() -> None:
    durations = np.linspace(50.0, 200.0, 1200)
    verdicts = np.where(durations < 140.0, "feasible", "infeasible").astype(object)
    table = {"T": durations, "verdict": verdicts, "margin": 200.0 - durations,
             "margin_required": np.full(1200, 60.0), "measure": np.full(1200, "arm")}  # fmt: skip
    panel = study_figure(table, {"T": "T [s]"}).axes[2]
    assert panel.collections[0].get_array().sum() == 1200
    assert [line.get_ydata()[0] for line in panel.lines] == [60.0]


def test_bars_are_seen_where_margins_are_close_together_and_far_from_the_required_one() -> None:
    table = {"T": np.arange(200.0), "verdict": np.full(200, "feasible", dtype=object),
             "margin": np.linspace(7.53, 7.54, 200), "margin_required": np.full(200, 2.0),
             "measure": np.full(200, "arm")}  # fmt: skip
    axes = study_figure(table, {"T": "T [s]"}).axes[0]
    shown = np.diff(axes.get_xlim())[0]
    bars = [bar for bar in axes.patches if bar.get_height() > 0.0]
    assert sum(bar.get_height() for bar in bars) == 200.0
    assert all(bar.get_width() > 0.005 * shown for bar in bars)


def test_runs_of_which_none_has_a_margin_have_a_figure() -> None:
    table = {**TABLE, "verdict": np.full(3, "error", dtype=object), "margin": np.full(3, np.nan),
             "margin_required": np.full(3, np.nan)}  # fmt: skip
    figure = study_figure(table, {"timing.duration": "T [s]"})
    assert not figure.axes[0].patches
    assert len(figure.axes[2].lines[0].get_ydata()) == 3
    low, high = figure.axes[2].get_ylim()
    assert -low > 0.1 * high  # the marks, which are at zero, are not cut


def test_one_run_is_drawn_with_its_margin() -> None:
    table = {name: values[:1] for name, values in TABLE.items()}
    figure = study_figure(table, {"timing.duration": "T [s]"})
    assert figure.axes[1].lines[0].get_marker() == "o"
    assert "margin 5" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_no_bar_is_partly_below_the_margin() -> None:
    """Also where motions touch the margin up to rounding, or all have the same."""
    for margins in ([5.0 - 4e-6, 4.9, 8.3, 2.2, 7.7], [7.5, 7.5 + 1e-15], [2.5], [0.0, 0.0]):
        count, margin = len(margins), np.array(margins)
        verdicts = np.where(margin > 4.99, "feasible", "infeasible").astype(object)
        table = {"verdict": verdicts, "margin": margin, "margin_required": np.full(count, 5.0),
                 "measure": np.full(count, "arm")}  # fmt: skip
        bars = [bar for bar in study_figure(table, {}).axes[0].patches if bar.get_height() > 0]
        assert sum(bar.get_height() for bar in bars) == count
        for bar in bars:
            low, high = bar.get_x(), bar.get_x() + bar.get_width()
            assert high < 5.0 + 1e-9 or low > 5.0 - 1e-5


def test_labels_are_cut_between_words() -> None:
    names = {"a": "limits.joint_rate [rad/s]", "b": "x" * 20 + ".joint_rate [rad/s]", "c": "c"}
    table = TABLE | dict.fromkeys(names, TABLE["timing.duration"])
    labels = [axes.get_xlabel() for axes in study_figure(table, names).axes[2:]]
    assert labels == [names["a"], "…joint_rate [rad/s]", "c"]


def test_what_limits_the_runs_is_drawn_where_it_is_not_the_margin() -> None:
    limiting = ["pointing of tool", "pointing of tool", "margin"]
    table = TABLE | {"limiting": np.array(limiting, dtype=object)}
    bars = study_figure(table, {"timing.duration": "T [s]"}).axes[0]
    assert bars.get_xlabel() == "runs by limiting quantity"
    assert [text.get_text() for text in bars.get_yticklabels()] == ["margin", "pointing\nof tool"]
    assert sum(bar.get_width() for bar in bars.patches) == 3.0
    for ratios, known in (([1.2, np.nan, 0.4], {1.2, 0.4}), ([np.nan] * 3, set())):
        figure = study_figure(table, {"timing.duration": "T [s]"}, ratios=np.array(ratios))
        drawn = np.concatenate([line.get_ydata() for line in figure.axes[2].lines])
        assert set(drawn.tolist()) == {1.0} | known  # the limit, and what is not known at the top
    table["limiting"] = np.array(["margin", "singularity", "pointing of tool"], dtype=object)
    assert "det A" in study_figure(table, {"timing.duration": "T [s]"}).axes[0].get_xlabel()
