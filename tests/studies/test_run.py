"""One run: the results of its command in a row, or the error that ended it."""

import json
import pickle
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import yaml

import freefloat as ff
from freefloat.beyond.engines.track_runs import followed_motion
from freefloat.beyond.formats.mjcf_file import robot_mjcf
from freefloat.io.results import load
from freefloat.io.scenario.loading import load_scenario
from freefloat.planning.simulation import simulate
from freefloat.robot.named_files import find_scenario
from freefloat.so3 import heading_quaternion
from freefloat.studies.run import RunResult, execute
from freefloat.studies.workers import PortableStudy, study_files
from tests.example_studies import BASE, HEADINGS, a_study

pytestmark = pytest.mark.usefixtures("kernels")


def results(folder: Path, vary: dict[str, Any] | None = None, **keys: Any) -> list[RunResult]:
    study = PortableStudy(a_study(folder, vary, **keys))
    return [execute(study, number, save_file=True) for number in range(study.study.count)]


def rows(folder: Path, vary: dict[str, Any] | None = None, **keys: Any) -> list[dict[str, Any]]:
    return [result.values for result in results(folder, vary, **keys)]


def joints(row: dict[str, Any]) -> list[float]:
    return [value for name, value in row.items() if name.startswith("joints.")]


@pytest.mark.slow
def test_a_simulation_has_the_results_of_simulate_and_its_file(tmp_path: Path) -> None:
    simulated = results(tmp_path, HEADINGS, start={"branch": 0})
    problem = load_scenario(tmp_path / "base.yaml").problem()
    for result, heading in zip(simulated, HEADINGS["heading_deg"]["list"], strict=True):
        row, start = result.values, heading_quaternion(np.radians(heading))
        chosen = simulate(problem, start, branch=0).chosen
        assert row["completed"] == chosen.motion.completed
        assert row["heading_deg"] == pytest.approx(heading)
        assert joints(row) == pytest.approx(chosen.motion.initial.joints.tolist())
        assert row["seconds"] is not None
        assert result.content is not None
        (tmp_path / "run.h5").write_bytes(result.content)
        assert load(tmp_path / "run.h5").chosen.minimum_margin == row["margin"]
    assert [result.values["verdict"] for result in simulated] == [
        "feasible", "infeasible", "feasible",
    ]  # fmt: skip
    assert simulated[1].values["singular_time"] == pytest.approx(simulated[1].values["margin_time"])
    assert simulated[1].values["reason"] == "The arm became singular."


def test_a_run_in_space_has_no_heading(tmp_path: Path) -> None:
    """Not even from an attitude that is a rotation about z."""
    base = yaml.safe_load(find_scenario("spatial_6dof/line").read_text())
    keys = {"base": base, "heading_deg": None, "attitude": [0.0, 0.0, 0.0, 1.0]}
    (row,) = rows(tmp_path, {"timing.duration": {"list": [100]}}, **keys)
    assert row["completed"]
    assert [row[f"attitude.{axis}"] for axis in "xyzw"] == [0.0, 0.0, 0.0, 1.0]
    assert row["heading_deg"] is None


@pytest.mark.slow
def test_a_plan_has_the_results_of_plan(tmp_path: Path) -> None:
    keys = {"command": "plan", "heading_deg": None}
    (result,) = results(tmp_path, {"momentum.2": {"list": [0.25]}}, **keys)
    row = result.values
    assert row["verdict"] == "feasible"
    assert result.content is not None
    (tmp_path / "run.h5").write_bytes(result.content)
    document = load(tmp_path / "run.h5").to_dict()
    for key in ("robust_radius_deg", "heading_deg", "branch"):
        assert row[key] == pytest.approx(document[key])
    assert (row["limiting"], row["limiting_time"]) == ("margin", document["min_margin"]["time"])
    ranges = {str(entry["branch"]): entry["ranges"] for entry in document["attitude_ranges_deg"]}
    for branch, spans in ranges.items():
        assert json.loads(row[f"attitude_ranges_deg.{branch}"]) == spans
    spans = [span for entry in ranges.values() for span in entry]
    inside = [any(low <= heading <= high for low, high in spans)
              for heading in np.linspace(0.0, 360.0, 3601)]  # fmt: skip
    assert 0.5 < np.mean(inside) < 1.0
    assert row["feasible_fraction"] == pytest.approx(np.mean(inside), abs=2e-3)


