"""``freefloat reorient``: its document, its file, and how that is checked and played."""

from __future__ import annotations

from pathlib import Path

import pytest

import freefloat as ff
from tests.commands import document, run

TURN = ("reorient", "planar_2dof/line", "--from", 0, 0, 0, 1, "--to", 0, 0, 0.1305262, 0.9914449)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("reorient") / "turn.h5"
    found = document(*TURN, "-o", path)
    assert found["feasible"]
    assert found["error"] < 1e-9
    assert found["final"]["joints"] == pytest.approx(found["initial"]["joints"], abs=1e-12)
    return path


@pytest.mark.slow
def test_a_file_is_verified_with_mujoco(file: Path) -> None:
    assert document("check", file, "--engine", "mujoco")["proved"]
    assert run("retime", file).exit_code == 2  # it lasts as short as limits permit


@pytest.mark.slow
def test_too_short_a_time_ends_with_exit_code_1(tmp_path: Path) -> None:
    text = run("models", "planar_2dof/line").stdout
    scenario = tmp_path / "facing.yaml"
    scenario.write_text(f"{text}search: {{from_attitude: [0, 0, 0, 1]}}\n")
    turn = ("reorient", scenario, *TURN[TURN.index("--to") :], "--duration", 5)
    found = document(*turn, "-o", tmp_path / "late.h5", code=1)
    assert found["needed"]["duration"] > 5.0
    assert not ff.load(tmp_path / "late.h5").feasible
    assert run("check", tmp_path / "late.h5").exit_code == 1
