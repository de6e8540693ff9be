"""A URDF as a drifting robot: which joints move, what is merged or fixed, what is refused.

Joints that mimic others; arms without mass, on which the spacecraft does not react.
"""

import copy
import pickle
import re
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import freefloat as ff
from freefloat.dynamics.momentum import end_effector_jacobian, momentum_map
from freefloat.errors import ModelError
from freefloat.robot.named_files import models_folder
from freefloat.robot.validation import read_urdf
from freefloat.rotations import rotation_matrix
from tests.errors import error_key
from tests.motions import from_here
from tests.robots import (
    Robot,
    attitudes,
    inertial_text,
    joint_text,
    link_text,
    pin_configuration,
    pinocchio_jacobian,
    random_robot,
    robots,
)

BUS = link_text("bus", inertial_text(100.0, 10.0 * np.eye(3)))


def a_link(name: str, mass: float = 5.0) -> str:
    return link_text(name, inertial_text(mass, 0.5 * mass * np.eye(3), "0.3 0 0"))


def chain_of(*parts: str) -> str:
    return f"<robot name='r'>{BUS}{''.join(parts)}</robot>"


ELBOW = chain_of(
    a_link("upper"), joint_text("shoulder", "R", "bus", "upper", "0.5 0 0", limits=(-1.0, 2.0)),
    a_link("fore"), joint_text("elbow", "C", "upper", "fore", "1 0 0"),
    a_link("mast"), joint_text("hinge", "R", "bus", "mast", "-0.5 0 0", axis="0 1 0"),
)  # fmt: skip


def test_bodies_have_ranges_axes_and_kinds() -> None:
    """Ranges come from the URDF; a continuous joint has none."""
    text = ELBOW.replace('axis xyz="0 0 1"', 'axis xyz="0 0 3"')
    text = text.replace("</robot>", a_link("slide") + joint_text(
        "rail", "P", "fore", "slide", "0.2 0 0", "0 0 1.5707963267948966", "0 -2 0", (0.1, 0.9)
    ) + "</robot>")  # fmt: skip
    bus, shoulder, elbow, rail = ff.FreeFloatingModel.from_urdf(text, "slide").bodies
    assert (bus.joint, bus.lower, bus.upper) == ("root_joint", -np.inf, np.inf)
    assert (shoulder.lower, shoulder.upper, shoulder.prismatic) == (-1.0, 2.0, False)
    assert (elbow.lower, elbow.upper) == (-np.inf, np.inf)
    assert (rail.lower, rail.upper, rail.prismatic) == (0.1, 0.9, True)
    np.testing.assert_array_equal(bus.axis, [0, 0, 0])
    np.testing.assert_allclose(shoulder.axis, [0, 0, 1], atol=1e-15)  # unit, though written as 3
    np.testing.assert_allclose(rail.axis, [0, -1, 0], atol=1e-15)
    np.testing.assert_allclose(rail.placement.position, [0.2, 0, 0], atol=1e-15)
    np.testing.assert_allclose(rail.placement.rotation[:, 0], [0, 1, 0], atol=1e-15)


def test_too_many_moving_joints_are_refused() -> None:
    """Pinocchio would need gigabytes; joints that are fixed by name do not count."""
    names = ["bus", *(f"link_{k}" for k in range(129))]
    chain = [joint_text(f"q_{name}", "C", before, name) + link_text(name)
             for before, name in pairwise(names)]  # fmt: skip
    text = f"<robot name='chain'>{BUS}{''.join(chain)}</robot>"
    assert error_key(ff.FreeFloatingModel.from_urdf, text) == "robot"
    fixed = {"q_link_0": 0.0}
    assert ff.FreeFloatingModel.from_urdf(text, fixed_joints=fixed).dof == 128


@pytest.mark.parametrize("frame", ["bus", "antenna", "glue"])
def test_a_frame_fixed_to_the_spacecraft_is_refused(frame: str) -> None:
    antenna = a_link("antenna") + joint_text("glue", "F", "bus", "antenna")
    text = ELBOW.replace("</robot>", antenna + "</robot>")
    assert error_key(ff.FreeFloatingModel.from_urdf, text, frame) == "end_effector"


@pytest.mark.parametrize(("fixed", "key"), [
    ({"hing": 0.1}, "fixed_joints.hing"),
    ({"root_joint": 0.1}, "fixed_joints.root_joint"),
    ({"hinge": np.nan}, "fixed_joints.hinge"),
    ({"shoulder": 0.1, "elbow": 0.2}, "fixed_joints"),
])  # fmt: skip
def test_joints_that_cannot_be_fixed_are_refused(fixed: dict[str, float], key: str) -> None:
    assert error_key(ff.FreeFloatingModel.from_urdf, ELBOW, "fore", fixed_joints=fixed) == key


