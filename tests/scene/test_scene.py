"""Bodies beside the robot and the corridor: shapes, poses, values that are refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.scene.scene_body import EndEffectorPoses
from tests.errors import error_key
from tests.prismatic import LENGTH, prismatic_problem, prismatic_robot
from tests.robots import joint_text

TURNED = Rotation.from_euler("z", 90.0, degrees=True).as_matrix()


def test_a_body_with_the_target_has_the_pose_of_the_path():
    path = ff.load_scenario("spatial_6dof/line").problem().path
    body = ff.SceneBody("tool", ff.Sphere(0.1), [0.1, 0.2, 0.3], TURNED, motion="target")
    for t in (0.0, 31.0, 100.0):
        expected = path.pose(t)
        pose = body.pose_at(t, path, EndEffectorPoses.on(expected))
        position = expected.position + expected.rotation @ [0.1, 0.2, 0.3]
        np.testing.assert_allclose(pose.position, position, atol=1e-14)
        np.testing.assert_allclose(pose.rotation, expected.rotation @ TURNED, atol=1e-14)


def test_a_tumbling_body_rotates_about_its_centre_of_mass():
    path = prismatic_problem(prismatic_robot()).path
    tumbling = ff.Tumbling([4.0, 3.0, 2.0], [0.3, 0.1, 0.2], com=[0.5, -0.1, 0.0])
    body = ff.SceneBody("client", ff.Box([1, 1, 1]), [2.0, 0.0, 1.0], TURNED, tumbling)
    centre = body.position + TURNED @ tumbling.com
    for t in (0.0, 3.0, 11.0):
        pose = body.pose_at(t, path)
        np.testing.assert_allclose(pose.position + pose.rotation @ tumbling.com, centre, atol=1e-12)
    np.testing.assert_allclose(body.pose_at(0.0, path).rotation, TURNED, atol=1e-14)
    rate = Rotation.from_matrix(body.pose_at(1e-5, path).rotation @ TURNED.T).as_rotvec() / 1e-5
    np.testing.assert_allclose(rate, TURNED @ tumbling.rate, atol=1e-4)


def test_a_urdf_has_the_shapes_of_all_links_with_joints_at_zero(tmp_path):
    text = (
        '<robot name="client"><link name="bus"><visual><geometry><box size="1 1 1"/></geometry>'
        '</visual></link><link name="array"><visual><geometry><sphere radius="9"/></geometry>'
        '</visual><collision><origin xyz="0 0 2"/><geometry><box size="1 2 3"/></geometry>'
        "</collision></link>"
        + joint_text("hinge", "R", "bus", "array", "1 0 0", "0 0 1.5707963267948966")
        + "</robot>"
    )
    file = tmp_path / "client.urdf"
    file.write_text(text)
    bus, array = ff.SceneBody("client", str(file)).shapes("collision")
    assert (bus.geometry.size == [1, 1, 1]).all()
    assert (array.geometry.size == [1, 2, 3]).all()
    np.testing.assert_allclose(array.origin.position, [1.0, 0.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(array.origin.rotation, TURNED, atol=1e-12)
    assert [shape.geometry for shape in ff.SceneBody("client", file).shapes("visual")][
        1
    ] == ff.Sphere(9)


def test_deviations_from_cones_are_angles_and_from_cylinders_distances():
    cone = ff.Corridor([1.0, 0.0, 0.0], [0.0, 0.0, 2.0], half_angle=0.3)
    assert cone.deviation(np.array([1.0, 0.5, 0.5])) == pytest.approx(np.pi / 4.0)
    assert cone.deviation(np.array([1.0, 0.0, -0.5])) == pytest.approx(np.pi)
    assert cone.deviation(np.array([1.0, 5e-4, -5e-4])) == 0.0
    cylinder = ff.Corridor([1.0, 0.0, 0.0], [0.0, 0.0, 2.0], radius=0.3)
    assert cylinder.deviation(np.array([1.0, 0.5, -7.0])) == pytest.approx(0.5)
    assert cone.allowed == cylinder.allowed == 0.3


def test_a_corridor_moves_with_its_body():
    body = ff.SceneBody("client", ff.Sphere(0.1), [0.0, 0.2, 0.0], motion="target")
    scene = ff.Scene([body], ff.Corridor([0, 0, 0], [1, 0, 0], radius=1.0, body="client"))
    problem = prismatic_problem(prismatic_robot()).replace(scene=scene)
    path = problem.path
    first, last = (
        scene.corridor_pose(t, path, EndEffectorPoses.on(path.pose(t))).position
        for t in (0.0, 20.0)
    )
    np.testing.assert_allclose(last - first, [LENGTH, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(("call", "key"), [
    (lambda: ff.SceneBody("a", ff.Box([1.0, -1.0, 1.0])), "body.shape.size"),
    (lambda: ff.SceneBody("a", "missing.stl"), "body.shape"),
    (lambda: ff.SceneBody("a", ff.Sphere(1.0), motion="drifting"), "body.motion"),
    (lambda: ff.Corridor([0, 0, 0], [0, 0, 1]), "corridor"),
    (lambda: ff.Scene([ff.SceneBody("a", ff.Sphere(1.0))] * 2), "scene.bodies"),
    (lambda: ff.Scene([], ff.Corridor([0, 0, 0], [0, 0, 1], 0.1, body="a")), "scene.corridor.body"),
])  # fmt: skip
def test_impossible_values_are_refused(call, key):
    assert error_key(call) == key


@pytest.mark.parametrize(("body", "key"), [
    (ff.SceneBody("hand", ff.Sphere(1.0)), "scene.bodies"),
    (ff.SceneBody("client", ff.Sphere(1.0), touch_links=("finger",)), "scene.bodies.touch_links"),
    (ff.SceneBody("client", ff.Sphere(1.0), motion=ff.Tumbling([1, 1, 1], [0, 0, 1e4])),
     "scene.bodies.tumbling.rate"),
])  # fmt: skip
def test_bodies_that_do_not_suit_the_problem_are_refused(body, key):
    problem = prismatic_problem(prismatic_robot())
    assert error_key(lambda: problem.replace(scene=ff.Scene([body]))) == key
