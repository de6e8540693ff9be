"""Kill a study at random moments, continue it, and compare its rows with those of a whole one.

``python scripts/lab/verify_study_resumption.py [kills]``: 20,000 runs of the bundled Monte Carlo,
on this computer and on a Dask scheduler with two workers in turn, killed thirty times if nothing
else is said: the command, a worker, or both. A row that was committed must stay as it is; work that
is repeated is that of the chunks in flight. Exit code 1: a row differs, was lost or computed twice.
"""

from __future__ import annotations

import json
import random
import re
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import psutil

from freefloat.robot.named_files import find_study
from freefloat.studies.rows import StudyRows

RUNS, WORKERS = 20_000, 2
LONGEST = 2.0
"""Longest time from the first committed chunk to a kill [s]."""


def dask(*words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "dask", *words, "--no-dashboard"]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


@contextmanager
def cluster() -> Iterator[str]:
    """The address of a scheduler with workers, which are replaced when they die."""
    process = dask("scheduler", "--host", "127.0.0.1", "--port", "0")
    matches = (re.search(r"Scheduler at: +(tcp://\S+)", line) for line in process.stderr or ())
    address = next(match[1] for match in matches if match)
    workers = dask("worker", address, "--nthreads", "1", "--nworkers", str(WORKERS))
    try:
        yield address
    finally:
        for child in (*psutil.Process(workers.pid).children(recursive=True), workers, process):
            child.kill()


def batch(study: Path, out: Path, *words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "freefloat", "batch", str(study), "-o", str(out), "--json"]
    return subprocess.Popen(
        [*command, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def times(out: Path) -> dict[int, str]:
    """When the committed runs were computed, by number."""
    if not (out / "study.sqlite").is_file():
        return {}
    try:
        with closing(sqlite3.connect(out / "study.sqlite", timeout=60.0)) as connection:
            return dict(connection.execute("SELECT number, began FROM runs"))
    except sqlite3.OperationalError:  # there is no table yet
        return {}


def results(out: Path) -> list[dict[str, Any]]:
    rows = StudyRows(out / "study.sqlite", ())
    return [row | {"seconds": None, "began": None} for row in rows]


def kill(running: subprocess.Popen[str], target: str) -> None:
    """Kill the command, a worker of the cluster, or both."""
    if target != "worker":
        running.kill()
    if target != "command":
        random.choice(list(spawned())).kill()


def spawned() -> Iterator[psutil.Process]:
    """Workers of the cluster."""
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):  # it has just ended
            if "spawn_main" in " ".join(child.cmdline()):
                yield child


def main(kills: int = 30) -> int:
    random.seed(1)
    with tempfile.TemporaryDirectory() as place, cluster() as address:
        folder, failures, done = Path(place), 0, 0
        study = folder / "study.yaml"
        text = find_study("spatial_6dof/montecarlo").read_text("utf-8")
        study.write_text(text.replace("cases: 200", f"cases: {RUNS}"), "utf-8")
        batch(study, folder / "whole").communicate()
        whole = results(folder / "whole")
        while done < kills:
            out, before, targets = folder / f"out{done}", dict[int, str](), list[str]()
            while len(before) < RUNS:
                remote = random.random() < 0.5
                running = batch(study, out, *(("--scheduler", address) if remote else ()))
                committed = before
                while len(committed) == len(before) and running.poll() is None:
                    time.sleep(0.01)
                    committed = times(out)
                time.sleep(random.uniform(0.0, LONGEST) * random.random())
                if running.poll() is None and done < kills:
                    done += 1
                    targets.append(
                        random.choice(["command", "worker", "both"]) if remote else "command"
                    )
                    kill(running, targets[-1])
                document, errors = running.communicate()
                if running.returncode == 0:
                    reused = json.loads(document)["reused"]
                    if reused != len(before):
                        print(f"{reused:,} of {len(before):,} rows were reused")
                        failures += 1
                elif running.returncode != -9:
                    print(errors, file=sys.stderr)
                    failures += 1
                after = times(out)
                changed = sum(after.get(number) != began for number, began in before.items())
                if changed:
                    print(f"{changed:,} of {len(before):,} committed rows are others or lost")
                    failures += 1
                before = after
            same = results(out) == whole
            failures += not same
            print(f"{len(targets)} kills ({', '.join(targets) or 'none'}): {len(before):,} rows, "
                  f"{'the same' if same else 'others'}", flush=True)  # fmt: skip
    print(f"{done} kills, {failures} failures")
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
