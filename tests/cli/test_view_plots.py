"""``freefloat view --plots`` draws the figures of saved results."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib import rc_context

import freefloat as ff
from freefloat.so3 import heading_quaternion
from freefloat.visualization import figures as figures_module
from freefloat.visualization.figure_style import new_figure
from tests.commands import document


@pytest.mark.slow
def test_figures_of_a_motion_and_of_several_beside_each_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures_module, "figures", lambda *_, **__: {"name": new_figure()})
    problem = ff.load_scenario("planar_2dof/line").problem()
    files = [tmp_path / "a" / "motion.h5", tmp_path / "b" / "motion.h5"]
    for heading, file in zip((0.0, 1.0), files, strict=True):
        file.parent.mkdir()
        ff.save(ff.simulate(problem, heading_quaternion(heading)), file)
    (figure, *_) = document("view", files[0], "--plots", tmp_path / "one")["figures"]
    assert Path(figure).parent == tmp_path / "one"
    figures = {
        Path(name) for name in document("view", *files, "--plots", tmp_path / "two")["figures"]
    }
    assert all(figure.stat().st_size > 500 for figure in figures)
    assert {figure.parent.name for figure in figures} == {"motion", "motion (2)", "two"}
    assert tmp_path / "two" / "comparison.pdf" in figures


@pytest.mark.slow
def test_figures_need_no_latex_that_the_users_own_settings_ask_for(tmp_path: Path) -> None:
    """As a matplotlibrc of the user, or of the current folder, does."""
    problem = ff.load_scenario("planar_2dof/line").problem()
    ff.save(ff.simulate(problem, heading_quaternion(0.0)), tmp_path / "motion.h5")
    with rc_context({"text.usetex": True, "text.latex.preamble": r"\input{secret}"}):
        figures = document("view", tmp_path / "motion.h5", "--plots", tmp_path / "out")["figures"]
    assert len(figures) > 2
