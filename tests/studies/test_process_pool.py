"""Processes in which runs are executed: without sockets, and ended with the command."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from freefloat.studies.portable import PortableStudy
from freefloat.studies.process_pool import FEW, completed_in_pool
from tests.example_studies import SHORT, a_study, write_study

PATHS = {"path.polynomial.y.1": {"uniform": [0.01, 0.0101]}}
"""Runs that no ensemble represents."""
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
        assert sum("spawn_main" in " ".join(entry.cmdline()) for entry in tree) == 2
        assert sockets(tree) == []
    finally:
        process.kill()
        process.communicate()
    assert psutil.wait_procs(tree, timeout=60)[1] == []  # the death of the command ends all
