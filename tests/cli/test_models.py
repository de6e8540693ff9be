"""``freefloat models``, ``info``, ``workspace`` and ``schema``."""

from __future__ import annotations

import json
import math
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from jsonschema import Draft202012Validator
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.cli.models import catalogue
from freefloat.robot.names import bundled_robots, bundled_scenarios, bundled_studies, models_folder
from freefloat.so3 import Pose, rotation_matrix, unit_quaternion
from tests.commands import document, error, run

ENTRIES = {entry.name: entry for group in catalogue().values() for entry in group}


# --- models -------------------------------------------------------------------------------------


def test_models_lists_everything_bundled_with_a_description() -> None:
    groups = document("models")
    text = run("models").stdout
    for group, names in (
        ("robots", bundled_robots()),
        ("scenarios", bundled_scenarios()),
        ("studies", bundled_studies()),
    ):
        assert [entry["name"] for entry in groups[group]] == list(names)
        for entry in groups[group]:
            assert 20 < len(entry["description"]) < 140
            assert Path(entry["file"]).is_file()
            assert f" {entry['name']} " in text
    assert all(entry["source"] for entry in groups["robots"])
    assert ENTRIES["ur5_servicer/arc"].details["robot"] == "example-robot-data:ur5"
    assert {entry["base"] for entry in groups["studies"]} <= set(bundled_scenarios())


@pytest.mark.parametrize("name", ["spatial_6dof/line", "spatial_6dof/montecarlo", "ssrms"])
def test_models_prints_the_file_of_a_name(name: str) -> None:
    entry = ENTRIES[name]
    assert run("models", name).stdout == run("models", name, "--quiet").stdout == entry.text
    assert document("models", name) == entry.to_dict() | {"text": entry.text}


def test_a_copy_of_a_bundled_file_works_in_any_folder(tmp_path: Path) -> None:
    copy = tmp_path / "mine.yaml"
    for name in bundled_scenarios():
        copy.write_text(ENTRIES[name].text, encoding="utf-8")
        assert ff.load_scenario(copy).robot_source() == ff.load_scenario(name).robot_source()
    for name in bundled_studies():
        copy.write_text(ENTRIES[name].text, encoding="utf-8")
        assert ff.load_study(copy).base == ff.load_study(name).base


# --- info ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_info_describes_the_same_robot_by_any_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(models_folder() / "planar_3dof" / "planar_3dof.urdf", tmp_path / "arm.urdf")
    for name in ("planar_3dof/parabola", "arm.urdf"):
        robot = document("info", name)
        assert (robot["total_mass"], robot["dof"], robot["task"]) == (471.0, 3, "planar-pose")
        assert [joint["name"] for joint in robot["joints"]] == ["q1", "q2", "q3"]
        (warning,) = robot["warnings"]
        assert "gyration radius is 1.22 m" in warning  # 1.5 kg m² of 1 kg: Table I
        expected = [0.424628, 1.783439, 0.966030, 0.399575]
        assert robot["barycentric_lengths"] == pytest.approx(expected, abs=1e-6)
    text = run("info", "planar_3dof").stdout
    assert "471 kg" in text
    assert "1 warning" in text


MISSION: dict[str, Any] = {
    "limits": {
        "base_turn_deg": 8.0,
        "pointing": [
            {"body": "spacecraft", "axis": [0.0, 1.0, 0.0], "target": {"point": [9.0, 0.0, 1.0]},
             "keep": "outside", "angle_deg": 30.0},
        ],
    },
    "scene": {
        "bodies": [
            {"name": "client", "box": [1.0, 1.0, 2.0], "position": [9.0, 0.0, 0.0],
             "tumbling": {"inertia": [9.0, 8.0, 4.0], "rate": [0.03, 0.0, 0.04]}},
            {"name": "mast", "cylinder": {"radius": 0.1, "length": 3.0}},
        ],
        "corridor": {"point": [0.0, 0.0, 1.0], "axis": [0.0, 0.0, 1.0], "radius": 0.3,
                     "body": "client"},
    },
    "wheels": {"momentum": [0.1, 0.0, -0.2]},
}  # fmt: skip


def test_info_lists_scene_pointing_turn_and_wheels_of_a_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    content = yaml.safe_load(ENTRIES["spatial_6dof/line"].text)
    Path("mission.yaml").write_text(yaml.safe_dump(content | MISSION))
    shown = document("info", "mission.yaml")
    (limit,) = shown["pointing"]
    assert limit["target"] == MISSION["limits"]["pointing"][0]["target"]
    assert [limit["angle_deg"], shown["base_turn_deg"]] == pytest.approx([30.0, 8.0])
    assert [body["name"] for body in shown["scene"]["bodies"]] == ["client", "mast"]
    assert shown["scene"]["corridor"] == MISSION["scene"]["corridor"]
    assert shown["wheel_momentum"] == MISSION["wheels"]["momentum"]
    text = run("info", "mission.yaml").stdout
    for words in (
        "box 1 x 1 x 2 m", "tumbling, 2.865 deg/s", "cylinder, radius 0.1 m, length 3 m",
        "cylinder of radius 0.3 m", "axes of client", "spacecraft (pointing.0)", "outside 30°",
        "point 9.0000 0.0000 1.0000 m", "at most 8 deg", "0.1000 0.0000 -0.2000 N m s",
    ):  # fmt: skip
        assert words in text
    assert not {"scene", "pointing"} & document("info", "spatial_6dof").keys()


