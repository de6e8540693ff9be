"""Robots as others publish them: URDFs without limits, scenes of MuJoCo, packages of ROS."""

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import freefloat as ff
from tests.commands import document, error, run
from tests.errors import error_key
from tests.spart_robots import ROBOTS, scene, write_scenario


def warned(robot: dict) -> list[str]:
    """Elements of the warnings of ``info``."""
    return [finding["element"] for finding in robot["findings"]]


@pytest.mark.slow
def test_a_robot_of_spart_plans_with_its_other_arm_held(tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(ROBOTS["two arms"])
    info = document("info", tmp_path / "robot.urdf", "--end-effector", "tip")
    assert {"joint J1", "joint J2"} <= set(warned(info))
    held = {"left_J1": 0.4, "left_J2": -0.7}
    scenario = write_scenario(tmp_path, "robot.urdf", held=held)
    assert document("plan", scenario, "-o", tmp_path / "p.h5")["feasible"]
    assert run("check", tmp_path / "p.h5", "--engine", "mujoco").exit_code == 0
    (tmp_path / "robot.urdf").unlink()
    model = ff.load(tmp_path / "p.h5").problem.model
    assert model.fixed_joints == held
    assert model.bodies[0].mass == pytest.approx(118.0)


def test_joints_without_limits_have_none() -> None:
    model = ff.FreeFloatingModel.from_urdf(ROBOTS["no limits"])
    assert not np.isfinite(model.joint_ranges).any()
    assert all(np.isinf([body.rated_speed, body.rated_effort]).all() for body in model.bodies)
    ranged = ff.FreeFloatingModel.from_urdf(ROBOTS["a range without effort and velocity"])
    assert ranged.joint_ranges[1].tolist() == [3.0, 3.0]
    assert all(np.isinf([body.rated_speed, body.rated_effort]).all() for body in ranged.bodies)


@pytest.mark.parametrize("name", ROBOTS)
def test_another_parser_reads_what_is_saved(name: str) -> None:
    text = ff.FreeFloatingModel.from_urdf(ROBOTS[name], "tip").description.text
    parsed = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    assert parsed.nv == 6 + (4 if name == "two arms" else 2)
    assert ff.FreeFloatingModel.from_urdf(text, "tip").joint_names == ("J1", "J2")


def test_prismatic_joints_need_a_range() -> None:
    sliding = ROBOTS["no limits"].replace('"revolute"', '"prismatic"', 1)
    assert error_key(ff.FreeFloatingModel.from_urdf, sliding) == "joint J1"


@pytest.mark.slow
@pytest.mark.usefixtures("readers_here")
def test_the_chaser_of_a_scene_is_found_or_named(tmp_path: Path) -> None:
    orbit = tmp_path / "scene.xml"
    orbit.write_text(scene())
    info = document("info", orbit)
    assert (info["total_mass"], info["dof"]) == (118.0, 2)
    assert warned(info) == ["robot scene"]
    orbit.write_text(scene(target='<body name="panel"><joint/><geom size="1"/></body>'))
    assert error("info", orbit)["key"] == "root"
    assert error("info", orbit, "--root", "chase")["key"] == "root"
    assert error("info", "planar_2dof", "--root", "chaser")["key"] == "root"
    assert error("info", "planar_2dof/line", "--root", "chaser")["key"] == "root"
    chaser = document("info", orbit, "--root", "chaser")
    assert (chaser["dof"], chaser["warnings"]) == (2, [])
    scenario = write_scenario(tmp_path, "scene.xml", root="chaser")
    assert ff.load_scenario(scenario).model().body_names[0] == "chaser"


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A workspace of ROS beside a folder with files of the same names; writes the arm's file."""
    parts = {"arm_description/urdf": 12.0, "parts": 13.0, "far/part_files": 14.0, "here": 1001.0}
    for folder, mass in parts.items():
        (tmp_path / folder).mkdir(parents=True)
        text = f'<robot xmlns:xacro="x"><xacro:property name="m" value="{mass}"/></robot>'
        (tmp_path / folder / "part.xacro").write_text(text)
    monkeypatch.chdir(tmp_path / "here")

    def write(include: str) -> str:
        body = ROBOTS["no limits"].replace('"100.0"', '"${m}"')
        body = body.replace('name="SC_2DoF">', f'name="a" xmlns:xacro="x">\n{include}')
        (tmp_path / "arm_description/urdf/arm.xacro").write_text(body)
        return "../arm_description/urdf/arm.xacro"

    return write


@pytest.mark.parametrize(("include", "mass"), [
    ("part.xacro", 12.0),
    ("$(dirname)/part.xacro", 12.0),
    ("$(cwd)/part.xacro", 12.0),
    ("../urdf/part.xacro", 12.0),
    ("$(find arm_description)/urdf/part.xacro", 12.0),
    ("$(find parts)/part.xacro", 13.0),
])  # fmt: skip
@pytest.mark.usefixtures("readers_here")
def test_included_files_are_found_from_the_file(include: str, mass: float, workspace) -> None:
    file = workspace(f'<xacro:include filename="{include}"/>')
    assert ff.FreeFloatingModel.from_urdf(file).total_mass == mass + 18.0


@pytest.mark.usefixtures("readers_here")
def test_packages_are_named(workspace, tmp_path: Path) -> None:
    file = workspace('<xacro:include filename="$(find other)/part.xacro"/>')
    assert error("info", file)["key"] == "urdf"
    assert error("info", file, "--package", "other=nowhere")["key"] == "package"
    named = document("info", file, "--package", "other=../far/part_files")
    assert named["total_mass"] == 32.0
    for folder in ("far/part_files", "far/none"):
        packages = {"other": folder}
        file = write_scenario(tmp_path, "arm_description/urdf/arm.xacro", packages=packages)
        scenario = ff.load_scenario(file)
        if folder == "far/part_files":
            assert scenario.model().total_mass == 32.0
        else:
            assert error_key(scenario.model) == "robot.packages.other"


def test_every_command_knows_robot_descriptions(tmp_path, monkeypatch):
    package = tmp_path / "robot_descriptions"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (tmp_path / "arm.urdf").write_text(ROBOTS["no limits"])
    for name in ("mine", *(f"arm_{k}" for k in range(8))):
        text = f"URDF_PATH = {str(tmp_path / 'arm.urdf')!r}"
        (package / f"{name}_description.py").write_text(text)
    (package / "torn_description.py").write_text("raise OSError('no network')")
    for name in [name for name in sys.modules if name.startswith("robot_descriptions")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(tmp_path)
    assert error("info", "robot_descriptions:torn")["key"] == "urdf"
    assert document("info", "robot_descriptions:mine")["dof"] == 2
    output = tmp_path / "out.urdf"
    assert document("assemble", "robot_descriptions:mine", "-o", output)["total_mass"] == 118.0
    near = error("info", "robot_descriptions:arm_9")["accepted"]
    assert near.count("robot_descriptions:arm_") == 5
    for name in [name for name in sys.modules if name.startswith("robot_descriptions")]:
        monkeypatch.delitem(sys.modules, name)
