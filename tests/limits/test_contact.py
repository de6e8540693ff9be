"""Contact between bodies without a limit on the clearance: the same that the limit finds."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import freefloat as ff
from freefloat.limits.contact import deepest_contact, why_unchecked
from freefloat.motion.motion import Motion
from tests.prismatic import prismatic_motion, prismatic_robot, shape_text
from tests.robots import joint_text

ATTITUDE = [0.46008, 0.09337, 0.73519, -0.48898]
CUBE, BALL = shape_text('<box size="1 1 1"/>'), shape_text('<sphere radius="0.1"/>')


@pytest.fixture(scope="module")
def simulation():
    return ff.simulate(ff.load_scenario("spatial_6dof/line").problem(), ATTITUDE)


def test_the_deepest_contact_is_that_of_the_limit(simulation):
    motion = simulation.chosen.motion
    results = ff.check_limits(motion, ff.Limits(base_rate=1.0, clearance=0.0))
    limit = next(entry for entry in results if entry.limit == "clearance")
    contact = simulation.contact
    assert " - ".join(contact.bodies) == limit.where
    np.testing.assert_allclose([contact.depth, contact.time], [-limit.worst, limit.time])
    assert contact.s == motion.problem.path.timing.s(contact.time)
    assert deepest_contact(motion, [replace(limit, worst=0.01)]) is None  # no search


def test_a_motion_to_a_goal_states_its_contact():
    system = ff.System(ff.FreeFloatingModel.from_urdf("planar_2dof"))
    state, there = ([0.0, 0.0, 0.0, 1.0], [0.2, 0.4]), [1.2, 0.4]
    limits, goal = ff.Limits(joint_rate=[0.1, 0.1]), ff.Goal(joints=there)
    free = ff.move(system, state, goal, limits)
    half = ff.move(system, state, ff.Goal(joints=[0.7, 0.4]), limits).motion.final
    place = system.model.end_effector_pose(half.attitude, half.joints).position
    ball = ff.Scene((ff.SceneBody("ball", ff.Sphere(0.2), place),))
    contact = ff.move(system, state, goal, limits, ball).contact
    assert free.contact is None
    assert contact.bodies[1] == "ball"
    assert contact.depth > 0.04


def between_cubes(folder, gap: float) -> Motion:
    """An end-effector of radius 0.1 m that passes between two cubes of one mesh."""
    away = gap / 2.0 + 0.05
    cubes = [trimesh.creation.box([0.1] * 3).apply_translation([0, 0, z]) for z in (-away, away)]
    trimesh.util.concatenate(cubes).export(folder / "gate.stl")
    mesh = shape_text('<mesh filename="gate.stl"/>')
    gate = f'<link name="gate">{mesh}</link>'
    file = folder / "robot.urdf"
    more = joint_text("gate_joint", "F", "bus", "gate", "1.4 0 0") + gate
    file.write_text(prismatic_robot(CUBE, BALL, more))
    return prismatic_motion(file)


def test_meshes_in_contact_are_divided_into_convex_parts(tmp_path):
    """The convex hull of the two cubes closes the gap between them."""
    assert deepest_contact(between_cubes(tmp_path, 0.24)) is None
    contact = deepest_contact(between_cubes(tmp_path, 0.18))
    assert contact.bodies == ("gate", "hand")
    assert str(contact) == f"hand overlaps gate by 0.01 m at t = {contact.time:.4f} s"
    assert contact.to_dict() == {**vars(contact), "bodies": ["gate", "hand"]}
    np.testing.assert_allclose(contact.depth, 0.01, atol=1e-6)


@pytest.mark.parametrize("shape", ["", shape_text('<mesh filename="none.stl"/>')])
def test_robots_whose_shapes_cannot_be_used_have_none(shape):
    motion = prismatic_motion(prismatic_robot(CUBE, shape))
    assert deepest_contact(motion) is None
    assert why_unchecked(motion.problem.model).startswith("link hand: <coll") is bool(shape)
    assert why_unchecked(prismatic_motion(prismatic_robot(CUBE, BALL)).problem.model) is None
