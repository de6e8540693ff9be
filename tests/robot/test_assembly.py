"""Assemblies: masses, poses and momentum of arms with spacecraft, payload and attachments."""

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.robot.assembly import assemble
from freefloat.robot.parts import Attachment, Mount
from tests.errors import error_key
from tests.robots import (
    inertial_text,
    joint_text,
    link_text,
    pin_configuration,
    random_inertia,
    random_robot,
)

CUBE = np.array([35.0, 35.0, 35.0])
IDENTITY = [0.0, 0.0, 0.0, 1.0]

seeds = st.integers(0, 2**32 - 1)


def assembled(*args: Any, **options: Any) -> str:
    return assemble(*args, **options).text


def place_of(mount: Mount) -> pin.SE3:
    """By SciPy's rotations."""
    return pin.SE3(Rotation.from_euler("xyz", mount.rpy).as_matrix(), np.array(mount.xyz, float))


def free_flyer(text: str) -> Any:
    return pin.buildModelFromXML(text, pin.JointModelFreeFlyer())


def assert_same_masses(first: pin.Model, second: pin.Model, rng: np.random.Generator) -> None:
    """Two free-flyers have the same mass matrix, joint by joint of the same names."""
    q = {name: rng.uniform(-2, 2) for name in [*first.names][2:]}
    stance = [*rng.uniform(-1, 1, 3), *Rotation.random(rng=rng).as_quat()]
    masses = []
    for model in (first, second):
        values = pin_configuration(model, q)
        values[:7] = stance
        order = [*range(6), *(model.joints[model.getJointId(name)].idx_v for name in sorted(q))]
        M = pin.crba(model, model.createData(), values)
        M = np.triu(M) + np.triu(M, 1).T
        masses.append(M[np.ix_(order, order)])
    np.testing.assert_allclose(*masses, rtol=0, atol=1e-12 * np.abs(masses[0]).max())


