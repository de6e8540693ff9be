"""Trajectories as CSV, JSON and MATLAB files; and the command that writes them."""

import csv
import io
import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

import freefloat as ff
from freefloat.io.export import Format
from freefloat.io.trajectory import Trajectory, even_times
from freefloat.io.trajectory_tables import csv_text, json_text, write_mat
from tests.commands import error, run
from tests.motions import heading, simulated
from tests.prismatic import prismatic_motion, prismatic_robot


@pytest.fixture(scope="module")
def motions(planar):
    """Example 1 from a feasible heading and from one that ends in a singularity."""
    return [simulated(planar, heading(degrees), 0) for degrees in (200.0, 140.0)]


@pytest.fixture(scope="module")
def trajectory(motions):
    return Trajectory.of(motions[0], even_times(motions[0], 51))


@pytest.fixture(scope="module")
def saved(tmp_path_factory, motions):
    """A folder with both as files."""
    folder = tmp_path_factory.mktemp("saved")
    for name, motion in zip(("good.h5", "bad.h5"), motions, strict=True):
        simulation = ff.simulate(motion.problem, motion.initial.attitude, branch=0)
        ff.save(simulation, folder / name)
    return folder


@pytest.fixture
def files(tmp_path, monkeypatch, saved):
    """A working folder with both files."""
    shutil.copytree(saved, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def arrays_of(trajectory):
    track = trajectory.end_effectors[0]
    return {
        "time": trajectory.times,
        "attitude": trajectory.attitudes,
        "base_position": trajectory.base_positions,
        "base_velocity": trajectory.base_velocities,
        "base_angular_velocity": trajectory.angular_velocities,
        "joints": trajectory.joints,
        "joint_rates": trajectory.joint_rates,
        "joint_accelerations": trajectory.joint_accelerations,
        "joint_torques": trajectory.joint_torques,
        "end_effector_position": track.positions,
        "end_effector_attitude": track.orientations,
        "measure": trajectory.measure,
    }


def test_csv_holds_every_number_under_a_name_with_its_unit(motions, trajectory):
    rows = list(csv.reader(io.StringIO(csv_text(trajectory))))
    assert {"time [s]", "attitude w [1]", "base velocity z [m/s]", "q1 position [rad]",
            "q3 acceleration [rad/s^2]", "end-effector position y [m]"} <= {*rows[0]}  # fmt: skip
    assert rows[0][-1] == f"system [{motions[0].problem.margin.measure.unit}]"
    numbers = np.array(rows[1:], dtype=float)
    wanted = [array.reshape(51, -1) for array in arrays_of(trajectory).values()]
    assert np.array_equal(numbers, np.hstack(wanted))


def test_prismatic_joints_have_other_units():
    motion = prismatic_motion(prismatic_robot())
    sampled = Trajectory.of(motion, [0.0, 1.0])
    header = csv_text(sampled).splitlines()[0].split(",")
    for name in ("x position [m]", "x velocity [m/s]", "x acceleration [m/s^2]", "x torque [N]"):
        assert name in header
    units = json.loads(json_text(sampled))["units"]
    assert units["joints"] == "m"


def test_json_holds_every_number_with_robot_and_problem(motions, trajectory):
    document = json.loads(json_text(trajectory))
    assert document["joint_names"] == ["q1", "q2", "q3"]
    assert document["completed"] is True
    assert document["momentum"] == [0.0, 0.0, 0.5]
    assert set(document["units"]) == set(document["trajectory"]) == set(arrays_of(trajectory))
    for key, array in arrays_of(trajectory).items():
        assert np.array_equal(document["trajectory"][key], array), key


def test_what_has_no_bound_is_null_in_json_and_nan_elsewhere(motions, tmp_path):
    bad = motions[1]
    sampled = Trajectory.of(bad, even_times(bad, 5))
    document = json.loads(json_text(sampled))
    assert document["trajectory"]["joint_rates"][-1] == [None, None, None]
    assert None not in document["trajectory"]["joint_rates"][-2]
    assert document["completed"] is False
    last = csv_text(sampled).splitlines()[-1].split(",")
    assert last.count("nan") == 3 + 3 + 3 * 3
    write_mat(tmp_path / "bad.mat", sampled)
    struct = loadmat(tmp_path / "bad.mat", simplify_cells=True)["trajectory"]
    assert np.isnan(struct["joint_torques"][-1]).all()


def test_matlab_reads_a_struct(motions, trajectory, tmp_path):
    write_mat(tmp_path / "plan.mat", trajectory)
    raw = loadmat(tmp_path / "plan.mat")["trajectory"]
    assert raw["time"][0, 0].shape == (51, 1)
    assert raw["joints"][0, 0].shape == (51, 3)
    assert max(map(len, raw.dtype.names)) < 32  # as long as names may be in older versions
    struct = loadmat(tmp_path / "plan.mat", simplify_cells=True)["trajectory"]
    for key, array in arrays_of(trajectory).items():
        assert np.array_equal(struct[key], array), key
    assert struct["joint_names"].tolist() == ["q1", "q2", "q3"]
    assert struct["units"]["joint_rates"] == "rad/s"
    assert struct["measure_name"] == "system"
    assert struct["momentum"].tolist() == [0.0, 0.0, 0.5]


def test_stdout_gets_the_text_alone(files):
    result = run("export", "good.h5", "-o", "-", "--rate", 0.1)
    assert (result.exit_code, result.stderr) == (0, "")
    rows = list(csv.reader(io.StringIO(result.stdout)))
    assert [float(row[0]) for row in rows[1:]] == [10.0 * k for k in range(11)]
    result = run("export", "good.h5", "-o", "-", "--format", "json", "--times", 2)
    assert json.loads(result.stdout)["trajectory"]["time"] == [0.0, 100.0]


@pytest.mark.parametrize(("words", "key"), [
    (("none.h5",), "file"),
    (("bad.h5", "--format", "ros2"), "format"),
    (("good.h5", "--format", "xml"), "format"),
    (("good.h5", "--times", 5, "--rate", 5), "rate"),
    (("good.h5", "--times", 5, "--format", "mjcf"), "times"),
    (("good.h5", "-o", "link.h5"), "output"),
    (("good.h5", "-o", "-", "--format", "mat"), "output"),
    (("good.h5", "-o", "bad.h5", "--format", "csv"), "output"),
    (("good.h5", "-o", "scenario.yaml"), "output"),
])  # fmt: skip
def test_bad_input_is_one_line_and_changes_nothing(files, words, key):
    Path("link.h5").symlink_to("good.h5")
    Path("scenario.yaml").write_text("robot: {urdf: planar_2dof}\n")
    before = {name: Path(name).read_bytes() for name in os.listdir()}
    assert error("export", *words)["key"] == key
    assert {name: Path(name).read_bytes() for name in os.listdir()} == before


@pytest.mark.parametrize("kind", [kind for kind in Format if kind is not Format.MCAP])
def test_an_export_replaces_one_of_its_kind(files, kind):
    for _ in range(2):
        assert run("export", "good.h5", "--format", kind, "-o", "exported").exit_code == 0
