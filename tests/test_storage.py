"""Plan and map files: whole or not at all, and readable by others."""

import json
import os
import subprocess
import sys

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

import freefloat as ff
from freefloat.cli import app
from freefloat.errors import InputError
from freefloat.report import plan_document
from freefloat.storage import load_plan, save_plan, written_beside

pytestmark = pytest.mark.usefixtures("kernels")


@pytest.fixture(scope="module")
def made():
    scenario = ff.load_scenario("planar_3dof/parabola_nonstop")
    plan = ff.plan(scenario.problem(), ff.Search(ff.Objective.ROBUST))
    return scenario, plan, plan_document(plan)


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
    assert stored.scenario == scenario.text
    assert ff.FreeFloatingModel.from_urdf(stored.robot, "end_effector").total_mass == 471.0
    assert stored.software["freefloat"] == "0.1.0"
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


def test_an_interrupted_writer_leaves_the_old_file_alone(tmp_path):
    """Written beside and renamed: an error on the way changes nothing."""
    target = tmp_path / "plan.h5"
    target.write_text("old")

    def broken():
        with written_beside(target) as temporary:
            temporary.write_text("half")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        broken()
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["plan.h5"]


def test_files_that_are_no_plans_are_refused(tmp_path):
    """Missing, other text, other HDF5, another version: one message with the file."""
    (tmp_path / "text.h5").write_text("hello")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    with h5py.File(tmp_path / "future.h5", "w") as file:
        file.attrs["format"], file.attrs["version"] = "freefloat plan", 99
    for name in ("missing.h5", "text.h5", "other.h5", "future.h5"):
        with pytest.raises(InputError, match=name):
            load_plan(tmp_path / name)


def test_an_unwritable_folder_is_one_clear_error(tmp_path):
    """Exit code 2, one line, nothing left behind."""
    arguments = ["plan", "planar_3dof/parabola_nonstop", "-o", str(tmp_path / "no" / "plan.h5")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert "No such file or directory" in result.stderr
    assert result.stderr.count("\n") == 1
    assert os.listdir(tmp_path) == []


def test_the_map_command_writes_arrays(tmp_path):
    """S_min over heading per branch, as numbers."""
    arguments = [
        "map",
        "planar_3dof/parabola",
        "--samples",
        "12",
        "-o",
        str(tmp_path / "m.h5"),
        "--json",
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.stderr
    document = json.loads(result.stdout)
    keys = {
        "samples",
        "motions",
        "feasible_fraction",
        "motion_fraction",
        "best",
        "robust",
        "regions",
        "seconds",
    }
    assert keys <= set(document)
    assert document["samples"] == 12
    with h5py.File(tmp_path / "m.h5") as file:
        assert file["least"].shape == (2, 12)
        assert np.degrees(file["heading"][()]) == pytest.approx(document["headings_deg"])


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


def test_the_workspace_command_tells_reach_and_areas():
    """Keys of the contract, and the spatial scenario refused with what is accepted."""
    result = CliRunner().invoke(app, ["workspace", "planar_3dof/parabola", "--json"])
    document = json.loads(result.stdout)
    assert result.exit_code == 0
    assert document["reach"] == pytest.approx([0.39278, 3.17410], abs=1e-5)
    assert len(document["pdw"]) == 2
    assert len(document["piw"]) == 1
    refused = CliRunner().invoke(app, ["workspace", "spatial_6dof/line"])
    assert refused.exit_code == 2
    assert "planar-pose with three" in refused.stderr


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
