"""Figure of a study."""

from __future__ import annotations

from pathlib import Path

from freefloat.visualization.figures.study_figure import study_figure

TABLE = {
    "case": [0, 1, 2], "timing.duration": [50.0, 60.0, 70.0], "fixed": [1.0, 1.0, 1.0],
    "robot.urdf": ["planar_3dof", "a$_{b", "c" * 99],
    "verdict": ["feasible", "infeasible", "error"], "margin": [7.5, 2.5, None],
    "margin_required": [5.0, 5.0, None], "measure": ["system", "system", None],
}  # fmt: skip


def test_the_figure_has_a_panel_for_every_parameter_that_varies(tmp_path: Path) -> None:
    figure = study_figure(
        TABLE, {"timing.duration": "T [s]", "fixed": "fixed", "robot.urdf": "robot.urdf"}, "m^2 kg"
    )
    assert figure.axes[0].get_ylabel() == "minimum |system| [m$^{2}$ kg]"
    panels = {axes.get_xlabel(): axes for axes in figure.axes}
    assert list(panels) == ["T [s]", "robot.urdf"]
    lines = {line.get_label(): line for line in panels["T [s]"].lines}
    assert lines["feasible (1)"].get_xydata().tolist() == [[50.0, 7.5]]
    assert lines["infeasible (1)"].get_xydata().tolist() == [[60.0, 2.5]]
    assert lines["error (1)"].get_xydata().tolist() == [[70.0, 0.0]]
    labels = [label.get_text() for label in panels["robot.urdf"].get_xticklabels()]
    assert labels[0] == "planar_3dof"
    assert len(labels[2]) < 40
    figure.savefig(tmp_path / "summary.png")  # no name is read as mathematics
