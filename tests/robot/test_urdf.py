"""URDF text to records: numbers, XML that is refused, lines, shapes; files that cannot be read."""

import io
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.errors import ModelError
from freefloat.robot.shapes import MeshFile
from freefloat.robot.urdf import parse_urdf
from freefloat.robot.validation import read_urdf
from tests.broken_robots import VALID
from tests.commands import error, run
from tests.errors import error_key
from tests.robots import inertial_text, joint_text, link_text

BUS = link_text("bus", inertial_text(100.0, 10.0 * np.eye(3)))
BALL = "<inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/>"


def one_joint(
    inertial: str = f"<inertial><mass value='5'/>{BALL}</inertial>", more: str = ""
) -> str:
    """A spacecraft with a single revolute link, whose ``<inertial>`` is given."""
    arm = link_text("arm", inertial + more) + joint_text("q", "C", "bus", "arm")
    return f"<robot name='r'>{BUS}{arm}</robot>"


def refused(urdf: str | Path) -> ModelError:
    with pytest.raises(ModelError) as caught:
        read_urdf(urdf)
    return caught.value


HEADS = {
    "an empty line": "\n{}",
    "both": "\ufeff \r\n\t{}",
    "a comment before the declaration": "<!-- servicer\n  of 2026 -->\n{}",
}


@pytest.mark.parametrize("head", HEADS.values(), ids=HEADS)
def test_what_precedes_a_robot_is_no_matter(head: str, tmp_path: Path) -> None:
    text = head.format('<?xml version="1.0" encoding="utf-8"?>\n') + one_joint()
    (tmp_path / "robot.urdf").write_bytes(text.encode())
    for urdf in (text, tmp_path / "robot.urdf"):
        assert read_urdf(urdf).links[1].mass == 5.0
        wrong = text.replace("<mass value='5'", "<mass value='5 kg'")
        (tmp_path / "wrong.urdf").write_bytes(wrong.encode())
        for refusal in (refused(wrong), refused(tmp_path / "wrong.urdf")):
            assert str(refusal.source) in ("URDF text", str(tmp_path / "wrong.urdf"))
            assert refusal.line == wrong[: wrong.index("5 kg")].count("\n") + 1


@pytest.mark.parametrize("prefix", ["", "u:"])
def test_a_namespace_of_all_elements_is_no_matter(prefix: str) -> None:
    other = '<d:rotor xmlns:d="http://drake.mit.edu/d" inertia="3"/>'
    text = one_joint(more=other)
    text = re.sub(r"<(/?)(?=[a-z]+[ />])", rf"<\1{prefix}", text)
    name = "xmlns" + f":{prefix}".rstrip(":")
    robot = read_urdf(text.replace("robot name", f'robot {name}="http://drake.mit.edu" name', 1))
    plain = read_urdf(one_joint())
    assert repr(robot.links) == repr(plain.links)
    assert [entry.element for entry in robot.not_read] == ["d:rotor of link arm"]
    assert yourdfpy.URDF.load(io.BytesIO(robot.text.encode())).validate()


@pytest.mark.parametrize(
    "text",
    ["<?xml version='1.0'?>\n<sdf version='1.7'><model name='m'/></sdf>", "<COLLADA/>", "",
     "<!doctype html><html>404</html>", "robot: {urdf: a.urdf}",
     "<robot><group name='arm'/></robot>", "<robot", "<robot/>"],
    ids=["sdf", "dae", "empty", "html", "yaml", "srdf", "open", "no links"],
)  # fmt: skip
def test_what_is_no_urdf_is_refused_by_its_name(text: str, tmp_path: Path) -> None:
    (tmp_path / "robot.sdf").write_text(text)
    known = {"sdf": "SDF", "COLLADA": "COLLADA", "html": "HTML", "group": "SRDF"}
    (name,) = [name for word, name in known.items() if f"<{word}" in text] or [""]
    assert name in refused(tmp_path / "robot.sdf").problem
    assert run("info", tmp_path / "robot.sdf").exit_code == 2


