"""URDF 1.1 and 1.2: rotations as quaternions, and capsules."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.beyond.formats.mjcf_file import robot_mjcf
from freefloat.errors import ModelError
from freefloat.io.urdf_file import write_urdf
from freefloat.robot.parts import Attachment
from freefloat.robot.shapes import Capsule
from freefloat.robot.validation import examine, read_urdf
from tests.robots import (
    Robot,
    assert_as_pinocchio_reads,
    inertial_text,
    link_text,
    numbers,
    random_robot,
)

CAPSULE = '<collision><geometry><capsule radius="0.2" length="1.5"/></geometry></collision>'


def with_quaternions(robot: Robot, rng: np.random.Generator) -> str:
    """The robot with a random ``quat_xyzw`` in every origin, some at a pitch of 90 degrees."""

    def quaternion(_: object) -> str:
        right = [rng.uniform(-3, 3), np.pi / 2, rng.uniform(-3, 3)]
        random = [Rotation.random(rng=rng), Rotation.from_euler("xyz", right)]
        return f'quat_xyzw="{numbers(random[rng.integers(2)].as_quat())}"'

    text = robot.text.replace("<robot ", '<robot version="1.1" ')
    return re.sub(r'rpy="[^"]*"', quaternion, text)


@pytest.mark.parametrize(("seed", "version"), [(0, "1.1"), (1, "1.2")])
def test_quaternions_are_read_as_pinocchio_reads_them(seed, version, tmp_path):
    """In joints, fixed joints and inertials; and the same in files that are written."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, "RFRRPRR").with_frame("tip", "0.1 0 0.1", "0.1 0.2 0.3")
    robot = replace(robot, text=with_quaternions(robot, rng).replace("1.1", version, 1))
    (tmp_path / "robot.urdf").write_text(robot.text)
    assert_as_pinocchio_reads(robot.model(), tmp_path / "robot.urdf", rng)
    laden = robot.model(payload=ff.Payload(5.0, [1, 1, 1]))
    written = write_urdf(laden, tmp_path / "written.urdf").file
    assert_as_pinocchio_reads(ff.FreeFloatingModel.from_urdf(written, "tip"), written, rng)


def test_a_quaternion_is_not_read_before_version_1_1(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    text = with_quaternions(random_robot(rng, "RRR"), rng)
    for version in ("", 'version="1.0"'):
        old = text.replace('version="1.1"', version)
        (tmp_path / "robot.urdf").write_text(old)
        model = ff.FreeFloatingModel.from_urdf(tmp_path / "robot.urdf")
        assert len(model.warnings) == old.count("quat_xyzw")
        assert [entry.attribute for entry in model.not_read] == ["quat_xyzw"] * len(model.warnings)
        assert_as_pinocchio_reads(model, tmp_path / "robot.urdf", rng)


def one_origin(attributes: str) -> str:
    robot = random_robot(np.random.default_rng(0), "R").text.replace(
        "<robot", '<robot version="1.1"'
    )
    return re.sub(r"<origin [^>]*/>", f"<origin {attributes}/>", robot)


@pytest.mark.parametrize(
    "attributes",
    ['quat_xyzw="0 0 0 0"', 'quat_xyzw="0 0 1"', 'quat_xyzw=""', 'quat_xyzw="0 0 0 a"',
     'quat_xyzw="0 0 0 1 0"', 'quat_xyzw="0 0 0 nan"', 'rpy="0 0 0" quat_xyzw="0 0 0 1"'],
)  # fmt: skip
def test_what_is_no_rotation_is_refused_once(attributes: str) -> None:
    text = one_origin(attributes)
    errors = [entry for entry in examine(text) if entry.severity == "error"]
    assert len(errors) == text.count("<origin")
    with pytest.raises(ModelError) as caught:
        ff.FreeFloatingModel.from_urdf(text)
    assert caught.value.line is not None


def test_a_long_quaternion_is_normalized_with_a_warning() -> None:
    long, unit = (read_urdf(one_origin(f'quat_xyzw="{q}"')) for q in ("0 3 0 4", "0 0.6 0 0.8"))
    np.testing.assert_allclose(long.joints[0].origin.rotation, unit.joints[0].origin.rotation)
    assert (len(long.warnings), len(unit.warnings)) == (3, 0)
    assert unit.not_read == ()


def test_an_unknown_version_is_warned_of_and_not_written() -> None:
    robot = read_urdf(one_origin('quat_xyzw="0 0.6 0 0.8"').replace('"1.1"', '"2.0"'))
    assert len(robot.warnings) == 1
    assert robot.joints[0].origin.rotation[0, 0] == pytest.approx(0.28)
    pin.buildModelFromXML(robot.text)


@pytest.mark.parametrize("version", ["", 'version="1.0"', 'version="1.1"'])
def test_a_capsule_stays_one_in_files_that_are_written(version: str, tmp_path: Path) -> None:
    """Also of a tool on an arm whose file is of an older version."""
    arm = random_robot(np.random.default_rng(3), "RRR")
    ball = link_text("ball", inertial_text(1.0, np.eye(3)) + CAPSULE)
    tool = Attachment(f"<robot name='t' {version}>{ball}</robot>", arm.end_effector)
    model = arm.model(attached=[tool])
    (shape,) = model.description.links_by_name["ball"].collisions
    assert shape.geometry == Capsule(0.2, 1.5)
    assert len(model.warnings) == (0 if "1.1" in version else 1)
    text = write_urdf(model, tmp_path / "out.urdf").file.read_text()
    theirs = pin.buildGeomFromUrdfString(pin.buildModelFromXML(text), text, pin.COLLISION)
    (capsule,) = [entry.geometry for entry in theirs.geometryObjects]
    assert (capsule.radius, capsule.halfLength) == (0.2, 0.75)


def test_a_capsule_of_a_model_of_mujoco_is_that_of_the_urdf() -> None:
    """MuJoCo states half the length of the cylinder."""
    drawn = CAPSULE.replace("collision", "visual")
    text = random_robot(np.random.default_rng(4), "RRR").text.replace(
        "</link>", f"{drawn}</link>", 1
    )
    text = text.replace("<robot", '<robot version="1.1"')
    written = ET.tostring(robot_mjcf(ff.FreeFloatingModel.from_urdf(text)), encoding="unicode")
    model = mujoco.MjModel.from_xml_string(written)
    assert model.geom_type.tolist() == [mujoco.mjtGeom.mjGEOM_CAPSULE]
    np.testing.assert_allclose(model.geom_size[0, :2], [0.2, 0.75])