def test_joint_vectors_come_by_name_or_in_order(planar_3dof: ff.FreeFloatingModel) -> None:
    by_name = planar_3dof.joint_vector({"q3": 3, "q1": 1.0, "q2": np.float64(2)})
    np.testing.assert_array_equal(by_name, [1, 2, 3])
    np.testing.assert_array_equal(planar_3dof.joint_vector((1, 2, 3)), [1, 2, 3])


def test_models_survive_pickling_and_copying(rng: np.random.Generator) -> None:
    robot = random_robot(rng, "RCPRR", "RP")
    fixed = dict(zip(robot.others, (0.3, -0.2), strict=True))
    model = robot.model(scale_mass={"bus": 2.0}, fixed_joints=fixed)
    q = rng.uniform(-2, 2, 5)
    expected = momentum_map(model, q)
    for copied in (pickle.loads(pickle.dumps(model)), copy.deepcopy(model), copy.copy(model)):
        np.testing.assert_array_equal(momentum_map(copied, q), expected)
        assert copied.joint_names == model.joint_names
        assert copied.scratch is not model.scratch


def whole_robot(robot: Robot, fixed: dict[str, float], joints: np.ndarray) -> tuple[pin.Model, ...]:
    """Pinocchio's own robot, no joint fixed, its root link at the origin."""
    model = pin.buildModelFromXML(read_urdf(robot.text).text)
    q = pin_configuration(model, fixed | dict(zip(robot.joints, joints, strict=True)))
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return model, data


@given(
    robot=robots(branch=st.text("RCPF", max_size=3)), attitude=attitudes, seed=st.integers(0, 99)
)
def test_every_link_is_where_pinocchio_puts_it(robot, attitude, seed):
    """Body pose times link place, whether the link moves, is fixed or on a fixed arm."""
    rng = np.random.default_rng(seed)
    fixed = {name: float(rng.uniform(-2, 2)) for name in robot.others}
    joints = rng.uniform(-2, 2, len(robot.joints))
    model = robot.model(fixed_joints=fixed)
    whole, data = whole_robot(robot, fixed, joints)
    poses = model.body_poses(attitude, joints)
    assert len(poses) == model.dof + 1
    np.testing.assert_allclose(poses[0].position, model.base_position(attitude, joints))
    np.testing.assert_allclose(poses[0].rotation, rotation_matrix(attitude), atol=1e-14)
    links = [frame.name for frame in whole.frames if frame.type == pin.FrameType.BODY]
    assert set(model.link_places) == set(links) - {"universe"}
    for link, (body, place) in model.link_places.items():
        inside = poses[body] @ place
        frame = data.oMf[whole.getFrameId(link, pin.FrameType.BODY)]
        seen = poses[0].rotation @ frame.translation + poses[0].position
        np.testing.assert_allclose(inside.position, seen, atol=1e-12)
        np.testing.assert_allclose(inside.rotation, poses[0].rotation @ frame.rotation, atol=1e-12)


def test_threads_use_a_model_at_the_same_time() -> None:
    model = ff.FreeFloatingModel.from_urdf("spatial_6dof")
    everywhere = np.random.default_rng(0).uniform(-2.0, 2.0, (640, model.dof))

    def heights(_: int) -> list[float]:
        poses = (model.end_effector_pose([0.0, 0.0, 0.0, 1.0], joints) for joints in everywhere)
        return [pose.position[2] for pose in poses]

    alone, interval = heights(0), sys.getswitchinterval()
    try:
        sys.setswitchinterval(1e-6)
        with ThreadPoolExecutor(4) as pool:
            assert all(found == alone for found in pool.map(heights, range(8)))
    finally:
        sys.setswitchinterval(interval)


BODY = inertial_text(5.0, np.diag([0.2, 0.3, 0.4]), "0.1 0.05 0.02")
LINKS = ("bus", "upper", "lower", "hand", "left", "right", "tip")


def with_gripper(lower: str = "", upper: str = "") -> str:
    """An arm of three joints with a gripper: right follows left, its tip follows right."""
    mimics = {"q1": upper, "q2": lower, "right": 'joint="left" multiplier="-2" offset="0.3"',
              "tip": 'joint="right" offset="0.1"'}  # fmt: skip
    table = (
        ("q1", "R", "bus", "upper"), ("q2", "R", "upper", "lower"), ("q3", "R", "lower", "hand"),
        ("left", "P", "hand", "left"), ("right", "P", "hand", "right"),
        ("tip", "R", "right", "tip"),
    )  # fmt: skip
    joints = ""
    for name, kind, *ends in table:
        text = joint_text(name, kind, *ends, "0.5 0 0.1", axis="0 0.6 0.8")
        mimic = f"<mimic {mimics[name]}/>" if mimics.get(name) else ""
        joints += text.replace("</joint>", f"{mimic}</joint>")
    links = "".join(link_text(name, BODY) for name in LINKS)
    return f'<robot name="r">{links}{joints}</robot>'