def test_prefixes_need_no_declaration() -> None:
    """As in Pinocchio's reader; what has them is listed."""
    limit = '<limit drake:acceleration="3" isaac:stiffness="1"'
    text = VALID.replace("<limit", limit, 1).replace("</robot>", "<drake:filter/></robot>")
    assert pin.buildModelFromXML(text).nv == 2
    entries = [(entry.element, entry.attribute) for entry in read_urdf(text).not_read]
    assert ("drake:filter", "") in entries
    assert sum("acceleration" in attribute for _, attribute in entries) == 1
    many = "".join(f"<p{number}:a/>" for number in range(2000))
    assert error_key(read_urdf, VALID.replace("</robot>", f"{many}</robot>")) == "urdf"


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    (tmp_path / "photo.urdf").write_bytes(b"\xff\xd8\xff\xe0")
    for path in (tmp_path / "gone.urdf", tmp_path, tmp_path / "photo.urdf"):
        assert refused(path).key == "urdf"


@pytest.mark.parametrize("encoding", ["ISO-8859-1", "iso-8859-15", "windows-1252", "UTF-16"])
def test_a_file_is_read_in_the_encoding_that_it_declares(encoding: str, tmp_path: Path) -> None:
    """A link is called by a German word; the robot is the one of the file in UTF-8."""
    links = link_text("bus", inertial_text(9.0, np.eye(3))) + link_text("Größe")
    text = f'<robot name="arm">{links}{joint_text("q", "C", "bus", "Größe")}</robot>'
    plain, other = tmp_path / "plain.urdf", tmp_path / "other.urdf"
    plain.write_text(text, encoding="utf-8")
    declared = f"<?xml version='1.0' encoding='{encoding}'?>\n{text}"
    other.write_bytes(declared.encode(encoding))
    assert read_urdf(other).text == read_urdf(plain).text
    for wrong in ("UTF-8", "iso-8859-99", "idna"):
        other.write_bytes(declared.replace(encoding, wrong).encode("latin-1"))
        assert error("info", other)["key"] == "urdf"


def test_shapes_have_geometry_pose_colour_and_line() -> None:
    shapes = """<visual><origin xyz='1 2 3' rpy='0.1 0.2 0.3'/>
      <geometry><box size='1 2 3'/></geometry><material name='red'/></visual>
    <visual><geometry><cylinder radius='1' length='2'/></geometry>
      <material name='x'><color rgba='0 2 0 1'/></material></visual>
    <collision><geometry><sphere radius='0.5'/></geometry></collision>
    <collision><geometry><mesh filename='a.stl' scale='1 1 -1'/></geometry></collision>
    <collision><geometry><capsule/></geometry></collision>
    <collision><geometry><box size='1 0 1'/></geometry></collision>"""
    red = "<material name='red'><color rgba='1 0 0 1'/></material></robot>"
    arm = parse_urdf(one_joint(more=shapes).replace("</robot>", red)).links_by_name["arm"]
    box, cylinder = arm.visuals
    assert isinstance(box.geometry, ff.Box)
    np.testing.assert_array_equal(box.geometry.size, [1, 2, 3])
    np.testing.assert_array_equal(box.origin.position, [1, 2, 3])
    rotation = Rotation.from_euler("xyz", [0.1, 0.2, 0.3]).as_matrix()
    np.testing.assert_allclose(box.origin.rotation, rotation, atol=1e-15)
    assert (box.colour, box.line) == ((1.0, 0.0, 0.0, 1.0), 3)
    assert cylinder.geometry == ff.Cylinder(1.0, 2.0)
    assert cylinder.colour == (0.0, 1.0, 0.0, 1.0)
    geometries = [shape.geometry for shape in arm.collisions]
    assert geometries == [ff.Sphere(0.5), MeshFile("a.stl", (1.0, 1.0, -1.0)), None, None]
