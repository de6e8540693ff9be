"""Starts of Newton's method: configurations with poses close to others."""

from __future__ import annotations

import numpy as np
import pytest

import freefloat as ff
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.ik.branches import many_arm_branches
from freefloat.so3 import Array
from tests.robots import random_robot

ARMS = [
    ("RRRRRRR", ff.Task.POSE), ("RRRPRRRP", ff.Task.POSE), ("PRRRR", ff.Task.POSITION),
    ("RRRRR", ff.Task.POSITION),
]  # fmt: skip


def reached_poses(
    structure: str, rng: np.random.Generator
) -> tuple[ff.FreeFloatingModel, Array, Array]:
    """A random robot, and positions and rotations that its arm reaches."""
    robot = random_robot(rng, structure)
    model = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    lower, upper = model.joint_ranges
    width = np.where(model.prismatic, upper - lower, 2.0 * np.pi)
    first = np.where(model.prismatic, lower, -np.pi)
    q = first + width * rng.random((40, model.dof))
    positions, rotations, _, _ = VirtualManipulator.of(model).kinematics(q)
    return model, positions, rotations


@pytest.mark.parametrize(("structure", "task"), [*ARMS, ("RRR", ff.Task.POSITION)])
def test_branches_do_not_depend_on_the_other_poses(
    structure: str, task: ff.Task, rng: np.random.Generator
) -> None:
    """A pose on its own has the very branches that it has among others."""
    model, positions, rotations = reached_poses(structure, rng)
    together = many_arm_branches(model, positions, rotations, task)
    assert together.exist.any(axis=1).all()
    for k in range(0, len(positions), 8):
        alone = many_arm_branches(model, positions[k], rotations[k], task)
        np.testing.assert_array_equal(alone.joints[0], together.joints[k])
        np.testing.assert_array_equal(alone.names[0], together.names[k])
