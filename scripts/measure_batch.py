"""Measure studies: the speed-up of two workers, the overhead of the machinery, its memory.

``python scripts/measure_batch.py [speedup] [overhead] [memory]`` runs what is named, all when
nothing is, on a machine that does nothing else. It takes about twenty minutes.
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
"""Cases that are refused at once: the path leaves the plane."""


def started(study: dict[str, Any], folder: Path, workers: int) -> subprocess.Popen[str]:
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


def say(text: str) -> None:
    print(text, flush=True)


def measure_speedup() -> None:
    seconds = {workers: run(SPEEDUP, workers)[0]["seconds"] for workers in (1, 2)}
    say(f"{SPEEDUP['cases']} plans of Example 2: {seconds[1]:.1f} s with one worker, "
          f"{seconds[2]:.1f} s with two: {seconds[1] / seconds[2]:.2f} times faster")  # fmt: skip


def measure_overhead() -> None:
    """From the first case to the last, without what starting and the tables take."""
    document, rows = run(OVERHEAD, 1)
    work = sum(row["seconds"] for row in rows)
    began = [time_of(row) for row in rows]
    span = max(began) - min(began) + rows[-1]["seconds"]
    between, around = span - work, document["seconds"] - span
    say(f"{len(rows)} cases of {work / len(rows):.2f} s on one worker: {between:.2f} s between "
          f"them, {between / work:.2%} of the work; {around:.1f} s to start and to write tables "
          "and figure")  # fmt: skip


def time_of(row: dict[str, Any]) -> float:
    return datetime.fromisoformat(row["began"]).timestamp()


def measure_memory() -> None:
    with tempfile.TemporaryDirectory() as place:
        begin, running = time.monotonic(), started(TRIVIAL, Path(place), 2)
        database = Path(place) / "out" / "study.sqlite"
        first: dict[int, int] = {}
        most: dict[int, int] = {}
        while running.poll() is None:
            if database.exists():
                for one in [psutil.Process(running.pid), *psutil.Process(running.pid).children()]:
                    try:
                        size = one.memory_info().rss
                    except psutil.Error:
                        continue
                    first.setdefault(one.pid, size)
                    most[one.pid] = max(most.get(one.pid, 0), size)
            time.sleep(0.2)
        running.communicate()
    grown = sum(most[pid] - first[pid] for pid in first) / 2**20
    seconds = time.monotonic() - begin
    say(f"{TRIVIAL['cases']:,} trivial cases in {seconds:.0f} s: coordinator and workers grew by "
          f"{grown:.0f} MiB, to {sum(most.values()) / 2**20:.0f} MiB")  # fmt: skip


if __name__ == "__main__":
    measures = {"speedup": measure_speedup, "overhead": measure_overhead, "memory": measure_memory}
    for name in sys.argv[1:] or measures:
        measures[name]()
