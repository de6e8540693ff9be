"""Body poses against Pinocchio; outlines against the kinematics and the URDF."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from freefloat.io.scenario import load_scenario
from freefloat.motion.motion import Ending, Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import models_folder
from freefloat.so3 import heading_quaternion, rotation_matrix
from freefloat.visualization.body_poses import body_poses, outlines, spacecraft_box
from tests.robots import random_robot


@pytest.mark.parametrize("structure", ["RRRRRR", "RPR", "PCRFRP", "CRRRRRRR", "R"])
def test_bodies_are_where_pinocchio_has_them(structure: str, rng: np.random.Generator) -> None:
    robot = random_robot(rng, structure)
    model = FreeFloatingModel.from_urdf(robot.text, robot.tip)
    joints = rng.uniform(-3.0, 3.0, (5, model.dof))
    attitudes = Rotation.random(5, random_state=rng).as_quat()
    poses = body_poses(model, attitudes, joints)
    for k in range(5):
        for body, pose in enumerate(model.body_poses(attitudes[k], joints[k])):
            assert poses.positions[k, body] == pytest.approx(pose.position, abs=1e-12)
            assert poses.rotations[k, body] == pytest.approx(pose.rotation, abs=1e-12)
        end = model.end_effector_pose(attitudes[k], joints[k])
        assert poses.end_effectors[k] == pytest.approx(end.position, abs=1e-12)
        assert poses.end_effector_rotations[k] == pytest.approx(end.rotation, abs=1e-12)


def motion_at_rest(name: str, attitude: list[float]) -> Motion:
    """A motion with a single state."""
    problem = load_scenario(name).problem()
    joints = problem.branches(attitude)[0].joints
    return Motion(problem, Ending.COMPLETED, np.zeros(1), np.array([attitude]), joints[None])


@pytest.mark.parametrize("name", ["planar_3dof/parabola", "spatial_6dof/line", "ur5_servicer/arc"])
def test_the_arm_runs_from_its_mount_to_the_end_effector(name: str) -> None:
    planar = name.startswith("planar")
    attitude = heading_quaternion(3.5) if planar else np.array([0.1, -0.2, 0.3, 0.927])
    attitude = attitude / np.linalg.norm(attitude)
    motion = motion_at_rest(name, attitude.tolist())
    model, joints = motion.problem.model, motion.joints[0]
    (shown,) = outlines(motion, [0.0])
    assert shown.arm.shape == (model.dof + 2, 3)
    end = model.end_effector_pose(attitude, joints).position
    assert np.allclose(shown.arm[-1], end, atol=1e-12)
    mount = model.base_position(attitude, joints) + rotation_matrix(attitude) @ (
        model.bodies[1].placement.position
    )
    assert np.allclose(shown.arm[1], mount, atol=1e-12)
    lengths = [np.linalg.norm(body.placement.position) for body in model.bodies[2:]]
    drawn = [np.linalg.norm(b - a) for a, b in pairwise(shown.arm[1:-1])]
    assert np.allclose(drawn, lengths, atol=1e-12)


def test_the_arm_starts_on_the_spacecraft() -> None:
    """The first joint of a UR5 is 0.089 m above its base, which is on top of a cube of 1 m."""
    motion = motion_at_rest("ur5_servicer/arc", [0.0, 0.0, 0.0, 1.0])
    (shown,) = outlines(motion, [0.0])
    mount, joint = shown.arm[:2] - motion.base_positions[0]
    assert np.allclose(mount, [0.0, 0.0, 0.5], atol=1e-12)
    assert joint[2] == pytest.approx(0.589, abs=1e-3)
    (planar,) = outlines(motion_at_rest("planar_3dof/parabola", [0.0, 0.0, 0.0, 1.0]), [0.0])
    assert np.allclose(planar.arm[0], planar.arm[1])  # the first joint is on the edge


def test_the_spacecraft_is_its_largest_box() -> None:
    model = load_scenario("planar_3dof/parabola").problem().model
    box = spacecraft_box(model)  # not its solar panels
    assert np.allclose(np.ptp(box, axis=0), [1.0, 1.0, 0.6])
    assert np.allclose(box.mean(axis=0), 0.0)


def test_the_box_moves_with_the_spacecraft() -> None:
    attitude = [0.5, 0.5, 0.5, 0.5]
    motion = motion_at_rest("spatial_6dof/line", attitude)
    (shown,) = outlines(motion, [0.0])
    assert np.allclose(shown.spacecraft.mean(axis=0), motion.base_positions[0], atol=1e-12)
    box = (shown.spacecraft - motion.base_positions[0]) @ rotation_matrix(attitude)
    assert np.allclose(box, spacecraft_box(motion.problem.model), atol=1e-12)


def test_a_spacecraft_without_boxes_gets_the_box_around_its_shape() -> None:
    text = (models_folder() / "planar_3dof" / "planar_3dof.urdf").read_text()
    whole, _, rest = text.partition("</link>")
    bare = re.sub(r"<visual>.*</visual>", "", whole, flags=re.DOTALL)
    shown = (
        '<visual><origin xyz="0 0 1"/><geometry><cylinder radius="0.5" length="3"/></geometry>'
        "</visual>"
    )
    text = f"{bare}{shown}</link>{rest}"
    box = spacecraft_box(FreeFloatingModel.from_urdf(text))
    assert np.allclose(box.min(axis=0), [-0.5, -0.5, -0.5])
    assert np.allclose(box.max(axis=0), [0.5, 0.5, 2.5])