@pytest.mark.slow
def test_info_takes_an_end_effector_and_stock_arms() -> None:
    robot = document("info", "spatial_6dof", "--end-effector", "link_3")
    assert (robot["end_effector"], robot["dof"]) == ("link_3", 3)
    robot = document("info", "example-robot-data:panda", "--end-effector", "panda_link8")
    assert robot["dof"] == 7
    assert math.isclose(robot["total_mass"], 17.451901, abs_tol=1e-9)
    assert error("info", "spatial_6dof/line", "--end-effector", "link_3")["key"] == "end_effector"
    assert error("info", "spatial_6dof", "--end-effector", "none")["key"] == "end_effector"


@pytest.mark.slow
def test_info_shows_the_end_effector_at_given_joints() -> None:
    """The poses are those of one point seen from three frames."""
    joints, attitude = [0.3, -0.8, 1.1, 0.4, 0.9, -0.2], [0.1, 0.5, 0.2, -0.8367]
    words = ["ur5_servicer/arc", "--joints", ",".join(map(str, joints))]
    shown = document("info", *words, "--attitude", *attitude)["configuration"]
    problem = ff.load_scenario("ur5_servicer/arc").problem()
    expected = problem.model.end_effector_pose(unit_quaternion("", attitude), joints)
    inertial, spacecraft, base = (
        Pose(np.array(pose["position"]), rotation_matrix(pose["quaternion"]))
        for pose in map(shown["end_effector"].get, ("inertial", "spacecraft", "base"))
    )
    np.testing.assert_allclose(inertial.position, expected.position, atol=1e-12)
    np.testing.assert_allclose(inertial.rotation, expected.rotation, atol=1e-12)
    root = Pose(problem.model.base_position(shown["attitude"], joints),
                rotation_matrix(shown["attitude"]))  # fmt: skip
    np.testing.assert_allclose((root @ spacecraft).position, expected.position, atol=1e-12)
    np.testing.assert_allclose(spacecraft.position - base.position, [0.0, 0.0, 0.5], atol=1e-12)
    angles = Rotation.from_euler("xyz", shown["end_effector"]["base"]["rpy"]).as_matrix()
    np.testing.assert_allclose(angles, spacecraft.rotation, atol=1e-12)
    (name,) = shown["measures"]
    assert shown["measures"][name] == problem.margin.measure(np.array(joints))
    again = document("info", *words)["configuration"]["end_effector"]
    np.testing.assert_allclose(again["base"]["position"], base.position, atol=1e-12)


def test_info_of_wrong_joints_is_an_error() -> None:
    assert error("info", "planar_2dof", "--joints", "0,x")["key"] == "joints"
    assert error("info", "planar_2dof", "--joints", "0.5")["key"] == "joints"
    assert error("info", "planar_2dof", "--attitude", 0, 0, 0, 1)["key"] == "attitude"


def test_info_says_why_contact_is_not_searched_for(tmp_path: Path) -> None:
    text = (models_folder() / "planar_3dof" / "planar_3dof.urdf").read_text()
    mesh = '<mesh filename="none.stl"/>'
    (tmp_path / "arm.urdf").write_text(re.sub("<box [^>]*/>", mesh, text))
    assert "none.stl" in document("info", tmp_path / "arm.urdf")["contact_unchecked"]
    assert document("info", "planar_3dof")["contact_unchecked"] is None


@pytest.mark.parametrize("name", ["nothing.yaml", "", "x" * 300])
def test_info_of_an_unknown_name_is_an_error(name: str) -> None:
    assert error("info", name)["key"] in ("robot", "scenario")


def test_info_prints_all_diagnostics_of_a_broken_urdf(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = (models_folder() / "planar_3dof" / "planar_3dof.urdf").read_text()
    text = text.replace('value="40"', 'value="80/2"').replace('type="fixed"', 'type="welded"')
    (tmp_path / "arm.urdf").write_text(text)
    result = run("info", "arm.urdf", "--json")
    assert result.exit_code == 2
    printed = json.loads(result.stdout)
    assert [entry["severity"] for entry in printed["findings"]] == ["error", "error", "warning"]
    assert [entry["line"] for entry in printed["findings"]] == [32, 70, 63]
    assert printed["error"]["line"] == 32
    assert "2 errors, 1 warning" in run("info", "arm.urdf").stderr


# --- workspace ----------------------------------------------------------------------------------


# --- schema -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def schemas() -> dict[str, Any]:
    return document("schema")


@pytest.mark.slow
def test_the_schemas_accept_what_is_bundled(schemas: dict[str, Any]) -> None:
    for group, key in (("scenarios", "scenario"), ("studies", "study")):
        Draft202012Validator.check_schema(schemas[key])
        validator = Draft202012Validator(schemas[key])
        for entry in catalogue()[group]:
            validator.validate(yaml.safe_load(entry.text))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("task: pose", "task: dance"),
        ("[0.5, 0.3, 0.1]", "[0.5, 0.3]"),
        ("value: 5", "value: -5"),
        ("task: pose\n", ""),
    ],
)
def test_the_schema_refuses_what_commands_refuse(
    old: str, new: str, schemas: dict[str, Any], tmp_path: Path
) -> None:
    text = ENTRIES["spatial_6dof/line"].text
    assert old in text
    text = text.replace(old, new, 1)
    (tmp_path / "scenario.yaml").write_text(text)
    error("info", tmp_path / "scenario.yaml")
    assert not Draft202012Validator(schemas["scenario"]).is_valid(yaml.safe_load(text))
