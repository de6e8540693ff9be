"""Arms with prismatic joints, second arms and fixed appendages: through the commands, and MuJoCo.

In MuJoCo every joint of the URDF exists, also those that a scenario fixes.
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import freefloat as ff
from freefloat.cli.app import app
from freefloat.motion.motion import Motion
from tests.errors import error_key
from tests.robots import inertial_text, joint_text, link_text

pytestmark = pytest.mark.usefixtures("kernels")

WINDOW = 0.4
"""Half the time over which a motion is differentiated [s]."""

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
RAIL = (
    '<robot name="rail">'
    + link_text("bus", inertial_text(150.0, 20.0 * np.eye(3)))
    + joint_text("rail", "P", "bus", "cart", "0.5 0 0.1", axis="0 1 0", limits=(-0.6, 0.6))
    + link_text("cart", inertial_text(10.0, 0.3 * np.eye(3)))
    + "</robot>"
)
RAIL_SCENARIO = """\
robot:
  urdf: rail.urdf
  end_effector: tool0
  attached:
    - urdf: example-robot-data:ur5
      link: cart
      mount: {xyz: [0.1, 0, 0], rpy: [0, 1.5707963268, 0]}
    - {urdf: "example-robot-data:ur5", mount: {xyz: [-0.5, 0, 0]}, prefix: other_}
  held: {other_shoulder_lift_joint: -1.2, other_elbow_joint: 1.0}
task: pose
momentum: [0.2, -0.1, 0.3]
path:
  line: {from: [1.1, -0.3, 0.3], to: [1.1, 0.5, 0.4]}
  attitude: {fixed: {rpy: [0, 1.5707963268, 0]}}
