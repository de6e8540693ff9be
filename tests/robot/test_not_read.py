"""What a URDF says and freefloat does not use: nothing is left out silently."""

import re
from pathlib import Path

import pytest

import freefloat as ff
from freefloat.robot.parts import Attachment
from freefloat.robot.validation import read_urdf
from tests.broken_robots import VALID
from tests.commands import document, run
from tests.spart_robots import ROBOTS, write_scenario

LIMIT = '<limit lower="-2" upper="2" effort="100" velocity="0.1"/>'
SHAPE = "<visual><geometry>{}</geometry></visual>"
UNUSED = {
    "damping": ("shoulder", '<dynamics damping="0.5" friction="0"/>', "damping"),
    "a soft limit": ("shoulder", '<safety_controller soft_upper_limit="1"/>', "soft_upper_limit"),
    "calibration": ("shoulder", '<calibration rising="0"/>', ""),
    "an unknown element of a joint": ("shoulder", "<hardware/>", ""),
    "a second limit": ("shoulder", '<limit lower="-1" upper="1"/>', ""),
    "a misspelt inertial": ("hand", '<intertial><mass value="3"/></intertial>', ""),
    "an origin of a link": ("hand", '<origin xyz="0 0 1"/>', ""),
    "contact": ("hand", '<contact><stiffness value="1e4"/></contact>', ""),
    "a second geometry": (
        "hand", SHAPE.format('<sphere radius="1"/><box size="1 1 1"/>'), ""),
    "a collision without geometry": ("hand", "<collision/>", ""),
    "a geometry without shape": ("hand", SHAPE.format(""), ""),
    "a quaternion before URDF 1.1": (
        "hand", '<visual><origin quat_xyzw="0 0 1 0"/><geometry><sphere radius="1"/></geometry>'
        "</visual>", "quat_xyzw"),
    "a flat box": ("hand", SHAPE.format('<box size="1 0 1"/>'), "size"),
    "a misspelt attribute": (
        "hand", '<visual><origin xzy="0 0 1"/><geometry><sphere radius="1"/></geometry></visual>',
        "xzy"),
    "text": (
        "hand", "<visual><origin>0 0 1</origin><geometry><sphere radius='1'/></geometry></visual>",
        ""),
    "of another program": ("hand", '<d:rotor xmlns:d="http://drake.mit.edu" inertia="3"/>', ""),
    "a transmission": ("", '<transmission name="t"><joint name="shoulder"/></transmission>', ""),
    "text behind an element": (
        "hand", "<visual><origin/> 7 kg <geometry><sphere radius='1'/></geometry></visual>", ""),
    "an element of damping": ("shoulder", "<dynamics><damping>3</damping></dynamics>", ""),
    "a group of collisions": (
        "hand", '<collision group="2"><geometry><sphere radius="1"/></geometry></collision>',
        "group"),
    "a geometry of a picture alone": ("hand", SHAPE.format("<verbose/>"), ""),
    "a plugin of Gazebo": (
        "", '<gazebo reference="upper"><plugin name="thruster"/></gazebo>', ""),
    "text for Gazebo": ("", "<gazebo>300 N thruster</gazebo>", ""),
    "a mass for Gazebo": ("", '<gazebo reference="upper" mass="3"/>', ""),
    "Gazebo": ("", '<gazebo reference="upper"><mu1>0.2</mu1></gazebo>', ""),
    "a sensor": ("", '<sensor name="camera"/>', ""),
}  # fmt: skip
HARMLESS = {
    "a colour": ("hand", "<visual><geometry><sphere radius='1'/></geometry><material name='red'>"
                 "<color rgba='1 0 0 1'/><texture filename='a.png'/></material></visual>"),
    "no damping": ("shoulder", '<dynamics damping="0.0" friction="0"/>'),
    "a colour of Gazebo": ("", '<gazebo reference="upper"><material>Red</material></gazebo>'),
    "the axis and limit of a fixed joint": ("tool", f"<axis xyz='0 0 1'/>{LIMIT}"),
    "a schema": ("hand", '<visual xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
                 'xsi:schemaLocation="a b"><geometry><sphere radius="1"/></geometry></visual>'),
}  # fmt: skip


