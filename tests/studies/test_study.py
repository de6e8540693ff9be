"""Study files: the runs they make, and errors before anything runs."""

from pathlib import Path

import pytest

from freefloat.errors import InputError
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.robot.named_files import bundled_scenarios, bundled_studies
from freefloat.studies.loading import load_study
from tests.errors import error_key
from tests.example_studies import BASE, a_study, write_study

MOMENTA, DURATIONS = {"list": [[0, 0, -1], [0, 0, 1]]}, {"list": [50, 100, 200]}


@pytest.mark.parametrize(("combine", "count"), [("crossed", 2 * 3 * 4), ("zipped", 3 * 4)])
def test_values_are_drawn_for_each_combination(combine: str, count: int, tmp_path: Path) -> None:
    momenta = MOMENTA if combine == "crossed" else {"list": [[0, 0, k] for k in range(3)]}
    vary = {"momentum": momenta, "timing.duration": DURATIONS, "margin.value": {"uniform": [0, 9]}}
    study = a_study(tmp_path, vary, cases=4, combine=combine)
    assert study.count == count
    runs = [study.parameters(k) for k in range(count)]
    assert len({run["margin.value"] for run in runs}) == count
    assert len({(str(run["momentum"]), run["timing.duration"]) for run in runs}) == count // 4
    assert runs[0]["momentum"] == runs[3]["momentum"]


def test_a_run_is_the_base_with_its_values(tmp_path: Path) -> None:
    study = a_study(tmp_path, {"momentum.2": {"list": [1.5]}, "limits.base_rate": {"list": [0.1]}})
    own = {"momentum": [0, 0, 1.5], "limits": {"base_rate": 0.1}}
    assert study.document(0) == BASE | own
    assert study.base == BASE


@pytest.mark.parametrize("name", bundled_studies())
def test_every_bundled_study_loads_and_is_no_scenario(name: str) -> None:
    study = load_study(name)
    assert study.count > 1
    assert name not in bundled_scenarios()
    ScenarioFile.model_validate(study.document(study.count - 1))


RANDOM, LISTED = {"momentum.2": {"uniform": [0, 1]}}, {"momentum.2": {"list": [0, 1]}}


@pytest.mark.parametrize(
    ("vary", "keys", "key"),
    [
        ({"momentun": {"list": [1]}}, {}, "vary.momentun"),
        ({"momentum.2": {"unifrom": [0, 1]}}, {}, "vary.momentum.2.unifrom"),
        ({"momentum.2": {"uniform": [1, 0]}}, {"cases": 2}, "vary.momentum.2"),
        ({"momentum.2": {"uniform": [0, "a"]}}, {}, "vary.momentum.2.uniform.1"),
        ({"momentum.2": {"range": [0, 1, -1]}}, {}, "vary.momentum.2"),
        ({"momentum.2": {"list": [1], "range": [0, 1, 1]}}, {}, "vary.momentum.2"),
        ({"momentum": {"ball": {"center": [0, 0, 0], "radius": -1}}}, {"cases": 1},
         "vary.momentum.ball.radius"),
        ({"momentum.2": {"normal": {"mean": 0, "sd": [1]}}}, {"cases": 1},
         "vary.momentum.2.normal"),
        ({"momentum.2": {"grid": {"from": 0, "to": [1], "count": 2}}}, {}, "vary.momentum.2.grid"),
        ({"momentum": {"grid": {"from": [0, 0], "to": [1, 1], "count": [10_000, 10_000]}}}, {},
         "vary.momentum.grid"),
        ({"attitude": {"so3": {"center": [0, 0, 0, 2], "angle_deg": 5.0}}}, {"heading_deg": None},
         "vary.attitude.so3.center"),
        ({}, {}, "vary"),
        ({"momentum": {"list": [[0, 0, 0]]}, "momentum.2": {"list": [0]}}, {}, "vary.momentum.2"),
        ({"momentum.3": {"list": [1]}}, {}, "vary.momentum.3"),
        ({"momentum": {"ball": {"center": [0, 0], "radius": 1}}}, {"cases": 2}, "vary.momentum"),
        ({"robot.scale_mass.link_9": {"list": [1]}}, {}, "vary.robot.scale_mass.link_9"),
        ({"margin.fraction": {"list": [0.5]}}, {}, "vary.margin.fraction"),
        ({"task": {"list": ["pose"]}, "path.attitude": {"list": [1]}}, {}, "vary.path.attitude"),
        ({"margin": {"list": [{}]}}, {}, "vary.margin"),
        (RANDOM, {}, "cases"),
        (LISTED, {"cases": 3}, "cases"),
        (LISTED, {"command": "dance"}, "command"),
        (LISTED, {"base": BASE | {"goal": {"joints": [0.1, 0.2, 0.3]}}}, "command"),
        ({"phases.0.duration": {"list": [9]}}, {}, "vary.phases.0.duration"),
        ({"search.seed": {"list": [1, 2]}}, {}, "vary.search.seed"),
        (LISTED, {"command": "plan"}, "heading_deg"),
        (LISTED, {"command": "plan", "heading_deg": None, "start": {"branch": 1}}, "start"),
        (LISTED, {"branch": 1}, "branch"),
        (LISTED, {"start": {"branch": 1, "joints": [0.1, 0.2, 0.3]}}, "start"),
        (LISTED, {"start": {"branch": "worst"}}, "start.branch"),
        (LISTED, {"start": {"joints": [0.1, 0.2]}}, "start.joints"),
        (LISTED, {"start": {"joints": {"q1": 0.1, "q2": 0.2}}}, "start.joints"),
        (LISTED, {"start": {"joints": [10.0, 20.0, 30.0]}}, "start.joints"),
        (LISTED, {"heading_deg": None}, "heading_deg"),
        (LISTED, {"attitude": [0, 0, 0, 1]}, "heading_deg"),
        ({**LISTED, "timing.duration": DURATIONS}, {"combine": "zipped"}, "combine"),
        ({"momentum.2": {"grid": {"from": 0, "to": 1, "count": 2000}},
          "timing.duration": {"grid": {"from": 1, "to": 2, "count": 2000}}}, {}, "vary"),
    ],
)  # fmt: skip
def test_errors_name_file_and_key(vary, keys, key, tmp_path):
    with pytest.raises(InputError) as caught:
        a_study(tmp_path, vary, **keys)
    assert (caught.value.source, caught.value.key) == (str(tmp_path / "study.yaml"), key)


