"""Contact in studies: ensembles know none, which is said; asked for, it is found run by run."""

from pathlib import Path
from typing import Any

import pytest
import yaml

import freefloat as ff
from freefloat.robot.named_files import find_scenario
from freefloat.studies.dry_run import why_run_by_run
from freefloat.studies.study import Study
from tests.commands import document, run
from tests.example_studies import a_study

pytestmark = pytest.mark.usefixtures("kernels")

DRAWN: dict[str, Any] = {"momentum.2": {"uniform": [-1e-3, 1e-3]}}
START: dict[str, Any] = {"heading_deg": 16.0, "start": {"branch": 1}}
"""From here the second link swings through the spacecraft."""


def base(**limits: Any) -> dict[str, Any]:
    content = yaml.safe_load(find_scenario("planar_2dof/line").read_text())
    return content | {"robot": content["robot"] | {"urdf": "planar_2dof"}, "limits": limits}


def study(folder: Path, vary: dict[str, Any] | None = None, **limits: Any) -> Study:
    values = {"cases": 20, "files": "worst 1"} | START
    return a_study(folder, DRAWN | (vary or {}), base=base(**limits), **values)


@pytest.mark.slow
def test_a_study_that_states_no_clearance_keeps_ensembles_and_says_so(tmp_path: Path) -> None:
    """Its result files say it, too: in their scenario the limit is off."""
    loaded = study(tmp_path)
    assert why_run_by_run(loaded) is None
    assert "clearance: 0" in loaded.contact_unchecked
    words, folder = ("batch", tmp_path / "study.yaml"), tmp_path / "out"
    dry = run(*words, "--dry-run").stdout
    shown = run(*words, "-o", folder, "--report").stdout
    outputs = [dry, shown, (folder / "report.html").read_text()]
    assert [" ".join(text.split()).count("is not considered") for text in outputs] == [1, 1, 1]
    answer = document(*words, "-o", folder)
    assert answer["contact_unchecked"] == loaded.contact_unchecked
    assert answer["verdicts"]["feasible"] == 20
    assert {row["contact"] for row in ff.run_study(loaded, folder, report=False).rows} == {
        "not considered"
    }
    assert document(*words, "--dry-run")["contact_unchecked"] == loaded.contact_unchecked
    files = sorted((folder / "cases").glob("*.h5"))
    assert len(files) == 2  # the worst one, and the undisturbed one
    for file in files:
        saved = ff.load(file)
        assert saved.limits.clearance == "off"
        assert saved.feasible
        assert saved.contact.bodies == ("spacecraft", "link_2")
        assert ff.check(saved).passed


@pytest.mark.parametrize(
    ("vary", "limits", "unchecked"),
    [
        ({}, {"base_rate": 1.0}, True), ({}, {"clearance": "off"}, False),
        ({"limits.clearance": {"list": [0.0, 0.01]}}, {}, False),
        ({"limits": {"list": [{"clearance": 0}, {"base_rate": 1.0}]}}, {"clearance": 0}, True),
    ],
)  # fmt: skip
def test_what_is_stated_anywhere_is_not_repeated(vary, limits, unchecked, tmp_path):
    loaded = study(tmp_path, vary, **limits)
    assert (loaded.contact_unchecked is not None) is unchecked
    stated = [loaded.scenario(number).limits().clearance for number in range(loaded.count)]
    assert None not in stated
    assert a_study(tmp_path, DRAWN, cases=20).contact_unchecked is None  # without shapes
    keys = {"base": base(), "command": "plan", "heading_deg": None}
    assert a_study(tmp_path, {"momentum.2": {"list": [0.0]}}, **keys).contact_unchecked is None
