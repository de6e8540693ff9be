"""An arm with a prismatic joint and a fixed appendage, repeated by MuJoCo."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from tests.commands import document
from tests.robots import inertial_text, joint_text, link_text

pytestmark = pytest.mark.usefixtures("kernels")


SLIDE = (
    '<robot name="slide">'
    + link_text("bus", inertial_text(40.0, 7.0 * np.eye(3)))
    + joint_text("q1", "C", "bus", "sleeve", "0.4 0 0")
    + link_text("sleeve", inertial_text(5.0, 0.4 * np.eye(3), "0.3 0 0"))
    + joint_text("q2", "P", "sleeve", "rod", "0.4 0 0", axis="1 0 0", limits=(0.0, 1.2))
    + link_text("rod", inertial_text(3.0, 0.3 * np.eye(3), "0.2 0 0"))
    + joint_text("tool", "F", "rod", "end_effector", "0.5 0 0")
    + link_text("end_effector")
    + joint_text("hinge", "R", "bus", "panel", "-0.5 0 0")
    + link_text("panel", inertial_text(6.0, 0.5 * np.eye(3), "-0.8 0 0"))
    + "</robot>"
)
"""In the plane: a revolute and a prismatic joint, and a panel on a hinge."""
SLIDE_SCENARIO = """\
robot: {urdf: slide.urdf, end_effector: end_effector, held: {hinge: 0.9}}
task: planar-position
momentum: [0, 0, 0.4]
path:
  line: {from: [1.3, -0.2, 0], to: [1.2, 0.8, 0]}
timing: {law: quintic, duration: 20}
margin: {measure: system, value: 1.0}
"""


@pytest.fixture
def slide(tmp_path: Path) -> Path:
    (tmp_path / "slide.urdf").write_text(SLIDE)
    (tmp_path / "slide.yaml").write_text(SLIDE_SCENARIO)
    return tmp_path / "slide.yaml"


@pytest.mark.slow
def test_a_prismatic_arm_with_a_fixed_panel_is_planned_and_checked(
    slide: Path, tmp_path: Path
) -> None:
    """The plan file contains the robot with its fixed hinge; MuJoCo repeats the motion."""
    plan = document("plan", slide, "-o", tmp_path / "plan.h5")
    assert plan["feasible"]
    checks = document("check", tmp_path / "plan.h5", "--engine", "mujoco")["checks"]
    assert {entry["passed"] for entry in checks if "mujoco" in entry["name"]} == {True}
    workspace = document("workspace", slide)
    assert workspace["reach"][0] < 1.1 < workspace["reach"][1]
    (prismatic,) = (
        joint for joint in document("info", slide)["joints"] if joint["type"] == "prismatic"
    )
    assert (prismatic["lower"], prismatic["upper"]) == (0.0, 1.2)
    slide.unlink()
    loaded = ff.load(tmp_path / "plan.h5")
    assert np.ptp(loaded.chosen.motion.joints[:, 1]) > 0.02
    again = loaded.problem.model
    assert again.fixed_joints == {"hinge": 0.9}
    assert np.isclose(again.bodies[0].mass, 46.0, rtol=1e-12)
