"""Maps and plans in space from the command line: what is told, written, and left behind."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from freefloat.cli import console
from freefloat.cli.app import app
from freefloat.cli.tables import attitude_map_tables, plan_tables
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.errors import InputError
from freefloat.io.map_file import load_map, save_map
from freefloat.io.plan_file import load_plan
from freefloat.io.scenario import load_scenario
from freefloat.motion.problem import Margin
from freefloat.planning.attitude_map import AttitudeMap, Candidate
from freefloat.planning.options import Search
from freefloat.planning.plan import Plan
from freefloat.planning.regions import find_regions
from freefloat.planning.sampling import sample_attitudes
from tests.scenarios import EASY

pytestmark = pytest.mark.usefixtures("kernels")

SEARCHED = EASY + "search: {samples: 64, seed: 3}\n"
HARD = SEARCHED.replace("value: 5", "value: 5000")
FAR = SEARCHED.replace("from: [1, 0, 0]", "from: [9, 0, 0]")
MAP_KEYS = {
    *("samples", "motions", "feasible_fraction", "motion_fraction", "best", "robust", "regions"),
    "seconds",
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with the scenarios."""
    for name, text in {"easy": SEARCHED, "hard": HARD, "far": FAR}.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*words: str) -> Any:
    return CliRunner().invoke(app, list(words))


def answer(*words: str, code: int = 0) -> dict[str, Any]:
    result = run(*words, "--json")
    assert result.exit_code == code, result.output
    assert result.stderr == ""
    return dict(json.loads(result.stdout))


@pytest.fixture(scope="module")
def partly() -> AttitudeMap:
    """The paper's line with a margin that four in ten attitudes keep."""
    asked = load_scenario("spatial_6dof/line").problem()
    problem = replace(asked, margin=Margin(asked.margin.measure, 40.0))
    return sample_attitudes(FeasibilityEvaluator(problem), 64)


# --- map ----------------------------------------------------------------------------------------


def test_a_map_tells_the_documented_keys_and_writes_every_attitude(folder: Path) -> None:
    words = ("map", "easy.yaml", "--nearest", "0", "0", "0", "1", "--boundary", "2")
    document = answer(*words, "-o", "map.h5")
    assert document.keys() >= MAP_KEYS
    assert (document["samples"], document["seed"], document["motions"]) == (64, 3, 512)
    assert document["feasible_fraction"] == document["motion_fraction"] == 1.0
    assert document["best"].keys() == {"attitude", "branch", "value"}
    assert document["best"]["value"] > 60.0
    assert document["robust"].keys() == {"attitude", "branch", "radius_deg"}
    assert document["robust"]["radius_deg"] > 150.0  # singularities of other factors are near
    assert document["nearest"] == {"attitude": [0, 0, 0, 1], "branch": 0, "deviation_deg": 0.0}
    assert document["boundary"] == []
    for region in document["regions"]:
        assert region.keys() == {
            *("branch", "fraction", "error", "volume_rad3", "centre", "depth_deg")
        }
        assert np.isclose(region["volume_rad3"], 8 * np.pi**2 * region["fraction"])
    assert len(document["branches"]) == 8
    assert document["branches"][3]["label"] == "shoulder+ elbow- wrist-"
    assert document["endings"] == {"completed": 512, "singular": 0, "given_up": 0, "unreached": 0}
    assert sorted(path.name for path in folder.glob("*.h5")) == ["map.h5"]
    with h5py.File("map.h5") as file:
        assert json.loads(file["document"].asstr()[()]) == document
        assert file["scenario"].asstr()[()] == SEARCHED
        assert (file.attrs["format"], file.attrs["seed"]) == ("freefloat attitude map", 3)
        assert file["regions/centre"].shape == (len(document["regions"]), 4)
        assert file["branches/label"].asstr()[3] == "shoulder+ elbow- wrist-"
        assert file["best/attitude"].attrs["unit"] == "1, quaternion x y z w"


def test_a_map_file_holds_what_the_map_holds(partly: AttitudeMap, folder: Path) -> None:
    """Nothing but the file is there at the end."""
    save_map("map.h5", partly, load_scenario("easy.yaml"))
    with h5py.File("map.h5") as file:
        assert np.array_equal(file["attitude"], partly.attitudes)
        assert np.array_equal(file["least"], partly.minimum_margins)
        assert np.array_equal(file["ending"], partly.endings)
        assert file["joints"].shape == (64, 8, 6)
        assert file["joints"].dtype == file["joint_upper"].dtype == np.float32
        done = partly.endings == 0
        assert np.allclose(file["ended_at"][()][done], 100.0)
        assert (file["joint_lower"][()] <= file["joint_upper"][()])[done].all()
        assert np.allclose(np.linalg.norm(file["final_attitude"][()][done], axis=-1), 1.0)
        for name in ("joints", "ended_at", "least", "least_at", "largest_rates", "ending"):
            assert file[name].attrs["unit"]
    assert sorted(path.name for path in folder.iterdir() if path.suffix != ".yaml") == ["map.h5"]
    stored = load_map("map.h5")
    assert not stored.planar
    assert np.array_equal(stored.attitudes, partly.attitudes)
    assert np.array_equal(stored.margins, partly.margins)
    assert np.array_equal(stored.endings, partly.endings)
    assert stored.branches.tolist() == list(range(8))
    margin = partly.problem.margin
    assert (stored.margin, stored.measure, stored.unit) == (margin.threshold, "arm", "m^4 kg")
    assert stored.document == {"best": None, "robust": None, "regions": []}