def test_a_missing_base_is_an_error(tmp_path: Path) -> None:
    file = write_study(tmp_path, LISTED)
    file.write_text(file.read_text().replace("base.yaml", "nothing.yaml"))
    with pytest.raises(InputError) as caught:
        load_study(file)
    assert (caught.value.source, caught.value.key) == (str(file), "base")


def test_a_heading_is_for_planar_tasks(tmp_path: Path) -> None:
    vary = {"attitude": {"list": [[0, 0, 0, 1]]}}
    assert a_study(tmp_path, vary, heading_deg=None).start(0) == {"attitude": [0, 0, 0, 1]}
    base = BASE | {"task": "pose"}
    assert error_key(a_study, tmp_path, LISTED, base=base) == "heading_deg"


def test_limits_of_links_that_the_robot_does_not_have_are_refused_before_the_runs(tmp_path):
    antenna = {
        "body": "mast",
        "axis": [1, 0, 0],
        "target": {"direction": [0, 1, 0]},
        "angle_deg": 9,
    }
    base = BASE | {"limits": {"pointing": [antenna]}}
    assert error_key(a_study, tmp_path, LISTED, base=base) == "limits.pointing.0.body"


def test_a_base_without_a_valid_run_is_an_error(tmp_path: Path) -> None:
    broken = BASE | {"margin": {"measure": "system"}}
    with pytest.raises(InputError) as caught:
        a_study(tmp_path, LISTED, base=broken)
    assert (caught.value.source, caught.value.key) == (str(tmp_path / "base.yaml"), "margin")
    values = {"margin.value": {"list": [1, 5]}}
    assert a_study(tmp_path, values, base=broken, start={"branch": "best"}).count == 2
    with pytest.raises(InputError) as caught:  # the unvaried scenario has no motion
        a_study(tmp_path, values, base=broken)
    assert (caught.value.source, caught.value.key) == (str(tmp_path / "study.yaml"), "start")


def test_entries_of_a_list_vary_where_the_base_leaves_it_to_its_default(tmp_path: Path) -> None:
    base = {key: value for key, value in BASE.items() if key != "momentum"}
    study = a_study(tmp_path, {"momentum.2": {"list": [0.5]}}, base=base)
    assert study.document(0)["momentum"] == [0.0, 0.0, 0.5]
    base["robot"] = BASE["robot"] | {"spacecraft": {"mass": 1.0, "inertia": [1.0, 1.0, 1.0]}}
    study = a_study(tmp_path, {"robot.spacecraft.mount.rpy.2": {"list": [1.0]}}, base=base)
    assert study.document(0)["robot"]["spacecraft"]["mount"] == {"rpy": [0.0, 0.0, 1.0]}


def test_one_valid_run_is_enough(tmp_path: Path) -> None:
    study = a_study(tmp_path, {"momentum.2": {"list": [float("nan"), "much", 0.5]}})
    assert study.count == 3


PAYLOAD = {"mass": 5, "inertia": [0.1, 0.1, 0.1]}


@pytest.mark.parametrize(
    ("key", "section", "keys"),
    [
        ("robot.payload.inertia", {"uniform": [[0.1, 0.1, 0.3], [0.1, 0.1, 0.4]]}, {"cases": 9}),
        ("robot.payload.inertia.0", {"uniform": [0.01, 0.5]}, {"cases": 20}),
        ("robot.scale_mass", {"normal": {"mean": 0.1, "sd": 0.5}}, {"cases": 50}),
        ("timing.duration", {"grid": {"from": 5, "to": 0, "count": 6}}, {}),
        ("margin.value", {"uniform": [-1, 5]}, {"cases": 50}),
        ("attitude", {"normal": {"mean": [0, 0, 0, 1], "sd": 0.1}}, {"cases": 50}),
    ],
)  # fmt: skip
def test_a_value_that_a_run_does_not_accept_is_an_error_before_all(key, section, keys, tmp_path):
    base = BASE | {"robot": BASE["robot"] | {"payload": PAYLOAD}}
    keys |= {"heading_deg": None} if key == "attitude" else {}
    assert error_key(a_study, tmp_path, {key: section}, base=base, **keys) == f"vary.{key}"
