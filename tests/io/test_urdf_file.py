"""Robots put together and written: what the file says, and what follows from another robot."""

from __future__ import annotations

import json
import shutil
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import trimesh
import yaml
import yourdfpy
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from freefloat.cli.app import app
from freefloat.errors import InputError
from freefloat.io.scenario import load_robot, load_scenario
from freefloat.io.urdf_file import write_urdf
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import EXAMPLE, find_robot
from tests.robots import inertial_text, joint_text, link_text, random_robot

pytestmark = pytest.mark.usefixtures("kernels")

IDENTITY = [0.0, 0.0, 0.0, 1.0]
UR5 = f"{EXAMPLE}ur5"
CRAFT = (
    *("--mass", "200", "--inertia", "35,1,-2,30,0.5,28", "--com", "0.02", "-0.03", "0.05"),
    *("--size", "1", "1", "1", "--mount", "0.1", "0.2", "0.5", "0.4", "-0.7", "1.1"),
)
LOAD = ("--payload-mass", "50", "--payload-inertia", "3,0.1,0,0.1,3,0,0,0,2",
        "--payload-com", "0.1", "0", "0.4")  # fmt: skip


@dataclass(frozen=True)
class Lump:
    """A rigid body: mass, centre of mass, inertia about it, all in one frame."""

    mass: float
    centre: np.ndarray
    inertia: np.ndarray

    def at(self, xyz: Any, turn: np.ndarray) -> Lump:
        """Seen from the frame in which its own stands there."""
        return Lump(self.mass, xyz + turn @ self.centre, turn @ self.inertia @ turn.T)


def together(*lumps: Lump) -> Lump:
    """Several as one, by the parallel axes."""
    mass = sum(lump.mass for lump in lumps)
    centre = sum(lump.mass * lump.centre for lump in lumps) / mass
    inertia = np.zeros((3, 3))
    for lump in lumps:
        r = lump.centre - centre
        inertia += lump.inertia + lump.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return Lump(mass, centre, inertia)


def reckoned(urdf: str | Path) -> Lump:
    """A URDF at zero, link by link, through yourdfpy's kinematics."""
    robot = yourdfpy.URDF.load(str(urdf), load_meshes=False)
    lumps = []
    for link in robot.robot.links:
        if link.inertial is None or not link.inertial.mass:
            continue
        T = robot.get_transform(link.name)
        if link.inertial.origin is not None:
            T = T @ link.inertial.origin
        own = Lump(link.inertial.mass, np.zeros(3), np.asarray(link.inertial.inertia))
        lumps.append(own.at(T[:3, 3], T[:3, :3]))
    return together(*lumps)


def turned(roll: float, pitch: float, yaw: float) -> np.ndarray:
    return np.asarray(Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix())


def run(*words: str) -> dict[str, Any]:
    result = CliRunner().invoke(app, [*words, "--json"])
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert isinstance(document, dict)
    return document


def refused(*words: str) -> dict[str, Any]:
    result = CliRunner().invoke(app, [*words, "--json"])
    assert result.exit_code == 2, result.output
    return dict(json.loads(result.stdout)["error"])


def assert_same(document: dict[str, Any], wanted: Lump) -> None:
    assert np.isclose(document["total_mass"], wanted.mass, rtol=1e-12)
    assert np.allclose(document["centre_of_mass"], wanted.centre, rtol=0, atol=1e-12)
    scale = np.abs(wanted.inertia).max()
    assert np.allclose(document["inertia"], wanted.inertia, rtol=0, atol=1e-12 * scale)


# ---------------------------------------------------------------------------------- the command


