"""``freefloat plan``: documents, exit codes, files, and what is built on the way."""

import json
import re
from pathlib import Path

import pytest

import freefloat as ff
from freefloat.robot.named_files import models_folder
from tests.commands import document, run
from tests.plans import planar_plan
from tests.scenarios import PARABOLA, SEARCHED

SCENARIOS = SEARCHED | {"strict": PARABOLA.replace("value: 5", "value: 149")}
MOST_LINES = 12
"""What a reader takes in at once."""


@pytest.fixture(autouse=True)
def folder(folder: Path) -> Path:
    """A working folder with the scenarios."""
    for name, text in SCENARIOS.items():
        (folder / f"{name}.yaml").write_text(text)
    return folder


@pytest.mark.slow
def test_a_spatial_plan_is_printed_and_written() -> None:
    result = run("plan", "easy.yaml", "-o", "plan.h5")
    text, plan = result.stdout, ff.load("plan.h5").to_dict()
    assert "plan.h5 was written\n" in result.stderr
    assert plan["feasible"] is plan["completed"] is True
    assert plan["attitude_ranges_deg"] == plan["disagreements"] == []
    assert plan["heading_deg"] is None
    assert (plan["samples"], plan["seed"]) == (64, 3)
    assert (plan["feasible_fraction"], plan["feasible_fraction_error"]) == (1.0, 0.0)
    assert plan["robust_radius_deg"] > 0.0
    assert plan["residuals"]["end_effector_position"] < 1e-7
    assert document("check", "plan.h5")["proved"] is True
    assert "100.00% (95% confidence: 94.34% to 100.00%) of 64 initial attitudes" in text
    shown = re.findall(
        r"Tolerances: attitude (.*) deg, momentum (\S+) N m s .*, duration .* s\.", text
    )
    found = plan["robust_radius_deg"], plan["tolerance"]["momentum"]
    ((radius, momentum),) = (map(float, numbers) for numbers in shown)
    assert 0.99 * found[0] < radius <= found[0]
    assert 0.999 * found[1] < momentum <= found[1]
    assert text.count("\n") <= MOST_LINES


@pytest.mark.parametrize("name", ["strict", pytest.param("far", marks=pytest.mark.slow)])
def test_an_infeasible_plan_has_a_reason_and_no_page(name: str, folder: Path) -> None:
    result = run("plan", f"{name}.yaml", "-o", "plan.h5", "--html", "page.html")
    plan = ff.load("plan.h5").to_dict()
    assert plan["feasible"] is plan["completed"] is False
    assert plan["initial"] is plan["tolerance"] is plan["robust_radius_deg"] is None
    assert not (folder / "page.html").exists()
    assert (result.exit_code, result.stderr) == (1, "freefloat: plan.h5 was written\n")
    assert plan.keys() == planar_plan().to_dict().keys()
    assert f"Not feasible: {plan['reason']}." in result.stdout


@pytest.mark.slow
def test_a_plan_that_violates_limits_alone_has_a_motion_and_a_page(folder: Path) -> None:
    """Everything that is written says that it is infeasible; check does not verify it."""
    text = (models_folder() / "planar_3dof" / "parabola.yaml").read_text("utf-8")
    path, _, _ = text.partition("limits:")
    (folder / "fast.yaml").write_text(path + "limits: {joint_rate: 0.001}")
    result = run("plan", "fast.yaml", "-o", "plan.h5", "--html", "page.html")
    plan = ff.load("plan.h5")
    assert result.exit_code == 1
    assert not plan.feasible
    assert plan.chosen.feasible
    assert plan.violation in result.stdout
    assert result.stdout.count("\n") <= MOST_LINES + 1  # the page
    verbose = run("plan", "fast.yaml", "--verbose").stdout
    assert verbose.count(" s (limits not considered):") == len(plan.segments) == 2
    assert plan.violation in (folder / "page.html").read_text("utf-8")
    assert plan.violation in run("export", "plan.h5", "-o", "plan.json").stdout
    assert json.loads((folder / "plan.json").read_text("utf-8"))["reason"] == plan.reason
    failed = [entry for entry in document("check", "plan.h5", code=1)["checks"]
              if not entry["passed"]]  # fmt: skip
    assert [entry["name"] for entry in failed] == ["feasible"]
