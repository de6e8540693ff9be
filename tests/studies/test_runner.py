"""Studies as a whole: their processes, killed, interrupted and continued; estimates."""

import json
import os
import re
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pyarrow.parquet
import pytest
import yaml

from freefloat.io.results import load
from freefloat.robot.named_files import find_scenario, models_folder
from freefloat.studies.database import open_results
from freefloat.studies.dry_run import estimate_study
from freefloat.studies.loading import load_study
from freefloat.studies.run import execute
from freefloat.studies.runner import run_study
from freefloat.studies.workers import FEW, PortableStudy, completed_in_pool, study_files
from tests.commands import document, error, run
from tests.errors import error_key
from tests.example_studies import HEADINGS, SHORT, a_study, write_study

pytestmark = pytest.mark.usefixtures("kernels")

RANDOM = {"momentum.2": {"uniform": [-1, 1]}}
PATHS = {"path.polynomial.y.1": {"uniform": [0.01, 0.0101]}}
"""Runs that no ensemble represents."""
CHUNK = 4096
"""Runs of an ensemble that are stored together."""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A working folder; the command changes the handler of SIGTERM."""
    monkeypatch.chdir(tmp_path)
    before = signal.getsignal(signal.SIGTERM)
    yield tmp_path
    signal.signal(signal.SIGTERM, before)


def table(folder: Path) -> dict[str, list[Any]]:
    return dict(pyarrow.parquet.read_table(folder / "cases.parquet").to_pydict())


Row = dict[str, Any]
TIMES = ("seconds", "began", "file", "bytes")


def assert_results(row: Row, alone: Row) -> None:
    """A row has the results of a run, but for its times and file."""
    assert {name: row[name] for name in alone if name not in TIMES} == {
        name: value for name, value in alone.items() if name not in TIMES
    }


@pytest.mark.slow
def test_a_study_has_the_rows_of_its_runs_and_is_not_repeated(folder: Path) -> None:
    study = a_study(folder, HEADINGS, start={"branch": 0})
    fractions: list[float] = []
    result = run_study(study, folder / "out", workers=2, progress=fractions.append)
    assert fractions == pytest.approx([1 / 3, 2 / 3, 1.0])
    assert result.verdicts == {"feasible": 2, "infeasible": 1, "error": 0}
    for number in range(3):
        row = result.rows[number]
        assert_results(row, execute(PortableStudy(study), number).values)
        stored = load(folder / "out" / row["file"])
        assert stored.chosen.minimum_margin == row["margin"]
    written = {path.name for path in (folder / "out").iterdir()}
    tables = {"study.sqlite", "cases", "cases.csv", "cases.parquet"}
    assert written == tables | {"report.html", "summary.pdf", "summary.png"}
    again = run_study(study, folder / "out", report=False)
    assert (again.computed, again.files["report"]) == (0, None)
    assert list(again.rows) == list(result.rows)


@pytest.mark.slow
def test_runs_that_fail_stop_no_other(folder: Path) -> None:
    """Runs with a path out of reach."""
    vary = {"path.polynomial.x.0": {"list": [2, 2, 2, 9] * 4}}
    write_study(folder, vary, base=SHORT, files="none")
    result = run("batch", "study.yaml", "-o", "out", "--workers", "1")
    assert result.exit_code == 1
    assert len(result.stderr.splitlines()) == 2  # run by run, and the first error
    rows = table(folder / "out")
    failed = [number for number, error in enumerate(rows["error"]) if error is not None]
    assert failed == [3, 7, 11, 15]
    assert rows["verdict"].count("feasible") == 12


def started(*words: str) -> subprocess.Popen[str]:
    """The command as the leader of a process group, as in a terminal."""
    command = [sys.executable, "-m", "freefloat", "batch", *words]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("cases/0*.h5"))


def wait_until(condition: Callable[[], bool], process: subprocess.Popen[str]) -> None:
    begin = time.monotonic()
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() - begin < 180.0
        time.sleep(0.01)


def workers(process: subprocess.Popen[str]) -> list[psutil.Process]:
    processes = []
    for child in psutil.Process(process.pid).children(recursive=True):
        try:
            processes += [child] if any("spawn_main" in word for word in child.cmdline()) else []
        except psutil.Error:
            continue
    return processes


@pytest.mark.slow
def test_no_finished_run_is_lost_or_repeated_whatever_process_is_killed(folder: Path) -> None:
    count, out = 9, folder / "out"
    write_study(folder, RANDOM, base=SHORT, cases=count)
    coordinator = started("study.yaml", "-o", "out", "--workers", "1")
    wait_until(lambda: len(files(out)) >= 3, coordinator)
    processes = workers(coordinator)
    coordinator.kill()
    coordinator.communicate()
    _, alive = psutil.wait_procs(processes, timeout=60)
    assert alive == []
    finished = files(out)[:-1]  # the last one may have no row yet
    times = {name: (out / "cases" / name).stat().st_mtime_ns for name in finished}
    again = started("study.yaml", "-o", "out", "--workers", "2", "--json", "--quiet")
    wait_until(lambda: len(files(out)) >= len(finished) + 2, again)
    workers(again)[0].kill()
    document, errors = again.communicate(timeout=300)
    assert (again.returncode, len(errors.splitlines()) <= 1) == (0, True), errors
    assert json.loads(document)["reused"] >= len(finished)
    rows = table(out)
    assert rows["case"] == list(range(count))
    assert set(rows["verdict"]) == {"feasible"}
    assert len(files(out)) == count
    for name, modified in times.items():
        assert (out / "cases" / name).stat().st_mtime_ns == modified


@pytest.mark.slow
def test_maps_without_a_margin_come_after_the_worst(folder: Path) -> None:
    """The path of run 1 is out of reach."""
    vary = {"path.polynomial.x.0": {"list": [2, 9, 2.1]}}
    keys = {"base": SHORT | {"search": {"samples": 24}}, "command": "map", "heading_deg": None}
    run_study(a_study(folder, vary, files="worst 2", **keys), folder / "out", report=False)
    margins = stored(folder / "out", "margin")
    assert margins[1] == (None,)
    assert margins[0] > margins[2]
    assert files(folder / "out") == ["00000.h5", "00002.h5"]


def stored(folder: Path, columns: str) -> list[Any]:
    connection = sqlite3.connect(folder / "study.sqlite", timeout=60.0)
    try:
        return connection.execute(f"SELECT {columns} FROM runs ORDER BY number").fetchall()
    except sqlite3.OperationalError:  # it has no tables yet
        return []
    finally:
        connection.close()


@pytest.mark.slow
def test_a_killed_ensemble_loses_at_most_the_chunk_in_flight(folder: Path) -> None:
    write_study(folder, RANDOM, base=SHORT, cases=3 * CHUNK, files="none")
    process = started("study.yaml", "-o", "out")
    database = folder / "out" / "study.sqlite"
    wait_until(lambda: database.exists() and len(stored(folder / "out", "number")) > 0, process)
    process.kill()
    process.communicate()
    reused = document("batch", "study.yaml", "-o", "out")["reused"]
    assert reused in (CHUNK, 2 * CHUNK, 3 * CHUNK)
    started("study.yaml", "-o", "whole").communicate()
    columns = 'number, verdict, margin, margin_time, "momentum.2", "joints.0", decided_by'
    assert stored(folder / "out", columns) == stored(folder / "whole", columns)


@pytest.mark.slow
@pytest.mark.parametrize("finished", [0, 1])
def test_an_interruption_ends_all_processes_and_keeps_rows(finished: int, folder: Path) -> None:
    """Ctrl-C in a terminal reaches the workers too, before and after the first runs."""
    write_study(folder, PATHS, base=SHORT, cases=500, files="all")
    process = started("study.yaml", "-o", "out", "--workers", "1")
    wait_until(lambda: len(files(folder / "out")) >= finished and bool(workers(process)), process)
    processes = workers(process)
    os.killpg(process.pid, signal.SIGINT)
    output, errors = process.communicate(timeout=60)
    assert (process.returncode, output) == (130, "")
    assert errors.splitlines()[-2:] == [
        "freefloat: the same command continues the study", "freefloat: interrupted",
    ]  # fmt: skip
    _, alive = psutil.wait_procs(processes, timeout=60)
    assert alive == []
    rows = table(folder / "out")["case"]
    assert finished - 1 <= len(rows) < 500  # the last file may have no row yet
    estimate = estimate_study(load_study("study.yaml"), folder / "out")
    assert sorted(estimate.finished) == rows


@pytest.mark.parametrize("absolute", [False, True])
def test_a_robot_that_changed_since_the_start_is_exit_code_2(absolute: bool, folder: Path) -> None:
    robot = folder / "arm.urdf"
    robot.write_text((models_folder() / "planar_3dof" / "planar_3dof.urdf").read_text())
    name = str(robot) if absolute else robot.name
    base = SHORT | {"robot": {"urdf": name, "end_effector": "end_effector"}}
    study = a_study(folder, RANDOM, base=base, cases=2)
    with open_results(folder / "out", study, study_files(study)) as database:
        database.add([0], {"verdict": ["feasible"]})
    robot.write_text(robot.read_text().replace('value="40"', 'value="41"'))
    assert error("batch", "study.yaml", "-o", "out")["key"] == "output"


@pytest.fixture
def scheduler() -> Iterator[str]:
    """Address of a scheduler with a worker."""
    dask = [sys.executable, "-m", "dask"]
    options: Any = {"stderr": subprocess.PIPE, "text": True}
    address = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    main = subprocess.Popen([*dask, "scheduler", *address], **options)
    assert main.stderr is not None
    matches = (re.search(r"Scheduler at: +(tcp://\S+)", line) for line in main.stderr)
    url = next(match[1] for match in matches if match)
    worker = [*dask, "worker", url, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
    processes = (subprocess.Popen(worker, **options), main)
    yield url
    for process in processes:
        process.kill()
        process.communicate()


@pytest.mark.slow
def test_workers_of_a_scheduler_get_the_same_rows(folder: Path, scheduler: str) -> None:
    """Those that ensembles decide, too, and files of runs."""
    study = a_study(folder, RANDOM, base=SHORT, cases=40, files="worst 2")
    there = run_study(study, folder / "there", scheduler=scheduler, report=False)
    here = run_study(a_study(folder, RANDOM, base=SHORT, cases=40, files="none"), folder / "here")
    for row, same in zip(there.rows, here.rows, strict=True):
        assert_results(row, same)
    assert len(files(folder / "there")) == 2


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://a"])
def test_a_scheduler_that_is_silent_is_an_error(address: str, folder: Path, monkeypatch) -> None:
    monkeypatch.setattr("freefloat.studies.dask_cluster._TIMEOUT", 1.0)
    assert error_key(run_study, a_study(folder), folder / "out", scheduler=address) == "scheduler"


@pytest.mark.slow
def test_an_estimate_times_every_step_and_writes_nothing(folder: Path) -> None:
    write_study(
        folder, RANDOM | {"timing.duration": {"list": [5, 6]}}, base=SHORT, cases=30,
        files="worst 20",
    )  # fmt: skip
    before = sorted(folder.iterdir())
    printed = document("batch", "study.yaml", "--dry-run", "--workers", "1")
    assert [case["case"] for case in printed["cases"]] == list(range(60))
    assert printed["cases"][59]["parameters"]["timing.duration"] == 6
    assert printed["timed"].endswith("of an ensemble")
    assert printed["seconds_each"] < 0.01 < printed["file_seconds_each"]
    assert printed["files"] == 21  # and the undisturbed one
    whole = printed["start_up_seconds"] + printed["seconds_each"] * 60
    whole += printed["file_seconds_each"] * 21
    assert printed["seconds"] == pytest.approx(whole, rel=1e-3)
    assert "60 to run" in run("batch", "study.yaml", "--dry-run").stdout
    assert sorted(folder.iterdir()) == before
    arc = yaml.safe_load(find_scenario("ur5_servicer/arc").read_text("utf-8"))
    masses = {"robot.spacecraft.mass": {"uniform": [190, 210]}}  # a fraction is that of each robot
    upright = {"heading_deg": None, "attitude": [0, -0.1736, 0, 0.9848]}
    write_study(folder, masses, base=arc, cases=20, **upright)
    assert document("batch", "study.yaml", "--dry-run")["timed"].startswith("run")
    assert estimate_study(a_study(folder), workers=8).workers == 3


@pytest.mark.parametrize(
    ("words", "key"),
    [
        (["study.yaml"], "output"),
        (["study.yaml", "--run", "3", "-o", "run.h5"], "run"),
        (["study.yaml", "-o", "out", "--until", "many"], "until"),
        (["study.yaml", "-o", "out", "--until", "0"], "until"),
        (["study.yaml", "-o", "out", "--until", "200%"], "until"),
        (["study.yaml", "--run", "0"], "output"),
        (["study.yaml", "--run", "0", "-o", "taken.h5"], "output"),
        (["study.yaml", "--run", "0", "-o", "run.h5", "--report"], "report"),
        (["study.yaml", "--dry-run", "--until", "1%"], "until"),
        (["branch.yaml", "-o", "out"], "start.branch"),
        (["nothing.yaml", "-o", "out"], "study"),
        (["study.yaml", "-o", "base.yaml"], "output"),
        (["study.yaml", "-o", "out", "--workers", "2", "--scheduler", "tcp://a:1"], "workers"),
        (["study.yaml", "--dry-run", "--workers", "2", "--scheduler", "tcp://a:1"], "workers"),
        (["broken.yaml", "-o", "out"], "vary.momentun.2"),
        (["odd.yaml", "-o", "out"], "urdf"),
    ],
)
def test_invalid_input_is_exit_code_2_with_the_key(words, key, folder):
    text = write_study(folder, RANDOM, base=SHORT, cases=3).read_text()
    (folder / "broken.yaml").write_text(text.replace("momentum", "momentun"))
    (folder / "odd.yaml").write_text(text.replace("base.yaml", "far.yaml"))
    (folder / "taken.h5").write_text("the only copy")
    (folder / "branch.yaml").write_text(f"{text}start: {{branch: 99}}\n")
    base = (folder / "base.yaml").read_text()
    (folder / "far.yaml").write_text(base.replace("planar_3dof.urdf", "bad.urdf"))
    (folder / "bad.urdf").write_text("<robot><link")
    assert error("batch", *words)["key"] == key


LISTENING = 0x10000
"""Flag of a socket that accepts connections, in /proc/net/unix."""


@pytest.fixture
def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers find this module, whose functions are their work."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2])


def kill_at(study: PortableStudy, number: int) -> int:
    """The work of a run; that of run 5 kills its process."""
    if number == 5:
        os._exit(9)
    return number


def threads_of(study: PortableStudy, number: int) -> set[int]:
    """Numbers of threads of the libraries for linear algebra in a worker."""
    import threadpoolctl

    return {pool["num_threads"] for pool in threadpoolctl.threadpool_info()}


@pytest.mark.slow
@pytest.mark.usefixtures("importable")
def test_a_run_that_kills_its_process_is_named_and_no_other_is_lost(tmp_path: Path) -> None:
    study = PortableStudy(a_study(tmp_path))
    found = dict(completed_in_pool(kill_at, study, range(FEW + 8), 2))
    assert found == {number: None if number == 5 else number for number in range(FEW + 8)}


@pytest.mark.slow
@pytest.mark.usefixtures("importable")
def test_a_worker_computes_on_one_thread_and_imports_nothing_from_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "multiprocessing.py").write_text("open('imported', 'w')")
    study = PortableStudy(a_study(tmp_path))
    monkeypatch.chdir(tmp_path)
    found = dict(completed_in_pool(threads_of, study, range(FEW + 1), 1))
    assert len(found) == FEW + 1
    assert set().union(*filter(None, found.values())) == {1}
    assert not (tmp_path / "imported").exists()
    assert "PYTHONSAFEPATH" not in os.environ


@pytest.mark.slow
@pytest.mark.usefixtures("kernels")
def test_workers_that_end_as_they_start_are_an_input_error(tmp_path: Path) -> None:
    """As those of a script that begins its study again when a worker imports it."""
    file = write_study(tmp_path, PATHS, base=SHORT, cases=500)
    words = ["batch", str(file), "-o", str(tmp_path / "out")]
    script = tmp_path / "script.py"
    script.write_text(f"from freefloat.cli.app import app\napp({words})\n")
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "freefloat: workers: " in done.stderr


def sockets(processes: list[psutil.Process]) -> list[str]:
    """Sockets of processes that accept connections."""
    found, unix = [], set()
    for line in Path("/proc/net/unix").read_text().splitlines()[1:]:
        words = line.split()
        if int(words[3], 16) & LISTENING:
            unix.add(f"socket:[{words[6]}]")
    for process in processes:
        found += [str(entry) for entry in process.net_connections("inet")]
        for file in Path(f"/proc/{process.pid}/fd").iterdir():
            found += [str(file)] if os.readlink(file) in unix else []
    return found


@pytest.mark.slow
@pytest.mark.usefixtures("kernels")
def test_no_process_of_a_study_has_a_listening_socket(tmp_path: Path) -> None:
    file = write_study(tmp_path, PATHS, base=SHORT, cases=500, files="all")
    command = [sys.executable, "-m", "freefloat", "batch", str(file), "-o", str(tmp_path / "out")]
    process = subprocess.Popen(
        [*command, "--workers", "2", "--quiet"], stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        begin = time.monotonic()
        while not list(tmp_path.glob("out/cases/0*.h5")):
            assert process.poll() is None
            assert time.monotonic() - begin < 180.0
            time.sleep(0.05)
        tree = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
        tree = [entry for entry in tree if entry.status() != psutil.STATUS_ZOMBIE]
        assert sum("spawn_main" in " ".join(entry.cmdline()) for entry in tree) == 2
        assert sockets(tree) == []
    finally:
        process.kill()
        process.communicate()
    assert psutil.wait_procs(tree, timeout=60)[1] == []  # the death of the command ends all