def test_the_file_weighs_what_its_parts_weigh(tmp_path: Path) -> None:
    """Total mass, centre of mass and inertia of the reloaded URDF are the sum of the parts'."""
    file, arm = tmp_path / "servicer.urdf", find_robot(UR5, Path())
    document = run("assemble", UR5, "-o", str(file), "--end-effector", "tool0", *CRAFT, *LOAD)
    mount, turn = np.array([0.1, 0.2, 0.5]), turned(0.4, -0.7, 1.1)
    bare = yourdfpy.URDF.load(str(arm), load_meshes=False)
    hand = bare.get_transform("tool0", bare.base_link)
    matrix = np.array([[35, 1, -2], [1, 30, 0.5], [-2, 0.5, 28]])
    craft = Lump(200.0, np.array([0.02, -0.03, 0.05]), matrix)
    load = np.array([[3, 0.1, 0], [0.1, 3, 0], [0, 0, 2]])
    held = Lump(50.0, np.array([0.1, 0, 0.4]), load).at(hand[:3, 3], hand[:3, :3])
    wanted = together(craft, reckoned(arm).at(mount, turn), held.at(mount, turn))
    assert_same(document, wanted)
    again = reckoned(file)
    model = pin.buildModelFromUrdf(str(file), pin.JointModelFreeFlyer())
    assert np.isclose(pin.computeTotalMass(model), wanted.mass, rtol=1e-12)
    assert np.isclose(again.mass, wanted.mass, rtol=1e-12)
    assert np.allclose(again.centre, wanted.centre, rtol=0, atol=1e-12)
    assert np.allclose(again.inertia, wanted.inertia, rtol=0, atol=1e-12 * 200.0)


def test_the_virtual_root_is_gone_and_the_arms_own_base_is_kept(tmp_path: Path) -> None:
    file = tmp_path / "servicer.urdf"
    document = run("assemble", UR5, "-o", str(file), "--end-effector", "tool0", *CRAFT)
    robot = ET.parse(file).getroot()
    links = [link.get("name") for link in robot.findall("link")]
    assert "world" not in links
    assert {"base_link", "spacecraft"} <= set(links)
    parents = {joint.find("child").get("link"): joint.find("parent").get("link")  # type: ignore[union-attr]
               for joint in robot.findall("joint")}  # fmt: skip
    assert parents["base_link"] == document["root"] == "spacecraft"
    (base,) = (link for link in robot.findall("link") if link.get("name") == "base_link")
    assert base.find("inertial/mass").get("value") == "4.0"  # type: ignore[union-attr]


def test_a_scenarios_robot_is_written_as_its_commands_see_it(tmp_path: Path) -> None:
    file = tmp_path / "servicer.urdf"
    document = run("assemble", "ur5_servicer/arc", "-o", str(file))
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
    document = run("assemble", str(alone), "-o", str(tmp_path / "out.urdf"))
    single = load_scenario("ur5_servicer/arc").model().total_mass
    assert np.isclose(document["total_mass"], single + 200.0, rtol=1e-12)
    assert np.isclose(reckoned(tmp_path / "out.urdf").mass, single + 200.0, rtol=1e-12)
    section["weight"] = 3
    alone.write_text(yaml.safe_dump({"robot": section}))
    error = refused("assemble", str(alone), "-o", str(tmp_path / "out.urdf"))
    assert (error["key"], error["file"]) == ("robot.weight", str(alone))


def test_what_does_not_fit_together_is_told_with_its_scenario(tmp_path: Path) -> None:
    section = yaml.safe_load(find_robot_scenario().read_text())["robot"]
    section["attached"] = [{"urdf": "planar_2dof", "link": "no_such"}]
    alone = tmp_path / "robot.yaml"
    alone.write_text(yaml.safe_dump({"robot": section}))
    error = refused("assemble", str(alone), "-o", str(tmp_path / "out.urdf"))
    assert (error["key"], error["file"]) == ("robot.attached.0.link", str(alone))


def find_robot_scenario() -> Path:
    return load_scenario("ur5_servicer/arc").source


def test_meshes_are_found_wherever_the_file_stands(tmp_path: Path) -> None:
    file = tmp_path / "here" / "servicer.urdf"
    file.parent.mkdir()
    document = run("assemble", UR5, "-o", str(file), "--end-effector", "tool0", *CRAFT)
    moved = tmp_path / "servicer.urdf"
    file.rename(moved)
    shown = {str(mesh.get("filename")) for mesh in ET.parse(moved).getroot().iter("mesh")}
    assert shown == set(document["meshes"])
    assert len(shown) == 14
    assert all(Path(name).is_absolute() and Path(name).is_file() for name in shown)


