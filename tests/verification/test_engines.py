"""MuJoCo repeats motions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.engines.mujoco import MuJoCo
from freefloat.robot.bundled import find_robot
from tests.commands import document, run
from tests.robots import inertial_text, joint_text, link_text

STILL = {
    "robot": {"urdf": "planar_2dof", "end_effector": "tool"},
    "task": "planar-position",
    "path": {"line": {"from": [1.5, 0, 0], "to": [1.5000001, 0, 0]}},
    "timing": {"duration": 100},
    "margin": {"fraction": 0.01},
}
"""A system that practically rests."""


@pytest.mark.slow
def test_a_spacecraft_has_an_antenna_whose_inertia_mujoco_refuses(tmp_path: Path) -> None:
    file = tmp_path / "robot.urdf"
    inertia = 1e-12 * np.array([[2.0, 6.0, 0.0], [6.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
    antenna = link_text("antenna", inertial_text(1e-9, inertia))
    antenna += joint_text("mount", "F", "spacecraft", "antenna")
    text = find_robot("planar_2dof", tmp_path).read_text()
    file.write_text(text.replace("</robot>", f"{antenna}</robot>"))
    scenario = {**STILL, "robot": {"urdf": str(file), "end_effector": "tool"}}
    motion = ff.simulate(ff.load_scenario(scenario).problem(), heading=0.6).chosen.motion
    runs = MuJoCo().repeated(motion)
    assert runs.forward is not None
    assert runs.forward.attitude < 1e-6


@pytest.mark.slow
def test_the_command_names_the_engine(tmp_path: Path) -> None:
    file = tmp_path / "motion.h5"
    run("simulate", "planar_2dof/line", "--heading", 0, "-o", file)
    assert document("check", file, "--engine", "mujoco")["engine"]["name"] == "mujoco"
    assert document("check", file)["engine"] is None
