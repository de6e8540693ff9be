"""Certificates: recomputed errors and margins, and a second integrator."""

import json
from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.engines.mujoco import forward_run
from freefloat.beyond.engines.mujoco_model import MuJoCoModel
from freefloat.certificate.certificate import certify, integrate_again
from freefloat.io.scenario.loading import parse_scenario
from freefloat.motion.motion import Ending
from freefloat.motion.panels import DEGREE
from tests.motions import GOOD, bundled, heading, simulated
from tests.prismatic import prismatic_motion, prismatic_robot

X_AXIS = np.array([1.0, 0.0, 0.0])


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
    result = certify(replace(motion, law=redundant.law))
    assert result.end_effector_position.value < 1e-8
    assert result.momentum.value < 1e-6 * result.momentum_scale
    assert result.rates.value > 1e-3
    assert result.integration.joints > 1e-3


def test_second_integration_shows_the_error_of_the_first(motion):
    again = integrate_again(motion)
    assert again.attitude < 1e-8
    assert again.joints < 1e-8
    assert again.until == motion.times[-1]
    turned = motion.attitudes.copy()
    turned[-1, :3] += 1e-6 * turned[-1, 3] * X_AXIS
    turned[-1] /= np.linalg.norm(turned[-1])
    assert integrate_again(replace(motion, attitudes=turned)).attitude > 1e-6


def test_a_motion_that_goes_on_beyond_a_singularity_differs_from_its_second_integration(singular):
    doubled = np.concatenate([singular.joints, singular.joints[:-1][::-1]])
    again = np.concatenate([singular.attitudes, singular.attitudes[:-1][::-1]])
    times = np.concatenate([singular.times, 2.0 * singular.times[-1] - singular.times[:-1][::-1]])
    beyond = replace(
        singular, ending=Ending.COMPLETED, times=times, attitudes=again, joints=doubled
    )
    assert integrate_again(beyond).joints > 1e-2


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


@pytest.mark.slow
def test_mujoco_does_not_read_the_attitude(redundant):
    scenario = ff.load_scenario("panda_servicer/line")
    heavier = scenario.text.replace("inertia: [16, 16, 16]", "inertia: [18, 16, 16]")
    system = parse_scenario(heavier, scenario.source).problem().system
    assert forward_run(redundant, MuJoCoModel(system)).attitude > 1e-3
