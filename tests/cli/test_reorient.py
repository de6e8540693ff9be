"""``freefloat reorient``: its document, its file, and how that is checked and played."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import freefloat as ff
from tests.commands import document, run

TURN = ("reorient", "planar_2dof/line", "--from", 0, 0, 0, 1, "--to", 0, 0, 0.1305262, 0.9914449)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("reorient") / "turn.h5"
    found = document(*TURN, "-o", path)
    assert found["reached"]
    assert found["turn_deg"] == pytest.approx(15.0, abs=1e-4)
    assert found["error"] < 1e-6
    return path


@pytest.mark.slow
def test_a_file_is_verified_with_mujoco(file: Path) -> None:
    assert document("check", file, "--engine", "mujoco")["proved"]


@pytest.mark.slow
def test_an_altered_loop_is_a_discrepancy(file: Path) -> None:
    loaded = ff.load(file)
    loops = ff.load(file).loops
    changed = type(loops)(loops.joints, 1.01 * loops.cosines, loops.sines, loops.count)
    altered = replace(loaded, motion=replace(loaded.motion, curve=changed))
    report = ff.check(altered)
    assert {entry.name for entry in report.discrepancies} >= {"integrated again", "final attitude"}


@pytest.mark.slow
def test_too_short_a_time_ends_with_exit_code_1(file: Path, tmp_path: Path) -> None:
    found = document(*TURN, "--duration", 5, "--loops", 1, "-o", tmp_path / "late.h5", code=1)
    assert found["needed"]["duration"] > 5.0
    assert not ff.load(tmp_path / "late.h5").reached
    assert run("check", tmp_path / "late.h5").exit_code == 0
