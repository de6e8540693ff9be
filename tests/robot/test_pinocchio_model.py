"""Robots that Pinocchio has: the same as their files; its poses and quaternions."""

import re
from collections.abc import Callable
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import freefloat as ff
from freefloat.robot.named_files import example_robot
from freefloat.robot.shapes import MeshFile
from tests.errors import error_key
from tests.motions import bundled
from tests.robots import pin_configuration, pinocchio_jacobian

pytestmark = pytest.mark.usefixtures("readers_here")
Case = tuple[pin.Model, ff.FreeFloatingModel]
"""A model of Pinocchio, and the robot that a file describes."""
FREE, PLANAR = pin.JointModelFreeFlyer(), pin.JointModelPlanar()
BUS = pin.Inertia(100.0, np.array([0.1, 0.2, 0.3]), np.diag([30.0, 40.0, 50.0]))
LINK = pin.Inertia(5.0, np.array([0.3, 0.0, 0.1]), np.diag([0.2, 0.4, 0.5]))
MJCF = """<mujoco><compiler angle="radian"/><worldbody><body name="bus"><freejoint name="free"/>
<inertial pos="0.1 0 0.2" mass="90" diaginertia="10 12 15"/>
<body name="upper" pos="0.5 0 0.1"><joint name="q1" axis="0 0.6 0.8" range="-1.5 2"/>
<inertial pos="0.2 0 0" mass="6" diaginertia="0.1 0.3 0.3" quat="0.8 0.6 0 0"/>
<body name="rail" pos="0.4 0.1 0" quat="0.6 0 0.8 0">
<joint name="q2" type="slide" axis="1 0 0" range="-0.3 0.5"/>
<inertial pos="0 0 0.2" mass="4" diaginertia="0.1 0.1 0.05"/>
<body name="hand" pos="0 0.3 0"><joint name="q3" axis="1 0 0" range="-1.5 1.5"/>
<inertial pos="0 0 0.1" mass="2" diaginertia="0.02 0.02 0.01"/>
</body></body></body></body></worldbody></mujoco>"""


def from_text(name: str, *root: object, base: str = "free") -> Case:
    file = ff.FreeFloatingModel.from_urdf(name, base=base)
    return pin.buildModelFromXML(file.description.text, *root), file


def from_example(name: str, link: str, *root: object, base: str = "free") -> Case:
    file = example_robot(name)
    robot = ff.FreeFloatingModel.from_urdf(file, link, base=base)
    return pin.buildModelFromUrdf(str(file), *root), robot


def reduced(name: str, link: str, **fixed: float) -> Case:
    model, _ = from_example(name, link, FREE)
    numbers = [model.getJointId(joint) for joint in fixed]
    file = ff.FreeFloatingModel.from_urdf(example_robot(name), link, fixed_joints=fixed)
    return pin.buildReducedModel(model, numbers, pin_configuration(model, fixed)), file


def from_mjcf(folder: Path) -> Case:
    file = folder / "robot.xml"
    file.write_text(MJCF)
    return pin.buildModelFromMJCF(str(file)), ff.FreeFloatingModel.from_urdf(file, "hand")