def test_figures_of_a_map_are_drawn_and_told(folder: Path) -> None:
    """Also into a folder that is not there yet; a file in its place is refused before the work."""
    document = answer("map", "easy.yaml", "--plots", "figures/easy")
    names = ("map_slices.pdf", "map_slices.png", "map_histogram.pdf", "map_histogram.png")
    assert document["plots"] == [f"figures/easy/{name}" for name in names]
    assert all(Path(file).stat().st_size > 5000 for file in document["plots"])
    Path("taken").write_text("")
    result = run("map", "easy.yaml", "--samples", "1000000", "--plots", "taken")
    assert result.exit_code == 2
    assert "no folder" in result.stderr


def test_control_c_ends_a_long_map_with_one_line(folder: Path) -> None:
    before = sorted(folder.iterdir())
    words = ["map", "easy.yaml", "--samples", "10000000", "-o", "map.h5"]
    program = [sys.executable, "-m", "freefloat", *words]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        for _ in range(600):
            time.sleep(0.1)
            if len(list(folder.iterdir())) > len(before):
                break
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130
    assert (stdout, stderr) == (b"", b"freefloat: interrupted\n")
    assert sorted(folder.iterdir()) == before


def test_a_full_disk_is_one_clear_error_and_leaves_nothing(folder: Path) -> None:
    before = sorted(folder.iterdir())
    program = [
        sys.executable,
        "-m",
        "freefloat",
        "map",
        "easy.yaml",
        "--samples",
        "2048",
        "-o",
        "map.h5",
    ]
    done = subprocess.run(
        program,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (500_000, 500_000)),
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "map.h5: File too large" in done.stderr
    assert sorted(folder.iterdir()) == before


def test_threads_change_nothing_but_the_time() -> None:
    one, two = (answer("map", "easy.yaml", "--threads", threads) for threads in "12")
    assert {**one, "seconds": 0} == {**two, "seconds": 0}
    one, two = (answer("plan", "easy.yaml", "--threads", threads) for threads in "12")
    assert one == two


def test_samples_and_seed_of_the_command_line_go_before_those_of_the_scenario() -> None:
    document = answer("map", "hard.yaml", "--samples", "9", "--seed", "0", code=1)
    assert (document["samples"], document["seed"]) == (9, 0)


@pytest.mark.parametrize("name", ["hard", "far"])
def test_a_map_without_a_feasible_attitude_exits_with_1(name: str) -> None:
    document = answer("map", f"{name}.yaml", code=1)
    assert document["feasible_fraction"] == 0.0
    assert document["best"] is document["robust"] is None
    assert document["regions"] == []
    assert (document["motions"] == 0) is (name == "far")
    text = " ".join(run("map", f"{name}.yaml").stdout.split())
    assert "no attitude was found" in text
    reach = document["out_of_reach"]
    assert (reach is None) is (name == "hard")
    assert name == "hard" or f"keeps the margin: {reach}" in text


def test_people_are_told_of_regions_branches_and_known_attitudes(partly: AttitudeMap) -> None:
    best = Candidate(partly.attitudes[0], 2, 53.6)
    robust = Candidate(partly.attitudes[1], 4, 0.5)
    document = replace(
        partly, regions=find_regions(partly), best=best, robust=robust, seconds=1.25
    ).to_dict()
    document["nearest"] = {"attitude": [0, 0, 0, 1], "branch": None, "deviation_deg": 12.5}
    text = told(attitude_map_tables(document, "spatial_6dof/line"))
    assert "40.62% ± 6.14% of the attitudes keep arm 40" in text
    assert "2 s+ e- w+" in text
    assert "branch 2, arm 53.6" in text
    assert "branch 4, 28.6479 deg around keep the margin" in text
    assert "branch any, 12.5 deg away" in text
    assert "1.2 s" in text


def test_shares_of_a_map_add_up(partly: AttitudeMap) -> None:
    document = replace(partly, regions=find_regions(partly)).to_dict()
    assert 0.0 < document["feasible_fraction"] < 1.0
    for one in document["branches"]:
        parts = [r["fraction"] for r in document["regions"] if r["branch"] == one["branch"]]
        if parts:  # of twins only the first has regions
            assert np.isclose(sum(parts), one["fraction"])
    assert sum(document["endings"].values()) == 64 * 8
    assert document["motions"] == 64 * 8 - document["endings"]["unreached"]


def told(tables: Any) -> str:
    from rich.console import Console

    screen = Console(width=140)
    with screen.capture() as capture:
        for table in tables:
            screen.print(table)
    return capture.get()


# --- plan ---------------------------------------------------------------------------------------


