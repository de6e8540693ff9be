"""Robots in xacro and MJCF files, and of the package robot_descriptions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.formats.mjcf_file import mjcf_text
from freefloat.dynamics.momentum import mass_matrix
from freefloat.io.trajectory import Trajectory
from tests.commands import document
from tests.errors import error_key
from tests.motions import bundled, first_motion

HEAD = '<robot name="{name}" xmlns:xacro="http://www.ros.org/wiki/xacro">\n'
BODIES = """
  <xacro:macro name="body" params="name mass:=10 length:=0.5 radius:=0.05">
    <link name="${name}">
      <visual><origin xyz="${length / 2} 0 0" rpy="0 ${pi / 2} 0"/>
        <geometry><cylinder radius="${radius}" length="${length}"/></geometry></visual>
      <inertial>
        <origin xyz="${length / 2} 0 0"/><mass value="${mass}"/>
        <inertia ixx="${mass * radius**2 / 2}" ixy="0" ixz="0"
          iyy="${mass * (3 * radius**2 + length**2) / 12}" iyz="0"
          izz="${mass * (3 * radius**2 + length**2) / 12}"/>
      </inertial>
    </link>
  </xacro:macro>
  <xacro:macro name="hinge" params="name parent child x axis">
    <joint name="${name}" type="revolute">
      <parent link="${parent}"/><child link="${child}"/>
      <origin xyz="${x} 0 0"/><axis xyz="${axis}"/>
      <limit lower="${-pi}" upper="${pi}" effort="30" velocity="0.5"/>
    </joint>
  </xacro:macro>
"""
TOOL = """
  <link name="tool"/>
  <joint name="tool_joint" type="fixed"><parent link="c"/><child link="tool"/>
    <origin xyz="0.5 0 0"/></joint>
"""
CONDITIONS = """
  <xacro:property name="slender" value="true"/>
  <xacro:body name="bus" mass="100" length="1.0" radius="0.4"/>
  <xacro:if value="${slender}"><xacro:body name="a" length="0.9" radius="0.02"/></xacro:if>
  <xacro:unless value="${slender}"><xacro:body name="a" length="0.5"/></xacro:unless>
  <xacro:body name="b" length="${0.5 * sqrt(2)}"/><xacro:body name="c" length="${sin(pi / 6)}"/>
  <xacro:hinge name="q1" parent="bus" child="a" x="1.0" axis="0 0 1"/>
  <xacro:hinge name="q2" parent="a" child="b" x="0.9" axis="0 0 1"/>
  <xacro:hinge name="q3" parent="b" child="c" x="${0.5 * sqrt(2)}" axis="0 0 1"/>