CASES: dict[str, Callable[[Path], Case]] = {
    "URDF": lambda _: from_text("planar_2dof", FREE),
    "URDF, planar": lambda _: from_text("planar_3dof", PLANAR, base="planar"),
    "URDF, no root": lambda _: from_text("ssrms"),
    "MJCF": from_mjcf,
    "example, two arms": lambda _: from_example("romeo", "RShoulderYawLink", FREE),
    "reduced": lambda _: reduced(
        "kinova",
        "j2s6s200_end_effector",
        j2s6s200_joint_1=-2.0,
        j2s6s200_joint_4=0.3,
        j2s6s200_joint_5=1.0,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_model_is_the_robot_of_its_file(name: str, tmp_path: Path) -> None:
    pin_model, file = CASES[name](tmp_path)
    model = ff.FreeFloatingModel.from_pinocchio(pin_model, file.end_effector)
    assert (model.joint_names, model.base) == (file.joint_names, file.base)
    np.testing.assert_allclose(model.joint_ranges, file.joint_ranges, atol=1e-12)
    if name != "MJCF":  # Pinocchio has no rated effort there
        rated, expected = ([(body.rated_speed, body.rated_effort) for body in robot.bodies]
                           for robot in (model, file))  # fmt: skip
        assert rated == expected
    q = np.random.default_rng(1).uniform(-0.3, 0.3, (4, model.dof))
    written = ff.FreeFloatingModel.from_urdf(model.description.text, file.end_effector)
    expected = ff.generalized_jacobian(file, q)
    for robot in (model, written):
        S = ff.generalized_jacobian(robot, q)
        np.testing.assert_allclose(S, expected, rtol=0.0, atol=1e-12)


def arm(root: object = FREE, *joints: object) -> pin.Model:
    """Joints a metre apart, ``j1``, ``j2`` ..., each with a body; a frame ``tip`` on the last."""
    model, step = pin.Model(), pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.2]))
    last = 0 if root is None else model.addJoint(0, root, step, "root")
    model.appendBodyToJoint(last, BUS, pin.SE3.Identity())
    for number, joint in enumerate(joints or (pin.JointModelRZ(), pin.JointModelRY()), start=1):
        last = model.addJoint(last, joint, step, f"j{number}")
        model.appendBodyToJoint(last, LINK, pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", last, 0, step, pin.OP_FRAME))
    return model


def named(joints: np.ndarray) -> dict[str, float]:
    """Joints by the names that :func:`arm` gives them."""
    return {f"j{number}": value for number, value in enumerate(joints, start=1)}


OBLIQUE = np.array([0.6, 0.0, 0.8])
JOINTS = (
    pin.JointModelRUBZ(), pin.JointModelRevoluteUnaligned(OBLIQUE), pin.JointModelPX(),
    pin.JointModelPrismaticUnaligned(OBLIQUE), pin.JointModelRY(), pin.JointModelRX(),
)  # fmt: skip


@pytest.mark.parametrize("root", [FREE, None])
def test_a_model_that_is_put_together_is_that_of_pinocchios_matrices(root: object) -> None:
    robot = ff.FreeFloatingModel.from_pinocchio(arm(root, *JOINTS), "tip")
    assert robot.base == "free"
    q = np.array([0.3, -0.4, 0.2, 0.5, 0.7, -0.6])
    expected = pinocchio_jacobian(arm(FREE, *JOINTS), "tip", named(q))
    np.testing.assert_allclose(ff.generalized_jacobian(robot, q), expected, rtol=0.0, atol=1e-12)
    assert ff.FreeFloatingModel.from_pinocchio(arm(PLANAR, *JOINTS), "tip").base == "planar"


def test_other_joints_off_the_arm_are_fixed_at_neutral() -> None:
    model = arm(FREE, pin.JointModelRZ(), pin.JointModelPY(), pin.JointModelRevoluteUnaligned(
        np.array([0.6, 0.0, 0.8])))  # fmt: skip
    upright = pin.SE3(pin.rpy.rpyToMatrix(0.3, np.pi / 2.0 - 1e-9, -1.0), np.array([0.1, 0.2, 0.3]))
    ball = model.addJoint(2, pin.JointModelSpherical(), upright, "ball")
    model.appendBodyToJoint(ball, LINK, upright)
    finger = model.addJoint(4, pin.JointModelHX(0.3), upright, "screw")
    model.appendBodyToJoint(finger, LINK, upright)
    robot = ff.FreeFloatingModel.from_pinocchio(model, "tip")
    assert robot.joint_names == ("j1", "j2", "j3")
    q = np.array([0.3, -0.2, 0.8])
    expected = pinocchio_jacobian(model, "tip", named(q))
    np.testing.assert_allclose(ff.generalized_jacobian(robot, q), expected, rtol=0.0, atol=1e-12)
    assert error_key(ff.FreeFloatingModel.from_pinocchio, model, "screw") == "joint screw"


def test_mimics_of_moving_joints_are_refused() -> None:
    robot = ff.FreeFloatingModel.from_urdf("planar_3dof", "end_effector")
    coupled = re.sub('(name="q2" type.*?)</joint>', r'\1<mimic joint="q1"/></joint>',
                     robot.description.text, count=1, flags=re.DOTALL)  # fmt: skip
    model = pin.buildModelFromXML(coupled, pin.JointModelFreeFlyer(), mimic=True)
    for link in robot.body_names[1:]:
        assert error_key(ff.FreeFloatingModel.from_pinocchio, model, link) == "joint q2"


def test_tiny_and_massless_bodies_stay() -> None:
    model = arm()
    last = model.addJoint(3, pin.JointModelRX(), pin.SE3.Identity(), "roll")
    speck = pin.Inertia(1e-12, np.array([0.1, 0.0, 0.0]), 1e-18 * np.diag([1.0, 2.0, 2.0]))
    model.appendBodyToJoint(last, speck, pin.SE3.Identity())
    model.addJoint(last, pin.JointModelRY(), pin.SE3.Identity(), "pitch")
    bodies = ff.FreeFloatingModel.from_pinocchio(model, "pitch").bodies
    assert [body.mass for body in bodies] == [100.0, 5.0, 5.0, 1e-12, 0.0]
    np.testing.assert_allclose(bodies[3].centre, [0.1, 0.0, 0.0])
    np.testing.assert_allclose(np.diag(bodies[3].inertia), [1e-18, 2e-18, 2e-18], rtol=1e-12)


def test_only_what_the_root_carries_is_the_robot() -> None:
    model = arm()
    model.appendBodyToJoint(0, BUS, pin.SE3.Identity())
    other = model.addJoint(0, FREE, pin.SE3.Identity(), "client")
    model.appendBodyToJoint(other, BUS, pin.SE3.Identity())
    assert ff.FreeFloatingModel.from_pinocchio(model, "tip").total_mass == pytest.approx(110.0)


def test_names_may_be_those_of_joints_links_and_frames_at_once() -> None:
    """The body of a name is the end-effector; two names for one place are one link."""
    model, place = arm(), pin.SE3(np.eye(3), np.array([0.0, 0.5, 0.0]))
    model.addFrame(pin.Frame("j1", 3, 0, place, pin.OP_FRAME))
    model.addFrame(pin.Frame("j2", 3, 0, place, pin.FIXED_JOINT))
    model.addBodyFrame("j2", 3, place, model.getFrameId("j2", pin.FIXED_JOINT))
    model.addFrame(pin.Frame("tip", 2, 0, place, pin.FIXED_JOINT))
    for name, expected in {"j1": 0.5, "j2": 0.5, "tip": 0.0}.items():
        robot = ff.FreeFloatingModel.from_pinocchio(model, name)
        assert robot.joint_names == ("j1", "j2")
        assert robot.tool.position[1] == expected


def shapes() -> pin.GeometryModel:
    """Shapes of an arm's second link."""
    kinds = {
        "box": coal.Box(0.2, 0.3, 0.4), "ball": coal.Sphere(0.3), "can": coal.Cylinder(0.1, 0.6),
        "pill": coal.Capsule(0.1, 0.5),
    }  # fmt: skip
    geometry, place = pin.GeometryModel(), pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))
    for name, kind in kinds.items():
        shape = pin.GeometryObject(name, 3, place, kind)
        shape.meshColor = np.array([1.0, 0.5, 0.0, 1.0])
        geometry.addGeometryObject(shape)
    return geometry


