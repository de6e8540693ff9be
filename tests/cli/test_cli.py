"""The ``freefloat`` command: what it prints, where, and with which exit code."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from freefloat.cli.app import app
from freefloat.dynamics.momentum import Task
from freefloat.io.scenario import load_scenario
from freefloat.robot.names import bundled_robots, bundled_scenarios, models_folder

pytestmark = pytest.mark.usefixtures("kernels")

PLANAR = """\
# The parabola of the paper's first example; the hand rests on its way at t = 69.73 s.
robot: {urdf: planar_3dof.urdf, end_effector: end_effector}   # beside this file, or bundled
task: planar-pose
momentum: [0, 0, 0.5]
path:
  polynomial: {x: [2, -3], y: [0, 0.5, 1.5], z: [0]}
  attitude: {follow: {axis: -y, normal: [0, 0, 1]}}   # minus y looks where it goes
timing: {law: quintic, duration: 100, stops: [{s: 0.8333333333, t: 69.73}]}
margin: {measure: system, value: 5}
"""
SPATIAL = """\
# The straight line of the paper's second example.
robot: {urdf: spatial_6dof.urdf, end_effector: end_effector}
task: pose
momentum: [0.5, 0.3, 0.1]
path:
  line: {from: [1, 0, 0], to: [-0.5, 0.8, 0.33]}
  attitude: {fixed: {axes: {x: [0.4683, 1.1683, -0.7], z: [1.5, -0.8, -0.33]}}}   # x is kept
timing: {law: quintic, duration: 100}
margin: {measure: arm, value: 5}
"""
GOOD = ("--attitude", "0.46008", "0.09337", "0.73519", "-0.48898")
"""Touches the margin of Example 2 on four branches and keeps it on the others."""
BAD = ("--attitude", "0.1", "0.5", "0.2", "-0.8367")
"""Four of the eight branches meet a singularity from here."""

PLANAR_RUN = ("planar_3dof/parabola", "--heading", "200")
PLANAR_FAILS = ("planar_3dof/parabola", "--heading", "140", "--branch", "0")
SPATIAL_RUN = ("spatial_6dof/line", *GOOD)

Call = Callable[..., Any]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with the two scenarios and no URDF beside them."""
    (tmp_path / "planar_example1.yaml").write_text(PLANAR)
    (tmp_path / "spatial_example2.yaml").write_text(SPATIAL)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*words: str) -> Any:
    """The result of a command, run in this process."""
    return CliRunner().invoke(app, list(words))


def answer(*words: str, code: int | None = None) -> dict[str, Any]:
    """The JSON document of a command that prints it and nothing else."""
    bundled = words[1] in (*bundled_robots(), *bundled_scenarios())
    result = (remembered if bundled else run)(*words, "--json")
    assert code is None or result.exit_code == code, result.output
    assert result.stderr == ""
    document = json.loads(result.stdout)
    assert isinstance(document, dict)
    return document


@cache
def remembered(*words: str) -> Any:
    """The same for what does not depend on files of the working folder."""
    return run(*words)


def refusal(*words: str) -> str:
    """The one line with which a command refuses its input."""
    result = run(*words)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1, result.stderr
    return str(result.stderr)


