"""Certificates: recomputed errors and margins, and a second integrator."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import freefloat as ff
from freefloat.certificate.certificate import certify, integrate_again
from freefloat.io.scenario.scenario import parse_scenario
from freefloat.motion.motion import DEGREE, Ending
from freefloat.verification.engines.mujoco import forward_run, inverse_run
from freefloat.verification.engines.mujoco_model import Engine
from tests.motions import GOOD, bundled, heading, simulated
from tests.prismatic import prismatic_motion, prismatic_robot
from tests.robots import random_robot

assert_close = partial(np.testing.assert_allclose, rtol=0)


def measure(certificate, name):
    """The entry of a measure."""
    return next(entry for entry in certificate.minima if entry.measure == name)


@pytest.fixture(scope="module")
def motion(spatial):
    return simulated(spatial, GOOD, 2)


@pytest.fixture(scope="module")
def redundant():
    return simulated(bundled("panda_servicer/line"), [0, 0, 0, 1], 0)


@pytest.fixture(scope="module")
def singular(planar):
    return simulated(planar, heading(140.0), 0)


@pytest.mark.slow
def test_certificate_agrees_with_residuals(motion):
    result, residuals = certify(motion), motion.residuals()
    assert 0.99 * residuals.end_effector_position < result.end_effector_position.value < 1e-8
    assert 0.99 * residuals.end_effector_orientation < result.end_effector_orientation.value < 1e-8
    assert result.momentum.value == pytest.approx(residuals.momentum, rel=1.0)
    assert result.momentum.value < 1e-6 * result.momentum_scale
    assert result.rates.value < 1e-6
    for entry in result.minima:
        assert 0.9 * entry.value <= entry.bound <= entry.value
    closest = ff.closest_approach(motion, motion.problem.margin.measure)
    arm = measure(result, "arm")
    assert (arm.value, arm.time) == (closest.value, closest.time)
    assert json.loads(json.dumps(result.to_dict(), allow_nan=False)) == result.to_dict()


@pytest.mark.slow
def test_other_null_space_motion_is_an_error_of_the_rates(redundant):
    assert certify(redundant).rates.value < 1e-6
    other = replace(redundant.problem, redundancy=ff.Redundancy("energy"))
    motion = ff.integrate_motion(other, redundant.initial.attitude, redundant.initial.joints)
    result = certify(replace(motion, problem=redundant.problem))
    assert result.end_effector_position.value < 1e-8
    assert result.momentum.value < 1e-6 * result.momentum_scale
    assert result.rates.value > 1e-3
    assert result.integration.joints > 1e-3


def test_second_integrator_agrees_and_is_of_fourth_order(motion):
    again = integrate_again(motion)
    assert again.attitude < 1e-8
    assert again.joints < 1e-8
    assert again.until == motion.times[-1]
    assert again.steps == 2 * DEGREE * motion.panels
    assert again.joints < again.halving_joints < 30.0 * again.joints
    assert again.halving_attitude < 1e-6


def test_second_integrator_names_the_deviating_joint(motion):
    joints = motion.joints.copy()
    joints[77, 4] += 1e-3
    again = integrate_again(replace(motion, joints=joints))
    assert again.joint == motion.problem.model.joint_names[4]
    assert again.joints == pytest.approx(1e-3, rel=1e-3)
    assert again.joints_time == motion.times[77]


def test_second_integration_ends_before_a_singularity(singular):
    again = integrate_again(singular)
    assert again.until == singular.times[-1 - 2 * DEGREE]
    assert again.attitude < 1e-6
    assert {entry.bound for entry in certify(singular).minima} == {0.0}


def test_certificates_of_a_prismatic_arm_and_of_no_duration():
    motion = prismatic_motion(prismatic_robot())
    result = certify(motion)
    assert result.integration.attitude < 1e-12
    assert result.integration.joints < 1e-6
    assert measure(result, "gjm").bound >= 0.9 * measure(result, "gjm").value > 0.0
    still = certify(motion.cut(0.0, Ending.MARGIN))
    assert still.rates.value == still.momentum.value == 0.0
    assert still.end_effector_position.value < 1e-12


def test_fixed_joints_in_mujoco(rng):
    for _ in range(4):
        robot = random_robot(rng, "RPRCRRP", "RP")
        fixed = dict(zip(robot.joints[1:3], (0.7, -1.1), strict=True)) | {robot.others[0]: 0.4}
        model = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector, fixed_joints=fixed)
        engine, joints = Engine(ff.System(model)), rng.uniform(-1.0, 1.0, model.dof)
        attitude = rng.normal(size=4)
        attitude /= np.linalg.norm(attitude)
        value = np.concatenate([model.base_position(attitude, joints), attitude, joints])
        engine.place(value, np.zeros_like(value), np.zeros_like(value))
        position, axes = engine.end_effector()
        pose = model.end_effector_pose(attitude, joints)
        assert_close(position, pose.position, atol=1e-9)
        assert_close(axes, pose.rotation, atol=1e-9)


@pytest.mark.slow
def test_mujoco_agrees_with_the_motion(redundant):
    engine = Engine(redundant.problem.system)
    forward, inverse = forward_run(redundant, engine), inverse_run(redundant, engine)
    assert forward.attitude < 1e-5
    assert forward.joints < 1e-5
    assert forward.position < 1e-5
    assert inverse.wrench < 1e-4 * inverse.torque
    assert inverse.end_effector < 1e-7
    assert inverse.looks > 50


@pytest.mark.slow
def test_mujoco_does_not_read_the_attitude(redundant):
    scenario = ff.load_scenario("panda_servicer/line")
    heavier = scenario.text.replace("inertia: [16, 16, 16]", "inertia: [18, 16, 16]")
    system = parse_scenario(heavier, scenario.source).problem().system
    assert forward_run(redundant, Engine(system)).attitude > 1e-3
