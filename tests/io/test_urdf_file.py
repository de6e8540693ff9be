"""URDF files of assembled robots."""

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yaml
import yourdfpy

from freefloat.dynamics.momentum import inertia_matrices
from freefloat.io.scenario.loading import load_scenario
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.named_files import EXAMPLE, find_robot
from freefloat.robot.parts import Mount, Payload, Spacecraft
from tests import commands
from tests.robot.test_model import with_gripper
from tests.robots import inertial_text, joint_text, link_text

UR5 = f"{EXAMPLE}ur5"
CRAFT: dict[str, Any] = {
    "mass": 200, "inertia": [[35, 1, -2], [1, 30, 0.5], [-2, 0.5, 28]], "com": [0.02, -0.03, 0.05],
    "size": [1, 1, 1], "mount": {"xyz": [0.1, 0.2, 0.5], "rpy": [0.4, -0.7, 1.1]},
}  # fmt: skip
LOAD = {"mass": 50, "inertia": [[3, 0.1, 0], [0.1, 3, 0], [0, 0, 2]], "com": [0.1, 0, 0.4]}
SPACECRAFT = Spacecraft(200.0, CRAFT["inertia"], Mount(**CRAFT["mount"]), com=CRAFT["com"])
PAYLOAD = Payload(50.0, LOAD["inertia"], LOAD["com"])
"""What CRAFT and LOAD say."""


def assembled(*words: object) -> dict[str, Any]:
    return commands.document("assemble", *words)


def assembled_parts(folder: Path, *words: object, **robot: Any) -> dict[str, Any]:
    """What is written to ``out.urdf`` of a robot section: a UR5 on CRAFT, unless it says more."""
    section = {"urdf": UR5, "end_effector": "tool0", "spacecraft": CRAFT} | robot
    (folder / "robot.yaml").write_text(yaml.safe_dump({"robot": section}))
    return assembled(folder / "robot.yaml", "-o", folder / "out.urdf", *words)


def assert_same(document: dict[str, Any], wanted: FreeFloatingModel) -> None:
    """Mass, centre of mass and inertia about it are those of a robot with its joints at zero."""
    joints = np.zeros(wanted.dof)
    centre = -wanted.base_position([0.0, 0.0, 0.0, 1.0], joints)
    inertia, _ = inertia_matrices(wanted, joints)
    assert np.isclose(document["total_mass"], wanted.total_mass, rtol=1e-12)
    assert np.allclose(document["centre_of_mass"], centre, rtol=0, atol=1e-12)
    scale = np.abs(inertia).max()
    assert np.allclose(document["inertia"], inertia, rtol=0, atol=1e-12 * scale)


def test_the_file_weighs_what_its_parts_weigh(tmp_path: Path) -> None:
    """By yourdfpy's masses and Pinocchio's; the inertia is that of the robot made in Python."""
    file, arm = tmp_path / "out.urdf", find_robot(UR5, Path())
    document = assembled_parts(tmp_path, payload=LOAD)
    wanted = FreeFloatingModel.from_urdf(arm, "tool0", spacecraft=SPACECRAFT, payload=PAYLOAD)
    for robot in (wanted, FreeFloatingModel.from_urdf(file, "tool0")):
        assert_same(document, robot)
    whole = pin.buildModelFromUrdf(str(file), pin.JointModelFreeFlyer())
    assert np.isclose(pin.computeTotalMass(whole), weight(arm) + 250.0, rtol=1e-12)


def weight(urdf: str | Path) -> float:
    """Mass of a URDF by yourdfpy."""
    links = yourdfpy.URDF.load(str(urdf), load_meshes=False).robot.links
    return sum(link.inertial.mass for link in links if link.inertial is not None)


