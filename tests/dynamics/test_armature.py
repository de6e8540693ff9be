"""Inertia of rotors: joint torques as MuJoCo and Pinocchio have them; momentum without it."""

import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import freefloat as ff
from freefloat.beyond.engines.mujoco_model import MuJoCoModel
from freefloat.beyond.formats.mjcf_file import robot_mjcf
from freefloat.dynamics.inverse_dynamics import InverseDynamics

ARMATURE = (0.7, 0.2, 5.0)
MJCF = """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
  <body name="bus"><freejoint/>
  <inertial pos="0.1 0 0.2" mass="90" fullinertia="9 8 7 0.3 0 0.1"/>
  <body name="upper" pos="0.5 0 0.2"><joint name="q1" axis="0 0.6 0.8" range="-3 3" armature="0.7"/>
    <inertial pos="0.3 0.1 0" mass="8" diaginertia="0.1 0.7 0.7"/>
    <body name="lower" pos="0.6 0 0"><joint name="q2" axis="0 0 1" range="-3 3" armature="0.2"/>
      <inertial pos="0.2 0 0.1" mass="5" diaginertia="0.1 0.3 0.3"/>
      <body name="hand" pos="0.4 0 0"><joint name="q3" axis="1 0 0" type="slide" range="-1 1"
        armature="5"/>
        <inertial pos="0.1 0 0" mass="3" diaginertia="0.02 0.02 0.01"/></body>
    </body></body></body></worldbody></mujoco>"""
Q, RATES, ACCELERATIONS = np.array([[0.3, -0.8, 0.1], [0.2, -0.5, 0.3], [0.4, 0.9, -0.6]])


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "robot.xml").write_text(MJCF)
    return tmp_path / "robot.xml"


def test_torques_are_those_of_mujoco_and_momentum_has_no_rotors(file: Path) -> None:
    robot = ff.FreeFloatingModel.from_urdf(file)
    still = np.array([0.0, 0.0, 0.0, 1.0])
    system = ff.System(robot)
    twist = system.base_twist(still, Q, RATES)
    forces = InverseDynamics(system).of_joints(
        still, Q, np.concatenate([twist[3:], RATES]), ACCELERATIONS
    )
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    data.qpos[7:], data.qvel[:], data.qacc[:] = Q, forces.rates, forces.accelerations
    data.qacc[:3] += np.cross(forces.rates[3:6], forces.rates[:3])  # of the origin, in the world
    mujoco.mj_inverse(model, data)
    np.testing.assert_allclose(data.qfrc_inverse[6:], forces.joint_torques, atol=1e-9)
    np.testing.assert_allclose(data.qfrc_inverse[:6], 0.0, atol=1e-9)
    np.testing.assert_allclose(forces.base_wrench, 0.0, atol=1e-9)


def test_readers_and_writers_keep_the_armature(file: Path, tmp_path: Path) -> None:
    robot = ff.FreeFloatingModel.from_urdf(file)
    model = pin.buildModelFromXML(robot.description.text, pin.JointModelFreeFlyer())
    model.armature[6:] = ARMATURE
    taken = ff.FreeFloatingModel.from_pinocchio(model, "hand")
    again = ff.FreeFloatingModel.from_urdf(taken.description.text)
    for other in (robot, taken, again):
        assert tuple(body.armature for body in other.bodies[1:]) == ARMATURE
    written = mujoco.MjModel.from_xml_string(ET.tostring(robot_mjcf(robot), encoding="unicode"))
    engine = MuJoCoModel(ff.System(robot)).model
    for simulated in (written, engine):
        np.testing.assert_array_equal(simulated.dof_armature, [*np.zeros(6), *ARMATURE])
    q = pin.neutral(model)
    q[7:] = Q
    v, a = np.concatenate([np.ones(6), RATES]), np.concatenate([np.ones(6), ACCELERATIONS])
    model.gravity = pin.Motion.Zero()
    torques = [pin.rnea(arm, arm.createData(), q, v, a) for arm in (model, robot.pin_model)]
    np.testing.assert_allclose(*torques, rtol=0.0, atol=1e-10)
    S = ff.generalized_jacobian(robot, Q)
    rotorless = MJCF.replace("armature", "user")
    (tmp_path / "light.xml").write_text(rotorless)
    light = ff.FreeFloatingModel.from_urdf(tmp_path / "light.xml")
    np.testing.assert_array_equal(ff.generalized_jacobian(light, Q), S)