def with_content(owner: str, content: str) -> str:
    """The valid robot with more in a link or joint, or, without owner, in the robot."""
    if not owner:
        return VALID.replace("</robot>", f"{content}\n</robot>")
    text = VALID.replace('<link name="hand"/>', '<link name="hand"></link>')
    tag = "link" if owner == "hand" else "joint"
    return re.sub(rf'(<{tag} name="{owner}".*?)(</{tag}>)', rf"\1\n{content}\2", text, count=1,
                  flags=re.DOTALL)  # fmt: skip


@pytest.mark.parametrize(("owner", "content", "attribute"), UNUSED.values(), ids=UNUSED)
def test_what_is_not_used_is_listed_once(owner: str, content: str, attribute: str) -> None:
    text = with_content(owner, content)
    (entry,) = read_urdf(text).not_read
    assert entry.attribute == attribute
    assert entry.line == text[: text.index(content)].count("\n") + 1
    assert owner in entry.element
    assert entry.meaning


@pytest.mark.parametrize(("owner", "content"), HARMLESS.values(), ids=HARMLESS)
def test_pictures_and_fixed_joints_lose_nothing(owner: str, content: str) -> None:
    assert read_urdf(with_content(owner, content)).not_read == ()


def test_limits_that_are_not_used_are_listed() -> None:
    for old, new, keys in (
        ('velocity="0.1"', 'velocity="0.1" deceleration="2" jerk="9"', ["deceleration"]),
        ('effort="100"', 'effort="0"', ["effort"]),
        ('type="revolute"', 'type="continuous"', ["lower", "upper"]),
    ):
        entries = read_urdf(VALID.replace(old, new, 1)).not_read
        assert [entry.attribute for entry in entries] == keys
        assert {entry.element for entry in entries} == {"limit of joint shoulder"}


def test_text_between_links_is_listed() -> None:
    (entry,) = read_urdf(with_content("", "the mass is 300 kg")).not_read
    assert entry.element.startswith("robot")


def test_the_shape_is_the_known_element_of_the_first_geometry() -> None:
    for content, radii, listed in (
        ('<plane/><sphere radius="1"/>', [1.0], ["plane"]),
        ('<verbose/><sphere radius="1"/>', [1.0], []),
        ('<sphere radius="1"/></geometry><geometry><box size="1 1 1"/>', [1.0], ["geometry"]),
        ('</geometry><geometry><sphere radius="1"/>', [], ["geometry", "geometry"]),
    ):
        model = ff.FreeFloatingModel.from_urdf(with_content("hand", SHAPE.format(content)), "hand")
        shapes = [shape.geometry for shape in model.description.links_by_name["hand"].shapes]
        assert [shape.radius for shape in shapes if isinstance(shape, ff.Sphere)] == radii
        assert [entry.element.split()[0] for entry in model.not_read] == listed


def test_parts_of_an_assembly_are_listed_with_it() -> None:
    damped = with_content("shoulder", '<dynamics damping="0.5"/>')
    tool = Attachment(with_content("hand", '<intertial mass="1"/>'), "hand", prefix="tool_")
    model = ff.FreeFloatingModel.from_urdf(damped, "hand", attached=[tool])
    elements = [entry.element for entry in model.not_read]
    assert elements == ["dynamics of joint shoulder", "intertial of link hand"]
    assert model.scaled(2.0).not_read == model.not_read


@pytest.mark.slow
def test_info_lists_and_simulate_counts_them(tmp_path: Path) -> None:
    text, axis = ROBOTS["no limits"], '<axis xyz="0 0 1"/></joint>\n<link name='
    damped = text.replace(axis, axis.replace("</joint>", '<dynamics damping="3"/></joint>'))
    scenario = write_scenario(tmp_path, "robot.urdf")
    for robot, lines in ((text, 0), (damped, 1)):
        (tmp_path / "robot.urdf").write_text(robot)
        shown = run("simulate", scenario, "--heading", 0).stdout
        assert len(re.findall(r"2 entries of its robot file are not used", shown)) == lines
        printed = document("info", tmp_path / "robot.urdf")["not_read"]
        assert len(printed) == 2 * lines
    assert printed[0].keys() == {"element", "attribute", "line", "meaning"}
    (line,) = re.findall("damping of <dynamics>.*", run("info", tmp_path / "robot.urdf").stdout)
    assert "joints J1, J2" in line