def test_a_file_may_say_nothing_but_its_robot(tmp_path: Path) -> None:
    section = yaml.safe_load(load_scenario("ur5_servicer/arc").text)["robot"]
    section["scale_mass"] = {"spacecraft": 2.0}
    alone = tmp_path / "robot.yaml"
    alone.write_text(yaml.safe_dump({"robot": section}))
    document = assembled(str(alone), "-o", str(tmp_path / "out.urdf"))
    single = load_scenario("ur5_servicer/arc").model().total_mass
    assert np.isclose(document["total_mass"], single + 200.0, rtol=1e-12)
    assert np.isclose(weight(tmp_path / "out.urdf"), single + 200.0, rtol=1e-12)
    attached = [{"urdf": "planar_2dof", "link": "no_such"}]
    for change, key in (({"attached": attached}, "attached.0.link"), ({"weight": 3}, "weight")):
        alone.write_text(yaml.safe_dump({"robot": section | change}))
        error = commands.error("assemble", str(alone), "-o", str(tmp_path / "out.urdf"))
        assert (error["key"], error["file"]) == (f"robot.{key}", str(alone))


@pytest.mark.parametrize("copied", [False, True])
def test_meshes_are_found_wherever_the_file_is(copied: bool, tmp_path: Path) -> None:
    """By absolute paths, or as copies that are moved with the file."""
    folder = tmp_path / "here"
    folder.mkdir()
    options = ["--copy-meshes"] if copied else []
    document = assembled_parts(folder, *options)
    moved = folder.rename(tmp_path / "there")
    names = {str(mesh.get("filename")) for mesh in ET.parse(moved / "out.urdf").iter("mesh")}
    assert names == set(document["meshes"])
    assert len(names) == 14
    assert all((moved / name).is_file() and Path(name).is_absolute() != copied for name in names)