def test_copied_meshes_move_with_the_file(tmp_path: Path) -> None:
    folder = tmp_path / "here"
    folder.mkdir()
    run("assemble", UR5, "-o", str(folder / "servicer.urdf"), "--end-effector", "tool0", *CRAFT,
        "--copy-meshes")  # fmt: skip
    there = tmp_path / "there"
    folder.rename(there)
    shown = {str(mesh.get("filename")) for mesh in ET.parse(there / "servicer.urdf").iter("mesh")}
    assert len(shown) == 14
    assert all((there / name).is_file() and not Path(name).is_absolute() for name in shown)
    yourdfpy.URDF.load(str(there / "servicer.urdf"), load_meshes=True)


def test_meshes_of_the_same_name_stay_two(tmp_path: Path) -> None:
    names = []
    for size in (1.0, 2.0):
        folder = tmp_path / f"{size:g}"
        folder.mkdir()
        trimesh.creation.box((size, size, size)).export(folder / "part.stl")
        names.append(str(folder / "part.stl"))
    run("assemble", UR5, "-o", str(tmp_path / "out.urdf"), "--end-effector", "tool0",
        "--mass", "9", "--inertia", "1,1,1", "--mesh", names[0], "--payload-mass", "1",
        "--payload-inertia", "1,1,1", "--payload-mesh", names[1], "--copy-meshes")  # fmt: skip
    robot = ET.parse(tmp_path / "out.urdf").getroot()
    for link, edge in (("spacecraft", 1.0), ("payload", 2.0)):
        (mesh,) = robot.findall(f"link[@name='{link}']/collision/geometry/mesh")
        loaded: Any = trimesh.load(tmp_path / str(mesh.get("filename")))
        assert np.allclose(loaded.extents, edge)


def test_a_missing_mesh_is_told_and_left_as_it_is(tmp_path: Path) -> None:
    arm = tmp_path / "arm.urdf"
    shown = '<visual><geometry><mesh filename="gone.stl"/></geometry></visual>'
    arm.write_text(
        '<robot name="a">' + link_text("foot", inertial_text(9.0, np.eye(3)) + shown)
        + joint_text("q1", "R", "foot", "tip") + link_text("tip", inertial_text(5.0, np.eye(3)))
        + "</robot>"
    )  # fmt: skip
    document = run("assemble", str(arm), "-o", str(tmp_path / "out.urdf"), "--copy-meshes")
    assert [word for word in document["warnings"] if "gone.stl" in word and "no such file" in word]
    assert 'filename="gone.stl"' in (tmp_path / "out.urdf").read_text()
    assert not (tmp_path / "out_meshes").exists()


def test_two_arms_stand_on_one_spacecraft(tmp_path: Path) -> None:
    """The second arm's names are its own, its joints are held, its mass counts."""
    file = tmp_path / "two.urdf"
    second = ("--second-arm", UR5, "--second-mount", "0.5", "0", "0", "0", "1.5", "0")
    document = run("assemble", UR5, "-o", str(file), "--end-effector", "tool0", *CRAFT, *second)
    moves = {joint["name"]: joint["moves"] for joint in document["joints"]}
    assert sum(moves.values()) == 6
    assert all(name.startswith("second_") != moving for name, moving in moves.items())
    arm = reckoned(find_robot(UR5, Path()))
    craft = Lump(200.0, np.array([0.02, -0.03, 0.05]),
                 np.array([[35, 1, -2], [1, 30, 0.5], [-2, 0.5, 28]]))  # fmt: skip
    wanted = together(craft, arm.at(np.array([0.1, 0.2, 0.5]), turned(0.4, -0.7, 1.1)),
                      arm.at(np.array([0.5, 0, 0]), turned(0, 1.5, 0)))  # fmt: skip
    assert_same(document, wanted)


