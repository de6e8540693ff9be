"""``freefloat simulate``: documents, exit codes, arm branches, limits and files."""

import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import freefloat as ff
from tests.commands import document, error, run
from tests.scenarios import PARABOLA

PLANAR = ("planar_3dof/parabola", "--heading", "200")
SINGULAR = ("planar_3dof/parabola", "--heading", "140", "--branch", "0")
LIMITS = "limits: {joint_rate: 0.5, joint_torque: 5, base_rate: 0.02, clearance: 0.01}\n"


@cache
def simulated(*words: object, code: int = 0) -> dict[str, Any]:
    """The document of a bundled scenario's simulation."""
    return document("simulate", *words, code=code)


@pytest.fixture(autouse=True)
def folder(folder: Path) -> Path:
    """A working folder with a scenario, no URDF beside it."""
    (folder / "mine.yaml").write_text(PARABOLA)
    (folder / "limited.yaml").write_text(PARABOLA + LIMITS)
    return folder


def test_a_singular_motion_has_place_and_time() -> None:
    motion = simulated(*SINGULAR, code=1)
    singular = motion["singular"]
    assert singular["time"] == motion["final"]["time"] < 100.0
    assert singular["joints"] == motion["final"]["joints"]
    x, y, z = singular["end_effector"]
    assert math.isclose(x, 2 - 3 * singular["s"], abs_tol=1e-6)
    assert math.isclose(y, x**2 / 6 - 5 * x / 6 + 1, abs_tol=1e-6)
    assert math.isclose(z, 0.0, abs_tol=1e-9)
    assert motion["min_margin"]["value"] < 1e-6
    text = run("simulate", *SINGULAR).stdout
    assert f"singular at t = {singular['time']:.4f} s, s = {singular['s']:.4f}" in text


def test_joint_rates_next_to_a_singularity_that_the_measure_does_not_see_are_printed() -> None:
    attitude = (0.480125681, -0.688301930, -0.523773470, 0.146222898)
    line = "next to a singularity: joint rates of up to"
    assert (
        line in run("simulate", "spatial_6dof/line", "--attitude", *attitude, "--branch", 0).stdout
    )
    assert line not in run("simulate", *PLANAR).stdout


def test_an_attitude_that_a_position_task_does_not_use_is_named(folder: Path) -> None:
    position = PARABOLA.replace("task: planar-pose", "task: planar-position")
    assert position != PARABOLA
    (folder / "position.yaml").write_text(position)
    for name, said in (("position.yaml", True), ("mine.yaml", False)):
        assert ("path.attitude" in run("simulate", name, "--heading", "200").stdout) is said


def test_the_distance_of_the_path_from_the_present_pose_is_printed() -> None:
    """Nothing is said where the path begins there."""
    problem = ff.load_scenario("planar_2dof/line").problem()
    joints, attitude = [0.3, 1.4], [0.0, 0.0, 0.0, 1.0]
    place = problem.model.end_effector_pose(attitude, joints).position
    apart = np.linalg.norm(place - problem.path.pose(0.0).position)
    words = ("simulate", "planar_2dof.yaml", "--attitude", *attitude, "--branch", "0")
    text = ff.load_scenario("planar_2dof/line").text.replace("planar_2dof.urdf", "planar_2dof")
    Path("planar_2dof.yaml").write_text(f"{text}search: {{joints: {joints}}}\n")
    assert f"begins {apart:.4g} m from" in run(*words).stdout
    there = problem.branches(attitude)[0].joints.tolist()
    Path("planar_2dof.yaml").write_text(f"{text}search: {{joints: {there}}}\n")
    assert "The path begins" not in run(*words).stdout
    present = f"{{joints: {joints}, from_attitude: {attitude}}}"
    Path("planar_2dof.yaml").write_text(f"{text}search: {present}\n")
    assert f"begins {apart:.4g} m from" in run("plan", "planar_2dof.yaml").stdout


def comma(values: Any) -> str:
    return ",".join(repr(float(value)) for value in values)


def test_a_branch_is_chosen_by_number_or_joints() -> None:
    branch = simulated(*PLANAR)["branches"][-1]
    signs = (-1.0) ** np.arange(len(branch["joints"]))
    near = np.array(branch["joints"]) + 0.049 * signs + 2 * np.pi * signs
    for option in (("--branch", branch["branch"]), ("--joints", comma(near))):
        motion = document("simulate", *PLANAR, *option)
        assert motion["branch"] == branch["branch"]
        assert motion["initial"]["joints"] == branch["joints"]


@pytest.mark.slow
def test_joints_of_the_search_choose_unless_others_are_given() -> None:
    best, other = (simulated("mine.yaml", *PLANAR[1:], "--branch", k) for k in (0, 1))
    if best["min_margin"]["value"] < other["min_margin"]["value"]:
        best, other = other, best
    joints = np.add(other["initial"]["joints"], 0.2).tolist()
    Path("present.yaml").write_text(f"{PARABOLA}search: {{joints: {joints}}}\n")
    assert document("simulate", "present.yaml", *PLANAR[1:])["branch"] == other["branch"]
    motion = document("simulate", "present.yaml", *PLANAR[1:], "--branch", best["branch"])
    assert motion["branch"] == best["branch"]


def test_joints_of_no_branch_are_refused_with_the_branches_listed() -> None:
    branches = simulated(*PLANAR)["branches"]
    far = np.add(branches[0]["joints"], [0, 0.051, 0])
    refusal = error("simulate", *PLANAR, "--joints", comma(far))
    assert refusal["key"] == "joints"
    for branch in branches:
        assert str(np.round(branch["joints"], 4).tolist()) in refusal["accepted"]


@pytest.mark.slow
def test_limits_are_checked_along_the_chosen_motion() -> None:
    """Both branches exceed the limit of the spacecraft's rate: exit code 1."""
    limits = document("simulate", "limited.yaml", "--heading", "200", code=1)["limits"]
    results = {entry["limit"]: entry for entry in limits}
    assert results.keys() == {"joint_rate", "joint_torque", "base_rate", "clearance"}
    for entry in limits:
        assert 0.0 <= entry["time"] <= 100.0
    assert (results["base_rate"]["allowed"], results["base_rate"]["kept"]) == (0.02, False)
    assert (results["joint_rate"]["kept"], results["base_rate"]["where"]) == (True, "spacecraft")
    assert results["joint_torque"]["base_wrench"] < 1e-6
    text = run("simulate", "limited.yaml", "--heading", "200").stdout
    assert text.count("violated") == sum(not entry["kept"] for entry in limits)
