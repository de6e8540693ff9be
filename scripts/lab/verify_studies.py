"""Compare runs that ensembles decide with runs on their own.

``python scripts/lab/verify_studies.py``.

Momentum, duration, attitude, margin and the robot (masses of links, payload, spacecraft, mount)
vary in studies of four robots. Verdicts must be equal and minimum margins agree to 1e-4; so must
the minimum margins of motions that SciPy integrates with Pinocchio's matrices. ``--runs`` is the
number for each robot, of ``--draws`` random ones: a third singular, half of them near a
singularity, if there are as many (a UR5 has few). ``--scipy`` is that of motions by SciPy,
``--seed`` selects others.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from benchmarks.plain import PlainMotion
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

import freefloat as ff
from freefloat.ensemble.endings import DECIDERS, MOTION, NORMAL
from freefloat.robot.named_files import find_scenario
from freefloat.so3 import IntArray
from freefloat.studies.columns import NUMBER, Columns
from freefloat.studies.disturbances import Chunk
from freefloat.studies.ensembles import computed
from freefloat.studies.run import execute
from freefloat.studies.study import Study
from freefloat.studies.workers import PortableStudy

NEAR = 1e-4
"""Permitted relative difference of minimum margins."""
_EXACT = {"xatol": 1e-9}
"""Error of the time of a minimum that SciPy searches for [s], narrow near a singularity."""
PAYLOAD = {
    "robot.payload.mass": {"uniform": [1, 20]},
    "robot.payload.com": {"uniform": [[-0.1, -0.1, -0.1], [0.1, 0.1, 0.2]]},
    "robot.payload.inertia": {"uniform": [[0.4, 0.4, 0.4], [0.7, 0.7, 0.7]]},
}
CASES: dict[str, tuple[str, dict[str, Any], dict[str, Any], tuple[str, ...]]] = {
    "Example 2": ("spatial_6dof/line", {}, {
        "attitude": {"so3": {}}, "timing.duration": {"uniform": [50, 200]},
        "momentum": {"ball": {"center": [0.5, 0.3, 0.1], "radius": 1.0}},
        "margin.value": {"uniform": [0.5, 12]}, **PAYLOAD,
    }, ("spacecraft", "link_2", "link_3", "link_6")),
    "a UR5": ("ur5_servicer/arc", {"margin": {"measure": "gjm", "value": 0.02}, "limits": {}}, {
        "attitude": {"so3": {"center": [0, 0, 0, 1], "angle_deg": 40.0}},
        "timing.duration": {"uniform": [20, 80]}, "margin.value": {"uniform": [0.005, 0.1]},
        "momentum": {"ball": {"center": [0, 0, 0], "radius": 0.5}},
        "robot.spacecraft.mass": {"uniform": [100, 300]},
        "robot.spacecraft.inertia": {"uniform": [[20, 25, 30], [40, 40, 45]]},
        "robot.spacecraft.com": {"uniform": [[-0.1, -0.1, -0.1], [0.1, 0.1, 0.1]]},
        "robot.spacecraft.mount.xyz": {"uniform": [[-0.05, -0.05, 0.45], [0.05, 0.05, 0.55]]},
        "robot.spacecraft.mount.rpy": {"uniform": [[-0.1, -0.1, -0.1], [0.1, 0.1, 0.1]]},
        **PAYLOAD,
    }, ("upper_arm_link", "forearm_link", "wrist_1_link")),
    "seven joints": ("panda_servicer/line", {"margin": {"measure": "gjm", "value": 0.02},
                                             "limits": {}}, {
        "momentum": {"ball": {"center": [0, 0, 0], "radius": 1.0}},
        "timing.duration": {"uniform": [15, 60]}, "robot.payload.mass": {"uniform": [1, 20]},
        "robot.payload.inertia": {"list": [[0.5, 0.5, 0.5]]},
        "robot.spacecraft.mount.xyz.2": {"uniform": [0.35, 0.45]},
    }, ("spacecraft", "panda_link2", "panda_link5")),
    "its attitudes": ("panda_servicer/line", {"margin": {"measure": "gjm", "value": 0.02},
                                              "limits": {}}, {
        "attitude": {"so3": {"center": [0, 0, 0, 1], "angle_deg": 20.0}},
        "momentum": {"ball": {"center": [0, 0, 0], "radius": 1.0}},
    }, ("spacecraft", "panda_link2")),
    "joints nearby": ("ur5_servicer/arc", {
        "margin": {"measure": "gjm", "value": 0.02}, "limits": {},
        "search": {"joints": [2.9, -2.6, -1.2, 0.5, -1.0, 3.0]},
    }, {
        "attitude": {"so3": {"center": [0, 0, 0, 1], "angle_deg": 40.0}},
        "momentum": {"ball": {"center": [0, 0, 0], "radius": 0.5}},
    }, ("upper_arm_link", "forearm_link")),
    "Example 1": ("planar_3dof/parabola_nonstop", {}, {
        "heading_deg": {"uniform": [0, 360]}, "timing.duration": {"uniform": [50, 200]},
        "momentum.2": {"uniform": [-1, 1.5]}, "margin.value": {"uniform": [1, 20]},
        "robot.payload.mass": {"uniform": [1, 30]},
        "robot.payload.inertia": {"list": [[0.5, 0.5, 0.5]]},
    }, ("spacecraft", "link_1", "link_2", "link_3")),
}  # fmt: skip
"""Base scenario, changes to it, varied keys, and links with factors of their own."""
STARTS: dict[str, dict[str, Any]] = {"seven joints": {"attitude": [0, 0, 0, 1]}}


def write_study(name: str, runs: int, seed: int, folder: Path) -> Study:
    """Write a study and its base scenario."""
    scenario, changes, vary, links = CASES[name]
    source = find_scenario(scenario)
    base = yaml.safe_load(source.read_text("utf-8"))
    base.pop("search", None)
    base |= changes
    if not base["robot"]["urdf"].startswith("example-robot-data"):
        base["robot"]["urdf"] = str(source.parent / base["robot"]["urdf"])
    (folder / "base.yaml").write_text(yaml.safe_dump(base), "utf-8")
    factors = {f"robot.scale_mass.{link}": {"uniform": [0.8, 1.25]} for link in links}
    document = {"base": "base.yaml", "command": "simulate", "cases": runs, "seed": seed,
                "files": "none", **STARTS.get(name, {}), "vary": vary | factors}  # fmt: skip
    (folder / "study.yaml").write_text(yaml.safe_dump(document), "utf-8")
    return ff.load_study(folder / "study.yaml")


def vector(row: dict[str, Any], name: str) -> list[float]:
    """A vector of a row, whose entries are columns, and ``found`` ones where a key has its name."""
    entries = (key for key in row if key.removeprefix("found.").startswith(f"{name}."))
    chosen = [key for key in entries if key.startswith("found.") or f"found.{key}" not in row]
    return [row[key] for key in chosen]


def by_scipy(study: Study, number: int, row: dict[str, Any]) -> float:
    """The minimum margin of the motion of a row, by an integration without freefloat."""
    problem = study.scenario(number).problem()
    plain, measure = PlainMotion(problem), problem.margin.measure
    start = [*vector(row, "attitude"), *vector(row, "joints")]
    solution = solve_ivp(
        plain.rates, (0.0, problem.path.duration), start, method="DOP853", rtol=1e-9, atol=1e-9,
        dense_output=True,
    )  # fmt: skip

    def value(t: float) -> float:
        return abs(measure(solution.sol(t)[4:]))

    times = np.linspace(0.0, problem.path.duration, 1001)
    k = int(np.argmin([value(t) for t in times]))
    bounds = times[max(k - 1, 0)], times[min(k + 1, 1000)]
    return float(minimize_scalar(value, bounds=bounds, method="bounded", options=_EXACT).fun)


def compare(name: str, options: argparse.Namespace, pool: ProcessPoolExecutor) -> dict[str, Any]:
    """What differs between the rows of a study and those of its runs on their own."""
    with tempfile.TemporaryDirectory() as place:
        study = write_study(name, options.draws, options.seed, Path(place))
        sent = PortableStudy(study)
        columns = computed(sent, Chunk(0, np.arange(options.draws)))
        places = selection(columns, options.runs)
        chosen = {name: np.asarray(column)[places].tolist() for name, column in columns.items()}
        numbers = chosen.pop(NUMBER)
        rows = [dict(zip(chosen, row, strict=True)) for row in zip(*chosen.values(), strict=True)]
        alone = pool.map(execute, [sent] * len(numbers), numbers, chunksize=8)
        wrong, differences = [], [0.0]
        for number, row, result in zip(numbers, rows, alone, strict=True):
            single = result.values
            margin, own = row["margin"], single.get("margin") or 0.0
            differences.append(abs(margin - own) / max(own, 1e-12))
            keys = ("verdict", "completed", "branch")
            same = all(row[key] == single.get(key) for key in keys)
            if not same or differences[-1] > NEAR:
                shown = [{key: values.get(key) for key in (*keys, "margin", "error", "decided_by")}
                         for values in (row, single)]  # fmt: skip
                wrong.append(f"{name} run {number}: {shown[0]}; alone {shown[1]}")
        complete = [k for k, row in enumerate(rows) if row["completed"]][-options.scipy :]
        scipy = {numbers[k]: by_scipy(study, numbers[k], rows[k]) / rows[k]["margin"] - 1.0
                 for k in complete}  # fmt: skip
    wrong += [f"{name} run {k}: by SciPy the margin differs by {error:+.1e} of it"
              for k, error in scipy.items() if abs(error) > NEAR]  # fmt: skip
    near = [row["completed"] and row["decided_by"] != DECIDERS[NORMAL] for row in rows]
    return {"robot": name, "runs": len(rows), "singular": sum(not row["completed"] for row in rows),
            "near singular": sum(near), "feasible": chosen["verdict"].count("feasible"),
            "by motions": chosen["decided_by"].count(DECIDERS[MOTION]),
            "largest difference": max(differences), "by SciPy": len(scipy),
            "from SciPy": max(map(abs, scipy.values()), default=0.0), "wrong": wrong}  # fmt: skip


def selection(columns: Columns, count: int) -> IntArray:
    """Places of runs, ascending: a third singular, half near a singularity, if there are."""
    completed = np.asarray(columns["completed"])
    again = np.asarray(columns["decided_by"]) != DECIDERS[NORMAL]
    kinds = ~completed, completed & again, completed & ~again
    shares = -(-count // 3), count // 2
    most = [np.flatnonzero(kind)[:share] for kind, share in zip(kinds, shares, strict=False)]
    rest = np.flatnonzero(kinds[2])[: count - sum(map(len, most))]
    return np.sort(np.concatenate([*most, rest]))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=list(CASES), help="all robots when left out")
    parser.add_argument("--runs", type=int, default=250)
    parser.add_argument("--draws", type=int, default=8000)
    parser.add_argument("--scipy", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with ProcessPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        results = [compare(name, options, pool) for name in options.names]
    table = Table(title="runs that ensembles decide against runs on their own")
    for column in results[0]:
        table.add_column(column)
    for result in results:
        *cells, wrong = result.values()
        words = (f"{cell:.1e}" if isinstance(cell, float) else str(cell) for cell in cells)
        table.add_row(*words, str(len(wrong)))
    Console(width=120).print(table)
    for result in results:
        for line in result["wrong"]:
            print(line)
    return 1 if any(result["wrong"] for result in results) else 0


if __name__ == "__main__":
    sys.exit(main())