@given(seed=seeds)
def test_a_mounted_and_laden_arm_is_pinocchios_own_sum_of_bodies(seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm, mount = random_robot(rng, "RPR"), Mount(rng.uniform(-1, 1, 3), rng.uniform(-3, 3, 3))
    craft = ff.Spacecraft(rng.uniform(50, 500), random_inertia(rng, 40.0), mount)
    load = ff.Payload(rng.uniform(1, 50), random_inertia(rng, 2.0), rng.uniform(-0.5, 0.5, 3))
    body = free_flyer(f'<robot name="b"><link name="b">'
                      f"{inertial_text(craft.mass, craft.inertia)}</link></robot>")  # fmt: skip
    fixed = pin.buildModelFromXML(arm.text)
    hand = fixed.frames[fixed.getFrameId(arm.end_effector)]
    fixed.appendBodyToJoint(
        hand.parentJoint, pin.Inertia(load.mass, load.com, load.inertia), hand.placement
    )
    whole = pin.appendModel(body, fixed, body.getFrameId("b"), place_of(mount))
    model = arm.model(spacecraft=craft, payload=load)
    assert np.isclose(model.total_mass, pin.computeTotalMass(whole), rtol=1e-12)
    assert_same_masses(model.pin_model, whole, rng)


def test_names_that_are_taken_get_a_number() -> None:
    arm = '<robot name="a">' + link_text("spacecraft", inertial_text(1.0, np.eye(3)))
    arm += joint_text("spacecraft_2", "R", "spacecraft", "payload")
    arm += link_text("payload", inertial_text(2.0, np.eye(3)))
    arm += joint_text("spacecraft_mount", "F", "payload", "tool") + link_text("tool") + "</robot>"
    text = assembled(arm, ff.Spacecraft(100.0, CUBE), ff.Payload(3.0, CUBE), "tool")
    robot = ET.fromstring(text)
    names = [element.get("name") for element in robot]
    assert len(set(names)) == len(names)
    assert {"spacecraft_3", "payload_2", "spacecraft_mount_2"} <= set(names)
    model = ff.FreeFloatingModel.from_urdf(text, "tool")
    assert np.isclose(model.total_mass, 106.0, rtol=1e-12)
    assert np.isclose(model.bodies[0].mass, 101.0, rtol=1e-12)


@pytest.mark.parametrize("part", [ff.Spacecraft, ff.Payload])
@pytest.mark.parametrize(("key", "value"), [
    ("mass", -1.0), ("mass", "heavy"),
    ("inertia", [[2.0, 0.5, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]]),
    ("inertia", [1.0, 1.0, 0.0]), ("inertia", [1.0, 1.0, 2.001]),
])  # fmt: skip
def test_impossible_bodies_are_refused(part: type, key: str, value: object) -> None:
    body = {"mass": 10.0, "inertia": [1.0, 1.0, 1.0], key: value}
    assert error_key(part, **body) == f"{part.__name__.lower()}.{key}"


@given(seed=seeds)
def test_an_attached_arm_is_pinocchios_own_sum_of_two_models(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, second = random_robot(rng, "RPR"), random_robot(rng, "CR")
    mount, at = Mount(rng.uniform(-1, 1, 3), rng.uniform(-3, 3, 3)), first.joints[1]
    whole = free_flyer(assembled(first.text, attached=[Attachment(second.text, at, mount, "b_")]))
    renamed = second.text.replace('name="', 'name="b_').replace('link="', 'link="b_')
    base = free_flyer(first.text)
    moved = base.frames[base.getFrameId(at)].parentJoint
    frame = next(i for i, entry in enumerate(base.frames)
                 if entry.type == pin.FrameType.BODY and entry.parentJoint == moved)  # fmt: skip
    expected = pin.appendModel(base, pin.buildModelFromXML(renamed), frame, place_of(mount))
    assert_same_masses(whole, expected, rng)


def test_attached_parts_need_neither_mass_nor_a_spacecraft() -> None:
    """Frames alone; a tool whose foot is heavier than what it carries, and the other way round."""
    for foot, finger in (("", ""), ("5", "2"), ("2", "5")):
        inertials = (mass and inertial_text(float(mass), 0.01 * np.eye(3), "0.1 0 0")
                     for mass in (foot, finger))  # fmt: skip
        tool = "".join(map(link_text, ("foot", "finger"), inertials))
        tool += joint_text("grip", "R" if foot else "F", "foot", "finger", "0.2 0 0")
        part = Attachment(f'<robot name="tool">{tool}</robot>', prefix="tool_")
        assert not ff.FreeFloatingModel.from_urdf(
            "ets_vii", "end_effector", attached=[part]
        ).warnings


def test_parts_are_attached_by_name_and_masses_scaled_by_numbers_of_numpy() -> None:
    tool = Attachment("planar_2dof", prefix="tool_")
    factor = {"tool_link_2": np.float64(2.0)}
    model = ff.FreeFloatingModel.from_urdf(
        "planar_2dof", "end_effector", attached=[tool], scale_mass=factor
    )
    alone = ff.FreeFloatingModel.from_urdf("planar_2dof")
    assert model.total_mass == pytest.approx(2.0 * alone.total_mass + alone.bodies[-1].mass)


def test_an_empty_root_gives_way_to_what_is_joined_to_it() -> None:
    """Also where several joints leave it and one of them moves, under an awkward mount."""
    arm = '<robot name="a">' + link_text("world")
    arm += joint_text("left", "F", "world", "foot", "1 2 3", "0.3 -0.2 1")
    arm += link_text("foot", inertial_text(3.0, np.eye(3), "0.2 0 0"))
    arm += joint_text("rail", "P", "world", "cart", "0 1 0", "0 0 0.5", "1 0 0")
    arm += link_text("cart", inertial_text(4.0, np.eye(3), "0 0.3 0")) + "</robot>"
    mount = Mount([0.5, -0.4, 0.3], [0.7, np.pi / 2, -0.4])
    text = assembled(arm, ff.Spacecraft(65.0, CUBE, mount))
    assert "world" not in text
    model = free_flyer(text)
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.array([0, 0, 0, *IDENTITY, 0.0]))
    for name, xyz, rpy in (("foot", [1, 2, 3], [0.3, -0.2, 1]), ("cart", [0, 1, 0], [0, 0, 0.5])):
        expected = place_of(mount) * place_of(Mount(xyz, rpy))
        frame = data.oMf[model.getFrameId(name, pin.FrameType.BODY)]
        np.testing.assert_allclose(frame.homogeneous, expected.homogeneous, rtol=0, atol=1e-14)
