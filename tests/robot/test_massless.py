"""Arms without mass: the spacecraft does not react, the robot moves as on a fixed base."""

import re

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.momentum import end_effector_jacobian
from freefloat.robot.named_files import models_folder
from tests.errors import error_key
from tests.motions import from_here


@pytest.fixture(scope="module")
def model():
    """The bundled arm with six joints, without mass, on a spacecraft."""
    text = (models_folder() / "spatial_6dof" / "spatial_6dof.urdf").read_text()
    arm = re.sub(r"<inertial>.*?</inertial>", "", text, flags=re.DOTALL)
    spacecraft = ff.Spacecraft(mass=200.0, inertia=np.diag([30.0, 40.0, 50.0]))
    return ff.FreeFloatingModel.from_urdf(arm, "end_effector", spacecraft=spacecraft)


def test_the_generalized_jacobian_is_that_of_a_fixed_base(model):
    joints = np.array([0.3, -0.8, 1.1, 0.4, 0.9, -0.2])
    expected = end_effector_jacobian(model, joints)[:, 6:]
    np.testing.assert_allclose(ff.generalized_jacobian(model, joints), expected, atol=1e-12)


def test_the_spacecraft_keeps_its_attitude_without_torques(model):
    joints = np.array([0.3, -0.8, 1.1, 0.4, 0.9, -0.2])
    attitude, step = np.array([0.0, 0.0, 0.0, 1.0]), [0.05, -0.1, 0.1]
    problem = from_here(
        model, ff.Task.POSE, np.zeros(3), attitude, joints, step, np.zeros(3), ff.Timing(20.0)
    )
    limits = ff.Limits(joint_torque=np.full(6, 1.0))
    simulation = ff.simulate(problem, attitude, joints=joints, limits=limits)
    assert simulation.feasible
    motion = simulation.chosen.motion
    np.testing.assert_allclose(motion.attitudes, [attitude] * len(motion.times))
    torque = next(entry for entry in simulation.limit_results if entry.limit == "joint_torque")
    assert torque.worst == 0.0


def test_the_kinetic_energy_is_no_metric_of_a_massless_arm(model):
    assert (
        error_key(ff.Redundancy(metric="energy").require_applicable, model, ff.Task.POSITION)
        == "redundancy.metric"
    )
