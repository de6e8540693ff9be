"""Studies of scenarios with a fraction, a path in the spacecraft's frame and limits: on ensembles.

Rows are compared with ``ff.simulate`` of the posed scenario.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import freefloat as ff
from freefloat.studies.estimate import why_run_by_run
from freefloat.studies.runner import run_study
from freefloat.studies.study import Study
from tests.example_studies import a_study

pytestmark = [pytest.mark.usefixtures("kernels"), pytest.mark.slow]

ATTITUDE = [0.1, 0.2, 0.3, 0.9273618495495704]
BASE: dict[str, Any] = {
    "robot": {
        "urdf": "example-robot-data:ur5", "end_effector": "tool0",
        "spacecraft": {"mass": 200, "inertia": [35, 35, 35], "mount": {"xyz": [0, 0, 0.5]}},
    },
    "task": "pose",
    "path": {
        "frame": "spacecraft", "line": {"from": [0.6, 0.1, 0.9], "to": [0.35, 0.35, 1.0]},
        "attitude": {"fixed": {"rpy": [0, 1.5707963268, 0]}},
    },
    "timing": {"duration": 20},
    "margin": {"measure": "gjm", "fraction": 0.2},
    "search": {"joints": [0.3, -1.2, 1.4, -0.2, 1.3, 0.2], "from_attitude": ATTITUDE},
}  # fmt: skip
VARY: dict[str, Any] = {
    "robot.spacecraft.mass": {"uniform": [150, 250]},
    "momentum": {"uniform": [[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]]},
    "timing.duration": {"uniform": [15, 30]},
}
LINKS: dict[str, Any] = {
    "robot.scale_mass.forearm_link": {"uniform": [0.5, 2.0]},
    "robot.spacecraft.com": {"uniform": [[-0.1, -0.1, -0.1], [0.1, 0.1, 0.1]]},
    "attitude": {"so3": {"center": ATTITUDE, "angle_deg": 10.0}},
}
MOUNTS: dict[str, Any] = {
    "robot.spacecraft.mount.xyz.2": {"uniform": [0.45, 0.55]},
    "robot.spacecraft.mount.rpy.1": {"uniform": [-0.05, 0.05]},
}


def a_spatial_study(folder: Path, vary: dict[str, Any], **keys: Any) -> Study:
    start = {} if "attitude" in vary else {"attitude": ATTITUDE}
    defaults = {"base": BASE, "cases": 40, "files": "none", "heading_deg": None}
    return a_study(folder, vary, **(defaults | start | keys))


def rows_and_simulations(
    study: Study, folder: Path, apart: int
) -> tuple[list[dict[str, Any]], list[tuple[dict[str, Any], ff.Simulation]]]:
    """All rows, and some of those that ensembles decided with precise motions of the same runs."""
    rows = list(run_study(study, folder, workers=1, report=False).rows)
    decided = [row for row in rows if str(row["decided_by"]).startswith("ensemble")]
    pairs = []
    for row in decided[::apart]:
        number = row["number"]
        start = {"attitude": study.start(number)["attitude"], "branch": row["branch"]}
        pairs.append((row, ff.simulate(study.scenario(number).problem(), **start)))
    return rows, pairs


def assert_same(row: dict[str, Any], simulation: ff.Simulation) -> None:
    """Verdicts are equal, values within 1e-4."""
    chosen = simulation.chosen
    assert row["verdict"] == ("feasible" if simulation.feasible else "infeasible")
    assert row["completed"] == chosen.motion.completed
    assert row["margin"] == pytest.approx(chosen.minimum_margin, rel=1e-4)
    assert row["margin_required"] == pytest.approx(simulation.problem.margin.threshold, rel=1e-12)
    joints = [row[f"joints.{k}"] for k in range(6)]
    assert joints == pytest.approx(chosen.motion.initial.joints.tolist(), abs=1e-9)


@pytest.mark.parametrize(
    ("vary", "frame", "keys"),
    [
        (VARY, "spacecraft", {}),
        (VARY | LINKS, "base_link", {}),
        (LINKS | MOUNTS, "spacecraft", {"branch": 1}),
        (LINKS | MOUNTS, "spacecraft", {"branch": "best"}),
    ],
)
def test_paths_in_the_frame_of_the_spacecraft_begin_where_each_robot_has_it(
    vary: dict[str, Any], frame: str, keys: dict[str, Any], tmp_path: Path
) -> None:
    path = BASE["path"] | {"frame": frame}
    if frame != "spacecraft":
        path |= {"line": {"from": [0.6, 0.1, 0.4], "to": [0.35, 0.35, 0.5]}}
    study = a_spatial_study(tmp_path, vary, base=BASE | {"path": path}, **keys)
    assert why_run_by_run(study) is None
    rows, pairs = rows_and_simulations(study, tmp_path / "out", 5)
    assert {str(row["decided_by"]).split()[0] for row in rows} == {"ensemble"}
    for row, simulation in pairs:
        assert_same(row, simulation)


def test_paths_in_frames_that_turn_with_a_mount_go_run_by_run(tmp_path: Path) -> None:
    base = BASE | {"path": BASE["path"] | {"frame": "base"}}
    assert "mount" in str(why_run_by_run(a_spatial_study(tmp_path, MOUNTS, base=base)))
