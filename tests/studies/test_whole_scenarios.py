"""Studies of scenarios with a fraction, a path in the spacecraft's frame and limits: on ensembles.

Rows are compared with ``ff.simulate`` of the posed scenario.
"""

from pathlib import Path
from typing import Any

import pytest

import freefloat as ff
from freefloat.planning.simulation import Simulation
from freefloat.studies.dry_run import why_run_by_run
from freefloat.studies.run import record_values
from freefloat.studies.runner import run_study
from freefloat.studies.study import Study
from tests.example_studies import BASE as PLANAR
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
LIMITS: dict[str, Any] = {
    "joint_rate": 0.1, "base_rate": 0.0165, "base_turn_deg": 15.0,
    "pointing": [{"body": "spacecraft", "axis": [0, 0, 1], "angle_deg": 20.0, "keep": "outside",
                  "target": {"direction": [0.63, 0.28, 0.73]}},
                 {"body": "forearm_link", "axis": [1, 0, 0], "angle_deg": 120.0,
                  "target": {"point": [2.0, 1.0, 1.0]}}],
}  # fmt: skip
KNOWN = ("joint_rate", "base_rate", "base_turn", "pointing")
DRIFTS: dict[str, Any] = {"drift": {"uniform": [[-0.01, -0.01, -0.01], [0.01, 0.01, 0.01]]}}
MOUNTS: dict[str, Any] = {
    "robot.spacecraft.mount.xyz.2": {"uniform": [0.45, 0.55]},
    "robot.spacecraft.mount.rpy.1": {"uniform": [-0.05, 0.05]},
}
FACTORS = {"robot.scale_mass": {"list": [{"forearm_link": 1.3}, {"spacecraft": 0.9}]}}
ENDS: dict[str, Any] = {
    "path.line.to": {"ball": {"center": [0.35, 0.35, 1.0], "radius": 0.03}},
    "path.line.from.1": {"uniform": [0.07, 0.13]},
}


def a_spatial_study(folder: Path, vary: dict[str, Any], **keys: Any) -> Study:
    start = {} if "attitude" in vary else {"attitude": ATTITUDE}
    defaults = {"base": BASE, "cases": 40, "files": "none", "heading_deg": None}
    return a_study(folder, vary, **(defaults | start | keys))


def rows_and_simulations(
    study: Study, folder: Path, apart: int
) -> tuple[list[dict[str, Any]], list[tuple[dict[str, Any], Simulation]]]:
    """All rows, and some of those that ensembles decided with precise motions of the same runs."""
    rows = list(run_study(study, folder, workers=1, report=False).rows)
    decided = [row for row in rows if str(row["decided_by"]).startswith("ensemble")]
    pairs = []
    for row in decided[::apart]:
        number = row["number"]
        start = {"attitude": [row[f"attitude.{axis}"] for axis in "xyzw"], "branch": row["branch"]}
        pairs.append((row, ff.simulate(study.scenario(number).problem(), **start)))
    return rows, pairs


def of_limit(row: dict[str, Any], name: str) -> float | None:
    """The ratio of a limit, whose column has another name where its bound varies."""
    return row.get(f"found.limits.{name}", row.get(f"limits.{name}"))


def assert_same(row: dict[str, Any], simulation: Simulation) -> None:
    """Verdicts are equal, values within 1e-4."""
    chosen = simulation.chosen
    assert row["verdict"] == ("feasible" if simulation.feasible else "infeasible")
    assert row["completed"] == chosen.motion.completed
    assert row["margin"] == pytest.approx(chosen.minimum_margin, rel=1e-4)
    assert row["margin_required"] == pytest.approx(simulation.problem.margin.threshold, rel=1e-12)
    initial = chosen.motion.initial.joints.tolist()
    joints = [row[f"joints.{k}"] for k in range(len(initial))]
    assert joints == pytest.approx(initial, abs=1e-9)
    if not chosen.motion.completed:
        return
    assert_same_extremes(row, simulation)
    for result in simulation.limit_results:
        if (ratio := of_limit(row, result.limit)) is not None:
            error = 1e-5 if result.ratio < 2.0 else 1e-4  # the largest are next to singularities
            assert ratio == pytest.approx(result.ratio, rel=error)
    if chosen.feasible:
        names = ", ".join(result.limit for result in simulation.limit_results if not result.kept)
        assert row["reason"] == (f"Limits are not kept: {names}." if names else "")
        assert row["limits_kept"] is (not names)


def assert_same_extremes(row: dict[str, Any], simulation: Simulation) -> None:
    """Final attitude, rates, turn and range ratios; what limits the motion, unless two are near."""
    for key, value in record_values(simulation).items():
        if key.startswith(("final_attitude.", "base_", "joint_rates.", "range_ratios.")):
            assert row[key] == pytest.approx(value, rel=2e-5, abs=1e-5), key
    ratios = [simulation.problem.margin.threshold / simulation.chosen.minimum_margin]
    ratios += [result.ratio for result in simulation.limit_results]
    *_, second, first = sorted([0.0, *ratios])
    if second < 0.999 * first and None not in [of_limit(row, r.limit)
                                               for r in simulation.limit_results]:  # fmt: skip
        values = record_values(simulation)
        assert row["limiting"] == values["limiting"]
        duration = simulation.problem.path.duration
        assert row["limiting_time"] == pytest.approx(values["limiting_time"], abs=0.01 * duration)


