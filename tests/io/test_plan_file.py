"""Plan and motion files: readable by others, and enough to rebuild what was planned."""

import json
import os
import shutil
import subprocess
import sys

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import freefloat as ff
from freefloat.cli.app import app
from freefloat.errors import InputError
from freefloat.io.plan_file import load_plan, save_motion, save_plan
from freefloat.io.result_file import kind_of
from freefloat.planning.documents import simulation_document
from freefloat.planning.plan import Plan
from freefloat.robot.names import find_robot

pytestmark = pytest.mark.usefixtures("kernels")


@pytest.fixture(scope="module")
def made():
    scenario = ff.load_scenario("planar_3dof/parabola_nonstop")
    plan = ff.plan(scenario.problem(), ff.Search(ff.Objective.ROBUST))
    return scenario, plan, plan.to_dict()


def test_a_plan_comes_back_as_it_was(made, tmp_path):
    """Motion, ranges, scenario text, robot and what was told are all in the file."""
    scenario, plan, document = made
    save_plan(tmp_path / "plan.h5", plan, scenario, document)
    stored = load_plan(tmp_path / "plan.h5")
    motion = plan.chosen.motion
    assert np.array_equal(stored.times, motion.times)
    assert np.array_equal(stored.attitudes, motion.attitudes)
    assert np.array_equal(stored.joints, motion.joints)
    assert stored.document == json.loads(json.dumps(document))
    assert stored.origin.scenario == scenario.text
    assert ff.FreeFloatingModel.from_urdf(stored.origin.robot, "end_effector").total_mass == 471.0
    assert stored.origin.software["freefloat"] == "0.1.0"
    first = plan.ranges[0].ranges[0]
    assert stored.ranges[0][0] == pytest.approx([first.low, first.high])
    assert os.listdir(tmp_path) == ["plan.h5"]


def test_plain_hdf5_tools_can_read_it(made, tmp_path):
    """Only arrays of numbers, text and attributes with units: what MATLAB's h5read takes."""
    scenario, plan, document = made
    save_plan(tmp_path / "plan.h5", plan, scenario, document)
    with h5py.File(tmp_path / "plan.h5") as file:
        kinds = []
        file.visititems(lambda _, item: kinds.append(getattr(item, "dtype", None)))
        assert {str(kind) for kind in kinds if kind is not None} <= {"float64", "int64", "object"}
        assert file["motion/time"].attrs["unit"] == "s"
        assert file["motion"].attrs["joint_names"].tolist() == ["q1", "q2", "q3"]


def rebuilt(stored, motion):
    """Check that the motion of a stored plan is the one written, and proves itself as it did."""
    again = stored.motion()
    assert again is not None
    assert again.ending is motion.ending
    for name in ("times", "attitudes", "joints", "base_positions"):
        assert np.array_equal(getattr(again, name), getattr(motion, name)), name
    assert again.residuals() == motion.residuals()
    margin, wanted = again.problem.margin, motion.problem.margin
    assert margin.threshold == wanted.threshold
    assert ff.closest_approach(again, margin.measure) == ff.closest_approach(motion, wanted.measure)
    assert np.array_equal(again.problem.momentum, motion.problem.momentum)
    return again


def test_a_plan_is_rebuilt_bit_by_bit(made, tmp_path, monkeypatch):
    """From another folder, from the file alone."""
    scenario, plan, document = made
    save_plan(tmp_path / "plan.h5", plan, scenario, document)
    monkeypatch.chdir(tmp_path)
    again = rebuilt(load_plan("plan.h5"), plan.chosen.motion)
    assert again.problem.model.description.source == plan.problem.model.description.source


CARRIED = """\
# A scaled arm on a spacecraft, with a payload, along samples, its margin a share of the largest.
robot:
  urdf: robots/arm.urdf
  end_effector: tool0
  scale_mass: {upper_arm_link: 1.1}
  spacecraft: {mass: 200, inertia: [35, 35, 35], size: [1, 1, 1], mount: {xyz: [0, 0, 0.5]}}
  payload: {mass: 5, inertia: [0.1, 0.1, 0.1], com: [0, 0, 0.2]}
task: pose
momentum: [0.05, 0, 0.02]
path: {samples: way.csv}
timing: {duration: 20}
margin: {measure: gjm, fraction: 0.01}
"""


