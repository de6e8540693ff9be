"""URDF files of assembled robots."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yaml
import yourdfpy
from scipy.spatial.transform import Rotation

from freefloat.io.scenario.scenario import load_scenario
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import find_robot
from freefloat.robot.robot_packages import EXAMPLE
from tests import commands
from tests.robots import inertial_text, joint_text, link_text

UR5 = f"{EXAMPLE}ur5"
CRAFT = (
    *("--mass", "200", "--inertia", "35,1,-2,30,0.5,28", "--com", "0.02", "-0.03", "0.05"),
    *("--size", "1", "1", "1", "--mount", "0.1", "0.2", "0.5", "0.4", "-0.7", "1.1"),
)
LOAD = ("--payload-mass", "50", "--payload-inertia", "3,0.1,0,0.1,3,0,0,0,2",
        "--payload-com", "0.1", "0", "0.4")  # fmt: skip


@dataclass(frozen=True)
class RigidBody:
    """A rigid body: mass, centre of mass, inertia about it, all in one frame."""

    mass: float
    centre: np.ndarray
    inertia: np.ndarray

    def at(self, xyz: Any, R: np.ndarray) -> RigidBody:
        """The body in a frame in which its frame has this pose."""
        return RigidBody(self.mass, xyz + R @ self.centre, R @ self.inertia @ R.T)


def combined(*bodies: RigidBody) -> RigidBody:
    """Rigid bodies fixed to each other, by the parallel axis theorem."""
    mass = sum(body.mass for body in bodies)
    centre = sum(body.mass * body.centre for body in bodies) / mass
    inertia = np.zeros((3, 3))
    for body in bodies:
        r = body.centre - centre
        inertia += body.inertia + body.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return RigidBody(mass, centre, inertia)


def rigid_body(urdf: str | Path) -> RigidBody:
    """Rigid body of a URDF, joints at zero, by yourdfpy's kinematics."""
    robot = yourdfpy.URDF.load(str(urdf), load_meshes=False)
    bodies = []
    for link in robot.robot.links:
        if link.inertial is None or not link.inertial.mass:
            continue
        T = robot.get_transform(link.name)
        if link.inertial.origin is not None:
            T = T @ link.inertial.origin
        body = RigidBody(link.inertial.mass, np.zeros(3), np.asarray(link.inertial.inertia))
        bodies.append(body.at(T[:3, 3], T[:3, :3]))
    return combined(*bodies)


def craft() -> RigidBody:
    """The spacecraft of CRAFT."""
    inertia = np.array([[35, 1, -2], [1, 30, 0.5], [-2, 0.5, 28]])
    return RigidBody(200.0, np.array([0.02, -0.03, 0.05]), inertia)


def mount() -> tuple[np.ndarray, np.ndarray]:
    """The mount of CRAFT."""
    return np.array([0.1, 0.2, 0.5]), rpy(0.4, -0.7, 1.1)


def rpy(roll: float, pitch: float, yaw: float) -> np.ndarray:
    return np.asarray(Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix())


def assembled(*words: object) -> dict[str, Any]:
    return commands.document("assemble", *words)


def assert_same(document: dict[str, Any], wanted: RigidBody) -> None:
    assert np.isclose(document["total_mass"], wanted.mass, rtol=1e-12)
    assert np.allclose(document["centre_of_mass"], wanted.centre, rtol=0, atol=1e-12)
    scale = np.abs(wanted.inertia).max()
    assert np.allclose(document["inertia"], wanted.inertia, rtol=0, atol=1e-12 * scale)


def test_the_file_weighs_what_its_parts_weigh(tmp_path: Path) -> None:
    """Total mass, centre of mass and inertia of the reloaded URDF are the sum of the parts'."""
    file, arm = tmp_path / "servicer.urdf", find_robot(UR5, Path())
    document = assembled(UR5, "-o", str(file), "--end-effector", "tool0", *CRAFT, *LOAD)
    bare = yourdfpy.URDF.load(str(arm), load_meshes=False)
    flange = bare.get_transform("tool0", bare.base_link)
    load = np.array([[3, 0.1, 0], [0.1, 3, 0], [0, 0, 2]])
    payload = RigidBody(50.0, np.array([0.1, 0, 0.4]), load).at(flange[:3, 3], flange[:3, :3])
    wanted = combined(craft(), rigid_body(arm).at(*mount()), payload.at(*mount()))
    assert_same(document, wanted)
    again = rigid_body(file)
    model = pin.buildModelFromUrdf(str(file), pin.JointModelFreeFlyer())
    assert np.isclose(pin.computeTotalMass(model), wanted.mass, rtol=1e-12)
    assert np.isclose(again.mass, wanted.mass, rtol=1e-12)
    assert np.allclose(again.centre, wanted.centre, rtol=0, atol=1e-12)
    assert np.allclose(again.inertia, wanted.inertia, rtol=0, atol=1e-12 * 200.0)


def test_a_scenarios_robot_is_written_as_its_commands_see_it(tmp_path: Path) -> None:
    file = tmp_path / "servicer.urdf"
    document = assembled("ur5_servicer/arc", "-o", str(file))
    wanted, loaded = (
        load_scenario("ur5_servicer/arc").model(),
        FreeFloatingModel.from_urdf(file, "tool0"),
    )
    assert loaded.joint_names == wanted.joint_names
    assert loaded.body_names[0] == "spacecraft"
    for ours, theirs in zip(loaded.bodies, wanted.bodies, strict=True):
        assert np.allclose(ours.placement.position, theirs.placement.position, rtol=0, atol=1e-15)
        assert np.allclose(ours.inertia, theirs.inertia, rtol=0, atol=1e-14)
    assert document["total_mass"] == wanted.total_mass
    assert [joint["name"] for joint in document["joints"]] == list(wanted.joint_names)