"""


@pytest.fixture
def xacro(tmp_path: Path) -> Path:
    """A xacro file that includes one of its package of ROS."""
    folder = tmp_path / "arm_description" / "urdf"
    folder.mkdir(parents=True)
    (folder.parent / "package.xml").write_text("<package><name>arm_description</name></package>")
    (folder / "bodies.xacro").write_text(HEAD.format(name="bodies") + BODIES + "</robot>")
    file = folder / "arm.urdf.xacro"
    include = '<xacro:include filename="$(find arm_description)/urdf/bodies.xacro"/>'
    file.write_text(HEAD.format(name="arm") + include + CONDITIONS + TOOL + "</robot>")
    return file


@pytest.mark.slow
def test_robots_in_xacro_load_and_plan(xacro: Path) -> None:
    model, upright = ff.FreeFloatingModel.from_urdf(xacro), [0.0, 0.0, 0.0, 1.0]
    reach = model.end_effector_pose(upright, np.zeros(3)).position[0]
    bus = model.base_position(upright, np.zeros(3))[0]
    assert reach - bus == pytest.approx(1.0 + 0.9 + np.sqrt(0.5) + 0.5)
    start = model.end_effector_pose(upright, [0.6, 0.8, 0.7])
    line = {"from": start.position.tolist(), "to": (0.97 * start.position).tolist()}
    axes = {"x": start.rotation[:, 0].tolist(), "y": start.rotation[:, 1].tolist()}
    loaded = ff.load_scenario({
        "robot": {"urdf": str(xacro), "end_effector": "tool"}, "task": "planar-pose",
        "path": {"line": line, "attitude": {"fixed": {"axes": axes}}}, "timing": {"duration": 60},
        "margin": {"measure": "system", "fraction": 0.01},
    })  # fmt: skip
    plan = ff.plan(loaded.problem(), loaded.search(), loaded.limits())
    assert plan.feasible, plan.reason
    assert ff.check(plan).discrepancies == ()


@pytest.mark.slow
def test_errors_of_xacro_files(tmp_path: Path) -> None:
    for text in ("<robot", HEAD.format(name="a") + "<xacro:none/></robot>",
                 HEAD.format(name="a") + '<link name="${1 / 0}"/></robot>'):  # fmt: skip
        (tmp_path / "a.xacro").write_text(text)
        assert error_key(ff.FreeFloatingModel.from_urdf, tmp_path / "a.xacro") == "urdf"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ets_vii/line", "planar_3dof/parabola"])
def test_a_model_of_mujoco_has_the_same_dynamics(name: str, tmp_path: Path) -> None:
    problem = bundled(name)
    motion = first_motion(problem)
    file = tmp_path / "robot.xml"
    file.write_text(mjcf_text(Trajectory.sampled(motion, 3)))
    read = ff.FreeFloatingModel.from_urdf(file)
    assert read.joint_names == problem.model.joint_names
    for q in np.random.default_rng(0).uniform(-1.0, 1.0, (5, read.dof)):
        M = mass_matrix(problem.model, q)
        np.testing.assert_allclose(mass_matrix(read, q), M, atol=1e-9 * np.abs(M).max())


@pytest.mark.slow
def test_models_of_mujoco_that_are_no_arms_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    bodies = {
        "no body": '<geom size="1"/>',
        "two roots": '<body name="a"><geom size="1"/></body><body name="b"><geom size="1"/></body>',
        "ball": '<body name="a"><freejoint/><geom size="1"/><body name="b"><joint type="ball"/>'
                '<geom size="1"/></body></body>',
        "not closed": "<body>",
    }  # fmt: skip
    for name, text in bodies.items():
        file.write_text(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
        key = "root" if name in ("no body", "two roots") else "urdf"
        assert error_key(ff.FreeFloatingModel.from_urdf, file) == key


@pytest.mark.slow
def test_joints_have_the_values_of_mujoco(tmp_path: Path) -> None:
    """A joint's ``ref`` is its value where the model is as it is written."""
    import mujoco

    file = tmp_path / "arm.xml"
    file.write_text("""<mujoco><worldbody><body name="base"><freejoint/><geom size="1"/>
      <body name="a" pos="0 0 1" euler="30 0 0"><joint name="q1" axis="0 1 1" ref="90"
      range="0 180"/><geom size="0.1"/><body name="b" pos="1 0 0"><joint name="q2" type="slide"
      ref="0.5" axis="1 0 1" range="0 1"/><geom size="0.1"/><body name="c" pos="1 0 0">
      <joint name="q3" ref="-90" range="-180 0"/><geom size="0.1"/></body></body></body></body>
      </worldbody><equality><joint joint1="q1" joint2="q2"/></equality></mujoco>""")
    model = ff.FreeFloatingModel.from_urdf(file, "c")
    ranges = [[0.0, 0.0, -np.pi], [np.pi, 1.0, 0.0]]
    np.testing.assert_allclose(model.joint_ranges, ranges, atol=1e-12)
    robot = mujoco.MjModel.from_xml_path(str(file))
    state, still, joints = mujoco.MjData(robot), [0.0, 0.0, 0.0, 1.0], [0.3, 0.8, -0.4]
    state.qpos[7:] = joints
    mujoco.mj_kinematics(robot, state)
    pose = model.end_effector_pose(still, joints)
    away = pose.position - model.base_position(still, joints)
    np.testing.assert_allclose(away, state.body("c").xpos, atol=1e-12)
    np.testing.assert_allclose(pose.rotation.ravel(), state.body("c").xmat, atol=1e-12)
    findings = document("info", file)["findings"]
    assert any("equality" in entry["problem"] for entry in findings)
    assert {entry["line"] for entry in findings} == {None}