def command(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A command as a shell runs it."""
    return subprocess.run(
        [sys.executable, "-m", "freefloat", *words],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


# --- simulate: one JSON document ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "dof"),
    [
        (("planar_example1.yaml", "--heading", "200"), 3),
        (("spatial_example2.yaml", *GOOD), 6),
        (("planar_3dof/parabola_nonstop", "--heading", "200"), 3),
    ],
)
def test_simulate_answers_with_the_documented_keys(
    words: tuple[str, ...], dof: int, folder: Path
) -> None:
    document = answer("simulate", *words, code=0)
    assert document.keys() >= {
        *("completed", "singular", "min_margin", "initial", "final", "residuals", "branches")
    }
    assert document["completed"] is True
    assert document["singular"] is None
    assert document["min_margin"].keys() >= {"measure", "value", "time"}
    for state in (document["initial"], document["final"]):
        assert state.keys() >= {"attitude", "joints", "base_position"}
        assert [len(state[key]) for key in ("attitude", "joints", "base_position")] == [4, dof, 3]
        assert math.isclose(np.linalg.norm(state["attitude"]), 1.0, abs_tol=1e-9)
    assert document["residuals"].keys() == {
        *("end_effector_position", "end_effector_attitude", "momentum")
    }
    assert document["residuals"]["end_effector_position"] < 1e-7
    assert document["residuals"]["end_effector_attitude"] < 1e-7
    assert document["residuals"]["momentum"] < 1e-5
    assert len(document["branches"]) == {3: 2, 6: 8}[dof]
    for one in document["branches"]:
        assert one.keys() >= {"branch", "joints", "completed", "singular", "min_margin"}
        assert len(one["joints"]) == dof


def test_simulate_tells_where_a_motion_becomes_singular(folder: Path) -> None:
    document = answer("simulate", *PLANAR_FAILS)
    singular = document["singular"]
    assert document["completed"] is False
    assert singular.keys() == {"time", "s", "end_effector", "joints"}
    assert singular["time"] == document["final"]["time"] < 100.0
    assert singular["joints"] == document["final"]["joints"]
    x, y, z = singular["end_effector"]
    assert math.isclose(x, 2 - 3 * singular["s"], abs_tol=1e-6)
    assert math.isclose(y, x**2 / 6 - 5 * x / 6 + 1, abs_tol=1e-6)
    assert math.isclose(z, 0.0, abs_tol=1e-9)
    assert document["min_margin"]["value"] < 1e-6


def test_the_papers_bad_attitude_becomes_singular_where_it_says(folder: Path) -> None:
    branches = answer("simulate", "spatial_6dof/line", *BAD)["branches"]
    failed = [one for one in branches if not one["completed"]]
    assert len(failed) == 4
    for one in failed:
        assert np.allclose(one["singular"]["end_effector"], [0.120, 0.469, 0.194], atol=1e-3)


def test_the_papers_touch_point_keeps_the_margin_on_every_branch(folder: Path) -> None:
    branches = answer("simulate", "spatial_6dof/line", *GOOD)["branches"]
    assert all(one["completed"] for one in branches)
    smallest = min(one["min_margin"]["value"] for one in branches)
    assert math.isclose(smallest, 5.0, abs_tol=0.05)


def test_a_position_task_has_no_attitude_residual(folder: Path) -> None:
    text = PLANAR.replace("planar-pose", "planar-position")
    (folder / "position.yaml").write_text(text)
    document = answer("simulate", "position.yaml", "--heading", "200")
    assert document["residuals"]["end_effector_attitude"] is None


# --- simulate: exit codes -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("planar_example1.yaml", "--heading", "200"), 0),
        (("planar_example1.yaml", "--heading", "140"), 0),
        (("planar_example1.yaml", "--heading", "140", "--branch", "0"), 1),
        (("planar_example1.yaml", "--heading", "140", "--branch", "1"), 0),
        (("planar_example1.yaml", "--heading", "140", "--stop-at-margin"), 1),
        (("planar_example1.yaml", "--heading", "200", "--stop-at-margin"), 0),
        (("spatial_example2.yaml", *GOOD), 0),
        (("spatial_example2.yaml", *BAD, "--branch", "2"), 1),
        (("planar_example1.yaml",), 2),
        (("nothing.yaml", "--heading", "0"), 2),
        (("planar_example1.yaml", "--heading", "0", "--branch", "2"), 2),
    ],
)
def test_the_exit_code_answers_the_question(
    words: tuple[str, ...], code: int, folder: Path
) -> None:
    assert run("simulate", *words).exit_code == code
    as_json = run("simulate", *words, "--json")
    assert as_json.exit_code == code
    document = json.loads(as_json.stdout)
    assert ("error" in document) is (code == 2)
    if code != 2:
        assert document["completed"] is (code == 0)


def test_nothing_is_written_to_the_working_folder(folder: Path) -> None:
    before = sorted(folder.iterdir())
    run("simulate", "planar_example1.yaml", "--heading", "200")
    run("info", "planar_example1.yaml")
    run("schema")
    assert sorted(folder.iterdir()) == before


# --- simulate: which branch ---------------------------------------------------------------------


def test_without_a_wish_the_branch_with_the_largest_margin_is_followed(folder: Path) -> None:
    for heading in ("0", "60", "200", "260"):
        document = answer("simulate", "planar_3dof/parabola", "--heading", heading)
        best = max(
            document["branches"], key=lambda one: (one["completed"], one["min_margin"]["value"])
        )
        assert document["branch"] == best["branch"]
        assert document["min_margin"] == best["min_margin"]
        assert document["initial"]["joints"] == best["joints"]


def test_a_branch_that_completes_is_followed_before_one_that_does_not(folder: Path) -> None:
    document = answer("simulate", "planar_3dof/parabola", "--heading", "140")
    assert [one["completed"] for one in document["branches"]] == [False, True]
    assert document["branch"] == 1
    assert document["completed"] is True


def test_a_branch_is_followed_by_its_number(folder: Path) -> None:
    whole = answer("simulate", "planar_3dof/parabola", "--heading", "200")
    for one in whole["branches"]:
        number = str(one["branch"])
        document = answer(
            "simulate", "planar_3dof/parabola", "--heading", "200", "--branch", number
        )
        assert document["branch"] == one["branch"]
        assert document["initial"]["joints"] == one["joints"]
        assert document["min_margin"] == one["min_margin"]
        assert document["branches"] == whole["branches"]


def test_a_branch_that_does_not_exist_is_refused_with_those_that_do(folder: Path) -> None:
    line = refusal("simulate", "planar_3dof/parabola", "--heading", "200", "--branch", "5")
    assert "branch" in line
    assert line.endswith("accepted: 0, 1\n")


def joints_of(*words: str) -> list[list[float]]:
    return [one["joints"] for one in answer("simulate", *words)["branches"]]


def comma(values: Any) -> str:
    return ",".join(repr(float(value)) for value in values)


@pytest.mark.parametrize("words", [PLANAR_RUN, SPATIAL_RUN])
def test_joints_select_the_branch_they_lie_near(words: tuple[str, ...], folder: Path) -> None:
    whole = answer("simulate", *words)["branches"]
    for one in (whole[0], whole[-1]):
        signs = (-1.0) ** np.arange(len(one["joints"]))
        near = np.array(one["joints"]) + 0.049 * signs
        document = answer("simulate", *words, "--joints", comma(near))
        assert document["branch"] == one["branch"]
        assert document["initial"]["joints"] == one["joints"], "the branch itself is followed"


def test_whole_turns_of_joints_do_not_count(folder: Path) -> None:
    for number, joints in enumerate(joints_of(*PLANAR_RUN)):
        turned = np.array(joints) + 2 * np.pi * np.array([1, -2, 3]) + 0.03
        document = answer("simulate", *PLANAR_RUN, "--joints", comma(turned))
        assert document["branch"] == number


def test_joints_a_little_too_far_from_a_branch_are_refused_with_the_branches_listed(
    folder: Path,
) -> None:
    found = joints_of(*PLANAR_RUN)
    line = refusal("simulate", *PLANAR_RUN, "--joints", comma(np.add(found[0], [0, 0.051, 0])))
    assert "joints" in line
    assert "0.05 rad" in line
    for number, joints in enumerate(found):
        assert f"{number} {np.round(joints, 4).tolist()}" in line


def test_joints_near_no_branch_are_refused_with_all_eight_listed(folder: Path) -> None:
    line = refusal("simulate", *SPATIAL_RUN, "--joints", "0,0,0,0,0,0")
    for joints in joints_of(*SPATIAL_RUN):
        assert str(np.round(joints, 4).tolist()) in line


def test_joints_and_a_branch_together_are_refused(folder: Path) -> None:
    joints = comma(joints_of(*PLANAR_RUN)[0])
    line = refusal("simulate", *PLANAR_RUN, "--joints", joints, "--branch", "1")
    assert "branch" in line
    assert "joints" in line


# --- simulate: from which attitude --------------------------------------------------------------


@pytest.mark.parametrize("heading", [0.0, 40.0, -160.0, 560.0])
def test_a_heading_is_an_attitude_about_z_in_degrees(heading: float, folder: Path) -> None:
    half = math.radians(heading) / 2
    attitude = ("0", "0", repr(math.sin(half)), repr(math.cos(half)))
    by_heading = answer("simulate", "planar_3dof/parabola", "--heading", repr(heading))
    by_attitude = answer("simulate", "planar_3dof/parabola", "--attitude", *attitude)
    assert np.allclose(by_heading["initial"]["attitude"], [float(word) for word in attitude])
    for one, other in zip(by_heading["branches"], by_attitude["branches"], strict=True):
        assert one["completed"] == other["completed"]
        assert np.allclose(one["joints"], other["joints"], atol=1e-9)


def test_an_attitude_is_taken_as_given_but_normalized(folder: Path) -> None:
    initial = answer("simulate", *SPATIAL_RUN)["initial"]["attitude"]
    given = np.array([float(word) for word in GOOD[1:]])
    assert np.allclose(initial, given / np.linalg.norm(given), atol=1e-15)


def test_planar_tasks_without_an_attitude_are_told_of_heading(folder: Path) -> None:
    assert "accepted: --heading DEG" in refusal("simulate", "planar_3dof/parabola")


def test_spatial_tasks_without_an_attitude_are_told_of_attitude(folder: Path) -> None:
    assert "accepted: --attitude X Y Z W" in refusal("simulate", "spatial_6dof/line")


def test_heading_and_attitude_together_are_refused(folder: Path) -> None:
    line = refusal("simulate", *PLANAR_RUN, "--attitude", "0", "0", "0", "1")
    assert "--attitude and --heading" in line


def test_a_heading_for_a_spatial_task_is_refused(folder: Path) -> None:
    line = refusal("simulate", "spatial_6dof/line", "--heading", "10")
    assert "heading: task pose is not planar" in line
    assert "accepted: --attitude X Y Z W" in line


def test_an_attitude_that_leaves_the_plane_is_refused(folder: Path) -> None:
    line = refusal("simulate", "planar_3dof/parabola", "--attitude", "0.6", "0", "0", "0.8")
    assert "leaves the plane" in line
    assert "[0, 0, z, w]" in line


# --- simulate: stopping at the margin -----------------------------------------------------------


LIMITS = "limits: {joint_rate: 0.5, joint_torque: 5, base_rate: 0.02, clearance: 0.01}\n"


def test_limits_of_the_followed_motion_are_told(folder: Path) -> None:
    """All that the scenario asks for, worst value and verdict; the exit code is the path's."""
    (folder / "limited.yaml").write_text(PLANAR + LIMITS)
    found = answer("simulate", "limited.yaml", "--heading", "200", code=0)["limits"]
    told = {one["limit"]: one for one in found}
    assert told.keys() == {"joint_rate", "joint_torque", "base_rate", "clearance"}
    for one in found:
        assert one.keys() >= {"limit", "worst", "allowed", "time", "where", "kept"}
        assert 0.0 <= one["time"] <= 100.0
    assert (told["base_rate"]["allowed"], told["base_rate"]["kept"]) == (0.02, False)
    assert told["base_rate"]["where"] == "spacecraft"
    assert told["joint_rate"]["where"] in ("q1", "q2", "q3")
    assert told["joint_rate"]["kept"] is True
    assert told["joint_torque"]["base_wrench"] < 1e-6
    assert " - " in told["clearance"]["where"]
    text = run("simulate", "limited.yaml", "--heading", "200").stdout
    assert "base rate" in text
    assert text.count("broken") == sum(not one["kept"] for one in found)


def test_joint_ranges_are_told_without_being_asked_for(folder: Path) -> None:
    none = answer("simulate", *PLANAR_RUN, code=0)["limits"]
    assert none == []
    assert "allowed" not in run("simulate", *PLANAR_RUN).stdout
    text = yaml.safe_load((models_folder() / "ur5_servicer/arc.yaml").read_text())
    del text["limits"]
    (folder / "arc.yaml").write_text(yaml.safe_dump(text))
    (found,) = answer("simulate", "arc.yaml", "--attitude", "0", "0", "0", "1")["limits"]
    assert found["limit"] == "joint_range"


def test_rates_without_bound_are_null(folder: Path) -> None:
    """Of a motion that is singular where it ends, in JSON that every reader takes."""
    (folder / "limited.yaml").write_text(PLANAR + LIMITS)
    found = answer("simulate", "limited.yaml", *PLANAR_FAILS[1:], code=1)["limits"]
    rate = next(one for one in found if one["limit"] == "joint_rate")
    assert rate["kept"] is False
    assert rate["worst"] is None or abs(rate["worst"]) > 10.0


def test_limits_are_refused_before_anything_is_followed(folder: Path) -> None:
    (folder / "limited.yaml").write_text(PLANAR + "limits: {joint_torque: urdf}\n")
    told = refusal("simulate", "limited.yaml", "--heading", "200")
    assert "limited.yaml: limits.joint_torque" in told


@pytest.mark.parametrize("number", [0, 1])
def test_stop_at_margin_ends_where_the_margin_is_used_up(number: int, folder: Path) -> None:
    words = ("simulate", "planar_3dof/parabola", "--heading", "140", "--branch", str(number))
    stopped = answer(*words, "--stop-at-margin", code=1)
    further = answer(*words)
    assert stopped["completed"] is False
    assert stopped["singular"] is None
    assert stopped["final"]["time"] < further["final"]["time"]
    assert math.isclose(stopped["min_margin"]["value"], 5.0, rel_tol=1e-6)
    assert math.isclose(stopped["min_margin"]["time"], stopped["final"]["time"], abs_tol=1e-6)


def test_stop_at_margin_leaves_a_motion_that_keeps_it_alone(folder: Path) -> None:
    stopped = answer("simulate", *PLANAR_RUN, "--stop-at-margin")
    assert stopped == answer("simulate", *PLANAR_RUN)


@pytest.mark.parametrize("number", ["0", "1"])
def test_a_margin_that_was_used_up_is_not_told_as_kept(number: str, folder: Path) -> None:
    words = ("simulate", "planar_3dof/parabola", "--heading", "140", "--stop-at-margin")
    text = run(*words, "--branch", number).stdout
    assert "The margin to a dynamic singularity was used up." in text
    assert "kept the margin" not in text


# --- simulate: for people -----------------------------------------------------------------------


def rows(text: str) -> Iterator[list[str]]:
    """The rows of the table of branches, as words."""
    for line in text.splitlines():
        if re.match(r" *\d+\*? ", line):
            yield line.split()


@pytest.mark.parametrize(
    "words",
    [
        ("planar_3dof/parabola", "--heading", "140"),
        ("planar_3dof/parabola", "--heading", "200"),
        ("planar_3dof/parabola", "--heading", "0"),
        ("spatial_6dof/line", *GOOD),
        ("spatial_6dof/line", *BAD),
    ],
)
def test_people_are_told_for_every_branch_whether_it_completes_and_the_sign_of_s(
    words: tuple[str, ...], folder: Path
) -> None:
    document = answer("simulate", *words)
    result = run("simulate", *words)
    assert result.stderr == ""
    table = list(rows(result.stdout))
    assert len(table) == len(document["branches"])
    for row, one in zip(table, document["branches"], strict=True):
        assert row[0] == f"{one['branch']}{'*' if one['branch'] == document['branch'] else ''}"
        text, numbers = " ".join(row), [w for w in row[1:] if re.match(r"-?\d", w)]
        least = numbers[len(one["joints"])]
        assert least.startswith("-") is (one["min_margin"]["sign"] < 0)
        assert math.isclose(abs(float(least)), one["min_margin"]["value"], rel_tol=1e-3)
        if one["completed"]:
            assert "completes" in text
        else:
            assert f"singular at {one['singular']['time']:.4f} s" in text


def test_people_are_told_how_the_followed_branch_ends_and_that_it_is_right(folder: Path) -> None:
    text = run("simulate", *PLANAR_FAILS).stdout
    singular = answer("simulate", *PLANAR_FAILS)["singular"]
    assert "branch 0 (*)" in text
    assert "The arm became dynamically singular." in text
    assert f"singular at t = {singular['time']:.4f} s, s = {singular['s']:.4f}" in text
    x, y, z = singular["end_effector"]
    assert f"({x:.4f}, {y:.4f}, {z:.4f}) m" in text
    assert "proof: end-effector off by" in text


def test_people_are_told_of_a_completed_branch_that_falls_below_the_margin(folder: Path) -> None:
    text = run("simulate", "planar_3dof/parabola", "--heading", "140").stdout
    assert "completes, below 5" in text
    assert "below the margin 5" in text


def test_text_for_pipes_has_no_colours_and_no_wrapped_numbers(folder: Path) -> None:
    text = run("simulate", *SPATIAL_RUN).stdout
    assert "\x1b" not in text
    final = answer("simulate", *SPATIAL_RUN)["final"]
    assert " ".join(f"{value:.4f}" for value in final["joints"]) in text
    assert " ".join(f"{value:.5f}" for value in final["attitude"]) in text


# --- which URDF -----------------------------------------------------------------------------------

ROBOTS = [
    ("planar_example1.yaml", "planar_3dof", 471.0),
    ("spatial_example2.yaml", "spatial_6dof", 480.0),
]


@pytest.mark.parametrize(("file", "robot", "mass"), ROBOTS)
def test_a_urdf_that_is_not_beside_the_scenario_is_the_bundled_one(
    file: str, robot: str, mass: float, folder: Path
) -> None:
    document = answer("info", file, code=0)
    assert Path(document["urdf"]) == models_folder() / robot / f"{robot}.urdf"
    assert math.isclose(document["total_mass"], mass, abs_tol=1e-4)


@pytest.mark.parametrize(("file", "robot", "mass"), ROBOTS)
def test_a_urdf_beside_the_scenario_is_taken(
    file: str, robot: str, mass: float, folder: Path
) -> None:
    text = (models_folder() / robot / f"{robot}.urdf").read_text()
    heavy = text.replace('<mass value="400"/>', '<mass value="4000"/>')
    (folder / f"{robot}.urdf").write_text(heavy)
    document = answer("info", file, code=0)
    assert Path(document["urdf"]).resolve() == folder / f"{robot}.urdf"
    assert math.isclose(document["total_mass"], mass + 3600.0, abs_tol=1e-4)


def test_a_scenario_and_its_bundled_twin_answer_alike(folder: Path) -> None:
    mine = answer("simulate", "planar_example1.yaml", "--heading", "200")
    assert mine == answer("simulate", "planar_3dof/parabola", "--heading", "200")


def test_a_heavier_robot_beside_the_scenario_changes_the_motion(folder: Path) -> None:
    text = (models_folder() / "planar_3dof" / "planar_3dof.urdf").read_text()
    heavy = text.replace('<mass value="400"/>', '<mass value="4000"/>')
    (folder / "planar_3dof.urdf").write_text(heavy)
    mine = answer("simulate", "planar_example1.yaml", "--heading", "200")
    assert mine["final"] != answer("simulate", *PLANAR_RUN)["final"]


# --- info ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["planar_3dof", "planar_3dof/parabola", "arm.urdf"])
def test_info_tells_the_same_robot_by_any_name(name: str, folder: Path) -> None:
    shutil.copy(models_folder() / "planar_3dof" / "planar_3dof.urdf", folder / "arm.urdf")
    document = answer("info", name, code=0)
    assert document.keys() >= {"total_mass", "dof", "task", "joints", "warnings"}
    assert document["total_mass"] == 471.0
    assert document["dof"] == 3
    assert document["task"] == "planar-pose"
    assert [joint["name"] for joint in document["joints"]] == ["q1", "q2", "q3"]
    (warning,) = document["warnings"]
    assert "gyration radius is 1.22 m" in warning  # 1.5 kg m² of 1 kg: Table I
    assert [one["severity"] for one in document["findings"]] == ["warning"]
    printed = [0.424628, 1.783439, 0.966030, 0.399575]
    assert np.allclose(document["barycentric_lengths"], printed, atol=1e-6)


def test_info_of_a_scenario_tells_the_largest_value_of_its_measure(folder: Path) -> None:
    document = answer("info", "planar_3dof/parabola")
    assert document["measure"]["name"] == "system"
    assert math.isclose(document["s_max"], 148.6, abs_tol=0.05)
    assert math.isclose(document["s_min"], -148.6, abs_tol=0.05)


def test_info_prints_warnings_with_their_corrections() -> None:
    (warning,) = answer("info", "spatial_6dof", code=0)["warnings"]
    (finding,) = answer("info", "spatial_6dof", code=0)["findings"]
    assert finding["line"] == 60
    assert warning == (
        f"{finding['file']}:60: link link_3: {finding['problem']}; {finding['remedy']}"
    )
    text = remembered("info", "spatial_6dof").stdout
    assert finding["problem"] in text
    assert finding["remedy"] in text


@pytest.mark.parametrize("name", ["planar_3dof/parabola", "spatial_6dof"])
def test_info_tells_people_the_numbers_it_tells_machines(name: str, folder: Path) -> None:
    document, text = answer("info", name), remembered("info", name).stdout
    assert f"{document['total_mass']:.6g} kg" in text
    assert f"{document['dof']} joints" in text
    assert f"task {document['task']}" in text
    assert f"reach {document['reach']:.4f} m" in text
    assert f"to {document['s_max']:.6g} {document['measure']['unit']}" in text
    for joint in document["joints"]:
        assert joint["name"] in text


def test_info_tells_all_that_is_wrong_in_a_urdf_that_cannot_be_loaded(folder: Path) -> None:
    text = (models_folder() / "planar_3dof" / "planar_3dof.urdf").read_text()
    text = text.replace('value="40"', 'value="80/2"').replace('type="fixed"', 'type="welded"')
    (folder / "arm.urdf").write_text(text)
    result = run("info", "arm.urdf")
    assert (result.exit_code, result.stdout) == (2, "")
    result = run("info", "arm.urdf", "--json")
    assert result.exit_code == 2
    document = json.loads(result.stdout)
    found = [(one["severity"], one["line"], one["element"]) for one in document["findings"]]
    assert found == [
        ("error", 32, "link link_1"), ("error", 70, "joint tool"), ("warning", 63, "link link_3"),
    ]  # fmt: skip
    assert document["error"]["line"] == 32


def test_info_takes_another_end_effector_for_a_urdf(folder: Path) -> None:
    document = answer("info", "spatial_6dof", "--end-effector", "link_3", code=0)
    assert (document["end_effector"], document["dof"]) == ("link_3", 3)


def test_info_tells_of_a_stock_arm(folder: Path) -> None:
    document = answer("info", "example-robot-data:panda", "--end-effector", "panda_link8", code=0)
    assert (document["end_effector"], document["dof"]) == ("panda_link8", 7)
    assert math.isclose(document["total_mass"], 17.451901, abs_tol=1e-9)
    assert len(document["warnings"]) == 1
    line = refusal("info", "example-robot-data:pand")
    assert "did you mean example-robot-data:panda?" in line


def test_info_does_not_ignore_an_end_effector_given_for_a_scenario(folder: Path) -> None:
    result = run("info", "spatial_6dof/line", "--end-effector", "link_3", "--json")
    if result.exit_code == 0:
        assert json.loads(result.stdout)["end_effector"] == "link_3"
    else:
        assert result.exit_code == 2


def test_info_of_nothing_known_lists_what_is(folder: Path) -> None:
    line = refusal("info", "spatial_5dof")
    assert "did you mean spatial_6dof?" in line
    assert "planar_3dof/parabola" in line


# --- schema -------------------------------------------------------------------------------------


def objections(value: Any, schema: dict[str, Any], find: Call, at: str = "") -> Iterator[str]:
    """What a JSON schema, of the words that ours uses, has against a value."""
    known = {"$ref", "$defs", "title", "description", "default", "type", "properties", "required"}
    known |= {"additionalProperties", "anyOf", "enum", "const", "items", "prefixItems", "minItems"}
    known |= {"maxItems", "minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum", "oneOf"}
    known |= {"$schema", "$id", "minProperties", "maxProperties", "allOf", "examples"}
    known |= {"minLength", "propertyNames"}
    assert set(schema) <= known, f"{at}: this test does not know {set(schema) - known}"
    if "$ref" in schema:
        yield from objections(value, find(schema["$ref"]), find, at)
    for part in schema.get("allOf", []):
        yield from objections(value, part, find, at)
    choices = schema.get("anyOf", schema.get("oneOf"))
    if choices and all(any(objections(value, one, find, at)) for one in choices):
        yield f"{at}: none of the choices"
    if "enum" in schema and value not in schema["enum"]:
        yield f"{at}: not one of {schema['enum']}"
    if "type" in schema and not _is(value, schema["type"]):
        yield f"{at}: not of type {schema['type']}"
    elif isinstance(value, dict):
        yield from _objections_to_mapping(value, schema, find, at)
    elif isinstance(value, list):
        lengths = schema.get("minItems", 0), schema.get("maxItems", math.inf)
        if not lengths[0] <= len(value) <= lengths[1]:
            yield f"{at}: {len(value)} items"
        kinds = schema.get("prefixItems", [schema.get("items", {})] * len(value))
        for k, (item, kind) in enumerate(zip(value, kinds, strict=False)):
            yield from objections(item, kind, find, f"{at}.{k}")
    elif isinstance(value, str):
        if len(value) < schema.get("minLength", 0):
            yield f"{at}: too short"
    elif isinstance(value, int | float):
        if not schema.get("minimum", -math.inf) <= value <= schema.get("maximum", math.inf):
            yield f"{at}: out of range"
        low, high = schema.get("exclusiveMinimum", -math.inf), schema.get("exclusiveMaximum")
        if not low < value < (math.inf if high is None else high):
            yield f"{at}: out of range"


def _objections_to_mapping(
    value: dict[str, Any], schema: dict[str, Any], find: Call, at: str
) -> Iterator[str]:
    if not schema.get("minProperties", 0) <= len(value) <= schema.get("maxProperties", math.inf):
        yield f"{at}: {len(value)} keys"
    for key in value if "propertyNames" in schema else ():
        yield from objections(key, schema["propertyNames"], find, f"{at}.{key}")
    properties, others = schema.get("properties", {}), schema.get("additionalProperties", {})
    for key in schema.get("required", []):
        if key not in value:
            yield f"{at}.{key}: missing"
    for key, item in value.items():
        if key in properties:
            yield from objections(item, properties[key], find, f"{at}.{key}")
        elif others is False:
            yield f"{at}.{key}: unknown"
        elif isinstance(others, dict):
            yield from objections(item, others, find, f"{at}.{key}")


def _is(value: Any, kind: str) -> bool:
    kinds = {"object": dict, "array": list, "string": str, "boolean": bool, "null": type(None)}
    if kind in kinds:
        return isinstance(value, kinds[kind])
    numbers = {"number": int | float, "integer": int}
    return isinstance(value, numbers[kind]) and not isinstance(value, bool)


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    """The schema of scenario files."""
    result = CliRunner().invoke(app, ["schema"])
    assert result.exit_code == 0
    assert result.stderr == ""
    return dict(json.loads(result.stdout)["scenario"])


def found_by(schema: dict[str, Any], text: str) -> list[str]:
    """What the schema has against a scenario."""

    def find(reference: str) -> dict[str, Any]:
        return dict(schema["$defs"][reference.rsplit("/", 1)[1]])

    return list(objections(yaml.safe_load(text), schema, find))


@pytest.mark.parametrize("name", bundled_scenarios())
def test_the_schema_accepts_every_bundled_scenario_as_written(
    name: str, schema: dict[str, Any]
) -> None:
    assert found_by(schema, (models_folder() / f"{name}.yaml").read_text()) == []


@pytest.mark.parametrize("text", [PLANAR, SPATIAL])
def test_the_schema_accepts_the_papers_examples(text: str, schema: dict[str, Any]) -> None:
    assert found_by(schema, text) == []


CRAFT = "{mass: 9, inertia: [1, 1, 1]}"
MATRIX = "{mass: 9, inertia: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], com: [0, 0, 1]}"
FIXED = "fixed: {axes: {x: [0.4683, 1.1683, -0.7], z: [1.5, -0.8, -0.33]}}"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("momentum: [0.5, 0.3, 0.1]\n", ""),
        (FIXED, "fixed: {quaternion: [0, 0, 0, 1]}"),
        (FIXED, "fixed: [0, 0, 0, 1]"),
        (FIXED, "fixed: {rpy: [0, 0, 0]}"),
        (FIXED, "slerp: {from: [0, 0, 0, 1], to: [0, 0, 1, 0]}"),
        (FIXED, "slerp: {from: {rpy: [0, 0, 0]}, to: {quaternion: [0, 0, 1, 0]}}"),
        (FIXED, "point_at: {target: [1, 2, 3], axis: -z}"),
        ("line: {from: [1, 0, 0], to: [-0.5, 0.8, 0.33]}", "waypoints: [[1, 0, 0], [0, 1, 0]]"),
        (
            "line: {from: [1, 0, 0], to: [-0.5, 0.8, 0.33]}",
            "arc: {center: [0, 0, 0], normal: [0, 0, 1], from: [1, 0, 0], angle_deg: 90}",
        ),
        ("end_effector}", "end_effector, scale_mass: 1.1}"),
        ("end_effector}", "end_effector, scale_mass: {link_1: 2}}"),
        ("end_effector}", f"end_effector, spacecraft: {CRAFT}}}"),
        ("end_effector}", f"end_effector, payload: {CRAFT}}}"),
        ("end_effector}", f"end_effector, payload: {MATRIX}}}"),
        (
            "end_effector}",
            "end_effector, spacecraft: {mass: 9, inertia: [1, 1, 1], size: [1, 1, 1], "
            "mount: {xyz: [0, 0, 1], rpy: [0, 0, 1]}}}",
        ),
        ("margin: {measure: arm, value: 5}", "margin: {fraction: 0.2}"),
        ("margin: {measure: arm, value: 5}\n", ""),
        ("duration: 100", "duration: 100, stops: [{s: 0.5, t: 20}]"),
        ("task: pose\n", "task: pose\nsearch: {samples: null, seed: 4}\n"),
        ("task: pose\n", "task: pose\nsearch: {samples: 8}\n"),
    ],
)
def test_the_schema_accepts_what_a_scenario_may_say(
    old: str, new: str, schema: dict[str, Any], folder: Path
) -> None:
    assert old in SPATIAL
    text = SPATIAL.replace(old, new)
    (folder / "wish.yaml").write_text(text)
    assert load_scenario("wish.yaml").problem().task is Task.POSE
    assert found_by(schema, text) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("task: pose", "task: dance"),
        ("momentum:", "momentm:"),
        ("duration: 100", "duraton: 100"),
        ("[0.5, 0.3, 0.1]", "[0.5, 0.3]"),
        ("[0.5, 0.3, 0.1]", "[0.5, 0.3, 0.1, 0]"),
        ("[0.5, 0.3, 0.1]", "[0.5, 0.3, 'x']"),
        ("duration: 100", "duration: '100'"),
        ("measure: arm", "measure: leg"),
        ("value: 5", "value: -5"),
        ("value: 5", "fraction: 1"),
        ("end_effector}", "end_effector, scale_mass: 0}"),
        ("end_effector}", f"end_effector, payload: {CRAFT.replace('9', '0')}}}"),
        ("end_effector}", f"end_effector, spacecraft: {CRAFT.replace('mass', 'weight')}}}"),
        ("end_effector}", f"end_effector, payload: {MATRIX.replace('[0, 0, 1]', '[0, 0]')}}}"),
        ("end_effector}", "end_effector, spacecraft: {mass: 9}}"),
        ("task: pose\n", ""),
        ("task: pose\n", "task: pose\nsearch: {samples: 7}\n"),
    ],
)
def test_the_schema_refuses_what_simulate_refuses(
    old: str, new: str, schema: dict[str, Any], folder: Path
) -> None:
    assert old in SPATIAL
    text = SPATIAL.replace(old, new, 1)
    (folder / "wish.yaml").write_text(text)
    refusal("info", "wish.yaml")
    assert found_by(schema, text) != []


