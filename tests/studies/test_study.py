"""Study files: which cases they make, and how wrong ones are told before anything runs."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import pytest

from freefloat.errors import InputError
from freefloat.io.schema import ScenarioFile
from freefloat.robot.names import bundled_scenarios, bundled_studies
from freefloat.studies.study import load_study
from tests.example_studies import BASE, a_study, write_study

MOMENTA = {"list": [[0, 0, -1], [0, 0, 1]]}
DURATIONS = {"list": [50, 100, 200]}


def test_listed_values_are_crossed_the_last_key_fastest(tmp_path: Path) -> None:
    study = a_study(tmp_path, {"momentum": MOMENTA, "timing.duration": DURATIONS})
    assert study.count == 6
    assert [list(study.parameters(k).values()) for k in range(6)] == [
        [momentum, duration] for momentum in MOMENTA["list"] for duration in DURATIONS["list"]
    ]


def test_listed_values_may_be_zipped(tmp_path: Path) -> None:
    vary = {"momentum": MOMENTA, "timing.duration": {"list": [50, 200]}}
    study = a_study(tmp_path, vary, combine="zipped")
    assert [list(study.parameters(k).values()) for k in range(study.count)] == [
        [[0, 0, -1], 50], [[0, 0, 1], 200],
    ]  # fmt: skip


@pytest.mark.parametrize(("combine", "count"), [("crossed", 2 * 3 * 4), ("zipped", 3 * 4)])
def test_so_many_cases_are_drawn_of_each_combination(
    combine: str, count: int, tmp_path: Path
) -> None:
    momenta = MOMENTA if combine == "crossed" else {"list": [[0, 0, k] for k in range(3)]}
    vary = {"momentum": momenta, "timing.duration": DURATIONS, "margin.value": {"uniform": [0, 9]}}
    study = a_study(tmp_path, vary, cases=4, combine=combine)
    assert study.count == count
    cases = [study.parameters(k) for k in range(count)]
    assert len({case["margin.value"] for case in cases}) == count
    assert len({(str(case["momentum"]), case["timing.duration"]) for case in cases}) == count // 4
    assert cases[0]["momentum"] == cases[3]["momentum"]


def test_a_case_is_the_base_with_its_values_in_place(tmp_path: Path) -> None:
    study = a_study(tmp_path, {"momentum.2": {"list": [1.5]}, "limits.base_rate": {"list": [0.1]}})
    document = study.document(0)
    assert document["momentum"] == [0, 0, 1.5]
    assert document["limits"] == {"base_rate": 0.1}
    assert {key: document[key] for key in ("robot", "path")} == {
        key: BASE[key] for key in ("robot", "path")
    }
    assert study.base == BASE


def test_a_start_may_be_varied_and_is_no_key_of_the_scenario(tmp_path: Path) -> None:
    study = a_study(tmp_path, {"heading_deg": {"list": [10, 20]}}, branch=1)
    assert [study.start(k) for k in (0, 1)] == [
        {"heading_deg": 10, "branch": 1}, {"heading_deg": 20, "branch": 1},
    ]  # fmt: skip
    assert study.document(1) == BASE


def test_a_study_goes_to_other_processes_whole(tmp_path: Path) -> None:
    study = a_study(tmp_path, {"momentum.2": {"uniform": [0, 1]}}, cases=3)
    again = pickle.loads(pickle.dumps(study))
    assert [again.document(k) for k in range(3)] == [study.document(k) for k in range(3)]


@pytest.mark.parametrize("name", bundled_studies())
def test_every_bundled_study_loads_and_is_no_scenario(name: str) -> None:
    study = load_study(name)
    assert study.count > 1
    assert name not in bundled_scenarios()
    ScenarioFile.model_validate(study.document(study.count - 1))


def test_a_misspelt_study_gets_a_suggestion() -> None:
    with pytest.raises(InputError) as caught:
        load_study("spatial_6dof/montecarl")
    assert caught.value.key == "study"
    assert "did you mean spatial_6dof/montecarlo?" in caught.value.problem


def test_the_base_may_be_a_bundled_scenario(tmp_path: Path) -> None:
    file = write_study(tmp_path, {"momentum.2": {"list": [0]}}, base=None)
    file.write_text(file.read_text().replace("wish.yaml", "planar_3dof/parabola_nonstop"))
    assert load_study(file).base["task"] == "planar-pose"


RANDOM = {"momentum.2": {"uniform": [0, 1]}}
LISTED = {"momentum.2": {"list": [0, 1]}}


@pytest.mark.parametrize(
    ("vary", "keys", "key", "accepted"),
    [
        ({"momentun": {"list": [1]}}, {}, "vary.momentun", "momentum"),
        ({"timing.length": {"list": [1]}}, {}, "vary.timing.length", "duration"),
        ({"momentum.2": {"unifrom": [0, 1]}}, {}, "vary.momentum.2.unifrom", "uniform"),
        ({"momentum.2": {"uniform": [1, 0]}}, {"cases": 2}, "vary.momentum.2", "lowest"),
        ({"momentum.2": {"uniform": [0, "a"]}}, {}, "vary.momentum.2.uniform.1", "number"),
        ({"momentum.2": {"uniform": [0, [1]]}}, {"cases": 2}, "vary.momentum.2", "equal length"),
        ({"momentum.2": {"list": []}}, {}, "vary.momentum.2.list", "1 entries or more"),
        ({"momentum.2": {"range": [0, 1, 0]}}, {}, "vary.momentum.2", "step"),
        ({"momentum.2": {"range": [0, 1, -1]}}, {}, "vary.momentum.2", "step"),
        ({"momentum.2": {"list": [1], "range": [0, 1, 1]}}, {}, "vary.momentum.2", "exactly one"),
        ({"momentum": {"ball": {"center": [0, 0, 0], "radius": -1}}}, {"cases": 1},
         "vary.momentum.ball.radius", "greater than or equal to 0"),
        ({"momentum.2": {"normal": {"mean": 0, "sd": [1]}}}, {"cases": 1},
         "vary.momentum.2.normal", "as long as mean"),
        ({"momentum.2": {"grid": {"from": 0, "to": [1], "count": 2}}}, {},
         "vary.momentum.2.grid", "equal length"),
        ({}, {}, "vary", "1"),
        ({"momentum": {"list": [[0, 0, 0]]}, "momentum.2": {"list": [0]}}, {},
         "vary.momentum.2", "one of them"),
        ({"momentum.3": {"list": [1]}}, {}, "vary.momentum.3", "0, 1, 2"),
        (RANDOM, {}, "cases", "how many are drawn of momentum.2"),
        (LISTED, {"cases": 3}, "cases", "2 cases"),
        (LISTED, {"task": "dance"}, "task", "'plan', 'map' or 'simulate'"),
        (LISTED, {"task": None}, "task", ""),
        (LISTED, {"task": "plan"}, "heading_deg", "task: simulate"),
        (LISTED, {"task": "plan", "heading_deg": None, "branch": 1}, "branch", "simulate"),
        (LISTED, {"heading_deg": None}, "heading_deg", "one heading_deg"),
        (LISTED, {"attitude": [0, 0, 0, 1]}, "heading_deg", "one heading_deg"),
        ({**LISTED, "timing.duration": DURATIONS}, {"combine": "zipped"}, "combine", "equal"),
        (LISTED, {"sede": 3}, "sede", "seed"),
        (LISTED, {"seed": -1}, "seed", "greater than or equal to 0"),
        ({"momentum.2": {"grid": {"from": 0, "to": 1, "count": 2000}},
          "timing.duration": {"grid": {"from": 1, "to": 2, "count": 2000}}}, {}, "vary", "at most"),
    ],
)  # fmt: skip
def test_wrong_keys_are_told_by_file_and_key(
    vary: dict[str, Any], keys: dict[str, Any], key: str, accepted: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        a_study(tmp_path, vary, **keys)
    assert caught.value.source == str(tmp_path / "study.yaml")
    assert caught.value.key == key
    assert accepted in caught.value.accepted


def test_a_base_that_is_not_there_is_told_with_those_that_are(tmp_path: Path) -> None:
    file = write_study(tmp_path, LISTED)
    file.write_text(file.read_text().replace("wish.yaml", "nothing.yaml"))
    with pytest.raises(InputError) as caught:
        load_study(file)
    assert (caught.value.source, caught.value.key) == (str(file), "base")
    assert "planar_3dof/parabola" in caught.value.accepted


def test_an_attitude_for_a_planar_study_is_fine_but_no_heading_in_space(tmp_path: Path) -> None:
    vary = {"attitude": {"list": [[0, 0, 0, 1]]}}
    assert a_study(tmp_path, vary, heading_deg=None).start(0) == {"attitude": [0, 0, 0, 1]}
    base = BASE | {"task": "pose"}
    with pytest.raises(InputError) as caught:
        a_study(tmp_path, LISTED, base=base)
    assert caught.value.key == "heading_deg"


def test_a_base_of_which_no_case_is_a_scenario_is_told_with_its_key(tmp_path: Path) -> None:
    broken = BASE | {"margin": {"measure": "system"}}
    with pytest.raises(InputError) as caught:
        a_study(tmp_path, LISTED, base=broken)
    assert (caught.value.source, caught.value.key) == (str(tmp_path / "wish.yaml"), "margin")
    completed = a_study(tmp_path, {"margin.value": {"list": [1, 5]}}, base=broken)
    assert completed.count == 2


def test_values_of_which_none_will_do_are_told_with_the_study(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        a_study(tmp_path, {"momentum": {"ball": {"center": [0, 0], "radius": 1}}}, cases=2)
    assert caught.value.source == str(tmp_path / "study.yaml")
    assert caught.value.key == "vary.momentum"
    assert "case 0: it is too short" in caught.value.problem


def test_one_good_case_is_enough_to_begin(tmp_path: Path) -> None:
    study = a_study(tmp_path, {"momentum.2": {"list": [float("nan"), "much", 0.5]}})
    assert study.count == 3