@pytest.fixture
def carried(tmp_path, monkeypatch):
    """A folder with such a scenario and everything that it leads to."""
    folder = tmp_path / "there"
    (folder / "robots").mkdir(parents=True)
    shutil.copy(find_robot("example-robot-data:ur5", folder), folder / "robots" / "arm.urdf")
    start = ff.load_scenario("ur5_servicer/arc").problem().path.path
    rows = [[*start.pose(s).position, *Rotation.from_matrix(start.pose(s).rotation).as_quat()]
            for s in (0.0, 0.1, 0.2)]  # fmt: skip
    lines = ["x,y,z,qx,qy,qz,qw", *(",".join(map(repr, map(float, row))) for row in rows)]
    (folder / "way.csv").write_text("\r\n".join(lines))
    (folder / "carried.yaml").write_text(CARRIED)
    monkeypatch.chdir(tmp_path)
    return folder


def test_a_file_suffices_when_scenario_robot_and_samples_are_gone(carried):
    """Masses scaled and bodies mounted once, not twice; mesh paths lead where they led."""
    scenario = ff.load_scenario("there/carried.yaml")
    problem = scenario.problem()
    simulation = ff.simulate(problem, [0.0, 0.0, 0.0, 1.0])
    motion = simulation.chosen.motion
    save_motion("m.h5", motion, scenario, simulation_document(simulation))
    shutil.rmtree(carried)
    os.mkdir("elsewhere")
    os.chdir("elsewhere")
    stored = load_plan("../m.h5")
    assert stored.kind == "motion"
    again = rebuilt(stored, motion)
    assert again.problem.model.total_mass == problem.model.total_mass
    assert again.problem.model.description.source == str(carried / "robots" / "arm.urdf")


def test_simulate_writes_the_motion_it_followed_be_it_singular(tmp_path):
    """The singular branch of the paper's first example, with what was told of it."""
    file = tmp_path / "bad.h5"
    words = ["simulate", "planar_3dof/parabola", "--heading", "140", "--branch", "0"]
    result = CliRunner().invoke(app, [*words, "-o", str(file), "--json"])
    assert result.exit_code == 1, result.output
    stored, document = load_plan(file), json.loads(result.stdout)
    motion = stored.motion()
    assert (stored.kind, stored.feasible, stored.document) == ("motion", False, document)
    assert motion.ending is ff.Ending.SINGULAR
    assert motion.final.time == document["singular"]["time"]
    assert motion.final.joints.tolist() == document["final"]["joints"]


def test_an_infeasible_plan_has_no_motion(tmp_path):
    """But it has its problem, and the reason."""
    scenario = ff.load_scenario("planar_3dof/parabola")
    plan = Plan(scenario.problem(), ff.Search(), False, "nothing keeps it")
    save_plan(tmp_path / "plan.h5", plan, scenario, {"reason": plan.reason})
    stored = load_plan(tmp_path / "plan.h5")
    assert (stored.feasible, stored.ending, stored.motion()) == (False, None, None)
    assert stored.problem().margin.threshold == 5.0
    assert stored.document["reason"] == "nothing keeps it"


def _other_text(file, name, text):
    del file[name]
    file[name] = text


def _other_array(file, name, change):
    values = change(file[name][()])
    del file[name]
    file[name] = values