def test_a_file_may_say_nothing_but_its_robot(tmp_path: Path) -> None:
    section = yaml.safe_load(find_robot_scenario().read_text())["robot"]
    section["scale_mass"] = {"spacecraft": 2.0}
    alone = tmp_path / "robot.yaml"
    alone.write_text(yaml.safe_dump({"robot": section}))
    document = assembled(str(alone), "-o", str(tmp_path / "out.urdf"))
    single = load_scenario("ur5_servicer/arc").model().total_mass
    assert np.isclose(document["total_mass"], single + 200.0, rtol=1e-12)
    assert np.isclose(rigid_body(tmp_path / "out.urdf").mass, single + 200.0, rtol=1e-12)
    attached = [{"urdf": "planar_2dof", "link": "no_such"}]
    for change, key in (({"attached": attached}, "attached.0.link"), ({"weight": 3}, "weight")):
        alone.write_text(yaml.safe_dump({"robot": section | change}))
        error = commands.error("assemble", str(alone), "-o", str(tmp_path / "out.urdf"))
        assert (error["key"], error["file"]) == (f"robot.{key}", str(alone))


def find_robot_scenario() -> Path:
    return load_scenario("ur5_servicer/arc").source


@pytest.mark.parametrize("copied", [False, True])
def test_meshes_are_found_wherever_the_file_is(copied: bool, tmp_path: Path) -> None:
    """By absolute paths, or as copies that are moved with the file."""
    folder = tmp_path / "here"
    folder.mkdir()
    options = ["--copy-meshes"] if copied else []
    document = assembled(UR5, "-o", str(folder / "servicer.urdf"), "--end-effector", "tool0",
                   *CRAFT, *options)  # fmt: skip
    moved = folder.rename(tmp_path / "there")
    names = {str(mesh.get("filename")) for mesh in ET.parse(moved / "servicer.urdf").iter("mesh")}
    assert names == set(document["meshes"])
    assert len(names) == 14
    assert all((moved / name).is_file() and Path(name).is_absolute() != copied for name in names)


def test_a_second_arm_is_attached(tmp_path: Path) -> None:
    """Its names have a prefix, its joints are fixed, its mass counts."""
    file = tmp_path / "two.urdf"
    second = ("--second-arm", UR5, "--second-mount", "0.5", "0", "0", "0", "1.5", "0")
    document = assembled(UR5, "-o", str(file), "--end-effector", "tool0", *CRAFT, *second)
    moves = {joint["name"]: joint["moves"] for joint in document["joints"]}
    assert sum(moves.values()) == 6
    assert all(name.startswith("second_") != moving for name, moving in moves.items())
    arm = rigid_body(find_robot(UR5, Path()))
    second_arm = arm.at(np.array([0.5, 0, 0]), rpy(0, 1.5, 0))
    assert_same(document, combined(craft(), arm.at(*mount()), second_arm))


def test_a_tool_is_fixed_to_the_end_effector(tmp_path: Path) -> None:
    tool = tmp_path / "tool.urdf"
    tool.write_text(
        '<robot name="t">' + link_text("flange", inertial_text(2.0, 0.01 * np.eye(3), "0 0 0.1"))
        + joint_text("tip_joint", "F", "flange", "tip", "0 0 0.3") + link_text("tip") + "</robot>"
    )  # fmt: skip
    document = assembled("ets_vii", "-o", str(tmp_path / "out.urdf"), "--tool", str(tool),
                   "--tool-mount", "0", "0", "0", "0", "1.5707963267948966", "0")  # fmt: skip
    model = FreeFloatingModel.from_urdf(tmp_path / "out.urdf")
    assert document["end_effector"] == model.end_effector == "tool_tip"
    bare = FreeFloatingModel.from_urdf(find_robot("ets_vii", Path()))
    assert np.isclose(model.total_mass, bare.total_mass + 2.0, rtol=1e-12)
    gap = model.tool.position - bare.tool.position
    assert np.allclose(gap, [0.3, 0, 0], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("words", "key"),
    [
        (("ur5_servicer/arc", "--mass", "3", "--inertia", "1,1,1"), "options"),
        ((UR5, "--end-effector", "tool0", "--size", "1", "1", "1"), "spacecraft.mass"),
        ((UR5, "--mass", "3", "--inertia", "1,1,1"), "end_effector"),
        ((UR5, "--end-effector", "tool0", "--tool", "no_such"), "tool"),
        ((UR5, "--end-effector", "tool0", "--second-arm", UR5, "--second-mount", *"000", "0", "0",
          "45"), "second_mount"),
        ((UR5, "--end-effector", "tool0", "--payload-mass", "1", "--payload-inertia", "1,1,1",
          "--payload-mesh", "no_such.stl"), "payload.mesh"),
    ],
)  # fmt: skip
def test_invalid_options_are_refused(words: tuple[str, ...], key: str, tmp_path: Path) -> None:
    error = commands.error("assemble", *words, "-o", str(tmp_path / "out.urdf"))
    assert error["key"] == key
    assert not list(tmp_path.iterdir()), "nothing is left behind"
