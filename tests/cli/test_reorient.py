"""``freefloat reorient``: its document, its file, and how that is checked and played."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from tests.commands import document, error, run

TURN = ("reorient", "planar_2dof/line", "--from", 0, 0, 0, 1, "--to", 0, 0, 0.1305262, 0.9914449)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("reorient") / "turn.h5"
    found = document(*TURN, "-o", path)
    assert found["reached"]
    assert found["turn_deg"] == pytest.approx(15.0, abs=1e-4)
    assert found["error"] < 1e-6
    return path


def test_a_file_holds_the_record(file: Path) -> None:
    loaded = ff.load(file)
    assert loaded.loops.count == 1
    np.testing.assert_allclose(loaded.motion.final.attitude, loaded.goal, atol=1e-8)


@pytest.mark.slow
def test_a_file_is_verified_with_mujoco(file: Path) -> None:
    assert document("check", file, "--engine", "mujoco")["proved"]


def test_an_altered_loop_is_a_discrepancy(file: Path) -> None:
    loaded = ff.load(file)
    loops = loaded.loops
    changed = type(loops)(loops.joints, 1.01 * loops.cosines, loops.sines, loops.count)
    object.__setattr__(loaded.motion, "curve", changed)
    report = ff.check(loaded)
    assert {entry.name for entry in report.discrepancies} >= {"integrated again", "final attitude"}


def test_a_page_plays_the_motion(file: Path, tmp_path: Path) -> None:
    assert document("view", file, "--html", tmp_path / "turn.html")["scenes"] == ["reorientation"]


@pytest.mark.slow
def test_an_export_has_the_rates_of_the_joints(file: Path, tmp_path: Path) -> None:
    document("export", file, "-o", tmp_path / "turn.json", "--times", 2001)
    rows = json.loads((tmp_path / "turn.json").read_text())["trajectory"]
    times, joints = np.array(rows["time"]), np.array(rows["joints"])
    differences = np.gradient(joints, times, axis=0, edge_order=2)
    np.testing.assert_allclose(rows["joint_rates"], differences, atol=2e-4)


@pytest.mark.slow
def test_figures_show_the_motion(file: Path) -> None:
    figures = document("plot", file, "-o", file.parent / "figures")["figures"]
    assert "motion.pdf" in {Path(figure).name for figure in figures}
    assert all(Path(figure).stat().st_size > 0 for figure in figures)


@pytest.mark.slow
def test_too_short_a_time_ends_with_exit_code_1(file: Path, tmp_path: Path) -> None:
    found = document(*TURN, "--duration", 5, "--loops", 1, "-o", tmp_path / "late.h5", code=1)
    assert found["needed"]["duration"] > 5.0
    assert not ff.load(tmp_path / "late.h5").reached
    assert run("check", tmp_path / "late.h5").exit_code == 0


def test_a_negative_seed_is_refused() -> None:
    assert error(*TURN, "--seed", -1)["key"] == "seed"


def test_a_rotation_out_of_the_plane_is_refused() -> None:
    assert error(*TURN[:-4], 0.1305262, 0, 0, 0.9914449)["key"] == "to"
