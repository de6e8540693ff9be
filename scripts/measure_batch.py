"""Measure studies: speed-up by a second worker, overhead between runs, memory.

``python scripts/measure_batch.py [speedup] [overhead] [memory]`` measures these, by default all, on
an otherwise idle machine. It takes about twenty minutes.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from datetime import datetime
from pathlib import Path
from typing import Any

import psutil
import pyarrow.parquet
import yaml

from freefloat.robot.names import find_scenario

SPEEDUP: dict[str, Any] = {
    "base": "spatial_6dof/line",
    "command": "plan",
    "cases": 40,
    "seed": 7,
    "vary": {
        "momentum": {"ball": {"center": [0.5, 0.3, 0.1], "radius": 0.5}},
        "search.samples": {"list": [2000]},
    },
}
"""A Monte Carlo of plans of the paper's Example 2."""
OVERHEAD: dict[str, Any] = {
    "base": "planar_3dof/parabola",
    "command": "map",
    "cases": 60,
    "vary": {"momentum.2": {"uniform": [-1, 1]}, "search.samples": {"list": [2000]}},
}
"""Maps of Example 1 that take one to two seconds each."""
TRIVIAL: dict[str, Any] = {
    "base": "planar_3dof/parabola_nonstop",
    "command": "simulate",
    "heading_deg": 200,
    "cases": 10_000,
    "vary": {"momentum.2": {"uniform": [-1, 1]}, "path.polynomial.z": {"list": [[1]]}},
}
"""Runs that end in an error at once: the path leaves the plane."""


def started(study: dict[str, Any], folder: Path, workers: int) -> subprocess.Popen[str]:
    """Start ``freefloat batch`` on a study, with its results in the folder out."""
    file = folder / "study.yaml"
    file.write_text(yaml.safe_dump(study | {"base": str(find_scenario(study["base"]))}))
    command = [sys.executable, "-m", "freefloat", "batch", str(file), "-o", str(folder / "out")]
    return subprocess.Popen(
        [*command, "--workers", str(workers), "--json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def run(study: dict[str, Any], workers: int) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Return the document of a study and the start and duration of its runs."""
    with tempfile.TemporaryDirectory() as place:
        output, errors = started(study, Path(place), workers).communicate()
        if errors:
            raise SystemExit(errors)
        table = pyarrow.parquet.read_table(Path(place) / "out" / "cases.parquet")
    rows: list[dict[str, Any]] = table.select(["began", "seconds"]).to_pylist()
    return json.loads(output), rows


def measure_speedup() -> None:
    seconds = {workers: run(SPEEDUP, workers)[0]["seconds"] for workers in (1, 2)}
    print(f"{SPEEDUP['cases']} plans of Example 2: {seconds[1]:.1f} s with one worker, "
          f"{seconds[2]:.1f} s with two: {seconds[1] / seconds[2]:.2f} times faster")  # fmt: skip


def measure_overhead() -> None:
    """Measure from the start of the first run to the end of the last one."""
    document, rows = run(OVERHEAD, 1)
    work = sum(row["seconds"] for row in rows)
    began = [datetime.fromisoformat(row["began"]).timestamp() for row in rows]
    span = max(began) - min(began) + rows[-1]["seconds"]
    between, around = span - work, document["seconds"] - span
    print(f"{len(rows)} runs of {work / len(rows):.2f} s on one worker: {between:.2f} s between "
          f"them, {between / work:.2%} of their time; {around:.1f} s to start and to write tables "
          "and figure")  # fmt: skip


def measure_memory() -> None:
    with tempfile.TemporaryDirectory() as place:
        begin, running = time.monotonic(), started(TRIVIAL, Path(place), 2)
        database = Path(place) / "out" / "study.sqlite"
        first: dict[int, int] = {}
        largest: dict[int, int] = {}
        while running.poll() is None:
            if database.exists():
                coordinator = psutil.Process(running.pid)
                for process in [coordinator, *coordinator.children()]:
                    try:
                        size = process.memory_info().rss
                    except psutil.Error:
                        continue
                    first.setdefault(process.pid, size)
                    largest[process.pid] = max(largest.get(process.pid, 0), size)
            time.sleep(0.2)
        running.communicate()
    growth = sum(largest[pid] - first[pid] for pid in first) / 2**20
    seconds = time.monotonic() - begin
    print(f"{TRIVIAL['cases']:,} trivial runs in {seconds:.0f} s: coordinator and workers grew by "
          f"{growth:.0f} MiB, to {sum(largest.values()) / 2**20:.0f} MiB")  # fmt: skip


if __name__ == "__main__":
    measures = {"speedup": measure_speedup, "overhead": measure_overhead, "memory": measure_memory}
    for name in sys.argv[1:] or measures:
        measures[name]()
