"""Bases that a URDF describes as free: a floating joint from a massless world, virtual joints."""

import itertools
import re
from functools import partial

import numpy as np
import pytest

import freefloat as ff
from freefloat.io.urdf_file import write_urdf
from freefloat.robot.validation import examine, read_urdf
from tests.errors import error_key
from tests.robots import Robot, inertial_text, joint_text, link_text, random_robot

FLOATING = joint_text("virtual", "F", "world", "bus").replace("fixed", "floating")
TINY = inertial_text(1e-6, 1e-9 * np.eye(3))
CRAFT = ff.Spacecraft(200.0, 30.0 * np.eye(3))
X, Y, Z = "1 0 0", "0 1 0", "0 0 1"


def robot() -> Robot:
    return random_robot(np.random.default_rng(5), "RRPR", "R", on_bus=True)


def within(more: str) -> str:
    """The robot with more links and joints."""
    return robot().text.replace("</robot>", f"{more}</robot>")


def virtual(kinds: str, axes: list[str], content: str = "", at: str = "0 0 0") -> str:
    """A massless world and joints in a row from it to the spacecraft."""
    names = ["world", *(f"v{number}" for number in range(1, len(kinds))), "bus"]
    links = [link_text("world"), *(link_text(name, content) for name in names[1:-1])]
    pairs = zip(kinds, itertools.pairwise(names), axes, strict=True)
    joints = [joint_text(f"j{child}", kind, parent, child, at, axis=axis)
              for kind, (parent, child), axis in pairs]  # fmt: skip
    return "".join([*links, *joints])


def planar(axis: str) -> str:
    """A planar joint to the spacecraft."""
    return joint_text("virtual", "R", "world", "bus", axis=axis).replace("revolute", "planar")


FREE = {
    "a floating joint": (link_text("world") + FLOATING, 0),
    "frames above it": (
        link_text("map") + link_text("world") + joint_text("m", "F", "map", "world") + FLOATING, 0),
    "with a placement": (link_text("world") + FLOATING.replace('"0 0 0"', '"1 2 3"', 1), 1),
    "six virtual joints": (virtual("PPPRRR", [X, Y, Z, X, Y, Z]), 12),
    "continuous ones, about z, y and x": (virtual("PPPCCC", [Y, X, Z, Z, Y, X]), 9),
    "rotations first": (virtual("RRRPPP", [X, Y, Z, X, Y, Z], at="0.1 0 0"), 12),
    "Euler angles z, x, z": (virtual("PPPRRR", [X, Y, Z, Z, X, Z]), 12),
    "half a turn of pitch": (re.sub(
        r'(name="jv5".*?<limit )[^>]*>',
        r'\1lower="-1.5708" upper="1.5708" effort="1" velocity="1"/>',
        virtual("PPPRRR", [X, Y, Z, Z, Y, X]), flags=re.DOTALL), 12),
}  # fmt: skip
"""Descriptions of a free base, and how many entries of them, such as ranges, are not used."""


@pytest.mark.parametrize(("base", "unused"), FREE.values(), ids=FREE)
def test_a_free_base_is_that_of_the_robot_without_it(base: str, unused: int) -> None:
    plain = robot().model()
    free = ff.FreeFloatingModel.from_urdf(within(base), robot().end_effector)
    assert repr(free.description.links) == repr(plain.description.links)
    assert free.joint_names == plain.joint_names
    assert free.warnings == plain.warnings
    assert len(free.not_read) == unused
    again = ff.FreeFloatingModel.from_urdf(free.description.text, robot().end_effector)
    assert again.joint_names == plain.joint_names


UNUSED = {
    "an axis": ('<axis xyz="0 0 1"/>', "axis of joint virtual", ""),
    "a limit": ('<limit lower="-1" upper="1" velocity="0.3"/>', "limit of joint virtual", ""),
    "damping": ('<dynamics damping="2"/>', "dynamics of joint virtual", "damping"),
    "an element of the world": ("<Inertial/>", "Inertial of link world", ""),
}


@pytest.mark.parametrize(("content", "element", "attribute"), UNUSED.values(), ids=UNUSED)
def test_what_a_floating_joint_and_its_world_say_is_listed(content, element, attribute):
    base = link_text("world") + FLOATING
    end = "</link>" if "world" in element else "</joint>"
    (entry,) = read_urdf(within(base.replace(end, f"{content}{end}"))).not_read
    assert (entry.element, entry.attribute) == (element, attribute)


def test_an_arm_with_a_free_base_is_mounted_by_its_base() -> None:
    plain, free = (ff.FreeFloatingModel.from_urdf(text, robot().end_effector, spacecraft=CRAFT)
                   for text in (robot().text, within(FREE["a floating joint"][0])))  # fmt: skip
    assert free.joint_names == plain.joint_names
    np.testing.assert_array_equal(free.bodies[0].inertia, plain.bodies[0].inertia)


