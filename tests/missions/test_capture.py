"""Captures conserve momentum, and agree with MuJoCo's weld constraint."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.beyond.formats.mjcf_file import robot_mjcf
from freefloat.dynamics.momentum import end_effector_jacobian, momentum_map
from freefloat.robot.parts import Mount
from freefloat.rotations import rotation_matrix
from tests.motions import bundled

ROBOTS = ("ets_vii/line", "ssrms/transfer")


def case(name: str, seed: int):
    """A robot, a client and a state just before contact; everything moves."""
    rng, model = np.random.default_rng(seed), bundled(name).model
    Q = Rotation.random(rng=rng).as_matrix()
    client = ff.Client(
        mass=rng.uniform(20.0, 2000.0),
        inertia=Q @ np.diag([50.0, 70.0, 90.0]) @ Q.T,
        grapple=Mount(rng.normal(size=3), rng.uniform(-1.0, 1.0, 3)),
        angular_velocity=rng.normal(0.0, 0.05, 3),
        velocity=rng.normal(0.0, 0.02, 3),
        com=rng.normal(0.0, 0.3, 3),
    )
    state = {
        "attitude": Rotation.random(rng=rng).as_quat(),
        "joints": rng.uniform(-1.0, 1.0, model.dof),
        "joint_rates": rng.normal(0.0, 0.05, model.dof),
    }
    momentum, wheels, drift = rng.normal(0.0, [[1.0], [0.3], [0.02]], (3, 3))
    system = ff.System(model, momentum, wheels, drift)
    return system, client, state


def grasped(client, model, attitude, joints):
    """Pose of the grapple, axes of the client, and its centre of mass from the grapple."""
    pose = model.end_effector_pose(attitude, joints)
    axes = pose.rotation @ client.grapple.pose.rotation.T
    return pose, axes, axes @ (client.com - client.grapple.xyz)


@pytest.mark.parametrize("name", ROBOTS)
def test_linear_and_angular_momentum_are_conserved(name: str) -> None:
    """Sums over the bodies of both, by Pinocchio's centroidal map of the robot with payload."""
    system, client, state = case(name, 1)
    model = system.model
    after = ff.capture(system, client, **state)
    a, q = state["attitude"], state["joints"]
    R = rotation_matrix(a)
    pose, axes, arm = grasped(client, model, a, q)
    place = pose.position + arm
    linear = model.total_mass * system.drift + client.mass * client.velocity
    about_origin = (
        system.momentum  # its own centre of mass is the origin
        + axes @ client.inertia @ client.angular_velocity
        + client.mass * np.cross(place, client.velocity)
    )
    total = model.total_mass + client.mass
    assert after.model.total_mass == pytest.approx(total)
    np.testing.assert_allclose(total * after.velocity, linear, atol=1e-10)
    moved = np.cross(after.centre_of_mass, total * after.velocity)
    scale = np.linalg.norm(about_origin)
    np.testing.assert_allclose(after.momentum + moved, about_origin, atol=1e-10 * scale)

    before_base = R.T @ (after.base_rate)
    A = momentum_map(after.model, q, a)
    linear_base = np.linalg.solve(
        A[:3, :3], linear - A[:3, 3:6] @ before_base - A[:3, 6:] @ after.joint_rates
    )
    twist = np.concatenate([linear_base, before_base, after.joint_rates])
    bodies = after.momentum - R @ system.wheels
    np.testing.assert_allclose(A[3:] @ twist, bodies, atol=1e-10 * scale)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_impulse_makes_the_velocities_at_the_grapple_equal(name: str) -> None:
    """The change of the client's momentum is minus the impulse, and no energy is gained."""
    system, client, state = case(name, 2)
    model = system.model
    after = ff.capture(system, client, **state)
    a, q = state["attitude"], state["joints"]
    pose, axes, arm = grasped(client, model, a, q)
    omega, inertia = axes @ client.angular_velocity, axes @ client.inertia @ axes.T
    velocity = client.velocity - after.impulse[:3] / client.mass
    moment = after.impulse[3:] - np.cross(arm, after.impulse[:3])
    omega_after = omega - np.linalg.solve(inertia, moment)
    at_grapple = np.concatenate([velocity - np.cross(omega_after, arm), omega_after])

    A = momentum_map(model, q, a)
    robot = np.concatenate([
        model.total_mass * system.drift + after.impulse[:3],
        system.momentum - rotation_matrix(a) @ system.wheels
        + np.cross(pose.position, after.impulse[:3]) + after.impulse[3:],
    ])  # fmt: skip
    base = np.linalg.solve(A[:, :6], robot - A[:, 6:] @ after.joint_rates)
    np.testing.assert_allclose(rotation_matrix(a) @ base[3:], after.base_rate, atol=1e-10)
    tip = end_effector_jacobian(model, q, a) @ np.concatenate([base, after.joint_rates])
    np.testing.assert_allclose(tip, at_grapple, atol=1e-10)