@pytest.mark.parametrize("left", [0.0, -0.25])
def test_a_held_gripper_follows_its_driver(left: float) -> None:
    model = ff.FreeFloatingModel.from_urdf(with_gripper(), "hand", fixed_joints={"left": left})
    reference = pin.buildModelFromXML(with_gripper(), pin.JointModelFreeFlyer())
    q, right = {"q1": 0.3, "q2": -0.7, "q3": 0.5}, -2.0 * left + 0.3
    fixed = {"left": left, "right": right, "tip": right + 0.1}
    S = pinocchio_jacobian(reference, "hand", q, fixed)
    found = ff.generalized_jacobian(model, [*q.values()])
    np.testing.assert_allclose(found, S, rtol=0.0, atol=1e-12)
    assert not [entry for entry in model.not_read if "mimic" in entry.element]


def test_followers_out_of_their_ranges_are_reported() -> None:
    """Not the tip, which has a value by name; all ranges end at 4."""
    fixed = {"left": -2, "tip": 0}
    model = ff.FreeFloatingModel.from_urdf(with_gripper(), "hand", fixed_joints=fixed)
    (warning,) = (entry for entry in model.warnings if "out of its range" in entry.problem)
    assert (warning.element, "fixed at 4.3" in warning.problem) == ("joint right", True)


def test_a_value_by_name_decouples() -> None:
    model = ff.FreeFloatingModel.from_urdf(with_gripper(), "hand", fixed_joints={"right": 0.05})
    (_, place), (_, tip) = model.link_places["right"], model.link_places["tip"]
    np.testing.assert_allclose(place.position, [0.5, 0.03, 0.14])
    turn = pin.log3(place.rotation.T @ tip.rotation)
    np.testing.assert_allclose(turn, [0.0, 0.09, 0.12], rtol=0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("text", "joint", "leader"),
    [(with_gripper(lower='joint="q1"'), "q2", "q1"),
     (with_gripper(upper='joint="q3" multiplier="-1"'), "q1", "q3"),
     (with_gripper().replace('joint="left" multi', 'joint="q2" multi'), "right", "q2")],
)  # fmt: skip
def test_joints_that_follow_moving_ones_are_refused(text: str, joint: str, leader: str) -> None:
    with pytest.raises(ModelError, match=f"joint {joint}: it mimics {leader}, which moves"):
        ff.FreeFloatingModel.from_urdf(text, "hand")
    for fixed, moves in (({leader: 0.2}, False), ({joint: 0.1}, True)):
        model = ff.FreeFloatingModel.from_urdf(text, "hand", fixed_joints=fixed)
        assert (leader in model.joint_names) is moves
        assert joint not in model.joint_names


@pytest.fixture(scope="module")
def massless() -> ff.FreeFloatingModel:
    """The bundled arm with six joints, without mass, on a spacecraft."""
    text = (models_folder() / "spatial_6dof" / "spatial_6dof.urdf").read_text()
    arm = re.sub(r"<inertial>.*?</inertial>", "", text, flags=re.DOTALL)
    spacecraft = ff.Spacecraft(mass=200.0, inertia=np.diag([30.0, 40.0, 50.0]))
    return ff.FreeFloatingModel.from_urdf(arm, "end_effector", spacecraft=spacecraft)


def test_an_arm_without_mass_moves_as_on_a_fixed_base_without_torques(massless) -> None:
    joints = np.array([0.3, -0.8, 1.1, 0.4, 0.9, -0.2])
    fixed_base = end_effector_jacobian(massless, joints)[:, 6:]
    np.testing.assert_allclose(ff.generalized_jacobian(massless, joints), fixed_base, atol=1e-12)
    attitude, step = np.array([0.0, 0.0, 0.0, 1.0]), [0.05, -0.1, 0.1]
    problem = from_here(
        massless, ff.Task.POSE, np.zeros(3), attitude, joints, step, np.zeros(3), ff.Timing(20.0)
    )
    limits = ff.Limits(joint_torque=np.full(6, 1.0))
    simulation = ff.simulate(problem, attitude, joints=joints, limits=limits)
    assert simulation.feasible
    motion = simulation.chosen.motion
    np.testing.assert_allclose(motion.attitudes, [attitude] * len(motion.times))
    torque = next(entry for entry in simulation.limit_results if entry.limit == "joint_torque")
    assert torque.worst == 0.0


def test_the_kinetic_energy_is_no_metric_of_a_massless_arm(massless) -> None:
    energy = ff.Redundancy(metric="energy").require_applicable
    assert error_key(energy, massless, ff.Task.POSITION) == "redundancy.metric"
