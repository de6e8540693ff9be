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
from freefloat.dynamics.momentum import momentum_map
from freefloat.robot.assembly import assemble
from freefloat.robot.parts import Attachment, Mount
from tests.robots import (
    Robot,
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


def joints(rng: np.random.Generator, robot: Robot) -> np.ndarray:
    return rng.uniform(-2.0, 2.0, len(robot.joints))


@given(seed=seeds)
def test_a_mounted_arm_is_pinocchios_own_sum_of_two_models(seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm, mount = random_robot(rng, "RPR"), Mount(rng.uniform(-1, 1, 3), rng.uniform(-3, 3, 3))
    craft = ff.Spacecraft(rng.uniform(50, 500), random_inertia(rng, 40.0), mount)
    model = arm.model(spacecraft=craft)
    body = free_flyer(f'<robot name="b"><link name="b">'
                      f"{inertial_text(craft.mass, craft.inertia)}</link></robot>")  # fmt: skip
    fixed = pin.buildModelFromXML(arm.text)
    whole = pin.appendModel(body, fixed, body.getFrameId("b"), place_of(mount))
    q = np.concatenate(
        [rng.uniform(-1, 1, 3), Rotation.random(rng=rng).as_quat(), joints(rng, arm)]
    )
    assert np.isclose(model.total_mass, pin.computeTotalMass(whole), rtol=1e-12)
    ours = pin.crba(model.pin_model, model.pin_model.createData(), q)
    theirs = pin.crba(whole, whole.createData(), q)
    scale = np.abs(theirs).max()
    assert np.allclose(np.triu(ours), np.triu(theirs), rtol=0, atol=1e-12 * scale)


@given(seed=seeds)
def test_a_payload_adds_its_own_momentum(seed: int) -> None:
    """Angular momentum about the whole's centre, summed over robot and payload."""
    rng = np.random.default_rng(seed)
    arm, com = random_robot(rng, "RRPR"), rng.uniform(-0.5, 0.5, 3)
    load = ff.Payload(rng.uniform(1, 50), random_inertia(rng, 2.0), com)
    empty, laden = arm.model(), arm.model(payload=load)
    assert np.isclose(laden.total_mass, empty.total_mass + load.mass, rtol=1e-12)
    q, v = joints(rng, arm), rng.normal(size=6 + len(arm.joints))

    model, data = empty.pin_model, empty.pin_model.createData()
    whole = np.concatenate([np.zeros(3), IDENTITY, q])
    pin.computeCentroidalMomentum(model, data, whole, v)
    pin.framesForwardKinematics(model, data, whole)
    end_effector = data.oMf[empty.frame_id]
    twist = pin.getFrameVelocity(model, data, empty.frame_id, pin.LOCAL_WORLD_ALIGNED)
    arm_to_load = end_effector.rotation @ load.com
    where = end_effector.translation + arm_to_load
    p_load = load.mass * (twist.linear + np.cross(twist.angular, arm_to_load))
    p_robot = data.hg.linear
    centre = (empty.total_mass * data.com[0] + load.mass * where) / laden.total_mass
    spin = end_effector.rotation @ load.inertia @ end_effector.rotation.T @ twist.angular
    h = data.hg.angular + spin
    h = h + np.cross(data.com[0] - centre, p_robot) + np.cross(where - centre, p_load)

    momentum = momentum_map(laden, q) @ v
    scale = np.abs(np.concatenate([p_robot + p_load, h])).max()
    assert np.allclose(momentum[:3], p_robot + p_load, rtol=0, atol=1e-11 * scale)
    assert np.allclose(momentum[3:], h, rtol=0, atol=1e-11 * scale)
    assert not np.allclose(momentum_map(empty, q) @ v, momentum, rtol=0, atol=1e-6 * scale)


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


IMPOSSIBLE = {
    "negative mass": {"mass": -1.0},
    "mass in words": {"mass": "heavy"},
    "an asymmetric matrix": {"inertia": [[2.0, 0.5, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]]},
    "a moment of zero": {"inertia": [1.0, 1.0, 0.0]},
    "a violated triangle inequality": {"inertia": [1.0, 1.0, 2.001]},
}


@pytest.mark.parametrize("part", [ff.Spacecraft, ff.Payload])
@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_impossible_bodies_are_refused(name: str, part: type) -> None:
    changed = IMPOSSIBLE[name]
    with pytest.raises(ff.InputError) as caught:
        part(**{"mass": 10.0, "inertia": [1.0, 1.0, 1.0], **changed})
    (key,) = changed
    assert caught.value.key == f"{part.__name__.lower()}.{key}"


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
    q = {name: rng.uniform(-2, 2) for name in [*whole.names][2:]}
    stance = [*rng.uniform(-1, 1, 3), *Rotation.random(rng=rng).as_quat()]
    masses = []
    for model in (whole, expected):
        values = pin_configuration(model, q)
        values[:7] = stance
        order = [*range(6), *(model.joints[model.getJointId(name)].idx_v for name in sorted(q))]
        M = pin.crba(model, model.createData(), values)
        M = np.triu(M) + np.triu(M, 1).T
        masses.append(M[np.ix_(order, order)])
    assert np.allclose(*masses, rtol=0, atol=1e-12 * np.abs(masses[0]).max())


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
        assert np.allclose(frame.homogeneous, expected.homogeneous, rtol=0, atol=1e-14)