@pytest.mark.slow
def test_goals_and_manoeuvres_have_the_results_of_plan(tmp_path: Path) -> None:
    """Joints as a goal; and after a short path phases of enough and of too few seconds."""
    robot = {"robot": {"urdf": "planar_2dof", "end_effector": "end_effector"}}
    state = {"from_attitude": [0, 0, 0, 1], "joints": [0.3, 0.7]}
    goal = robot | {"search": state, "goal": {"joints": [0.6, 0.2]}, "limits": {"joint_rate": 0.1}}
    line = {"line": {"from": [1.6, 0.4, 0], "to": [1.5, 0.5, 0]}}
    path = {"task": "planar-position", "path": line}
    away = {"to": {"position": [0.02, 0, 0], "frame": "end_effector"}, "duration": 20}
    berth = {"timing": {"duration": 20}, "phases": [{"joints": [0.6, 0.6], "duration": 30}, away]}
    for base, key, values in (
        (goal, "goal.joints.0", [0.6, 0.5]),
        (robot | path | berth | {"limits": {"joint_rate": 0.1}}, "phases.0.duration", [60, 1]),
    ):
        vary, keys = {key: {"list": values}}, {"command": "plan", "heading_deg": None}
        first, second = results(tmp_path, vary, base=base, **keys)
        (tmp_path / "run.h5").write_bytes(first.content or b"")
        document = load(tmp_path / "run.h5").to_dict()
        for name in ("reason", "duration"):
            assert first.values[name] == document[name]
        assert first.values["verdict"] == "feasible"
        assert second.values["verdict"] == ("feasible" if base is goal else "infeasible")
        assert first.values["limits.joint_rate"] <= 1.0
        ends = [
            (entry["ratio"], phase.get("start", 0.0) + entry["time"], entry["where"])
            for phase in document.get("phases", [document])
            for entry in phase["limits"]
        ]
        _, time, joint = max(ends)
        assert first.values["limiting_time"] == pytest.approx(time)
        assert first.values["limiting"].endswith(f" of {joint}")
    keys["command"] = "track"
    study = a_study(tmp_path, {"track.seed": {"list": [1]}}, base=base, **keys)
    assert followed_motion(json.dumps(study.inputs(0)), study.base_source).kind == "plan"
    end = document["phases"][2]["min_margin"]
    assert end["value"] < document["phases"][0]["min_margin"]["value"] / 2
    assert (first.values["margin"], first.values["margin_time"]) == (end["value"], end["time"] + 80)


def test_a_map_has_the_results_of_map(tmp_path: Path) -> None:
    base = BASE | {"search": {"samples": 24}}
    keys = {"command": "map", "heading_deg": None, "base": base}
    few, none = results(tmp_path, {"margin.value": {"list": [5, 500]}}, **keys)
    assert few.values["verdict"] == "feasible"
    assert few.values["feasible_fraction"] is not None
    assert 0.5 < few.values["feasible_fraction"] < 1.0
    assert few.content is not None
    assert (none.values["verdict"], none.values["feasible_fraction"]) == ("infeasible", 0.0)


def test_an_arm_that_is_not_the_bases_has_no_undisturbed_motion(tmp_path: Path) -> None:
    vary = {"robot.urdf": "planar_2dof", "task": "planar-position", "path.polynomial.x.0": 1.0}
    (row,) = rows(tmp_path, {key: {"list": [value]} for key, value in vary.items()})
    assert "start.joints: " in str(row["error"])


