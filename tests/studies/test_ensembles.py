"""Runs that ensembles decide: their rows and starts are those of runs executed one by one."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import freefloat as ff
from freefloat.studies.disturbances import group_numbers
from freefloat.studies.dry_run import why_run_by_run
from freefloat.studies.ensembles import chunks, computed
from freefloat.studies.groups import grouped
from freefloat.studies.run import execute
from freefloat.studies.runner import run_study
from freefloat.studies.study import Study
from freefloat.studies.workers import PortableStudy
from tests.commands import document
from tests.errors import error_key
from tests.example_studies import BASE, SHORT, a_study, finished

pytestmark = pytest.mark.usefixtures("kernels")

DISTURBED: dict[str, Any] = {
    "momentum.2": {"uniform": [-1.0, 1.5]},
    "wheels.momentum": {"normal": {"mean": [0, 0, 0], "sd": [0, 0, 0.05]}},
    "drift": {"uniform": [[-1e-3, -1e-3, 0], [1e-3, 1e-3, 0]]},
    "timing.duration": {"uniform": [50, 200]},
    "robot.scale_mass": {"normal": {"mean": 1, "sd": 0.1}},
}
ROBOTS: dict[str, Any] = {
    "robot.scale_mass.spacecraft": {"uniform": [0.8, 1.2]},
    "robot.scale_mass.link_2": {"uniform": [0.8, 1.25]},
    "robot.payload.mass": {"uniform": [1.0, 15.0]},
    "robot.payload.inertia": {"uniform": [[1, 1, 1], [1.5, 1.5, 1.5]]},
    "robot.payload.com.0": {"uniform": [-0.2, 0.2]},
    "momentum.2": {"uniform": [-1.0, 1.5]},
}
REDUNDANT = SHORT | {"task": "planar-position", "path": {"polynomial": SHORT["path"]["polynomial"]}}
MARGINS: dict[str, Any] = {"margin.value": {"uniform": [2.0, 30.0]}}
BUNDLED = {"urdf": "planar_3dof", "end_effector": "end_effector"}
FRACTION: dict[str, Any] = {"measure": "system", "fraction": 0.1}
NUMBERS = [0.1 + k / 12 for k in range(12)]
Row = dict[str, Any]


def assert_same(decided: Row, alone: Row) -> None:
    """Verdicts are equal, minima within 1e-4, the moments of minima within a thousandth."""
    for name in ("verdict", "reason", "measure", "completed", "branch"):
        assert decided[name] == alone[name], name
    assert decided["margin"] == pytest.approx(alone["margin"], rel=1e-4)
    assert decided["margin_required"] == pytest.approx(alone["margin_required"], rel=1e-6)
    assert decided["margin_time"] == pytest.approx(alone["margin_time"], abs=0.2)
    ends = [row["singular_time"] or 0.0 for row in (decided, alone)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-6)
    for name in alone:
        if name.startswith(("attitude.", "joints.", "heading_deg")):
            value = decided.get(f"found.{name}", decided[name])  # where the heading varies
            assert value == pytest.approx(alone[name], abs=1e-9), name


def alone(study: Study, number: int) -> Row:
    return execute(PortableStudy(study), number).values


def rows_of(study: Study, folder: Path) -> list[Row]:
    return list(run_study(study, folder, workers=1, report=False).rows)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vary", "keys"),
    [
        (DISTURBED | MARGINS, {}),
        (ROBOTS | MARGINS | {"heading_deg": {"uniform": [130.0, 230.0]}}, {}),
        (DISTURBED | {"heading_deg": {"normal": {"mean": 150.0, "sd": 60.0}}}, {"base": REDUNDANT}),
        (ROBOTS, {"base": BASE | {"margin": FRACTION}}),
        (DISTURBED, {"start": {"branch": "best"}, "heading_deg": 120.0}),
        (DISTURBED | MARGINS, {"base": BASE | {"limits": {"base_rate": 0.02, "joint_rate": 0.5}}}),
    ],
)  # fmt: skip
def test_rows_are_those_of_single_runs(vary, keys, tmp_path):
    study = a_study(tmp_path, vary, cases=16, files="none", **keys)
    rows = rows_of(study, tmp_path / "out")
    assert any(str(row["decided_by"]).startswith("ensemble") for row in rows)
    for number in range(0, 16, 5):
        assert_same(rows[number], alone(study, number))


@pytest.mark.slow
@pytest.mark.parametrize("command", ["simulate", "plan"])
def test_a_fraction_is_of_the_unvaried_robot_or_of_each_run(command: str, tmp_path: Path) -> None:
    """det A of a planar arm is proportional to a factor on masses and inertias."""
    masses = {"robot.scale_mass": {"list": [1.0, 2.0]}}
    keys: dict[str, Any] = {"command": command, "files": "worst 1"}
    if command != "simulate":
        keys["heading_deg"] = None
    required = []
    for number, of in enumerate((None, "base", "run")):
        margin = FRACTION | ({} if of is None else {"fraction_of": of})
        folder = tmp_path / str(number)
        folder.mkdir()
        study = a_study(folder, masses, base=SHORT | {"margin": margin}, **keys)
        rows = rows_of(study, folder / "out")
        required.append([row["margin_required"] for row in rows])
        (file, *_) = (folder / "out" / "cases").glob("0*.h5")
        saved = ff.load(file)
        assert saved.problem.margin.threshold == required[-1][int(file.stem)]
    largest = ff.load_scenario(SHORT | {"robot": BUNDLED, "margin": FRACTION})
    assert required[0] == [pytest.approx(largest.problem().margin.threshold)] * 2
    assert required[0] == required[1]
    assert required[2] == pytest.approx([required[0][0], 2.0 * required[0][0]])


def test_the_base_of_a_fraction_may_lack_what_all_runs_have(tmp_path: Path) -> None:
    base = SHORT | {"margin": FRACTION, "timing": {}}
    vary = {"timing.duration": {"list": [8.0, 9.0]}, "robot.scale_mass": {"list": [1.0, 2.0]}}
    study = a_study(tmp_path, vary, base=base, combine="zipped", start={"branch": 0}, files="none")
    assert [row["error"] for row in rows_of(study, tmp_path / "out")] == [None, None]


@pytest.mark.parametrize(
    "margin", [{"value": 5.0, "fraction_of": "run"}, FRACTION | {"fraction_of": "none"}]
)
def test_fraction_of_is_base_or_run_and_needs_a_fraction(margin: dict[str, Any]) -> None:
    content = BASE | {"robot": BUNDLED, "margin": margin}
    assert error_key(ff.load_scenario, content).startswith("margin")


@pytest.mark.slow
def test_robots_that_no_ensemble_represents_are_simulated_one_by_one(tmp_path: Path) -> None:
    """Masses of links divided by more than a hundred; a margin that is negative in run 0."""
    light = {"robot.scale_mass.link_2": {"list": [1e-3 + 1e-4 * k for k in range(16)]}}
    study = a_study(tmp_path, light, files="none")
    rows = rows_of(study, tmp_path / "out")
    assert [(row["error"], row["decided_by"]) for row in rows] == [(None, "motion")] * 16
    study = a_study(tmp_path, {"margin.value": {"list": [-1.0, *range(1, 16)]}}, files="none")
    verdicts = [row["verdict"] for row in rows_of(study, tmp_path / "margins")]
    assert verdicts[0] == "error"
    assert "error" not in verdicts[1:]


def test_listed_values_of_other_keys_make_groups(tmp_path: Path) -> None:
    vary = {"path.polynomial.x.1": {"list": [-3, -2.9]}, "momentum.2": {"uniform": [0, 1]},
            "margin.value": {"list": [1, 5]}}  # fmt: skip
    study = a_study(tmp_path, vary, cases=20, files="none")
    groups = group_numbers(study)
    assert [len(set(groups[k : k + 40])) for k in (0, 40)] == [1, 1]
    assert groups[0] != groups[40]
    rows = rows_of(study, tmp_path / "out")
    for number in (0, 39, 40, 79):
        assert_same(rows[number], alone(study, number))


def test_few_and_other_runs_are_executed_alone_and_say_why(tmp_path: Path) -> None:
    momentum, shape = (
        {"momentum.2": {"uniform": [0, 1]}},
        {"path.polynomial.x.1": {"uniform": [-3, -2.9]}},
    )
    plans = {"command": "plan", "heading_deg": None}
    cases = [
        (momentum, {"cases": 8, "files": "none"}, "16"),
        (momentum, {"files": "all"}, "files"),
        (shape, {}, "path.polynomial.x.1"),
        (momentum, plans, "plan"),
    ]
    for vary, keys, word in cases:
        study = a_study(tmp_path, vary, **({"cases": 30} | keys))
        assert (group_numbers(study) == -1).all()
        assert word in str(why_run_by_run(study))
    fractions = BASE | {"margin": FRACTION | {"fraction_of": "run"}}
    study = a_study(tmp_path, ROBOTS, base=fractions, cases=30, files="none")
    assert grouped(study, 0)[0] is None
    assert "fraction_of: run" in str(why_run_by_run(study))
    assert why_run_by_run(a_study(tmp_path, momentum, cases=30, files="none")) is None


@pytest.mark.parametrize(
    ("vary", "kept"),
    [
        ({"momentum.2": {"list": [0.5, "much", float("nan"), 1e5, True, *NUMBERS]},
          "margin.value": {"list": [5, -1]}}, [0, *range(10, 34, 2)]),
        ({"robot.payload.mass": {"list": [5, "heavy", -1.0, float("nan"), *NUMBERS]},
          "robot.payload.inertia": {"list": [[1, 1, 1], [1, 1, 3], [1, 1]]}},
         [0, *range(12, 48, 3)]),
    ],
)  # fmt: skip
def test_values_that_are_refused_are_left_to_single_runs(vary, kept, tmp_path):
    study = a_study(tmp_path, vary, files="none")
    decided: list[int] = []
    for chunk in chunks(study, np.arange(study.count)):
        decided.extend(computed(PortableStudy(study), chunk)["number"])
    assert decided == kept


@pytest.mark.slow
def test_rows_are_the_same_for_any_chunks_threads_and_interruptions(tmp_path, monkeypatch):
    study = a_study(tmp_path, ROBOTS, cases=300, files="none")
    every = rows_of(study, tmp_path / "out")
    times, drawn = {"seconds": None, "began": None}, study.variation.columns(0, 1)
    kept = [{name: value for name, value in row.items() if name not in drawn}
            for row in every if row["number"] % 7 <= 2 and row["number"] >= 40]  # fmt: skip
    finished(study, tmp_path / "part", *kept)
    again = run_study(study, tmp_path / "part", workers=2, report=False)
    assert 0 < again.computed < 300
    assert [row | times for row in again.rows] == [row | times for row in every]
    for size in (7, 100):
        monkeypatch.setattr("freefloat.studies.ensembles.CHUNK", size)
        parts = [computed(PortableStudy(study), chunk) for chunk in chunks(study, np.arange(300))]
        margins = np.concatenate([part["margin"] for part in reversed(parts)])
        numbers = np.concatenate([part["number"] for part in reversed(parts)])
        assert [every[number]["margin"] for number in numbers.tolist()] == margins.tolist()


@pytest.mark.slow
def test_files_of_the_worst_runs_and_of_the_undisturbed_one_are_kept(tmp_path: Path) -> None:
    study = a_study(tmp_path, DISTURBED, cases=30, files="worst 2", base=SHORT)
    rows = rows_of(study, tmp_path / "out")
    worst = sorted(range(30), key=lambda number: (rows[number]["margin"] or 0.0, number))[:2]
    names = {f"{number:05d}.h5" for number in worst}
    assert {path.name for path in (tmp_path / "out" / "cases").iterdir()} == {
        *names, "undisturbed.h5",
    }  # fmt: skip
    assert [rows[number]["file"] for number in worst] == [f"cases/{n:05d}.h5" for n in worst]


@pytest.mark.slow
def test_a_study_ends_when_its_interval_is_narrow(tmp_path: Path) -> None:
    study = a_study(tmp_path, DISTURBED, cases=20_000, files="none", base=SHORT)
    result = run_study(study, tmp_path / "out", until=0.02, report=False)
    low, high = result.feasible_interval or (0.0, 1.0)
    assert high - low <= 0.02
    assert result.done < 20_000
    listed = a_study(tmp_path, {"momentum.2": {"list": [0, 1]}})
    assert error_key(run_study, listed, tmp_path / "listed", until=0.02) == "until"


JOINTS = [0.5, -1.0, 0.5]
HEADINGS: dict[str, Any] = {"heading_deg": {"uniform": [130.0, 230.0]}}
MOMENTA: dict[str, Any] = {"momentum.2": {"uniform": [-1.0, 1.5]}}
NAMED = dict(zip(("q1", "q2", "q3"), JOINTS, strict=True))


@pytest.mark.parametrize(("vary", "joints"), [(HEADINGS, JOINTS), (HEADINGS | ROBOTS, NAMED)])
def test_joints_choose_the_nearest_arm_branch_on_all_roads(vary, joints, tmp_path):
    """In an ensemble, one by one, with ``--run``, and where a worker runs it."""
    study = a_study(tmp_path, vary, cases=24, files="none", start={"joints": joints})
    rows = list(run_study(study, tmp_path / "out", workers=1, report=False).rows)
    unvaried, chosen = ff.load_scenario(BASE | {"robot": ROBOT}).problem(), set()
    sent = pickle.loads(pickle.dumps(PortableStudy(study)))
    for row in rows[::6]:
        number, heading = row["number"], np.radians(row["heading_deg"])
        branches = unvaried.branches(unvaried.attitude(heading=heading))
        apart = [unvaried.model.joint_distance(branch.joints, JOINTS) for branch in branches]
        assert row["branch"] == branches[int(np.argmin(apart))].index
        assert execute(PortableStudy(study), number).values["branch"] == row["branch"]
        assert execute(sent, number).values["branch"] == row["branch"]
        chosen.add(row["branch"])
    assert len(chosen) == 2
    written = document("batch", tmp_path / "study.yaml", "--run", "6", "-o", tmp_path / "run.h5")
    assert written["branch"] == rows[6]["branch"]
    assert ff.load(tmp_path / "run.h5").chosen.branch.index == rows[6]["branch"]


ROBOT = {"urdf": "planar_3dof", "end_effector": "end_effector"}


def test_a_redundant_arm_starts_at_the_configuration_near_the_joints(tmp_path: Path) -> None:
    study = a_study(tmp_path, MOMENTA, base=REDUNDANT, cases=16, files="none",
                    start={"joints": JOINTS})  # fmt: skip
    rows = list(run_study(study, tmp_path / "out", workers=1, report=False).rows)
    problem = ff.load_scenario(REDUNDANT | {"robot": ROBOT}).problem()
    near = problem.replace(start_joints=JOINTS).closest_start(
        problem.attitude(heading=np.radians(200))
    )
    for row in (rows[3], execute(PortableStudy(study), 3).values):
        assert [row[f"joints.{k}"] for k in range(3)] == pytest.approx(near.tolist(), abs=1e-9)
    assert {row["branch"] for row in rows} == {execute(PortableStudy(study), 3).values["branch"]}


def test_the_arm_branch_of_the_unvaried_motion_is_found_once_and_kept(tmp_path: Path) -> None:
    """Workers receive it; a study that is continued has it; the undisturbed simulation, too."""
    study = a_study(tmp_path, MOMENTA, cases=20, files="worst 1", heading_deg=120.0)
    chosen = ff.load_scenario(tmp_path / "base.yaml").simulate(heading=np.radians(120.0)).chosen
    sent = pickle.loads(pickle.dumps(PortableStudy(study)))
    assert sent.study.content.start.joints == chosen.branch.joints.tolist()
    every = list(run_study(study, tmp_path / "every", workers=1, report=False).rows)
    assert {row["branch"] for row in every} == {chosen.branch.index}
    saved = ff.load(tmp_path / "every" / "cases" / "undisturbed.h5")
    assert saved.chosen.minimum_margin == pytest.approx(chosen.minimum_margin)
    finished(study, tmp_path / "part", *[
        {"number": row["number"], "verdict": "feasible"} for row in every[:10]
    ])  # fmt: skip
    rest = list(run_study(study, tmp_path / "part", workers=1, report=False).rows)[10:]
    assert [row["margin"] for row in rest] == [row["margin"] for row in every[10:]]


def test_an_unvaried_scenario_without_a_motion_is_said_before_all_runs(tmp_path: Path) -> None:
    far = BASE | {"path": BASE["path"] | {"polynomial": {"x": [20, -1], "y": [0], "z": [0]}}}
    study = a_study(tmp_path, {"path.polynomial.x.0": {"list": [2.0, 1.9]}}, base=far)
    with pytest.raises(ff.InputError, match="unvaried scenario has no motion") as caught:
        run_study(study, tmp_path / "out", workers=1, report=False)
    assert caught.value.key == "start"