def test_held_joints_and_what_mimics_them_are_written_as_fixed(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(with_gripper())
    section = {"urdf": "arm.urdf", "end_effector": "hand", "held": {"q2": 0.4, "left": -0.25}}
    document = assembled_parts(tmp_path, **section)
    whole = pin.buildModelFromUrdf(str(tmp_path / "out.urdf"), pin.JointModelFreeFlyer())
    assert list(whole.names)[2:] == ["q1", "q3"]
    data, neutral = whole.createData(), pin.neutral(whole)
    pin.ccrba(whole, data, neutral, np.zeros(whole.nv))
    assert np.allclose(data.com[0], document["centre_of_mass"], rtol=0, atol=1e-12)
    assert np.allclose(data.Ig.inertia, document["inertia"], rtol=0, atol=1e-10)


def test_copies_of_meshes_of_the_same_name_keep_their_materials(tmp_path: Path) -> None:
    """Also where the name is a pattern of names."""
    shapes = ""
    for folder in ("red", "blue"):
        (tmp_path / folder).mkdir()
        for name in ("part[1]", "hull"):
            mesh = tmp_path / folder / f"{name}.obj"
            mesh.write_text(f"mtllib {name}.mtl\nusemtl paint\n# {folder}")
            mesh.with_suffix(".mtl").write_text(f"newmtl paint\n# {folder}")
            mesh.with_suffix(".stl").write_text(f"solid\n# {folder}")  # of the same stem
            for file in (mesh, mesh.with_suffix(".stl")):
                shapes += f'<visual><geometry><mesh filename="{file}"/></geometry></visual>'
    robot = find_robot("planar_2dof", Path()).read_text()
    link = '<link name="end_effector">'
    plain = tmp_path / "painted.urdf"
    plain.write_text(robot.replace(f"{link[:-1]}/>", f"{link}{shapes}</link>"))
    document = assembled_parts(
        tmp_path, "--copy-meshes", urdf=str(plain), end_effector="end_effector"
    )
    copies = [tmp_path / name for name in document["meshes"]]
    colours = [copy.read_text().partition("# ")[2] for copy in copies]
    assert sorted(colours) == ["blue"] * 4 + ["red"] * 4
    assert len({copy.parent for copy in copies}) == 2
    for copy, colour in zip(copies, colours, strict=True):
        assert copy.with_suffix(".mtl").read_text().endswith(colour)


def test_copies_of_meshes_replace_no_file(tmp_path: Path) -> None:
    assembled_parts(tmp_path)
    (tmp_path / "out_meshes").mkdir()
    precious = tmp_path / "precious.txt"
    precious.write_text("precious")
    (tmp_path / "out_meshes" / "base.dae").symlink_to(precious)
    words = "assemble", tmp_path / "robot.yaml", "-o", tmp_path / "out.urdf", "--copy-meshes"
    assert commands.error(*words)["key"] == "output"
    assert precious.read_text() == "precious"


def test_a_second_arm_is_attached(tmp_path: Path) -> None:
    """Its names have a prefix, its joints are fixed, its mass counts."""
    pose = {"xyz": [0.5, 0, 0], "rpy": [0, 1.5, 0]}
    second = {"urdf": UR5, "prefix": "second_", "mount": pose}
    document = assembled_parts(tmp_path, attached=[second])
    moves = {joint["name"]: joint["moves"] for joint in document["joints"]}
    assert sum(moves.values()) == 6
    assert all(name.startswith("second_") != moving for name, moving in moves.items())
    arms = 2.0 * weight(find_robot(UR5, Path()))
    assert document["total_mass"] == pytest.approx(arms + SPACECRAFT.mass, rel=1e-12)


@pytest.mark.parametrize(("words", "key"), [
    (("ur5_servicer/arc", "--mass", "3", "--inertia", "1,1,1"), "options"),
    ((UR5, "--end-effector", "tool0", "--size", "1", "1", "1"), "spacecraft.mass"),
    ((UR5, "--mass", "3", "--inertia", "1,1,1"), "end_effector"),
    ((UR5, "--end-effector", "tool0", "--mass", "3", "--inertia", "1,1,1", "--mount", *"000",
      "0", "0", "45"), "mount"),
])  # fmt: skip
def test_invalid_options_are_refused(words: tuple[str, ...], key: str, tmp_path: Path) -> None:
    error = commands.error("assemble", *words, "-o", str(tmp_path / "out.urdf"))
    assert error["key"] == key
    assert not list(tmp_path.iterdir()), "nothing is left behind"


def test_what_is_left_out_of_attached_files_is_named(tmp_path: Path) -> None:
    """What names links and joints of a tool beside them; that of the arm itself is kept."""

    def robot(name: str, more: str) -> Path:
        links = (link_text(f"{name}_{k}", inertial_text(2.0, np.eye(3))) for k in "ab")
        joint = joint_text(f"{name}_j", "C", f"{name}_a", f"{name}_b")
        file = tmp_path / f"{name}.urdf"
        file.write_text(f'<robot name="{name}">{"".join(links)}{joint}{more}</robot>')
        return file

    drive = '<transmission name="t"><joint name="{}_j"/></transmission>'
    arm, out = robot("arm", drive.format("arm")), tmp_path / "out.urdf"
    plain = robot("plain", "<!-- nothing else -->")
    other = robot("other", drive.format("other") + "<gazebo><mu1>3</mu1></gazebo>" * 2)
    whole = {"urdf": str(arm), "end_effector": "arm_b"}
    parts = [{"urdf": str(file), "prefix": f"{file.stem}_"} for file in (plain, other)]
    document = assembled_parts(tmp_path, **whole, attached=parts)
    (warning,) = (text for text in document["warnings"] if "left out" in text)
    assert warning.startswith(f"{other}: <transmission>, <gazebo> ")
    assert [element.tag for element in ET.parse(out).getroot()].count("transmission") == 1
    assert not any("left out" in text for text in assembled_parts(tmp_path, **whole)["warnings"])


@pytest.mark.parametrize("name", ["robot.yaml", "part.urdf"])
def test_no_file_of_the_robot_is_replaced(name: str, tmp_path: Path) -> None:
    part = tmp_path / "part.urdf"
    part.write_text(find_robot("planar_2dof", Path()).read_text())
    assembled_parts(tmp_path, attached=[{"urdf": part.name, "prefix": "tool_"}])
    before = (tmp_path / name).read_bytes()
    words = tmp_path / "robot.yaml", "-o", tmp_path / name
    assert commands.error("assemble", *words)["key"] == "output"
    assert (tmp_path / name).read_bytes() == before