@pytest.mark.parametrize(
    ("vary", "frame", "keys"),
    [
        (ENDS | VARY | LINKS, "spacecraft", {}),
        (VARY | LINKS, "base_link", {}),
        (MOUNTS | FACTORS, "spacecraft", {"start": {"branch": "best"}, "cases": 20}),
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
    rows, pairs = rows_and_simulations(study, tmp_path / "out", 12)
    assert {str(row["decided_by"]).split()[0] for row in rows} == {"ensemble"}
    for row, simulation in pairs:
        assert_same(row, simulation)


def test_paths_in_frames_that_turn_with_a_mount_go_run_by_run(tmp_path: Path) -> None:
    base = BASE | {"path": BASE["path"] | {"frame": "base"}}
    assert "mount" in str(why_run_by_run(a_spatial_study(tmp_path, MOUNTS, base=base)))


@pytest.mark.parametrize(
    ("vary", "keys"), [(VARY | LINKS | DRIFTS, {}), (VARY | LINKS, {"start": {"branch": "best"}})]
)
def test_rates_turn_and_pointing_are_limited_without_precise_motions(vary, keys, tmp_path):
    """All verdicts occur; runs on their own are those near to a limit."""
    base = BASE | {"limits": LIMITS}
    study = a_spatial_study(tmp_path, vary, base=base, cases=120, **keys)
    assert why_run_by_run(study) is None
    rows, pairs = rows_and_simulations(study, tmp_path / "out", 20)
    reasons = " ".join({row["reason"] for row in rows})
    for name in (*KNOWN, "margin"):
        assert name in reasons
    assert any(row["verdict"] == "feasible" for row in rows)
    for row in rows:
        if row["decided_by"] == "motion":
            ratios = [row[f"limits.{name}"] for name in KNOWN]
            assert min(abs(ratio - 1.0) for ratio in ratios) < 1e-5
    for row, simulation in pairs:
        assert_same(row, simulation)


@pytest.mark.parametrize(
    "limits",
    [
        {"joint_torque": 0.012},
        {"joint_acceleration": 0.0127},
        {"joint_jerk": 0.01},
        {"clearance": 0.0137},
    ],
)
def test_some_limits_are_checked_on_recorded_motions(limits, tmp_path):
    """Of motions that keep all other limits; the robots differ in masses."""
    base, name = BASE | {"limits": LIMITS | limits}, next(iter(limits))
    study = a_spatial_study(tmp_path, VARY | LINKS, base=base, cases=32)
    assert why_run_by_run(study) is None
    rows, pairs = rows_and_simulations(study, tmp_path / "out", 6)
    kept = [row for row in rows if row[f"limits.{name}"] is not None]
    assert {row["verdict"] for row in kept} == {"feasible", "infeasible"}
    assert len(kept) < len(rows)
    for row, simulation in pairs:
        assert row["verdict"] == ("feasible" if simulation.feasible else "infeasible")
        if row in kept:
            assert_same(row, simulation)


def test_the_worst_of_several_recorded_limits_is_the_one_that_limits(tmp_path: Path) -> None:
    limits = {"joint_acceleration": 0.0127, "joint_jerk": 0.003, "joint_torque": 0.012,
              "clearance": 0.05}  # fmt: skip
    study = a_spatial_study(tmp_path, VARY, base=BASE | {"limits": limits}, cases=16)
    rows, pairs = rows_and_simulations(study, tmp_path / "out", 4)
    assert any("joint_jerk" in row["limiting"] for row in rows)
    for row, simulation in pairs:
        assert_same(row, simulation)


def test_bounds_of_limits_and_of_the_margin_vary_at_random(tmp_path: Path) -> None:
    """A fraction, and bounds of a limit, of a joint's rate and of the angle of a cone."""
    limits = LIMITS | {"joint_rate": {"elbow_joint": 0.1, "wrist_2_joint": 0.1}}
    vary = VARY | {
        "margin.fraction": {"uniform": [0.2, 0.3]}, "limits.base_rate": {"uniform": [5e-3, 2e-2]},
        "limits.joint_rate.wrist_2_joint": {"uniform": [0.05, 0.2]},
        "limits.pointing.0.angle_deg": {"uniform": [10.0, 50.0]},
        "limits.base_turn_deg": {"normal": {"mean": 8.0, "sd": 1.0}},
    }  # fmt: skip
    study = a_spatial_study(tmp_path, vary, base=BASE | {"limits": limits}, cases=64)
    assert why_run_by_run(study) is None
    rows, pairs = rows_and_simulations(study, tmp_path / "out", 9)
    assert len({row["reason"] for row in rows}) > 4
    for row, simulation in pairs:
        assert_same(row, simulation)


def test_the_corridor_is_checked_on_recorded_motions(tmp_path: Path) -> None:
    """Its axis is inertial; the arm is planar, and the ends of its path vary."""
    corridor = {"point": [0.0, 0.0, 0.0], "axis": [1.0, 0.0, 0.0], "radius": 0.4}
    line = {"line": {"from": [2.0, 0.0, 0.0], "to": [1.4, 0.4, 0.0]}}
    vary = {"momentum.2": {"uniform": [-1.0, 1.5]}, "timing.duration": {"uniform": [50, 200]},
            "path.line.to.1": {"uniform": [0.3, 0.5]}}  # fmt: skip
    base = PLANAR | {"scene": {"corridor": corridor}, "limits": {"joint_rate": 0.07},
                     "path": line | {"attitude": {"fixed": {"rpy": [0.0, 0.0, 0.5]}}}}  # fmt: skip
    study = a_study(tmp_path, vary, base=base, cases=64, files="none", heading_deg=200.0)
    assert why_run_by_run(study) is None
    rows, pairs = rows_and_simulations(study, tmp_path / "out", 8)
    ratios = [row["limits.corridor"] for row in rows if row["limits.corridor"] is not None]
    assert min(ratios) < 1.0 < max(ratios)
    for row, simulation in pairs:
        assert_same(row, simulation)