def test_locked_joints_spin_at_inverse_inertia_times_momentum() -> None:
    system, client, state = case("ets_vii/line", 3)
    after = ff.capture(system, client, **state)
    poses = after.model.body_poses(state["attitude"], state["joints"])
    inertia = np.zeros((3, 3))
    for body, pose in zip(after.model.bodies, poses, strict=True):
        c = pose.position + pose.rotation @ body.centre
        inertia += pose.rotation @ body.inertia @ pose.rotation.T
        inertia += body.mass * (c @ c * np.eye(3) - np.outer(c, c))
    momentum = after.momentum - rotation_matrix(state["attitude"]) @ system.wheels
    np.testing.assert_allclose(inertia @ after.locked_rate, momentum, rtol=1e-10)
    rate = np.linalg.norm(after.locked_rate)
    assert after.smallest_rate <= rate <= after.largest_rate


@pytest.mark.slow
def test_mujoco_welds_the_client_to_the_end_effector() -> None:
    system, client, state = case("ur5_servicer/arc", 5)
    model = system.model
    system = replace(system, wheels=np.zeros(3), drift=np.zeros(3))  # in that of the centre of mass
    after = ff.capture(system, client, **state)
    a, q = state["attitude"], state["joints"]
    root = robot_mjcf(model, shapes=False)
    pose, axes, arm = grasped(client, model, a, q)
    place = pose.position + arm
    moments, principal = np.linalg.eigh(client.inertia)
    principal[:, 0] *= np.linalg.det(principal)
    turn = Rotation.from_matrix(axes @ principal)
    world = root.find("worldbody")
    body = ET.SubElement(world, "body", name="client")
    ET.SubElement(body, "freejoint")
    ET.SubElement(body, "inertial", pos="0 0 0", mass=repr(client.mass),
                  diaginertia=" ".join(map(repr, moments.tolist())))  # fmt: skip
    ET.SubElement(
        body,
        "site",
        name="grapple",
        size="0.01",
        **_place(
            turn.inv().apply(pose.position - place),
            turn.inv() * Rotation.from_matrix(pose.rotation),
        ),
    )
    equality = ET.SubElement(root, "equality")
    ET.SubElement(equality, "weld", site1="end_effector", site2="grapple",
                  solref="0.00002 1", solimp="0.9999 0.9999 0.001")  # fmt: skip
    simulated = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    simulated.opt.timestep = 1e-6
    data = mujoco.MjData(simulated)
    n = model.dof
    A = momentum_map(model, q, a)
    R = rotation_matrix(a)
    twist = np.linalg.solve(
        A[:, :6], [0.0, 0.0, 0.0, *system.momentum] - A[:, 6:] @ state["joint_rates"]
    )
    omega = axes @ client.angular_velocity
    data.qpos[:] = [*model.base_position(a, q), *np.roll(a, 1), *q, *place,
                    *np.roll(turn.as_quat(), 1)]  # fmt: skip
    data.qvel[:] = [*(R @ twist[:3]), *twist[3:], *state["joint_rates"], *client.velocity,
                    *turn.inv().apply(omega)]  # fmt: skip
    for _ in range(500):
        mujoco.mj_step(simulated, data)
    np.testing.assert_allclose(data.qvel[6 : 6 + n], after.joint_rates, atol=1e-4)
    np.testing.assert_allclose(R @ data.qvel[3:6], after.base_rate, atol=1e-4)


def _place(position, rotation) -> dict[str, str]:
    quaternion = np.roll(rotation.as_quat(), 1)
    return {"pos": " ".join(map(repr, position.tolist())),
            "quat": " ".join(map(repr, quaternion.tolist()))}  # fmt: skip