timing: {law: quintic, duration: 30}
margin: {measure: gjm, value: 0.01}
"""
"""An arm of six joints on a rail, a second one fixed behind it."""


@pytest.fixture
def slide(tmp_path: Path) -> Path:
    (tmp_path / "slide.urdf").write_text(SLIDE)
    (tmp_path / "slide.yaml").write_text(SLIDE_SCENARIO)
    return tmp_path / "slide.yaml"


@pytest.fixture
def rail(tmp_path: Path) -> Path:
    (tmp_path / "rail.urdf").write_text(RAIL)
    (tmp_path / "rail.yaml").write_text(RAIL_SCENARIO)
    return tmp_path / "rail.yaml"


def run(*words: object) -> dict[str, Any]:
    result = CliRunner().invoke(app, [*map(str, words), "--json"])
    assert result.exit_code == 0, result.output
    return dict(json.loads(result.stdout))


def integrated(scenario: Path, heading: float = 0.0) -> Motion:
    problem = ff.load_scenario(scenario).problem()
    attitude = np.array([0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2)])
    return ff.integrate_motion(problem, attitude, problem.branches(attitude)[0].joints)


class Whole:
    """The robot in MuJoCo with every joint of the URDF."""

    def __init__(self, model: ff.FreeFloatingModel) -> None:
        robot = ET.fromstring(model.description.text)
        for link in robot.findall("link"):
            for shape in [*link.findall("visual"), *link.findall("collision")]:
                link.remove(shape)
        spec = mujoco.MjSpec.from_string(ET.tostring(robot, encoding="unicode"))
        spec.compiler.fusestatic = False
        spec.worldbody.first_body().add_freejoint()
        self.model = spec.compile()
        self.model.opt.gravity[:] = 0.0
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        self.data = mujoco.MjData(self.model)
        for name, value in model.fixed_joints.items():
            self.data.qpos[self.model.joint(name).qposadr[0]] = value
        self.joints = [self.model.joint(name) for name in model.joint_names]
        self.root, self.tool = 1, self.model.body(model.end_effector).id

    def place(self, motion: Motion, t: float) -> None:
        """State and its two derivatives by time: of a polynomial through the motion there."""
        places = np.polynomial.chebyshev.chebpts1(15)
        rows = [np.concatenate([s.base_position, s.attitude, s.joints])
                for s in motion.sample(t + WINDOW * places)]  # fmt: skip
        fit = np.polynomial.chebyshev.chebfit(places, np.array(rows), 6)
        value, rate, acceleration = (
            np.polynomial.chebyshev.chebval(0.0, np.polynomial.chebyshev.chebder(fit, k))
            / WINDOW**k
            for k in range(3)
        )
        attitude = Rotation.from_quat(value[3:7]).as_quat()
        self.data.qpos[:3], self.data.qpos[3:7] = value[:3], np.roll(attitude, 1)
        for target, source in ((self.data.qvel, rate), (self.data.qacc, acceleration)):
            change, a = source[3:7], value[3:7]
            target[:] = 0.0  # fixed joints rest
            target[:3] = source[:3]
            omega = 2.0 * (a[3] * change[:3] - change[3] * a[:3] - np.cross(a[:3], change[:3]))
            target[3:6] = omega
            for joint, number in zip(self.joints, source[7:], strict=True):
                target[joint.dofadr[0]] = number
        for joint, number in zip(self.joints, value[7:], strict=True):
            self.data.qpos[joint.qposadr[0]] = number


def assert_drifts(motion: Motion) -> None:
    """MuJoCo gives the momentum, the end-effector on the path, and no wrench on the base."""
    whole, end = Whole(motion.problem.model), motion.final.time
    wrenches, torques = [], []
    for t in np.linspace(0.1 * end, 0.9 * end, 9):
        whole.place(motion, float(t))
        mujoco.mj_inverse(whole.model, whole.data)
        wrenches.append(np.abs(whole.data.qfrc_inverse[:6]).max())
        torques.append(np.abs(whole.data.qfrc_inverse[6:]).max())
        mujoco.mj_forward(whole.model, whole.data)
        mujoco.mj_subtreeVel(whole.model, whole.data)
        assert np.allclose(whole.data.subtree_com[whole.root], 0.0, rtol=0, atol=1e-9)
        assert np.allclose(whole.data.subtree_linvel[whole.root], 0.0, rtol=0, atol=1e-7)
        momentum = whole.data.subtree_angmom[whole.root]
        assert np.allclose(momentum, motion.problem.momentum, rtol=0, atol=1e-6)
        target = motion.problem.path.pose(float(t)).position
        assert np.allclose(whole.data.xpos[whole.tool], target, rtol=0, atol=1e-8)
    assert max(torques) > 1e-3
    assert max(wrenches) < 1e-4 * max(torques)


# ------------------------------------------------------------------------------------ in the plane


def test_a_prismatic_arm_with_a_fixed_panel_agrees_with_mujoco(slide: Path) -> None:
    motion = integrated(slide)
    assert motion.completed
    assert [body.prismatic for body in motion.problem.model.bodies] == [False, False, True]
    assert np.ptp(motion.joints[:, 1]) > 0.02
    assert_drifts(motion)


def test_the_angle_of_a_fixed_panel_matters(slide: Path) -> None:
    """A motion planned for one hinge angle is wrong for the other."""
    motion = integrated(slide)
    slide.write_text(SLIDE_SCENARIO.replace("hinge: 0.9", "hinge: -0.9"))
    other = integrated(slide)
    gap = other.final.joints - motion.final.joints
    assert np.abs(gap).max() > 1e-3
    whole = Whole(other.problem.model)
    whole.place(motion, 0.5 * motion.final.time)
    mujoco.mj_forward(whole.model, whole.data)
    assert np.abs(whole.data.subtree_com[whole.root]).max() > 1e-6


@pytest.mark.slow
def test_a_prismatic_arm_is_planned(slide: Path, tmp_path: Path) -> None:
    """The plan file contains the robot with its fixed hinge."""
    document = run("plan", slide, "-o", tmp_path / "plan.h5")
    assert document["feasible"]
    assert document["residuals"]["end_effector_position"] < 1e-7
    workspace = run("workspace", slide)
    assert workspace["reach"][0] < 1.1 < workspace["reach"][1]
    (prismatic,) = (joint for joint in run("info", slide)["joints"] if joint["type"] == "prismatic")
    assert (prismatic["lower"], prismatic["upper"]) == (0.0, 1.2)
    slide.unlink()
    again = ff.load(tmp_path / "plan.h5").problem.model
    assert again.fixed_joints == {"hinge": 0.9}
    assert np.isclose(again.bodies[0].mass, 46.0, rtol=1e-12)


def test_invalid_fixed_joints_raise(slide: Path) -> None:
    slide.write_text(SLIDE_SCENARIO.replace("{hinge: 0.9}", "{hing: 1}"))
    assert error_key(ff.load_scenario(slide).problem) == "robot.held.hing"


# --------------------------------------------------------------------------------------- in space


def test_an_arm_on_a_rail_with_a_fixed_arm_agrees_with_mujoco(rail: Path) -> None:
    motion = integrated(rail)
    model = motion.problem.model
    assert motion.completed
    assert model.joint_names[0] == "rail"
    assert model.dof == 7
    assert np.ptp(motion.joints[:, 0]) > 0.02
    assert motion.residuals().end_effector_position < 1e-7
    assert_drifts(motion)