def test_shapes_are_for_collision_and_pictures() -> None:
    robot = ff.FreeFloatingModel.from_pinocchio(arm(), "tip", geometry=shapes())
    link = robot.description.links_by_name["j2"]
    names = ["Box", "Sphere", "Cylinder", "Capsule"]
    assert [type(shape.geometry).__name__ for shape in link.collisions] == names
    box, ball, can, pill = (shape.geometry for shape in link.visuals)
    np.testing.assert_allclose(box.size, [0.2, 0.3, 0.4])
    assert (ball.radius, can.radius, can.length, pill.radius) == (0.3, 0.1, 0.6, 0.1)
    assert pill.length == 0.5
    assert all(shape.colour == (1.0, 0.5, 0.0, 1.0) for shape in link.visuals)
    assert all(shape.origin.position[0] == 0.5 for shape in link.shapes)
    alone = ff.FreeFloatingModel.from_pinocchio(arm(), "tip", geometry=(shapes(), None))
    assert not alone.description.links_by_name["j2"].visuals


def test_meshes_are_those_of_the_file() -> None:
    file = example_robot("ur5")
    folders = [str(folder) for folder in file.parents]
    model, *geometry = pin.buildModelsFromUrdf(str(file), folders, FREE)
    robot = ff.FreeFloatingModel.from_pinocchio(model, "tool0", geometry=tuple(geometry))
    expected = ff.FreeFloatingModel.from_urdf(file, "tool0").description.links_by_name
    files = 0
    for name, link in robot.description.links_by_name.items():
        for kind in ("visuals", "collisions"):
            pairs = zip(getattr(link, kind), getattr(expected[name], kind), strict=True)
            for shape, other in pairs:
                assert type(shape.geometry) is type(other.geometry)
                np.testing.assert_allclose(shape.origin.position, other.origin.position, atol=1e-15)
                np.testing.assert_allclose(shape.origin.rotation, other.origin.rotation, atol=1e-12)
                if isinstance(shape.geometry, MeshFile):
                    assert Path(shape.geometry.filename).name == Path(other.geometry.filename).name
                    assert shape.geometry.scale == other.geometry.scale
                    files += Path(shape.geometry.filename).is_file()
    assert files == 14


