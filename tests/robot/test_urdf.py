"""What a URDF may not say, what it may only say with a doubt, and what is changed in it."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from freefloat.errors import InputError, ModelError
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import models_folder
from freefloat.robot.urdf import Description, read_urdf
from tests.robots import Robot, inertial_text, joint_text, link_text, robots

BUS = link_text("bus", inertial_text(100.0, 10.0 * np.eye(3)))
BALL = "<inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/>"


def one_joint(inertial: str = f"<inertial><mass value='5'/>{BALL}</inertial>") -> str:
    """A spacecraft with a single turning link, whose ``<inertial>`` is given."""
    arm = link_text("arm", inertial) + joint_text("q", "C", "bus", "arm")
    return f"<robot name='r'>{BUS}{arm}</robot>"


def refused(urdf: str | Path, **options: object) -> ModelError:
    with pytest.raises(ModelError) as caught:
        read_urdf(urdf, **options)
    return caught.value


# -------------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("value='5'", "value='five'", "link arm <mass value>"),
        ("value='5'", "value='10/2'", "link arm <mass value>"),
        ("value='5'", "value='nan'", "link arm <mass value>"),
        ("value='5'", "value=''", "link arm <mass value>"),
        ("ixy='0'", "ixy='1e400'", "link arm <inertia ixy>"),
        ('xyz="0 0 1"', 'xyz="0 0 pi/2"', "joint q <axis xyz>"),
        ('rpy="0 0 0"/><axis', 'rpy="0 0 ${pi}"/><axis', "joint q <origin rpy>"),
    ],
)
def test_numbers_that_are_none_are_refused_where_they_stand(old: str, new: str, key: str) -> None:
    """Expressions, words and infinities are no numbers; the element and attribute are named."""
    assert old in one_joint()
    error = refused(one_joint().replace(old, new))
    owner, _, attribute = key.partition(" <")
    assert error.key == owner
    assert f"<{attribute.removesuffix('>')}=" in error.problem
    assert "finite numbers" in error.accepted
    assert "expressions are not evaluated" in error.accepted
    assert re.split("[\"']", new)[1] in error.problem


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("value='5'", "value='3_0'"),
        ("value='5'", "value='5 0'"),
        ("value='5'", "value='\uff15'"),
        ("ixx='1'", "ixx='1 1'"),
        ("ixx='1'", "ixx='1_0'"),
        ("<mass", "<origin xyz='1 2'/><mass"),
        ("ixy='0' ", ""),
        (BALL, ""),
        ("<mass value='5'/>", ""),
        (" value='5'", ""),
    ],
    ids=[
        "underscore", "two masses", "wide digit", "two moments", "underscore in moment",
        "origin in two numbers", "a product missing", "no inertia", "no mass", "no value",
    ],
)  # fmt: skip
def test_no_inertial_is_dropped_in_silence(old: str, new: str) -> None:
    """What cannot be read is refused or doubted by name; else it weighs and spins as it says."""
    text = one_joint().replace(old, new)
    assert text != one_joint()
    try:
        model = FreeFloatingModel.from_urdf(text, "arm")
    except ModelError as error:
        told = error.key
    else:
        told = str(model.doubts)
    if told.startswith("link bus"):  # the same words stand in the other link, too
        return
    if "arm" not in told:
        assert model.bodies[1].mass == pytest.approx(5.0)
        np.testing.assert_allclose(model.bodies[1].inertia, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("axis", ["0 0 0", "0 0", "0 0 1 0"])
def test_an_axis_without_direction_is_refused(axis: str) -> None:
    """A joint about nothing is no joint: its column of the Jacobian would be zero."""
    with pytest.raises(ModelError):
        FreeFloatingModel.from_urdf(one_joint().replace('axis xyz="0 0 1"', f'axis xyz="{axis}"'))


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("limit", ["", "<limit lower='-1' upper='1'/>", "<limit effort='1'/>"])
def test_joints_that_need_limits_are_refused_without(kind: str, limit: str) -> None:
    """The remedy is in the message: a complete limit, or a continuous joint."""
    text = one_joint().replace('type="continuous"', f'type="{kind}"')
    error = refused(text.replace("<axis", limit + "<axis"))
    assert error.key == "joint q"
    assert kind in error.problem
    assert "lower" in error.accepted
    assert ("continuous" in error.accepted) is (kind == "revolute")


def test_negative_mass_is_refused() -> None:
    """Nothing weighs less than nothing."""
    error = refused(one_joint().replace("value='5'", "value='-5'"))
    assert (error.key, error.problem) == ("link arm", "mass -5.0 kg")


def test_a_robot_without_mass_is_refused() -> None:
    """Nothing drifts where nothing weighs."""
    text = one_joint("").replace('value="100.0"', 'value="0"')
    assert "total mass is zero" in refused(text).problem


@pytest.mark.parametrize(
    "prolog",
    [
        "<!DOCTYPE robot [<!ENTITY m '5'>]>",
        "<!DOCTYPE robot SYSTEM 'http://example.org/robot.dtd'>",
        "<?xml version='1.0'?><!DOCTYPE r [<!ENTITY a 'x'><!ENTITY b '&a;&a;&a;'>]>",
    ],
)
def test_document_types_are_refused(prolog: str) -> None:
    """A robot needs no entities, and entities can blow up or reach out."""
    error = refused(prolog + one_joint())
    assert "DTD" in error.problem
    assert error.accepted.startswith("plain XML")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("<robot", "not well-formed XML"),
        ("<robot></robt>", "not well-formed XML"),
        ("<sdf/>", "its root element is <sdf>"),
    ],
)
def test_what_is_no_robot_is_refused(text: str, problem: str) -> None:
    """Broken XML and other formats are told apart."""
    assert problem in refused(text).problem


def test_a_file_is_named_in_its_errors(tmp_path: Path) -> None:
    """Which file, then which link: the place to put the cursor."""
    path = tmp_path / "arm.urdf"
    path.write_text(one_joint().replace("value='5'", "value='-5'"))
    error = refused(path)
    assert error.source == str(path)
    assert error.line == 2
    assert str(error).startswith(f"{path}:2: link arm: mass -5.0 kg; accepted: ")
    assert refused(one_joint().replace("value='5'", "value='-5'")).source == "URDF text"


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    """Missing files, folders and binaries each have their sentence."""
    assert "no such file" in refused(tmp_path / "gone.urdf").problem
    assert "directory" in refused(tmp_path).problem
    (tmp_path / "photo.urdf").write_bytes(b"\xff\xd8\xff\xe0")
    assert "not UTF-8" in refused(str(tmp_path / "photo.urdf")).problem


def test_what_the_parser_would_reject_is_told_before_it_speaks() -> None:
    """Two roots, or one name for two links: in our words, with nothing on stderr from C++."""
    lost = one_joint().replace("</robot>", "<link name='lost'/></robot>")
    twice = one_joint().replace('name="arm"', 'name="bus"')
    for text in (lost, twice):
        with pytest.raises(ModelError, match=r"root|twice") as caught:
            FreeFloatingModel.from_urdf(text, "bus")
        assert "one root link" in caught.value.accepted


# -------------------------------------------------------------------------- what is only doubtful


def doubts(text: str) -> list[tuple[str, str, str]]:
    return [(d.element, d.problem, d.remedy) for d in read_urdf(text).doubts]


def with_inertia(matrix: np.ndarray, mass: float = 5.0) -> str:
    return one_joint(inertial_text(mass, matrix))


def test_sound_robots_leave_no_doubt() -> None:
    """Neither a link of unknown size nor one as large as its moments say."""
    assert doubts(one_joint()) == []
    shape = "<visual><geometry><sphere radius='0.5'/></geometry></visual>"
    assert doubts(one_joint().replace("</inertial></link>", f"</inertial>{shape}</link>")) == []


def test_published_table_two_is_doubted_for_its_third_link() -> None:
    """Table II prints 0.001, 1.7 and 7.5: no rigid body, and the reader is told."""
    (doubt,) = read_urdf(models_folder() / "spatial_6dof" / "spatial_6dof.urdf").doubts
    assert (doubt.element, doubt.line) == ("link link_3", 60)
    assert "0.001, 1.7, 7.5 break the triangle inequality" in doubt.problem


@given(robot=robots())
def test_bodies_of_positive_mass_leave_no_doubt(robot: Robot) -> None:
    """Whatever its frame, an inertia that a body can have is not doubted; its size may be."""
    told = " ".join(doubt.problem for doubt in read_urdf(robot.text).doubts)
    for word in ("definite", "triangle", "no mass", "range", "length"):
        assert word not in told


def test_inertia_that_is_not_positive_definite_is_doubted() -> None:
    """A wrong sign among the products shows in the principal moments."""
    for matrix in ([[1, 2, 0], [2, 1, 0], [0, 0, 2]], np.diag([1, 1, -1]), np.diag([0, 1, 1])):
        ((link, problem, remedy),) = doubts(with_inertia(np.array(matrix, dtype=float)))
        assert link == "link arm"
        assert "not positive definite" in problem
        assert "signs" in remedy
    assert "-1, 1, 1" in doubts(with_inertia(np.diag([1.0, 1, -1])))[0][1]


def test_inertia_that_breaks_the_triangle_inequality_is_doubted() -> None:
    """No body has one principal moment larger than the sum of the others, in whatever axes."""
    R = Rotation.from_euler("xyz", [0.4, 0.5, 0.6]).as_matrix()
    for turn in (np.eye(3), R):
        ((link, problem, remedy),) = doubts(with_inertia(turn @ np.diag([1.0, 2, 3.1]) @ turn.T))
        assert link == "link arm"
        assert "1, 2, 3.1 break the triangle inequality" in problem
        assert "sum" in remedy
        # a flat plate is a body, right on the border
        assert doubts(with_inertia(turn @ np.diag([1.0, 2, 3.0]) @ turn.T)) == []


def test_a_massless_moving_link_is_doubted_unless_something_massive_is_fixed_to_it() -> None:
    """Frames may be empty; what a joint moves should weigh something."""
    ((link, problem, remedy),) = doubts(one_joint(""))
    assert link == "link arm"
    assert "moves but has no mass" in problem
    assert "<inertial>" in remedy
    carried = link_text("box", inertial_text(1.0, np.eye(3))) + joint_text("f", "F", "arm", "box")
    assert doubts(one_joint("").replace("</robot>", carried + "</robot>")) == []
    empty = link_text("frame") + joint_text("f", "F", "arm", "frame")
    assert [d[0] for d in doubts(one_joint("").replace("</robot>", empty + "</robot>"))] == [
        "link arm"
    ]
    assert doubts(one_joint().replace("</robot>", empty + "</robot>")) == []


def test_a_mimicking_joint_is_doubted() -> None:
    """Mimicry is ignored, and that is said."""
    text = one_joint().replace("<axis", "<mimic joint='other'/><axis")
    ((joint, problem, remedy),) = doubts(text)
    assert joint == "joint q"
    assert "mimics" in problem
    assert "fixed" in remedy


def test_a_doubt_reads_as_a_sentence() -> None:
    """File, line, link, problem, remedy, in this order."""
    doubt = read_urdf(one_joint("")).doubts[0]
    assert str(doubt) == f"URDF text:2: link arm: {doubt.problem}; {doubt.remedy}"


# --------------------------------------------------------------------------------- what is changed


def masses(description: Description) -> dict[str, float]:
    robot = ET.fromstring(description.text)
    return {
        str(link.get("name")): float(link.find("inertial/mass").get("value"))  # type: ignore[union-attr]
        for link in robot.iter("link")
        if link.find("inertial") is not None
    }


def test_masses_and_inertias_are_scaled_together() -> None:
    """One factor for all, or one for a link: mass and moments grow alike, the place stays."""
    text = one_joint(inertial_text(5.0, np.diag([1.0, 2, 3]), "1 0 0"))
    assert masses(read_urdf(text)) == {"bus": 100.0, "arm": 5.0}
    assert masses(read_urdf(text, 2)) == {"bus": 200.0, "arm": 10.0}
    assert masses(read_urdf(text, {"arm": 0.5})) == {"bus": 100.0, "arm": 2.5}
    body = FreeFloatingModel.from_urdf(text, "arm", scale_mass={"arm": 0.5}).bodies[1]
    np.testing.assert_allclose(body.inertia, np.diag([0.5, 1, 1.5]), atol=1e-15)
    np.testing.assert_allclose(body.centre, [1, 0, 0], atol=1e-15)


def test_scaling_heeds_only_mass_and_inertia() -> None:
    """A foreign attribute beside the mass is not multiplied, nor does it break anything."""
    text = one_joint().replace("value='5'", "value='5' unit='kg'")
    assert masses(read_urdf(text, 3.0)) == {"bus": 300.0, "arm": 15.0}


@pytest.mark.parametrize("factor", [0.0, -1.0, float("nan"), float("inf")])
def test_factors_that_are_not_positive_are_refused(factor: float) -> None:
    """Neither for all links nor for one."""
    assert refused(one_joint(), scale_mass={"arm": factor}).key == "scale_mass.arm"
    assert refused(one_joint(), scale_mass=factor).accepted == "a positive number"


def test_scaling_a_link_that_is_not_there_lists_those_that_are() -> None:
    """A name not found is answered with the names that exist."""
    error = refused(one_joint(), scale_mass={"amr": 2.0})
    assert (error.key, error.accepted) == ("scale_mass.amr", "bus, arm")
    assert isinstance(error, InputError)
