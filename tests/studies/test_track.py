"""The command track of a study: how often the margin survives mass errors, noise and friction."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.engines.track_runs import chunks, computed
from freefloat.studies.results import StudyResult
from freefloat.studies.run import execute
from freefloat.studies.runner import run_study
from freefloat.studies.study import Study
from freefloat.studies.workers import PortableStudy
from tests.errors import error_key
from tests.example_studies import SHORT, a_study, write_study

VARY: dict[str, Any] = {
    "track.mass_error": {"list": [0.0, 0.2]},
    "track.noise": {"list": [0.0, 0.05]},
    "track.seed": {"list": [3, 4]},
}
TRACK: dict[str, Any] = {"base": SHORT, "command": "track", "track": {"friction": 0.01}}


def result_of(study: Study) -> StudyResult:
    folder = Path(tempfile.mkdtemp(dir=Path(study.source).parent))
    return run_study(study, folder, workers=1, report=False)


@pytest.mark.slow
def test_the_table_of_survival_follows_from_the_seeds(tmp_path: Path) -> None:
    study = a_study(tmp_path, VARY, **TRACK)
    first, again = result_of(study), result_of(study)
    assert first.combinations == again.combinations
    survived = [entry.feasible for entry in first.combinations]
    assert [entry.parameters["track.noise"] for entry in first.combinations] == [0.0, 0.05] * 2
    assert survived[0] == 2, "without errors"
    assert survived[1] == survived[3] == 0, "with noise beyond the tolerance"
    assert first.rows[2]["reason"] == "The end-effector leaves the path."
    errors = [value for name, value in first.rows[2].items() if name.startswith("residuals.")]
    assert max(errors) > 0.02
    other = a_study(tmp_path, VARY | {"track.seed": {"list": [5, 6]}}, **TRACK)
    assert result_of(other).combinations[2].margin != first.combinations[2].margin


def test_a_run_has_the_results_of_track(tmp_path: Path) -> None:
    study = a_study(tmp_path, VARY, start={"branch": 0}, **TRACK)
    problem = ff.load_scenario(tmp_path / "base.yaml").problem()
    simulation = ff.simulate(problem, heading=3.490658503988659, branch=0)
    tracking = ff.track(simulation, mass_error=0.2, noise=0.05, friction=0.01, seed=4)
    result = execute(PortableStudy(study), 7)
    assert result.values["margin"] == tracking.minimum_margin
    assert result.values["margin_time"] == tracking.margin_time
    assert result.values["branch"] == 0
    assert result.values["verdict"] == ("feasible" if tracking.survived else "infeasible")
    assert result.content is None
    (chunk,) = chunks(study, np.arange(8))
    columns = computed(PortableStudy(study), chunk, 2)
    assert columns["number"] == list(range(8))
    for name in result.values.keys() - {"began", "seconds"}:
        assert columns[name][7] == result.values[name]


@pytest.mark.usefixtures("kernels")
def test_without_an_attitude_the_plan_of_the_scenario_is_followed(tmp_path: Path) -> None:
    study = a_study(tmp_path, {"track.seed": {"list": [1, 2]}}, **TRACK | {"heading_deg": None})
    scenario = ff.load_scenario(tmp_path / "base.yaml")
    plan = ff.plan(scenario.problem(), scenario.search(), scenario.limits())
    row = execute(PortableStudy(study), 0).values
    assert row["verdict"] == "feasible"
    attitude = [row[f"attitude.{axis}"] for axis in "xyzw"]
    assert attitude == pytest.approx(plan.chosen.motion.initial.attitude.tolist())
    assert study.branch_rule is None
    far = SHORT | {"path": SHORT["path"] | {"polynomial": {"x": [20, -1], "y": [0], "z": [0]}}}
    nowhere = a_study(
        tmp_path, {"track.seed": {"list": [1, 2]}}, **TRACK | {"base": far, "heading_deg": None}
    )
    assert execute(PortableStudy(nowhere), 0).values["verdict"] == "infeasible"


def test_runs_are_grouped_where_a_combination_has_several(tmp_path: Path) -> None:
    vary = {"timing.duration": {"list": [5, 6]}, "margin.value": {"uniform": [0.1, 0.2]}}
    grouped = result_of(a_study(tmp_path, vary, base=SHORT, cases=2))
    margins = [row["margin"] for row in grouped.rows]
    assert grouped.to_dict()["combinations"] == [
        {"parameters": {"timing.duration": duration}, "feasible": 2, "cases": 2, "margin": margin}
        for duration, margin in ((5, min(margins[:2])), (6, min(margins[2:])))
    ]
    single = result_of(a_study(tmp_path, {"timing.duration": {"list": [5, 6]}}, base=SHORT))
    assert single.combinations == []


def test_what_runs_do_not_consider_is_said_of_varied_keys_too(tmp_path: Path) -> None:
    def unchecked(vary: dict[str, Any], **keys: Any) -> str:
        return " ".join(ff.load_study(write_study(tmp_path, vary, **keys)).unchecked)

    rates = {"limits.base_rate": {"list": [1e-6, 1.0]}}
    assert "limits" in unchecked(rates, **TRACK)
    assert "limits" not in unchecked(VARY, **TRACK)
    corridor = {"point": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0], "radius": 9.0}
    base = SHORT | {"scene": {"corridor": corridor}}
    assert "limits" in unchecked(VARY, **TRACK | {"base": base})
    assert "fastest" in unchecked({"timing.law": {"list": ["quintic", "optimal"]}})


def test_keys_of_the_section_belong_to_the_command(tmp_path: Path) -> None:
    def key(vary: dict[str, Any], **keys: Any) -> str:
        return error_key(ff.load_study, write_study(tmp_path, vary, **TRACK | keys))

    assert key(VARY, command="simulate") == "track"
    assert key({"momentum.2": {"list": [0.1]}}, command="simulate") == "track"
    assert key({"track.noise": {"list": [0.1, -1.0]}}) == "vary.track.noise"
    negative = {"track.noise": {"normal": {"mean": 0.001, "sd": 0.001}}}
    assert key(negative, cases=12) == "vary.track.noise"
    assert key({"track.noice": {"list": [0.1]}}) == "vary.track.noice"
    assert key({"track.seed": {"uniform": [0, 9]}}, cases=2) == "vary.track.seed"
    assert key(VARY, track={"gain": -1}) == "track.gain"
    assert key(VARY, heading_deg=None, start={"branch": 1}) == "start"