BROKEN = {
    "format": lambda file: file.attrs.update(format="freefloat map"),
    "future": lambda file: file.attrs.update(version=99),
    "past": lambda file: file.attrs.update(version=1),
    "ending": lambda file: file["motion"].attrs.update(ending="LOST"),
    "no_joints": lambda file: file.__delitem__("motion/joints"),
    "short": lambda file: _other_array(file, "motion/time", lambda t: t[:-1]),
    "nan": lambda file: _other_array(file, "motion/joints", lambda q: q * np.nan),
    "long": lambda file: _other_array(file, "motion/attitude", lambda a: 2 * a),
    "back": lambda file: _other_array(file, "motion/time", lambda t: t[np.argsort(np.sin(t))]),
    "document": lambda file: _other_text(file, "document", "[1, 2"),
    "list": lambda file: _other_text(file, "document", "[]"),
    "number": lambda file: _other_text(file, "scenario", 3.0),
    "group": lambda file: (file.__delitem__("robot"), file.create_group("robot")),
    "scenario": lambda file: _other_text(file, "scenario", "task: dance"),
    "robot": lambda file: _other_text(file, "robot", "<robot/>"),
    "arm": lambda file: _other_array(file, "motion/joints", lambda q: q[:, :2]),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_one_clear_error(made, tmp_path, name):
    """Tampered with in whatever way: an InputError that names the file."""
    scenario, plan, document = made
    path = tmp_path / f"{name}.h5"
    save_plan(path, plan, scenario, document)
    with h5py.File(path, "r+") as file:
        BROKEN[name](file)
    with pytest.raises(InputError) as caught:
        load_plan(path).motion()
    assert caught.value.source == str(path)
    assert "format 2" in caught.value.accepted
    assert len(str(caught.value)) < 600


def test_files_that_are_no_plans_are_refused(made, tmp_path):
    """Missing, a folder, other text, other HDF5, a truncated plan: one message with the file."""
    scenario, plan, document = made
    save_plan(tmp_path / "whole.h5", plan, scenario, document)
    (tmp_path / "cut.h5").write_bytes((tmp_path / "whole.h5").read_bytes()[:-4000])
    (tmp_path / "text.h5").write_text("hello")
    (tmp_path / "folder.h5").mkdir()
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    for name in ("missing.h5", "folder.h5", "text.h5", "other.h5", "cut.h5"):
        for read in (load_plan, kind_of):
            with pytest.raises(InputError, match=name):
                read(tmp_path / name)
    assert kind_of(tmp_path / "whole.h5") == "plan"


def test_an_unwritable_folder_is_one_clear_error(tmp_path):
    """Exit code 2, one line, nothing left behind."""
    arguments = ["plan", "planar_3dof/parabola_nonstop", "-o", str(tmp_path / "no" / "plan.h5")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert "No such file or directory" in result.stderr
    assert result.stderr.count("\n") == 1
    assert os.listdir(tmp_path) == []


def test_the_plan_command_answers_with_the_contract(tmp_path):
    """JSON keys, exit code, and the file, in a process of its own from another folder."""
    program = [
        sys.executable,
        "-m",
        "freefloat",
        "plan",
        "planar_3dof/parabola",
        "--json",
        "-o",
        "p.h5",
    ]
    run = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    document = json.loads(run.stdout)
    assert document["feasible"] is True
    assert document["completed"] is True
    entry = document["attitude_ranges_deg"][0]
    assert entry["branch"] == 0
    assert np.ravel(entry["ranges"]) == pytest.approx([0, 63, 161, 360], abs=0.5)
    assert [segment["to"] for segment in document["segments"]] == [69.73, 100.0]
    assert document["robust_radius_deg"] > 0
    assert document["min_margin"]["value"] >= 5.0
    assert load_plan(tmp_path / "p.h5").feasible


def test_infeasible_plans_exit_with_1(tmp_path):
    """The question was answered no: feasible false, the reason with the place, no traceback."""
    text = ff.load_scenario("planar_3dof/parabola_nonstop").text.replace("value: 5", "value: 149")
    (tmp_path / "hard.yaml").write_text(text)
    result = CliRunner().invoke(app, ["plan", str(tmp_path / "hard.yaml"), "--json"])
    assert result.exit_code == 1
    document = json.loads(result.stdout)
    assert document["feasible"] is False
    assert "s =" in document["reason"]
    assert document["initial"] is None


def test_only_plain_files_are_replaced(made, tmp_path):
    """A device or a folder stays what it is; a link keeps leading to its file."""
    scenario, plan, document = made
    for name in ("/dev/full", str(tmp_path), ""):
        with pytest.raises(InputError, match="output"):
            save_plan(name, plan, scenario, document)
    assert not os.path.isfile("/dev/full")
    (tmp_path / "real.h5").touch()
    (tmp_path / "link.h5").symlink_to(tmp_path / "real.h5")
    save_plan(tmp_path / "link.h5", plan, scenario, document)
    assert (tmp_path / "link.h5").is_symlink()
    assert load_plan(tmp_path / "real.h5").feasible
