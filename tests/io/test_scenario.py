"""Scenario files: paths, attitudes, timing, margins, robots, limits, and their errors."""

import math
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.io.scenario.problem_text import scenario_of
from freefloat.io.scenario.scenario import Scenario
from freefloat.paths.curves import Curve
from freefloat.paths.directed_orientation import DirectedOrientation
from freefloat.paths.timing import TimeLaw
from freefloat.so3 import Pose, unit_quaternion
from tests.errors import error_key

PLACES = np.linspace(0.0, 1.0, 11)
LINE = "line: {from: [1, 0, 0], to: [-0.5, 0.8, 0.33]}"
UPRIGHT = "attitude: {fixed: {rpy: [0, 0, 0]}}"

CURVES = {
    "line": LINE,
    "polynomial": "polynomial: {x: [2, -3], y: [0, 0.5, 1.5], z: [0, 0, 0, 0.2]}",
    "arc": "arc: {center: [0, 0, 1], normal: [0, 1, 1], from: [1, 0, 1], angle_deg: 100}",
    "waypoints": "waypoints: [[1, 0, 0], [1, 1, 0], [0, 1, 0.5], [-1, 1, 0.5]]",
}
LAWS = {
    "fixed": "{fixed: {rpy: [0.1, 0.2, 0.3]}}",
    "slerp": "{slerp: {from: [0, 0, 0, 1], to: {rpy: [0.5, 0, 1]}}}",
    "follow": "{follow: {axis: x, normal: [0.3, 0.2, 1]}}",
    "point_at": "{point_at: {target: [0.2, -3, 0.1], axis: z}}",
}
PAIRS = list(zip(CURVES, cycle(LAWS), strict=False))


def scenario_text(
    path: str,
    *,
    robot: str = "{urdf: spatial_6dof, end_effector: end_effector}",
    task: str = "pose",
    timing: str = "{duration: 100}",
    rest: str = "",
) -> str:
    return f"robot: {robot}\ntask: {task}\npath: {{{path}}}\ntiming: {timing}\n{rest}\n"


def scenario(tmp_path: Path, path: str = f"{LINE}, {UPRIGHT}", **rest: str) -> Scenario:
    file = tmp_path / "scenario.yaml"
    file.write_text(scenario_text(path, **rest))
    return ff.load_scenario(file)


def problem(tmp_path: Path, path: str = f"{LINE}, {UPRIGHT}", **rest: str) -> ff.Problem:
    return scenario(tmp_path, path, **rest).problem()


def path_of(tmp_path: Path, path: str, **rest: str) -> ff.EndEffectorPath:
    return problem(tmp_path, path, **rest).path.path


def close(values: Any, wanted: Any, tolerance: float = 1e-12) -> bool:
    return bool(np.allclose(values, wanted, rtol=0.0, atol=tolerance))


def test_what_is_left_out_has_its_default(tmp_path: Path) -> None:
    found = problem(tmp_path)
    assert close(found.momentum, [0, 0, 0])
    assert (found.margin.measure.name, found.margin.threshold) == ("gjm", 0.0)
    assert found.path.timing.law is TimeLaw.QUINTIC
    assert found.path.timing.stops == ()
    assert math.isclose(found.model.total_mass, 480.0, abs_tol=1e-4)


def test_samples_are_found_beside_the_scenario_and_not_in_the_working_folder(tmp_path, monkeypatch):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "path.csv").write_text("x,y,z\n9,9,9\n8,8,8\n")
    (tmp_path / "path.csv").write_text("x,y,z\n1,0,0\n0,1,0\n")
    monkeypatch.chdir(tmp_path / "elsewhere")
    path = path_of(tmp_path, f"samples: path.csv, {UPRIGHT}")
    assert close(path.pose(0.0).position, [1, 0, 0])


