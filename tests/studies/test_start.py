"""The start of runs: the arm branch that a study names, or that of the unvaried motion."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import freefloat as ff
from freefloat.studies.portable import PortableStudy
from freefloat.studies.run import execute
from freefloat.studies.runner import run_study
from tests.commands import document
from tests.example_studies import BASE, a_study, finished
from tests.studies.test_ensembles import REDUNDANT, ROBOTS

pytestmark = pytest.mark.usefixtures("kernels")

JOINTS = [0.5, -1.0, 0.5]
HEADINGS: dict[str, Any] = {"heading_deg": {"uniform": [130.0, 230.0]}}
MOMENTA: dict[str, Any] = {"momentum.2": {"uniform": [-1.0, 1.5]}}
NAMED = dict(zip(("q1", "q2", "q3"), JOINTS, strict=True))


@pytest.mark.parametrize(("vary", "joints"), [(HEADINGS, JOINTS), (HEADINGS | ROBOTS, NAMED)])
def test_joints_choose_the_nearest_arm_branch_on_all_roads(
    vary: dict[str, Any], joints: Any, tmp_path: Path
) -> None:
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