def test_a_plan_in_space_tells_the_documented_keys_and_is_written(folder: Path) -> None:
    document = answer("plan", "easy.yaml", "-o", "plan.h5")
    assert document["feasible"] is document["completed"] is True
    assert document["attitude_ranges_deg"] == document["disagreements"] == []
    assert document["heading_deg"] is None
    assert (document["samples"], document["seed"]) == (64, 3)
    assert (document["feasible_fraction"], document["feasible_fraction_error"]) == (1.0, 0.0)
    assert document["tolerance"].keys() == {"momentum", "momentum_limit", "shortest", "longest"}
    assert document["robust_radius_deg"] > 0.0
    assert document["residuals"]["end_effector_position"] < 1e-7
    stored = load_plan("plan.h5")
    assert stored.document == document
    assert stored.ranges == {}
    assert stored.joints.shape[1] == 6
    assert np.allclose(stored.attitudes[0], document["initial"]["attitude"])
    text = run("plan", "easy.yaml").stdout
    assert "100.00% (at least 95.43% with 95% confidence) of 64 initial attitudes" in text
    assert "it bears momentum off by" in text


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("hard", "none keeps arm 5000"),
        ("far", "the path begins out of reach: [9.0, 0.0, 0.0] m is 9 m"),
    ],
)
def test_an_infeasible_plan_in_space_says_why(name: str, words: str, folder: Path) -> None:
    document = answer("plan", f"{name}.yaml", "-o", "plan.h5", code=1)
    assert document["feasible"] is document["completed"] is False
    assert words in document["reason"]
    assert document["initial"] is document["tolerance"] is document["robust_radius_deg"] is None
    assert not load_plan("plan.h5").feasible
    assert words in run("plan", f"{name}.yaml").stdout


def test_people_are_told_what_was_not_confirmed() -> None:
    problem = load_scenario("easy.yaml").problem()
    plan = Plan(problem, Search(), False, "no", disagreements=("branch 3 becomes singular",))

    document = {**plan.to_dict(), "samples": 8, "feasible_fraction": 0.0}
    document["feasible_fraction_error"] = 0.0
    assert "not confirmed: branch 3 becomes singular" in told(plan_tables(document, "easy"))


# --- what is refused, and what is announced -----------------------------------------------------


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (("map", "easy.yaml", "--samples", "7"), "samples"),
        (("map", "easy.yaml", "--threads", "0"), "threads"),
        (("map", "easy.yaml", "--seed", "-1"), "seed"),
        (("map", "easy.yaml", "--nearest", "0", "0", "0", "0"), "nearest"),
        (("map", "easy.yaml", "--boundary", "0"), "boundary"),
        (("map", "easy.yaml", "-o", "no/map.h5"), "No such file or directory"),
        (("map", "planar_3dof/parabola", "--nearest", "0", "0", "0", "1"), "is planar"),
        (("map", "planar_3dof/parabola", "--boundary", "4"), "is planar"),
        (("plan", "easy.yaml", "--threads", "none"), "threads"),
        (("plan", "easy.yaml", "-o", "no/plan.h5"), "No such file or directory"),
    ],
)
def test_bad_options_are_refused_in_one_line(words: tuple[str, ...], problem: str) -> None:
    result = run(*words)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    assert problem in result.stderr


def test_samples_may_be_left_out_of_a_scenario_or_be_null(folder: Path) -> None:
    for text in ("search: {seed: 3}", "search: {samples: null, seed: 3}"):
        (folder / "wish.yaml").write_text(SEARCHED.replace("search: {samples: 64, seed: 3}", text))
        assert load_scenario("wish.yaml").search().samples is None
    (folder / "wish.yaml").write_text(SEARCHED.replace("samples: 64", "samples: 7"))
    with pytest.raises(InputError, match=r"search\.samples"):
        load_scenario("wish.yaml")


def test_compiling_is_announced_when_it_takes_long(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with console.compiling():
        pass
    assert capsys.readouterr() == ("", "")
    monkeypatch.setattr(console, "_PATIENCE", 0.01)
    monkeypatch.setattr(console, "_LOOK", 0.02)
    with console.compiling():
        time.sleep(0.3)  # on a busy machine loading takes long, too: only work counts
    assert capsys.readouterr() == ("", "")
    with console.compiling():
        end = time.process_time() + 0.3
        while time.process_time() < end:
            pass
    told_ = capsys.readouterr()
    assert told_.out == ""
    assert told_.err.count("\n") == 1
    assert "compiling kernels, once on this machine" in told_.err


def test_a_bar_on_a_terminal_tells_how_many_attitudes_are_followed() -> None:
    import pty

    program = [sys.executable, "-m", "freefloat", "plan", "easy.yaml", "--json"]
    leader, follower = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100"}
    with subprocess.Popen(
        program, stdout=subprocess.PIPE, stderr=follower, env=environment
    ) as process:
        os.close(follower)
        shown = b""
        while True:
            try:
                part = os.read(leader, 65536)
            except OSError:
                break
            if not part:
                break
            shown += part
        stdout, _ = process.communicate(timeout=60)
    os.close(leader)
    assert json.loads(stdout)["feasible"] is True
    assert b"following 64 attitudes" in shown
