"""``freefloat plan`` with phases: its document, and how its file is checked, played and drawn."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.motion.joint_curves import JointSpline
from tests.commands import document, error, run

SCENARIO = """
robot: {urdf: planar_2dof, end_effector: end_effector}
task: planar-position
path:
  line: {from: [1.9, 0.2, 0], to: [0.5, 1.2, 0]}
timing: {duration: 30}
margin: {measure: system, fraction: 0.1}
search: {objective: nearest, from_attitude: [0, 0, 0, 1], joints: [0.5, 0.8], reorient: true}
limits:
  joint_rate: 0.5
  base_turn_deg: 170
  pointing: [{body: link_1, axis: [0, 0, 1], target: {point: [1, -2, 0.5]}, angle_deg: 95}]
drift: [0.002, -0.003, 0]
scene:
  bodies:
    - {name: client, sphere: 0.1, position: [0.5, 1.2, 0],
       orientation: {rpy: [1.5707963267948966, 0, 1]},
       tumbling: {inertia: [0.1, 0.1, 0.1], rate: [0, 0.02, 0]}}
    - {name: wall, urdf: wall.urdf, position: [0, 0, 9]}
phases:
  - capture: {body: client, mass: 3}
  - {joints: {q1: 0.4, q2: 1.2}, duration: 30}
  - to: {position: [0.1, 0.1, 0], frame: end_effector}
    duration: 20
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("manoeuvre")
    (folder / "scenario.yaml").write_text(SCENARIO)
    sphere = '<collision><geometry><sphere radius="1"/></geometry></collision>'
    (folder / "wall.urdf").write_text(f'<robot name="r"><link name="a">{sphere}</link></robot>')
    found = document("plan", folder / "scenario.yaml", "-o", folder / "manoeuvre.h5")
    kinds = ["goal", "path", "capture", "goal", "path"]
    assert [phase["kind"] for phase in found["phases"]] == kinds
    assert found["feasible"]
    return folder / "manoeuvre.h5"


def changed(file: Path, old: str, new: str) -> Path:
    assert old in SCENARIO
    path = file.parent / "changed.yaml"
    path.write_text(SCENARIO.replace(old, new))
    return path


@pytest.mark.slow
def test_a_loaded_motion_knows_what_moves_its_arm(file: Path) -> None:
    """Its limits are those that were stated: of prescribed joints and of paths."""
    wall = (file.parent / "wall.urdf").rename(file.parent / "moved.urdf")
    moving = [phase for phase in ff.load(file).phases if phase.motion is not None]
    wall.rename(file.parent / "wall.urdf")
    assert len(moving) == 4
    for phase in moving:
        assert phase.motion.law.timing.duration == phase.motion.times[-1]
        stated = {result.limit: result for result in phase.result.limit_results}
        for found in ff.check_limits(phase.motion, phase.result.limits):
            assert found.worst == pytest.approx(stated[found.limit].worst, rel=1e-9)
            assert found.where == stated[found.limit].where


@pytest.mark.slow
def test_a_file_is_verified_with_mujoco(file: Path) -> None:
    found = document("check", file, "--engine", "mujoco")
    assert found["proved"]
    stated = [
        (f"{phase.name}: {entry.where}", pytest.approx(phase.start + entry.time))
        for phase in ff.load(file).phases for entry in phase.limit_results
    ]  # fmt: skip
    assert [(entry["where"], entry["time"]) for entry in found["limits"]] == stated


@pytest.mark.slow
def test_rates_and_places_that_do_not_join_are_discrepancies(file: Path) -> None:
    loaded = ff.load(file)
    before, _, _, berth, _ = loaded.phases
    points = berth.motion.law.curve.control_points.copy()
    points[1] += [1e-3, 0.0]
    object.__setattr__(berth.motion.law, "curve", JointSpline(points))
    object.__setattr__(before, "centre", before.centre + 1e-6)
    names = {entry.name for entry in ff.check(loaded).discrepancies}
    assert {"goal: rates at its start", "path: begins where reorientation ends"} <= names
    assert "path: rates at its start" not in names


@pytest.mark.slow
def test_exports_of_the_phases_join(file: Path, tmp_path: Path) -> None:
    found = document("export", file, "-o", tmp_path / "m.json", "--times", 301)
    names = ["1_reorientation", "2_path", "4_goal", "5_to"]
    files = [tmp_path / f"m_{name}.json" for name in names]
    assert [entry["file"] for entry in found["phases"]] == [str(path) for path in files]
    tables = [json.loads(path.read_text())["trajectory"] for path in files]
    for table in tables:
        differences = np.gradient(np.array(table["joints"]), table["time"], axis=0, edge_order=2)
        np.testing.assert_allclose(table["joint_rates"], differences, atol=2e-3)
    for before, after in pairwise(tables):
        for key in ("time", "attitude", "joints"):
            np.testing.assert_allclose(before[key][-1], after[key][0], atol=1e-8)
    reached = np.array(tables[1]["end_effector_position_fixed"][-1])  # where the client is grasped
    np.testing.assert_allclose(tables[2]["end_effector_position_fixed"][0], reached, atol=1e-8)
    assert error("export", file, "--format", "csv", "-o", "-")["key"] == "output"


@pytest.mark.slow
def test_a_phase_that_fails_ends_with_exit_code_1(file: Path, tmp_path: Path) -> None:
    late = changed(file, "q2: 1.2}, duration: 30", "q2: 1.2}, duration: 1")
    found = document("plan", late, "-o", tmp_path / "late.h5", code=1)
    assert [phase["feasible"] for phase in found["phases"]] == [True] * 3 + [False]
    assert found["duration"] == sum(phase["duration"] for phase in found["phases"])
    assert not ff.load(tmp_path / "late.h5").feasible
    assert run("check", tmp_path / "late.h5").exit_code == 1
    assert found["not_reached"] == ff.load(tmp_path / "late.h5").to_dict()["not_reached"] == ["to"]
    far = changed(file, "to: [0.5, 1.2, 0]}", "to: [5, 12, 0]}")  # no phase has a motion
    found = document("plan", far, "--plots", tmp_path / "figures", code=1)
    assert (found["feasible"], len(found["phases"])) == (False, 1)
    assert found["duration"] == found["phases"][0]["duration"] == 0.0
    assert found["not_reached"] == ["reorientation", "capture", "goal", "to"]


@pytest.mark.slow
@pytest.mark.parametrize(("old", "new", "key"), [
    ("mass: 3", "mass: 0", "phases.0.capture.mass"),
    ("mass: 3}", "mass: 3}\n    margin: 1", "phases.0"),
    ("duration: 20", "timing: {duration: 20}", "phases.2"),
    ("q2: 1.2", "q3: 1.2", "phases.1.joints"),
    ("frame: end_effector}", "frame: tool}", "phases.2.to.frame"),
    ("{joints: {q1: 0.4, q2: 1.2}, duration: 30}", "capture: {body: client, mass: 3}",
     "phases.1.capture.body"),
])  # fmt: skip
def test_bad_phases_are_refused(file: Path, old: str, new: str, key: str) -> None:
    scenario = changed(file, old, new)
    for words in (("plan", scenario), ("simulate", scenario, "--heading", "0")):
        assert error(*words)["key"] == key