def test_every_reference_of_the_printed_schema_can_be_followed() -> None:
    document = json.loads(run("schema").stdout)

    def follow(part: Any, root: Any) -> Iterator[str]:
        if isinstance(part, dict):
            root = part if "$id" in part else root
            if "$ref" in part:
                target = root
                for step in part["$ref"].removeprefix("#/").split("/"):
                    target = target.get(step, {})
                if not target:
                    yield part["$ref"]
            for child in part.values():
                yield from follow(child, root)
        elif isinstance(part, list):
            for child in part:
                yield from follow(child, root)

    assert sorted(set(follow(document, document))) == []


def test_every_section_of_the_schema_refuses_unknown_keys(schema: dict[str, Any]) -> None:
    sections = [schema, *schema["$defs"].values()]
    for section in sections:
        if section.get("type") == "object":
            assert section["additionalProperties"] is False, section["title"]


def test_schema_prints_the_same_with_and_without_json(folder: Path) -> None:
    assert run("schema").stdout == run("schema", "--json").stdout


# --- the command itself -------------------------------------------------------------------------


def test_help_names_every_command_and_every_option() -> None:
    text = run("--help").stdout
    for name in ("info", "simulate", "workspace", "plan", "map", "schema"):
        assert name in text
    text = run("simulate", "-h").stdout
    for option in ("--attitude", "--heading", "--joints", "--branch", "--stop-at-margin", "--json"):
        assert option in text
    text = run("map", "-h").stdout
    for option in ("--samples", "--seed", "--threads", "--nearest", "--boundary", "--output"):
        assert option in text
    assert "--threads" in run("plan", "-h").stdout