def with_frame(name: str) -> pin.Model:
    model = arm()
    model.addFrame(pin.Frame(name, 3, 0, pin.SE3.Identity(), pin.OP_FRAME))
    return model


def with_shape(shape: object) -> pin.GeometryModel:
    geometry = pin.GeometryModel()
    geometry.addGeometryObject(pin.GeometryObject("roof", 3, pin.SE3.Identity(), shape))
    return geometry


@pytest.mark.parametrize(("key", "model", "frame", "geometry"), [
    ("model", "robot.urdf", "tip", None),
    ("model", pin.buildSampleModelManipulator(), "wrist2_joint", None),
    ("model", with_frame("a\nb"), "tip", None),
    ("end_effector", arm(), 3, None),
    ("end_effector", arm(), "tool", None),
    ("end_effector", arm(), "root", None),
    ("joint j2", arm(FREE, pin.JointModelRZ(), pin.JointModelSpherical()), "tip", None),
    ("joint j1", arm(None, pin.JointModelTranslation()), "tip", None),
    ("geometry", arm(), "tip", [shapes()]),
    ("geometry", arm(), "tip", (shapes(), shapes(), shapes())),
    ("geometry.roof", arm(), "tip", with_shape(coal.Cone(0.1, 0.2))),
])  # fmt: skip
def test_what_is_refused(key: str, model: object, frame: object, geometry: object) -> None:
    load = ff.FreeFloatingModel.from_pinocchio
    assert error_key(load, model, frame, geometry=geometry) == key


def test_quaternions_and_poses_of_pinocchio_are_accepted() -> None:
    quaternion = pin.Quaternion(pin.exp3(np.array([0.1, 0.5, -0.3])))
    coefficients, place = quaternion.coeffs(), pin.SE3(quaternion, np.array([1.0, 2.0, 3.0]))
    problem = bundled("spatial_6dof/line")
    for accepts in (
        problem.attitude,
        lambda attitude: problem.model.configuration(attitude, np.zeros(6)),
        lambda attitude: ff.Search(from_attitude=attitude).from_attitude,
        lambda attitude: ff.Goal(attitude=attitude).attitude,
        lambda orientation: ff.paths.FixedOrientation(orientation).axes,
        lambda orientation: ff.SceneBody("b", ff.Sphere(0.1), orientation=orientation).orientation,
    ):
        np.testing.assert_array_equal(accepts(quaternion), accepts(coefficients))
    many = ff.simulate_many(problem, [quaternion, quaternion], branch=0)
    np.testing.assert_array_equal(many.attitudes[0], many.attitudes[1])
    for pose in (
        ff.Goal(pose=place).pose,
        ff.Spacecraft(100.0, [10.0, 10.0, 10.0], mount=place).mount.pose,
        ff.paths.transfer(place, np.zeros(6), pin.SE3.Identity(), 10.0).pose(0.0),
    ):
        np.testing.assert_allclose(pose.position, place.translation, atol=1e-15)
        np.testing.assert_allclose(pose.rotation, place.rotation, atol=1e-15)
    assert error_key(ff.Goal, pose=quaternion) == "goal.pose"
    assert error_key(ff.Goal, attitude=place) == "goal.attitude"
    assert error_key(ff.Spacecraft, 100.0, [10.0] * 3, mount=[0, 0, 1]) == "spacecraft.mount"


def test_gravity_on_a_table_is_what_is_given_not_what_pinocchio_assumes() -> None:
    model = pin.buildModelFromUrdf(str(example_robot("ur5")), PLANAR)
    for gravity in (0.0, 9.81):
        robot = ff.FreeFloatingModel.from_pinocchio(model, "tool0", gravity=gravity)
        assert robot.pin_model.gravity.linear.tolist() == [0.0, 0.0, -gravity]