@pytest.mark.parametrize(
    "base",
    [link_text("world") + planar(Z), virtual("PPC", [X, Y, Z]), virtual("CPP", [Z, Y, X]),
     link_text("world") + planar("0 0 -1")],
)  # fmt: skip
def test_a_planar_base_floats_on_a_table(base: str) -> None:
    found = ff.FreeFloatingModel.from_urdf(within(base), robot().end_effector)
    stated = robot().model(base="planar")
    assert (found.base, found.joint_names) == ("planar", stated.joint_names)
    q = np.linspace(-0.5, 0.5, found.dof)
    S, expected = (ff.generalized_jacobian(model, q, "position") for model in (found, stated))
    np.testing.assert_array_equal(S, expected)
    free = ff.FreeFloatingModel.from_urdf(within(base), robot().end_effector, base="free")
    assert free.base == "free"


def test_an_assembly_is_written_with_its_table(tmp_path) -> None:
    stated = robot().model(base="planar")
    written = write_urdf(stated, tmp_path / "robot.urdf")
    read = ff.FreeFloatingModel.from_urdf(written.file, robot().end_effector)
    assert (read.base, read.joint_names) == ("planar", stated.joint_names)
    free = robot().model()
    centre = -free.base_position([0.0, 0.0, 0.0, 1.0], np.zeros(free.dof))
    np.testing.assert_allclose(written.centre_of_mass, centre, atol=1e-14)


SIX = virtual("PPPRRR", [X, Y, Z, X, Y, Z])
MASSIVE = link_text("world", inertial_text(3.0, np.eye(3)))
BALL = "<visual><geometry><sphere radius='1'/></geometry></visual>"
REFUSED = {
    "a world with mass": (MASSIVE + FLOATING, "joint virtual"),
    "a placement in words": (
        link_text("world") + FLOATING.replace('"0 0 0"', '"1 2 x"', 1), "joint virtual"),
    "a world with shapes": (link_text("world", BALL) + FLOATING, "joint virtual"),
    "two floating joints": (
        link_text("world") + link_text("client") + FLOATING
        + FLOATING.replace("virtual", "other").replace('"bus"', '"client"'), "joint virtual"),
    "a joint beside it": (
        link_text("world") + link_text("door") + joint_text("hinge", "R", "world", "door")
        + FLOATING, "joint virtual"),
    "a planar joint about x": (link_text("world") + planar(X), "joint virtual"),
    "two planar joints": (
        link_text("world") + link_text("client") + planar(Z)
        + planar(Z).replace("virtual", "other").replace('"bus"', '"client"'), "joint virtual"),
    "virtual joints of an upright plane": (virtual("PPC", [X, Z, Y]), "joint jv1"),
    "parallel slides": (virtual("PPC", [X, X, Z]), "joint jv1"),
    "a base that turns only": (virtual("RRR", [X, Y, Z]), "joint jv1"),
    "virtual joints that do not span": (virtual("PPPRRR", [X, Y, X, X, Y, Z]), "joint jv1"),
    "virtual joints with tiny masses": (virtual("PPPRRR", [X, Y, Z, X, Y, Z], TINY), "joint jv1"),
    "one that follows another": (
        SIX.replace("</joint>", '<mimic joint="jv2"/></joint>', 1), "joint jv1"),
    "virtual joints with shapes": (virtual("PPPRRR", [X, Y, Z, X, Y, Z], BALL), "joint jv1"),
}  # fmt: skip


@pytest.mark.parametrize(
    ("joint", "limits"),
    [("jv3", (0, 0)), ("jv3", (-0.5, 0.5)), ("jv4", (0, 0)), ("jv5", (-1, 1)), ("jbus", (3, -3))],
)
def test_a_virtual_joint_of_a_narrow_range_is_refused_by_name(joint, limits):
    old = re.search(rf'name="{joint}".*?(<limit [^>]*>)', SIX, re.DOTALL)
    assert old is not None
    new = old[0].replace(old[1], '<limit lower="{}" upper="{}" effort="1" velocity="1"/>'.format(
        *limits))  # fmt: skip
    (fault, *_) = examine(within(SIX.replace(old[0], new)))
    assert (fault.element, fault.severity) == (f"joint {joint}", "error")
    assert f"from {limits[0]} to {limits[1]} " in fault.problem


@pytest.mark.parametrize(("base", "element"), REFUSED.values(), ids=REFUSED)
def test_another_base_is_refused(base: str, element: str) -> None:
    assert examine(within(base))[0].element == element
    arguments = within(base), robot().end_effector
    assert error_key(ff.FreeFloatingModel.from_urdf, *arguments) == element
    if TINY in base:
        mounted = partial(ff.FreeFloatingModel.from_urdf, spacecraft=CRAFT)
        assert error_key(mounted, *arguments) == element


def test_a_massless_shoulder_is_no_virtual_base() -> None:
    """An arm whose first two joints cross, on a massless link; its root has no mass, either."""
    arm = robot().text.replace('<link name="bus">', '<link name="cross">')
    arm = arm.replace('parent link="bus"', 'parent link="cross"')
    arm = re.sub(r'(<link name="cross">).*?(</link>)', r"\1\2", arm)
    shoulder = link_text("bus") + joint_text("yaw", "R", "bus", "cross")
    text = arm.replace("</robot>", f"{shoulder}</robot>")
    model = ff.FreeFloatingModel.from_urdf(text, robot().end_effector)
    assert model.joint_names == ("yaw", *robot().joints)
