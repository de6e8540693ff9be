"""MuJoCo as a second opinion: its dynamics, its kinematics, our motions.

`mujoco_model` describes how the robot reaches MuJoCo and what MuJoCo's free joint means.
"""

from functools import partial

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.beyond.engines.mujoco import forward_run
from freefloat.beyond.engines.mujoco_model import MuJoCoModel, wxyz
from freefloat.so3 import heading_quaternion
from tests.motions import GOOD, differentiated, relative, simulated
from tests.robots import Robot, joint_values, robots
from tests.validation.comparisons import assert_agrees

assert_close = partial(np.testing.assert_allclose, rtol=0)


@pytest.fixture(scope="module")
def motions():
    """Example 2 and Example 1, each from its good attitude."""
    return {
        "spatial": simulated(ff.load_scenario("spatial_6dof/line").problem(), GOOD, 2),
        "planar": simulated(
            ff.load_scenario("planar_3dof/parabola").problem(),
            heading_quaternion(np.deg2rad(200)),
            0,
        ),
    }


@pytest.fixture(scope="module")
def engines(motions):
    return {name: MuJoCoModel(motion.problem.system) for name, motion in motions.items()}


TIMES = np.linspace(6.0, 94.0, 12)


@pytest.mark.parametrize("name", ["spatial", "planar"])
def test_the_motion_needs_no_wrench_on_the_base(motions, engines, name):
    """Free floating: inverse dynamics needs joint torques alone, 1e-4 of the largest at most."""
    results = [engines[name].inverse(*differentiated(motions[name], t)) for t in TIMES]
    wrenches, torques = (np.array(column) for column in zip(*results, strict=True))
    assert np.abs(torques).max() > 1e-2
    assert_agrees(
        "test_the_motion_needs_no_wrench_on_the_base",
        np.abs(wrenches).max() / np.abs(torques).max(),
    )


@pytest.mark.parametrize("name", ["spatial", "planar"])
def test_mujoco_sees_the_end_effector_on_the_path(motions, engines, name):
    """Its kinematics of the recorded states put the end-effector on the path."""
    motion, engine = motions[name], engines[name]
    rest = np.zeros(7 + motion.problem.model.dof)
    for state in motion.sample(np.linspace(0.0, 100.0, 41)):
        value = np.concatenate([state.base_position, state.attitude, state.joints])
        engine.place(value, rest, rest)
        mujoco.mj_kinematics(engine.model, engine.data)
        expected = motion.problem.path.pose(state.time)
        position_error = engine.data.xpos[engine.tools[0]] - expected.position
        rotation_error = engine.data.xmat[engine.tools[0]].reshape(3, 3) - expected.rotation
        worst = max(np.abs(position_error).max(), np.abs(rotation_error).max())
        assert_agrees("test_mujoco_sees_the_end_effector_on_the_path", worst)


@pytest.fixture(scope="module")
def all_motions(motions):
    """And a stock arm without a spherical wrist, and a redundant one."""
    stock = {
        name: simulated(ff.load_scenario(name).problem(), [0, 0, 0, 1], branch)
        for name, branch in (("ur5_servicer/arc", 7), ("panda_servicer/line", 0))
    }
    return {**motions, **stock}


@pytest.mark.parametrize("name", [
    pytest.param("spatial", marks=pytest.mark.slow), "planar",
    pytest.param("ur5_servicer/arc", marks=pytest.mark.slow),
    pytest.param("panda_servicer/line", marks=pytest.mark.slow),
])  # fmt: skip
def test_mujoco_finds_the_same_joint_torques(all_motions, name):
    """From accelerations solved at a state, and from differences of the recorded motion."""
    motion = all_motions[name]
    engine, dynamics = MuJoCoModel(motion.problem.system), motion.law
    solved, seen, recorded, wrenches = [], [], [], []
    for t in np.linspace(0.06, 0.94, 12) * motion.problem.path.duration:
        (state,) = motion.sample(t)
        effort = dynamics.effort(t, state.attitude, state.joints)
        R = Rotation.from_quat(state.attitude).as_matrix()
        v, a = effort.rates, effort.accelerations
        engine.data.qpos[:] = [*state.base_position, *wxyz(state.attitude), *state.joints]
        engine.data.qvel[:] = [*(R @ v[:3]), *v[3:]]
        engine.data.qacc[:] = [*(R @ (a[:3] + np.cross(v[3:6], v[:3]))), *a[3:]]
        mujoco.mj_inverse(engine.model, engine.data)
        seen.append(engine.data.qfrc_inverse[6:].copy())
        wrenches.append(engine.data.qfrc_inverse[:6].copy())
        recorded.append(engine.inverse(*differentiated(motion, t))[1])
        solved.append(effort.joint_torques)
    largest = np.abs(solved).max()
    worst = np.abs(np.array(seen) - solved).max() / largest
    assert_agrees("test_mujoco_finds_the_same_joint_torques", worst)
    assert_close(wrenches, 0.0, atol=1e-9 * largest)
    assert_close(recorded, solved, atol=1e-3 * largest)


def mujoco_generalized_jacobian(
    robot: Robot, joints: np.ndarray, fixed: dict[str, float]
) -> np.ndarray:
    """S* from MuJoCo's mass matrix and Jacobian; its own reader of URDF, its own algorithms."""
    drift = (
        '<mujoco><compiler fusestatic="false" balanceinertia="false"/></mujoco><link name="world"/>'
        '<joint name="drift" type="floating"><parent link="world"/><child link="bus"/></joint>'
    )
    text = robot.text.replace('<link name="bus">', drift + '<link name="bus">', 1)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for name, value in {**dict(zip(robot.joints, joints, strict=True)), **fixed}.items():
        data.joint(name).qpos[0] = value
    mujoco.mj_forward(model, data)
    H, J = np.zeros((model.nv, model.nv)), np.zeros((6, model.nv))
    for column, unit in zip(H, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, column, unit)
    end_effector = data.body(robot.end_effector)
    mujoco.mj_jac(model, data, J[:3], J[3:], end_effector.xpos, end_effector.id)
    arm = [int(model.joint(name).dofadr[0]) for name in robot.joints]
    return J[:, arm] - J[:, :6] @ np.linalg.solve(H[:6, :6], H[:6, arm])


@pytest.mark.slow
@given(data=st.data(), robot=robots())
def test_mujoco_finds_the_same_generalized_jacobian(data: st.DataObject, robot: Robot) -> None:
    """Any structure: revolute, prismatic, fixed in mid-chain, a second, fixed arm."""
    fixed = dict(zip(robot.others, [0.7, -1.3, 0.4], strict=False))
    model = ff.FreeFloatingModel.from_urdf(robot.text, robot.end_effector, fixed_joints=fixed)
    assert model.joint_names == robot.joints
    q = data.draw(joint_values(model.dof))
    expected = mujoco_generalized_jacobian(robot, q, fixed)
    worst = relative(ff.generalized_jacobian(model, q), expected)
    assert_agrees("test_mujoco_finds_the_same_generalized_jacobian", worst)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["spatial", "ur5_servicer/arc"])
def test_servos_lead_to_the_same_attitude(all_motions, name):
    """Servos follow the recorded joints, nothing holds the base: it ends as freefloat says."""
    motion = all_motions[name]
    result = forward_run(motion, MuJoCoModel(motion.problem.system))
    assert_agrees("test_servos_lead_to_the_same_attitude", result.attitude)
    assert result.joints < 1e-3