def test_a_bad_row_after_blank_lines_is_refused_with_its_line_in_the_file(tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text("x,y,z\n\n\n1,0,0\n0,oops,0\n")
    with pytest.raises(ff.InputError) as caught:
        problem(tmp_path, f"samples: path.csv, {UPRIGHT}")
    assert "0,oops,0" in caught.value.problem
    assert "5" in f"{caught.value.key} {caught.value.problem}", "the number of the line"


@pytest.mark.parametrize("fixed", [
    "{quaternion: [0, 0, 0.7071067811865476, 0.7071067811865476]}",
    "[0, 0, 0.7071067811865476, 0.7071067811865476]",
    "{rpy: [0, 0, 1.5707963267948966]}",
    "{axes: {x: [0, 2, 0], z: [0, 0, 3]}}",
    "{axes: {z: [0, 0, 1], y: [-1, 0, 0]}}",
])  # fmt: skip
def test_an_attitude_can_be_written_in_several_ways(fixed: str, tmp_path: Path) -> None:
    path = path_of(tmp_path, f"{LINE}, attitude: {{fixed: {fixed}}}")
    quarter = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    for s in PLACES:
        assert close(path.pose(s).rotation, quarter, 1e-9)


PLANAR = {
    "path": f"line: {{from: [1, 0, 0], to: [0, 1, 0]}}, {UPRIGHT}",
    "robot": "{urdf: planar_3dof, end_effector: end_effector}",
    "task": "planar-pose",
}


@pytest.mark.parametrize("measure", ["gjm", "sigma"])
def test_a_fraction_is_of_the_measures_largest_magnitude(measure: str, tmp_path: Path) -> None:
    rest = f"margin: {{measure: {measure}, fraction: 0.25}}"
    margin = problem(tmp_path, **PLANAR, rest=rest).margin
    assert margin.measure.name == measure
    angles = np.linspace(-np.pi, np.pi, 17)
    joints = np.array(np.meshgrid(angles, angles, angles)).reshape(3, -1).T
    swept = max(abs(margin.measure(q)) for q in joints)
    assert 0.25 * swept <= margin.threshold <= 1.05 * 0.25 * swept


def robot(tmp_path: Path, rest: str) -> ff.FreeFloatingModel:
    section = f"{{urdf: planar_3dof, end_effector: end_effector{rest}}}"
    return scenario(tmp_path, **{**PLANAR, "robot": section}).model()


def test_a_map_of_mass_factors_scales_only_the_links_it_names(tmp_path: Path) -> None:
    plain, scaled = robot(tmp_path, ""), robot(tmp_path, ", scale_mass: {link_1: 2, link_3: 0.5}")
    factors = [1.0, 2.0, 1.0, 0.5]
    for factor, before, after in zip(factors, plain.bodies, scaled.bodies, strict=True):
        assert math.isclose(after.mass, factor * before.mass)
        assert close(after.inertia, factor * before.inertia)
    assert math.isclose(scaled.total_mass, 400 + 80 + 30 + 0.5)


UR5 = "{urdf: example-robot-data:ur5, end_effector: tool0}"


def limits(tmp_path: Path, text: str, robot: str = UR5) -> ff.Limits:
    return scenario(tmp_path, robot=robot, rest=f"limits: {text}").limits()


def test_limits_of_joints_are_a_number_a_map_or_the_urdfs(tmp_path: Path) -> None:
    checked = limits(tmp_path, "{joint_rate: 0.5, joint_torque: {elbow_joint: 7}, base_rate: 0.1}")
    assert checked.joint_rate is not None
    assert checked.joint_torque is not None
    assert checked.joint_rate.tolist() == [0.5] * 6
    assert checked.joint_torque.tolist() == [np.inf, np.inf, 7.0, np.inf, np.inf, np.inf]
    assert (checked.base_rate, checked.clearance) == (0.1, None)
    rated = limits(tmp_path, "{joint_rate: urdf, joint_torque: urdf, clearance: 0}")
    assert rated.joint_rate is not None
    assert rated.joint_torque is not None
    assert rated.joint_rate.tolist() == [3.15, 3.15, 3.15, 3.2, 3.2, 3.2]
    assert rated.joint_torque.tolist() == [150.0, 150.0, 150.0, 28.0, 28.0, 28.0]
    assert rated.clearance == 0.0


PRESENT = (
    "search: {joints: [0.3, -0.5, 1.1, 0.4, 0.9, -0.2], from_attitude: [0.1, 0.5, 0.2, -0.8367]}"
)


def frames_at_present(robot: ff.FreeFloatingModel) -> dict[str, Pose]:
    """Poses of frames at the present attitude and joints."""
    search = yaml.safe_load(PRESENT)["search"]
    attitude = unit_quaternion("", search["from_attitude"])
    spacecraft = robot.body_poses(attitude, search["joints"])[0]
    carrier = robot.moving_joints[0].parent
    return {"spacecraft": spacecraft, "base": spacecraft @ robot.link_places[carrier][1]}


@pytest.mark.parametrize(
    ("path", "frame"),
    [
        (f"{LINE}, attitude: {LAWS['slerp']}", "spacecraft"),
        (f"{CURVES['arc']}, attitude: {LAWS['follow']}", "base"),
        (f"{CURVES['waypoints']}, attitude: {LAWS['point_at']}", "spacecraft"),
    ],
)
def test_a_path_in_a_frame_moves_with_it(path: str, frame: str, tmp_path: Path) -> None:
    """Roll about an axis that points is settled by inertial axes, whatever the frame."""
    ur5 = (
        "{urdf: 'example-robot-data:ur5', end_effector: tool0, spacecraft: {mass: 200, "
        "inertia: [35, 35, 35], size: [1, 1, 1], mount: {xyz: [0.5, 0, 0.5], rpy: [0, 0.3, 0]}}}"
    )
    inertial = problem(tmp_path, path, robot=ur5, rest=PRESENT)
    found = scenario(tmp_path, f"frame: {frame}, {path}", robot=ur5, rest=PRESENT)
    moved, at = found.problem().path.path, frames_at_present(inertial.model)[frame]
    target = at.position + at.rotation @ [0.2, -3.0, 0.1]
    pointing = DirectedOrientation.point_at(moved.curve, "z", target)
    for s in PLACES:
        wanted = at @ inertial.path.path.pose(s)
        rotation = pointing.rotation(s) if "point_at" in path else wanted.rotation
        assert close(moved.pose(s).position, wanted.position)
        assert close(moved.pose(s).rotation, rotation)
    again = scenario_of(found.problem(), found.search())
    assert_same_problem(again.problem(), found.problem())


def assert_same_problem(found: ff.Problem, wanted: ff.Problem) -> None:
    assert found.model is wanted.model
    assert (found.task, found.path.timing) == (wanted.task, wanted.path.timing)
    assert close(found.momentum, wanted.momentum)
    assert found.margin.measure.name == wanted.margin.measure.name
    assert found.margin.threshold == wanted.margin.threshold
    assert repr(found.redundancy) == repr(wanted.redundancy)
    for s in PLACES:
        pose, same = found.path.path.pose(s), wanted.path.path.pose(s)
        assert close(pose.position, same.position)
        assert not wanted.task.prescribes_orientation or close(pose.rotation, same.rotation)
        assert close(found.path.path.tangent(s), wanted.path.path.tangent(s), 1e-9)


@pytest.mark.parametrize("name", ["planar_3dof/parabola", "panda_servicer/line", "ets_vii/inspect"])
def test_a_bundled_problem_is_that_of_its_scenario(name: str) -> None:
    loaded = ff.load_scenario(name)
    wanted, search, limits = loaded.problem(), loaded.search(), loaded.limits()
    again = scenario_of(wanted, search, limits)
    assert_same_problem(again.problem(), wanted)
    assert repr(again.search()) == repr(search)
    assert repr(again.limits()) == repr(limits)


@pytest.mark.parametrize(("curve", "law"), PAIRS)
def test_every_curve_and_orientation_comes_back(curve: str, law: str, tmp_path: Path) -> None:
    wanted = problem(tmp_path, f"{CURVES[curve]}, attitude: {LAWS[law]}")
    assert_same_problem(scenario_of(wanted).problem(), wanted)


@pytest.mark.parametrize("columns", ["x,y,z", "s,x,y,z", "x,y,z,qx,qy,qz,qw"])
def test_samples_come_back(columns: str, tmp_path: Path) -> None:
    values = {"s": [0, 0.2, 0.9, 1], "x": [1, 1, 0, -1], "y": [0, 1, 1, 1], "z": [0, 0, 0.5, 0.5]}
    quaternions = Rotation.from_euler("xz", [[0, 0], [0.1, 0.3], [0.2, 0.8], [0, 1]]).as_quat()
    values |= dict(zip(("qx", "qy", "qz", "qw"), quaternions.T.tolist(), strict=True))
    rows = zip(*(values[name] for name in columns.split(",")), strict=True)
    text = "\n".join([columns, *(",".join(map(repr, row)) for row in rows)])
    (tmp_path / "path.csv").write_text(text)
    attitude = "" if "qw" in columns else f", {UPRIGHT}"
    wanted = problem(tmp_path, f"samples: path.csv{attitude}")
    assert_same_problem(scenario_of(wanted).problem(), wanted)


def test_stops_laws_and_the_motion_of_a_redundant_arm_come_back(tmp_path: Path) -> None:
    wanted = problem(
        tmp_path, LINE, task="position",
        timing="{law: trapezoidal, duration: 50, stops: [{s: 0.5, t: 20}]}",
        rest="redundancy: {metric: {q2: 3}, toward: sigma, gain: 0.5, bound: 2}\n"
             "margin: {fraction: 0.1}",
    )  # fmt: skip
    stated = ff.Redundancy({"q2": 3.0}, "sigma", 0.5, 2.0)
    assert repr(wanted.redundancy) == repr(stated)
    assert_same_problem(scenario_of(wanted).problem(), wanted)


def test_a_curve_of_the_users_own_class_has_no_scenario(tmp_path: Path) -> None:
    class Circle(Curve):
        def __call__(self, s: float | np.ndarray, order: int = 0) -> np.ndarray:
            phase = s + order * np.pi / 2
            return np.array([np.cos(phase), np.sin(phase), 0.0 * phase]).T

    wanted = problem(tmp_path, LINE, task="position")
    timed = replace(wanted.path, path=ff.EndEffectorPath(Circle()))
    assert error_key(scenario_of, replace(wanted, path=timed)) == "path.curve"


def test_a_dictionary_is_a_scenario() -> None:
    content = yaml.safe_load(ff.load_scenario("planar_2dof/line").text)
    content["robot"]["urdf"] = "planar_2dof"
    content["path"] = {"line": {"from": np.array([1.9, 0.2, 0.0]), "to": [0.5, 1.2, np.int64(0)]}}
    content["margin"] = {"measure": "system", "value": np.float64(1e-5)}
    problem = ff.load_scenario(content).problem()
    assert problem.margin.threshold == 1e-5
    assert problem.path.pose(0.0).position == pytest.approx([1.9, 0.2, 0.0])
    assert error_key(ff.load_scenario, content | {"task": "dance"}) == "task"