def test_a_tool_is_fixed_to_the_hand(tmp_path: Path) -> None:
    tool = tmp_path / "tool.urdf"
    tool.write_text(
        '<robot name="t">' + link_text("flange", inertial_text(2.0, 0.01 * np.eye(3), "0 0 0.1"))
        + joint_text("tip_joint", "F", "flange", "tip", "0 0 0.3") + link_text("tip") + "</robot>"
    )  # fmt: skip
    document = run("assemble", "ets_vii", "-o", str(tmp_path / "out.urdf"), "--tool", str(tool),
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
        ((UR5, "--end-effector", "tool0", "--mass", "3"), "spacecraft.inertia"),
        ((UR5, "--end-effector", "tool0", "--size", "1", "1", "1"), "spacecraft.mass"),
        ((UR5, "--end-effector", "tool0", "--mass", "3", "--inertia", "1,x"), "spacecraft.inertia"),
        ((UR5, "--end-effector", "tool0", "--mass", "3", "--inertia", "1,1"), "spacecraft.inertia"),
        ((UR5, "--end-effector", "tool9"), "end_effector"),
        ((UR5, "--mass", "3", "--inertia", "1,1,1"), "end_effector"),
        ((UR5, "--end-effector", "tool0", "--tool", "no_such"), "tool"),
        ((UR5, "--end-effector", "tool0", "--tool-mount", *"100000"), "tool"),
        ((UR5, "--end-effector", "tool0", "--second-mount", *"100000"), "second_arm"),
        ((UR5, "--end-effector", "tool0", "--mass", "3", "--inertia", "1,1,1",
          "--mount", *"000", "0", "90", "0"), "mount"),
        ((UR5, "--end-effector", "tool0", "--second-arm", UR5, "--second-mount", *"000", "0", "0",
          "45"), "second_mount"),
        (("ur55",), "urdf"),
        (("no/such.yaml",), "scenario"),
        ((UR5, "--end-effector", "tool0", "--payload-mass", "1", "--payload-inertia", "1,1,1",
          "--payload-mesh", "no_such.stl"), "payload.mesh"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(words: tuple[str, ...], key: str, tmp_path: Path) -> None:
    error = refused("assemble", *words, "-o", str(tmp_path / "out.urdf"))
    assert error["key"] == key
    assert not list(tmp_path.iterdir()), "nothing is left behind"


def test_a_missing_folder_is_an_input_error(tmp_path: Path) -> None:
    model = FreeFloatingModel.from_urdf("ets_vii")
    with pytest.raises(InputError) as caught:
        write_urdf(model, tmp_path / "none" / "out.urdf")
    assert caught.value.key == "output"


def test_the_table_tells_mass_and_joints(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["assemble", "ets_vii", "-o", str(tmp_path / "out.urdf")])
    assert result.exit_code == 0, result.output
    assert "2690.4 kg" in result.stdout
    assert all(f"q{number}" in result.stdout for number in range(1, 7))


# ------------------------------------------------------------------ another robot, another motion

LINE = {
    "line": {"from": [0.4, 0.0, 0.6], "to": [0.3, 0.2, 0.6]},
    "attitude": {"fixed": {"rpy": [0, np.pi / 2, 0]}},
}
"""Near enough for all of the robots below."""


def written(folder: Path, change: Callable[[dict[str, Any]], object]) -> Path:
    """The scenario of the UR5 along that line, with another robot."""
    content = yaml.safe_load(find_robot_scenario().read_text())
    content["path"], content["margin"] = LINE, {"measure": "gjm", "value": 0.001}
    content["search"] = {"objective": "margin", "samples": 128}
    change(content["robot"])
    file = folder / "line.yaml"
    file.write_text(yaml.safe_dump(content))
    return file


def followed(file: Path) -> Motion:
    """From the identity attitude, its first joint forwards and its elbow up."""
    problem = load_scenario(file).problem()
    branches = problem.branches(IDENTITY)
    near = min(branches, key=lambda one: abs(one.joints[0]) + abs(one.joints[2] - 1.5))
    return integrate_motion(problem, np.array(IDENTITY), near.joints)


CHANGES: dict[str, Callable[[dict[str, Any]], object]] = {
    "another mount": lambda robot: robot["spacecraft"]["mount"].update(
        xyz=[0.05, 0.02, 0.52], rpy=[0, 0, 0.1]
    ),
    "twice the mass": lambda robot: robot["spacecraft"].update(mass=400, inertia=[70, 70, 70]),
    "a load of 50 kg": lambda robot: robot.update(
        payload={"mass": 50, "inertia": [2, 2, 2], "com": [0, 0, 0.1]}
    ),
}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Motion:
    return followed(written(tmp_path_factory.mktemp("plain"), lambda robot: None))


@pytest.mark.parametrize("name", CHANGES)
def test_another_robot_moves_otherwise_and_its_motion_is_right(
    name: str, plain: Motion, tmp_path: Path
) -> None:
    motion = followed(written(tmp_path, CHANGES[name]))
    assert plain.completed
    assert motion.completed
    assert np.abs(motion.final.attitude - plain.final.attitude).max() > 1e-3
    for one in (plain, motion):
        residuals = one.residuals()
        assert residuals.end_effector_position < 1e-7
        assert (residuals.end_effector_attitude or 0.0) < 1e-7
        assert residuals.momentum < 1e-6


PLANAR = """\
robot:
  urdf: planar_2dof
  end_effector: end_effector
  spacecraft: {mass: 40, inertia: [7, 7, 7], mount: {xyz: [0, 0, 0]}}
task: planar-position
path:
  line: {from: [0.9, 0.1, 0], to: [0.7, 0.4, 0]}
timing: {law: quintic, duration: 30}
margin: {measure: system, fraction: 0.02}
"""
PLANAR_CHANGES = {
    "another mount": ("xyz: [0, 0, 0]", "xyz: [0.2, 0.1, 0], rpy: [0, 0, 0.5]"),
    "twice the mass": ("spacecraft:", "scale_mass: {spacecraft: 2}\n  spacecraft:"),
    "a load of 50 kg": ("spacecraft:", "payload: {mass: 50, inertia: [2, 2, 2]}\n  spacecraft:"),
}


@pytest.mark.parametrize("name", PLANAR_CHANGES)
def test_another_robot_is_planned_otherwise_and_proved(name: str, tmp_path: Path) -> None:
    """Another start, another margin; and its motion is right, too."""
    found = []
    for text in (PLANAR, PLANAR.replace(*PLANAR_CHANGES[name])):
        file = tmp_path / "line.yaml"
        file.write_text(text)
        found.append(run("plan", str(file)))
        assert found[-1]["feasible"]
        assert found[-1]["residuals"]["end_effector_position"] < 1e-7
        assert found[-1]["residuals"]["momentum"] < 1e-6
    margins = [one["min_margin"]["value"] for one in found]
    assert abs(margins[0] / margins[1] - 1.0) > 0.01
    starts = [[one["heading_deg"], *one["initial"]["joints"]] for one in found]
    assert np.abs(np.subtract(*starts)).max() > 0.01


def test_a_copy_of_the_file_is_the_same_robot(tmp_path: Path) -> None:
    """What ``assemble`` wrote is assembled again without change."""
    first, second = tmp_path / "first.urdf", tmp_path / "second.urdf"
    run("assemble", "ur5_servicer/arc", "-o", str(first))
    run("assemble", str(first), "-o", str(second), "--end-effector", "tool0")
    assert ET.canonicalize(first.read_text()) == ET.canonicalize(second.read_text())
    shutil.copy(second, tmp_path / "third.urdf")
    assert (
        load_robot("ur5_servicer/arc").total_mass
        == FreeFloatingModel.from_urdf(tmp_path / "third.urdf", "tool0").total_mass
    )


def test_random_arms_come_back_as_they_were(tmp_path: Path) -> None:
    for seed in range(8):
        arm = random_robot(np.random.default_rng(seed), "RCPF", "RF")
        (tmp_path / "arm.urdf").write_text(arm.text)
        document = run("assemble", str(tmp_path / "arm.urdf"), "-o", str(tmp_path / "out.urdf"),
                       "--end-effector", arm.tip, *CRAFT)  # fmt: skip
        wanted = together(
            Lump(200.0, np.array([0.02, -0.03, 0.05]),
                 np.array([[35, 1, -2], [1, 30, 0.5], [-2, 0.5, 28]])),
            reckoned(tmp_path / "arm.urdf").at(
                np.array([0.1, 0.2, 0.5]), turned(0.4, -0.7, 1.1)),
        )  # fmt: skip
        assert_same(document, wanted)
        kinds = {joint["name"]: joint["type"] for joint in document["joints"]}
        assert sorted(kinds.values()) == ["continuous", "prismatic", "revolute", "revolute"]