def test_the_command_answers_from_another_folder(tmp_path: Path) -> None:
    done = command(tmp_path, "simulate", "planar_3dof/parabola", "--heading", "200", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["completed"] is True
    assert list(tmp_path.iterdir()) == []


def test_the_command_finds_what_stands_beside_a_scenario_from_another_folder(
    tmp_path: Path,
) -> None:
    (tmp_path / "wishes").mkdir()
    (tmp_path / "work").mkdir()
    text = PLANAR.replace("planar_3dof.urdf", "../robots/mine.urdf")
    (tmp_path / "wishes" / "wish.yaml").write_text(text)
    (tmp_path / "robots").mkdir()
    shutil.copy(
        models_folder() / "planar_3dof" / "planar_3dof.urdf", tmp_path / "robots" / "mine.urdf"
    )
    words = ("simulate", "../wishes/wish.yaml", "--heading", "140", "--branch", "0")
    done = command(tmp_path / "work", *words)
    assert (done.returncode, done.stderr) == (1, "")
    assert "The arm became dynamically singular." in done.stdout
    assert "\x1b" not in done.stdout


def test_the_command_refuses_bad_input_with_one_line(tmp_path: Path) -> None:
    done = command(tmp_path, "simulate", "nothing.yaml", "--heading", "0")
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert "nothing.yaml" in done.stderr
    done = command(tmp_path, "simulate", "nothing.yaml", "--heading", "0", "--json")
    assert done.returncode == 2
    assert "nothing.yaml" in json.loads(done.stdout)["error"]["message"]