@pytest.mark.parametrize(
    ("vary", "key"),
    [
        ({"momentum.2": {"list": [0, float("nan")]}}, "study.yaml: vary.momentum.2: "),
        ({"path.polynomial.x.0": {"list": [2, 9]}}, "path: "),
        ({"robot.urdf": {"list": ["planar_3dof", "none.urdf"]}}, "study.yaml: vary.robot.urdf: "),
        ({"robot.urdf": {"list": ["planar_3dof", "bad.urdf"]}}, "bad.urdf:1: urdf: "),
        ({"heading_deg": {"list": [9, float("inf")]}}, "heading_deg: "),
    ],
)
def test_an_error_becomes_a_row(vary: dict[str, Any], key: str, tmp_path: Path) -> None:
    (tmp_path / "bad.urdf").write_text("<robot><link")
    result = results(tmp_path, vary)[-1]
    assert result.values["verdict"] == "error"
    assert key in str(result.values["error"])
    assert "\n" not in str(result.values["error"])
    assert result.content is None


def test_an_error_of_a_solver_becomes_a_row(tmp_path: Path, monkeypatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("Singular\nmatrix")

    monkeypatch.setattr("freefloat.studies.run.simulate", fails)
    assert rows(tmp_path)[0]["error"] == "LinAlgError: Singular matrix"


XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="parameters" value="${load_yaml('parameters.yaml')}"/>
  <xacro:include filename="$(find arm_package)/${parameters['file']}"/></robot>"""
MJCF = """<mujoco><compiler meshdir="meshes"/><asset><mesh file="a&amp;b.stl"/></asset>
  <worldbody><include file="include/arm.xml"/></worldbody></mujoco>"""
MESHES = """<!-- <visual><geometry><mesh filename="it's.stl"/></geometry></visual> -->
  <visual><geometry><mesh filename="meshes/a&amp;b.stl"/></geometry></visual>
  <visual><geometry><mesh filename="missing.stl"/></geometry></visual>"""
ROBOTS = {
    "arm.urdf": {"meshes/a&b.stl"},
    "arm.xacro": {"include/links.urdf", "parameters.yaml"},
    "arm.xml": {"include/arm.xml", "meshes/a&b.stl"},
}
"""Robots and the further files that they need."""


def write_robots(folder: Path) -> None:
    """Write the same robot as URDF, xacro and MJCF, with meshes and files that they include."""
    model = ff.FreeFloatingModel.from_urdf("planar_3dof")
    world, text = robot_mjcf(model, shapes=False).find("worldbody"), model.description.text
    ET.SubElement(world.findall(".//body")[-1], "body", name="end_effector", pos="0.4 0 0")
    texts = {
        "arm.urdf": text.replace("</link>", f"{MESHES}</link>", 1), "include/links.urdf": text,
        "arm.xacro": XACRO, "parameters.yaml": "file: include/links.urdf", "it's.stl": "solid",
        "package.xml": "<package><name>arm_package</name></package>",
        "arm.xml": MJCF, "include/arm.xml": ET.tostring(world, "unicode"),
    }  # fmt: skip
    (folder / "include").mkdir(parents=True)
    (folder / "meshes").mkdir()
    for name, content in texts.items():
        (folder / name).write_text(content)
    trimesh.creation.box().export(folder / "meshes" / "a&b.stl")


@pytest.mark.slow
def test_files_sent_along_are_enough_elsewhere(tmp_path: Path, monkeypatch) -> None:
    """Robots are gone, and the working folder is another, when the runs are executed."""
    home = tmp_path / "home"
    write_robots(home / "robots")
    monkeypatch.chdir(home)
    studies = [a_study(Path(), {"robot.urdf": {"list": [f"robots/{name}", "robots/none.urdf"]}},
                       base=BASE | {"robot": BASE["robot"] | {"urdf": f"robots/{name}"}})
               for name in ROBOTS]  # fmt: skip
    here = [execute(PortableStudy(study), 0).values for study in studies]
    pickled = pickle.dumps([PortableStudy(study, study_files(study)) for study in studies])
    monkeypatch.chdir(tmp_path)
    home.rename(tmp_path / "away")
    for study, row, (name, more) in zip(pickle.loads(pickled), here, ROBOTS.items(), strict=True):
        names = {str(Path(path).relative_to(home / "robots")) for path, _ in study.files}
        assert names == {name, "package.xml", *more}
        there, error = (execute(study, number).values for number in range(2))
        assert there["margin"] == row["margin"]
        assert str(error["error"]).startswith("study.yaml: vary.robot.urdf: ")
