"""Planar arms about other directions than z, and frames of paths, in commands."""

from pathlib import Path

import pytest

import freefloat as ff
from tests.commands import document, error, run
from tests.robots import joint_text, planar_robot

TABLE = [40, 4, 3], [6.667, 0.333, 0.25], [0.5, 0.5], [0.5, 0.5, 0.5]
"""The arm 40/4/3 of Papadopoulos and Dubowsky."""
LINE = """
robot: {{urdf: arm.urdf, end_effector: end_effector}}
task: planar-position
momentum: [0, 0.2, 0]
path:
  line: {{from: [1.2, {0}, 0.8], to: [1.0, {0}, 1.0]}}
timing: {{duration: 30}}
margin: {{measure: gjm, value: 0.05}}
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """A line in the x-z plane, and beside it an arm about y."""
    (tmp_path / "arm.urdf").write_text(planar_robot(*TABLE, axis="0 1 0"))
    path = tmp_path / "line.yaml"
    path.write_text(LINE.format(0))
    return path


def test_info_names_the_plane_of_an_arm(scenario: Path) -> None:
    about_y = document("info", scenario.with_name("arm.urdf"), "--joints", "0.3,0.7")
    assert about_y["task"] == "planar-position"
    assert about_y["plane"] == {"name": "x-z plane", "normal": [0.0, 1.0, 0.0]}
    measures = about_y["configuration"]["measures"]
    assert abs(measures["gjm"]) == pytest.approx(0.19041257069102024)
    assert "headings are about y" in run("info", scenario).stdout
    assert document("info", "spatial_6dof")["plane"] is None


@pytest.mark.slow
def test_commands_plan_and_verify_arms_about_y(scenario: Path) -> None:
    plan, motion = scenario.with_name("plan.h5"), scenario.with_name("motion.h5")
    planned = document("plan", scenario, "-o", plan)
    x, y, z, _ = planned["initial"]["attitude"]
    assert (x, z) == (0.0, 0.0)
    assert y != 0.0
    assert "about y" in run("map", scenario, "--samples", 32).stdout
    heading = planned["heading_deg"]
    document("simulate", scenario, "--heading", heading, "-o", motion)
    for file in (plan, motion):
        assert run("check", file).exit_code == 0
    assert run("view", plan, "-o", scenario.with_name("page.html")).exit_code == 0


def test_paths_out_of_the_plane_and_other_attitudes_are_refused(scenario: Path) -> None:
    turned = ("simulate", scenario, "--attitude", 0, 0, 0.6, 0.8)
    assert error(*turned)["key"] == "attitude"
    scenario.write_text(LINE.format(0.1))
    refused = error("plan", scenario)
    assert refused["key"] == "path"
    assert "y = 0.1 m at s = 0" in refused["message"]


@pytest.mark.slow
def test_info_and_workspace_state_one_reach() -> None:
    regions, summary = (document(word, "planar_2dof/line") for word in ("workspace", "info"))
    assert regions["point"] == "end-effector"
    assert summary["reach"] == pytest.approx(regions["reach"], abs=1e-6)
    assert summary["reach"][1] <= summary["reach_bound"] + 1e-9


def test_links_of_the_spacecraft_are_frames_of_paths(scenario: Path) -> None:
    """The root link's is that of the spacecraft; other links have their own, arms have none."""
    boom = '<link name="boom"/>' + joint_text("b", "F", "bus", "boom", "0 0 0.3")
    robot = scenario.with_name("arm.urdf")
    robot.write_text(robot.read_text().replace("</robot>", boom + "</robot>"))
    present = "\nsearch: {joints: [0.3, 0.7]}\n"
    starts = {}
    for frame in ("spacecraft", "bus", "boom"):
        path = f"path:\n  frame: {frame}"
        scenario.write_text(LINE.format(0).replace("path:", path) + present)
        starts[frame] = ff.load_scenario(scenario).problem().path.path.curve(0.0)
    assert starts["bus"].tolist() == starts["spacecraft"].tolist()
    assert (starts["boom"] - starts["bus"]).tolist() == pytest.approx([0.0, 0.0, 0.3])
    for frame in ("a", "buss"):
        scenario.write_text(LINE.format(0).replace("path:", f"path:\n  frame: {frame}") + present)
        refused = error("plan", scenario)
        assert refused["key"] == "path.frame"
        assert "bus" in refused["message"]
