"""Forward kinematics of many states against Pinocchio's of one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from freefloat.robot.model import FreeFloatingModel
from freefloat.visualization.body_poses import body_poses
from tests.robots import random_robot


@pytest.mark.parametrize("structure", ["RRRRRR", "RPR", "PCRFRP", "CRRRRRRR", "R"])
def test_bodies_are_where_pinocchio_has_them(structure: str, rng: np.random.Generator) -> None:
    robot = random_robot(rng, structure)
    model = FreeFloatingModel.from_urdf(robot.text, robot.tip)
    joints = rng.uniform(-3.0, 3.0, (5, model.dof))
    attitudes = Rotation.random(5, random_state=rng).as_quat()
    found = body_poses(model, attitudes, joints)
    for k in range(5):
        for body, pose in enumerate(model.body_poses(attitudes[k], joints[k])):
            assert found.positions[k, body] == pytest.approx(pose.position, abs=1e-12)
            assert found.rotations[k, body] == pytest.approx(pose.rotation, abs=1e-12)
        tip = model.end_effector_pose(attitudes[k], joints[k])
        assert found.tips[k] == pytest.approx(tip.position, abs=1e-12)
        assert found.tip_rotations[k] == pytest.approx(tip.rotation, abs=1e-12)
