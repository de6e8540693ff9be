"""Arms that slide, second arms and appendages held still: through the commands, and MuJoCo.

MuJoCo knows nothing of what is held: there every joint of the URDF moves, at the rates it is told.
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

from freefloat.cli.app import app
from freefloat.errors import InputError
from freefloat.io.results import load
from freefloat.io.scenario import load_scenario
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.visualization.visuals import robot_visuals
from tests.robots import inertial_text, joint_text, link_text

pytestmark = pytest.mark.usefixtures("kernels")

UPRIGHT = [0.0, 0.0, 0.0, 1.0]
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
"""In the plane: a turning and a prismatic joint, and a panel on a hinge."""
SLIDE_SCENARIO = """\
robot: {urdf: slide.urdf, end_effector: end_effector, held: {hinge: 0.9}}
task: planar-position
momentum: [0, 0, 0.4]
path:
  line: {from: [1.3, -0.2, 0], to: [1.2, 0.8, 0]}
timing: {law: quintic, duration: 20}
margin: {measure: system, fraction: 0.02}
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
search: {objective: nearest, from_attitude: [0, 0, 0, 1], samples: 16}
"""
"""An arm of six joints on a rail, a second one held still behind it."""


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
    problem = load_scenario(scenario).problem()
    attitude = np.array([0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2)])
    return integrate_motion(problem, attitude, problem.branches(attitude)[0].joints)


class Whole:
    """The robot in MuJoCo, every joint of the URDF there, none held."""

    def __init__(self, model: FreeFloatingModel) -> None:
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
        for name, value in model.held.items():
            self.data.qpos[self.model.joint(name).qposadr[0]] = value
        self.joints = [self.model.joint(name) for name in model.joint_names]
        self.root, self.tool = 1, self.model.body(model.end_effector).id

    def place(self, motion: Motion, t: float) -> None:
        """State and its two derivatives by time: of a polynomial through the motion there."""
        places = np.polynomial.chebyshev.chebpts1(15)
        rows = [np.concatenate([s.base_position, s.attitude, s.joints])
                for s in motion.sample(t + WINDOW * places)]  # fmt: skip
        fit = np.polynomial.chebyshev.chebfit(places, np.array(rows), 6)
        value, rate, bend = (
            np.polynomial.chebyshev.chebval(0.0, np.polynomial.chebyshev.chebder(fit, k))
            / WINDOW**k
            for k in range(3)
        )
        turn = Rotation.from_quat(value[3:7])
        self.data.qpos[:3], self.data.qpos[3:7] = value[:3], np.roll(turn.as_quat(), 1)
        for of, given in ((self.data.qvel, rate), (self.data.qacc, bend)):
            change, a = given[3:7], value[3:7]
            of[:] = 0.0  # what is held rests
            of[:3] = given[:3]
            of[3:6] = 2.0 * (a[3] * change[:3] - change[3] * a[:3] - np.cross(a[:3], change[:3]))
            for joint, number in zip(self.joints, given[7:], strict=True):
                of[joint.dofadr[0]] = number
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
        wanted = motion.problem.path.pose(float(t)).position
        assert np.allclose(whole.data.xpos[whole.tool], wanted, rtol=0, atol=1e-8)
    assert max(torques) > 1e-3
    assert max(wrenches) < 1e-4 * max(torques)


# ------------------------------------------------------------------------------------ in the plane


def test_a_sliding_arm_beside_a_held_panel_drifts_as_mujoco_says(slide: Path) -> None:
    motion = integrated(slide)
    assert motion.completed
    assert [body.prismatic for body in motion.problem.model.bodies] == [False, False, True]
    assert np.ptp(motion.joints[:, 1]) > 0.02, "it slides"
    assert_drifts(motion)


def test_where_a_panel_is_held_matters(slide: Path) -> None:
    """And a motion planned for one hinge is wrong for the other."""
    motion = integrated(slide)
    slide.write_text(SLIDE_SCENARIO.replace("hinge: 0.9", "hinge: -0.9"))
    other = integrated(slide)
    gap = other.final.joints - motion.final.joints
    assert np.abs(gap).max() > 1e-3
    with pytest.raises(AssertionError):
        assert_drifts_as_if(motion, other.problem.model)


def assert_drifts_as_if(motion: Motion, model: FreeFloatingModel) -> None:
    """The centre of mass rests in another robot, too."""
    whole = Whole(model)
    whole.place(motion, 0.5 * motion.final.time)
    mujoco.mj_forward(whole.model, whole.data)
    assert np.allclose(whole.data.subtree_com[whole.root], 0.0, rtol=0, atol=1e-6)


def test_a_sliding_arm_is_planned_shown_and_told(slide: Path, tmp_path: Path) -> None:
    plan, page = tmp_path / "plan.h5", tmp_path / "page.html"
    document = run("plan", slide, "-o", plan, "--html", page)
    assert document["feasible"]
    assert document["residuals"]["end_effector_position"] < 1e-7
    shown = run("view", plan, "--html", tmp_path / "view.html")
    assert Path(shown["html"]).stat().st_size > 100_000
    assert page.stat().st_size > 100_000
    workspace = run("workspace", slide)
    assert workspace["reach"][0] < 1.1 < workspace["reach"][1]
    told = run("info", slide)
    (sliding,) = (joint for joint in told["joints"] if joint["type"] == "prismatic")
    assert (sliding["lower"], sliding["upper"]) == (0.0, 1.2)


def test_a_result_file_remembers_what_was_held(slide: Path, tmp_path: Path) -> None:
    run("simulate", slide, "--heading", 10, "-o", tmp_path / "motion.h5")
    slide.unlink()
    again = load(tmp_path / "motion.h5").chosen.motion.problem.model
    assert again.held == {"hinge": 0.9}
    assert np.isclose(again.bodies[0].mass, 46.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("held", "key"),
    [
        ("{flap: 1}", "robot.held.flap"),
        ("{hing: 1}", "robot.held.hing"),
        ("{hinge: up}", "robot.held.hinge"),
        ("[1]", "robot.held"),
    ],
)
def test_what_cannot_be_held_is_refused(slide: Path, held: str, key: str) -> None:
    slide.write_text(SLIDE_SCENARIO.replace("{hinge: 0.9}", held))
    with pytest.raises(InputError) as caught:
        load_scenario(slide).problem()
    assert caught.value.key == key
    assert caught.value.source == str(slide)


# --------------------------------------------------------------------------------------- in space


def test_an_arm_on_a_rail_beside_a_held_arm_drifts_as_mujoco_says(rail: Path) -> None:
    motion = integrated(rail)
    model = motion.problem.model
    assert motion.completed
    assert model.joint_names[0] == "rail"
    assert model.dof == 7
    assert np.ptp(motion.joints[:, 0]) > 0.02, "the cart moves"
    assert_drifts(motion)


def test_the_second_arm_stands_where_it_is_held(rail: Path) -> None:
    model = load_scenario(rail).model()
    raised, place = 1.2, model.link_places["other_forearm_link"]
    assert place[0] == 0, "it is a part of the spacecraft"
    upper = model.link_places["other_upper_arm_link"][1]
    along = place[1].position - upper.position
    assert np.isclose(along[2], 0.425 * np.sin(raised), rtol=0, atol=1e-6)
    shown = [visual for visual in robot_visuals(model).shapes if visual.name.startswith("other_")]
    assert {visual.body for visual in shown} == {0}


@pytest.mark.slow
def test_an_arm_on_a_rail_is_planned_and_shown(rail: Path, tmp_path: Path) -> None:
    plan = tmp_path / "plan.h5"
    document = run("plan", rail, "-o", plan)
    assert document["feasible"]
    assert document["min_margin"]["kept"]
    assert document["residuals"]["end_effector_position"] < 1e-7
    run("view", plan, "--html", tmp_path / "view.html")
    written = run("assemble", rail, "-o", tmp_path / "rail_robot.urdf")
    assert {joint["name"]: joint["held"] for joint in written["joints"]}["other_elbow_joint"] == 1.0
