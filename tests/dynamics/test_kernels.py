"""Forward kinematics and momentum of the kernels, which run as plain Python, against Pinocchio."""

from __future__ import annotations

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.missions.goals.placements import PlacedArm, Placements
from freefloat.dynamics.kernels import configurations
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.dynamics.robot_arrays import kernel_robot
from tests.lock_step import plain_kernels
from tests.robots import random_robot
from tests.two_arms import random_case

UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("structure", ["RPR", "RRPRRRR"])
def test_bodies_and_centres_of_mass_are_where_pinocchio_places_them(
    structure: str, rng: np.random.Generator
) -> None:
    robot = random_robot(rng, structure)
    model = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    joints, step = rng.uniform(-2.0, 2.0, (3, model.dof)), 1e-6 * np.eye(model.dof)
    with plain_kernels():
        placed = Placements.of(PlacedArm.of(model), joints)
    for k, q in enumerate(joints):
        base = model.base_position(UPRIGHT, q)
        poses = model.body_poses(UPRIGHT, q)
        np.testing.assert_allclose(
            placed.rotations[k], [pose.rotation for pose in poses], atol=1e-9
        )
        origins = np.array([pose.position - base for pose in poses])
        np.testing.assert_allclose(placed.origins[k], origins, atol=1e-9)
        np.testing.assert_allclose(placed.centres[k], -base, atol=1e-9)
        ahead, behind = ([model.base_position(UPRIGHT, q + d) for d in side * step]
                         for side in (1.0, -1.0))  # fmt: skip
        rates = (np.array(behind) - ahead).T / 2e-6
        np.testing.assert_allclose(placed.centre_rates[k], rates, atol=1e-7)


@pytest.mark.parametrize("both", [False, True])
def test_the_spacecraft_turns_as_the_matrices_of_pinocchio_say(
    both: bool, rng: np.random.Generator
) -> None:
    """Robots with one arm, and with two that follow paths."""
    model = random_case(rng, both=both).problem.model_at()
    joints = rng.uniform(-2.0, 2.0, (3, model.dof))
    with plain_kernels():
        found = configurations.Configurations.of(kernel_robot(model, ff.Task.POSITION), joints)
    for k, q in enumerate(joints):
        D, Dq = inertia_matrices(model, q)
        np.testing.assert_allclose(found.inverses[k] @ D, np.eye(3), atol=1e-9)
        np.testing.assert_allclose(found.turns[k], -np.linalg.solve(D, Dq), atol=1e-9)
