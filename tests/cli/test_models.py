"""``freefloat models``, ``info``, ``workspace`` and ``schema``."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from jsonschema import Draft202012Validator
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.cli.models import catalogue
from freefloat.robot.named_files import (
    bundled_robots,
    bundled_scenarios,
    bundled_studies,
    models_folder,
)
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Pose, unit_quaternion
from tests.commands import document, error, run

ENTRIES = {entry.name: entry for group in catalogue().values() for entry in group}


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
            assert entry["description"].endswith((".", "?"))
            assert Path(entry["file"]).is_file()
            assert f" {entry['name']} " in text
    assert all(entry["source"] for entry in groups["robots"])
    assert ENTRIES["ur5_servicer/arc"].details["robot"] == "example-robot-data:ur5"
    assert {entry["base"] for entry in groups["studies"]} <= set(bundled_scenarios())


@pytest.mark.slow
def test_info_describes_the_same_robot_by_any_name(folder: Path) -> None:
    shutil.copy(models_folder() / "planar_3dof" / "planar_3dof.urdf", folder / "arm.urdf")
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


@pytest.mark.slow
def test_info_lists_scene_pointing_turn_and_wheels_of_a_scenario() -> None:
    scenario = yaml.safe_load(ENTRIES["servicing/inspect_client"].text)
    shown = document("info", "servicing/inspect_client")
    for limit, stated in zip(shown["pointing"], scenario["limits"]["pointing"], strict=True):
        assert limit["angle_deg"] == pytest.approx(stated["angle_deg"])
    assert shown["base_turn_deg"] == pytest.approx(scenario["limits"]["base_turn_deg"])
    assert [body["name"] for body in shown["scene"]["bodies"]] == ["client"]
    corridor = shown["scene"]["corridor"]
    assert corridor["half_angle_deg"] == pytest.approx(20.0)
    assert shown["wheel_momentum"] == scenario["wheels"]["momentum"]
    assert "outside" in run("info", "servicing/inspect_client").stdout
    assert not {"scene", "pointing"} & document("info", "spatial_6dof").keys()


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


def test_info_prints_all_diagnostics_of_a_broken_urdf(folder: Path) -> None:
    text = (models_folder() / "planar_3dof" / "planar_3dof.urdf").read_text()
    text = text.replace('value="40"', 'value="80/2"').replace('type="fixed"', 'type="welded"')
    (folder / "arm.urdf").write_text(text)
    result = run("info", "arm.urdf", "--json")
    assert result.exit_code == 2
    printed = json.loads(result.stdout)
    assert [entry["severity"] for entry in printed["findings"]] == ["error", "error", "warning"]
    assert [entry["line"] for entry in printed["findings"]] == [32, 67, 61]
    assert printed["error"]["line"] == 32
    assert "2 errors, 1 warning" in run("info", "arm.urdf").stderr


@pytest.mark.slow
def test_the_schemas_accept_what_is_bundled() -> None:
    schemas = document("schema")
    assert error("schema", "robot")["key"] == "kind"
    for group, key in (("scenarios", "scenario"), ("studies", "study")):
        assert document("schema", key) == schemas[key]
        Draft202012Validator.check_schema(schemas[key])
        validator = Draft202012Validator(schemas[key])
        for entry in catalogue()[group]:
            validator.validate(yaml.safe_load(entry.text))
