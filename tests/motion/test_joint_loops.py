"""Closed loops of the joints: a published turn, orders of accuracy, MuJoCo, momentum."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.motion.joint_loops import JointLoops, integrate_loops, loop_rotations
from freefloat.verification.engines.mujoco import forward_run
from freefloat.verification.engines.mujoco_model import Engine

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
PUBLISHED = JointLoops([0.9, 0.7], [[-0.6, 0.0]], [[0.0, 0.6]], 1)
"""q = (.3 + .6 cos phi, .7 + .6 sin phi)."""


def spatial(count: int = 1) -> JointLoops:
    rng = np.random.default_rng(5)
    cosines, sines = 0.4 * rng.normal(size=(2, 2, 6))
    return JointLoops([0.0, 0.5, -1.0, 0.2, 0.4, 0.1], cosines, sines, count)


def without_momentum(name: str) -> ff.Problem:
    return ff.load_scenario(name).problem().replace(momentum=np.zeros(3))


def heading(attitude: np.ndarray) -> float:
    return float(2.0 * np.degrees(np.arctan2(attitude[2], attitude[3])))


def test_a_loop_turns_the_planar_arm_by_the_published_angle() -> None:
    motion = integrate_loops(without_momentum("planar_2dof/line"), PUBLISHED, IDENTITY)
    assert heading(motion.final.attitude) == pytest.approx(-2.354629743979, abs=1e-9)
    np.testing.assert_array_equal(motion.final.joints, motion.initial.joints)
    ends = loop_rotations(motion.problem.model, PUBLISHED.joints, PUBLISHED.coefficients)
    assert heading(ends) == pytest.approx(-2.354629743979, abs=1e-6)


def test_the_turn_does_not_depend_on_the_timing() -> None:
    problem = without_momentum("spatial_6dof/line")
    slow = integrate_loops(problem.stretched(7.0), spatial(), IDENTITY).final.attitude
    fast = integrate_loops(problem, spatial(), IDENTITY).final.attitude
    np.testing.assert_allclose(slow, fast, atol=1e-10)


def test_the_quick_rotation_is_that_of_the_precise_motion() -> None:
    problem, loops = without_momentum("spatial_6dof/line"), spatial()
    precise = integrate_loops(problem, loops, IDENTITY).final.attitude
    quick = loop_rotations(problem.model, loops.joints, loops.coefficients)
    assert (Rotation.from_quat(precise).inv() * Rotation.from_quat(quick)).magnitude() < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("momentum", [np.zeros(3), np.array([0.2, -0.1, 0.3])], ids=["0", "h"])
def test_mujoco_ends_in_the_same_attitude(momentum: np.ndarray) -> None:
    problem = without_momentum("spatial_6dof/line").replace(momentum=momentum)
    motion = integrate_loops(problem, spatial(), IDENTITY)
    assert np.nanmax(motion.momentum_errors(np.linspace(0.0, motion.panels, 301))) < 1e-6
    assert forward_run(motion, Engine(problem.system)).attitude < 1e-4
