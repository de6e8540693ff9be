"""Cases on Dask: our own workers and others', deaths among them, the same numbers everywhere."""

from __future__ import annotations

import errno
import logging
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
from distributed import KilledWorker
from distributed.comm.core import CommClosedError

from freefloat.errors import InputError
from freefloat.studies import cluster as study_cluster
from freefloat.studies import runner as study_run
from freefloat.studies.cluster import RETRIES
from freefloat.studies.files import StudyFiles
from freefloat.studies.run import CaseRunner
from freefloat.studies.runner import run_cases
from freefloat.studies.study import Study
from tests.example_studies import SHORT, a_study

pytestmark = pytest.mark.usefixtures("kernels")

VARY = {"momentum.2": {"uniform": [-1, 1]}, "robot.scale_mass": {"uniform": [0.9, 1.1]}}


class Deadly(Study):
    """Its case 1 ends the process that runs it."""

    def document(self, number: int) -> dict[str, Any]:
        if number == 1:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().document(number)


@pytest.fixture
def scheduler() -> Iterator[str]:
    """The address of a scheduler on loopback with two workers, three processes of their own."""
    words = [sys.executable, "-m", "dask"]
    quiet = {"stderr": subprocess.PIPE, "text": True, "env": os.environ | {"PYTHONWARNINGS": ""}}
    ports = ["--host", "127.0.0.1", "--port", "0", "--dashboard-address", "127.0.0.1:0"]
    main = subprocess.Popen([*words, "scheduler", *ports, "--no-dashboard"], **quiet)
    assert main.stderr is not None
    address = next(
        found[1]
        for line in main.stderr
        if (found := re.search(r"Scheduler at: +(tcp://\S+)", line))
    )
    one = [*words, "worker", address, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
    workers = [subprocess.Popen(one, **quiet) for _ in range(2)]
    yield address
    for process in (*workers, main):
        process.kill()
        process.communicate()


def without_times(row: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in row.items() if key not in ("began", "seconds")}


def test_results_do_not_depend_on_workers_or_order(tmp_path: Path, scheduler: str) -> None:
    """The robot exists on the coordinator's side alone: the workers get what they need."""
    study = a_study(tmp_path, VARY, base=SHORT, cases=6)
    files = StudyFiles.of(study)
    runner = CaseRunner(study, files.unpack(tmp_path / "copies"))
    alone = {number: runner.run(number) for number in reversed(range(6))}
    own = run_cases(study, files, range(6), workers=2)
    others = run_cases(study, files, [5, 1, 3, 0, 4, 2], scheduler=scheduler)
    for results in (own, others):
        found = {result.row["case"]: result for result in results}
        assert sorted(found) == list(range(6))
        for number, result in found.items():
            assert result.row["verdict"] == "feasible"
            assert without_times(result.row) == without_times(alone[number].row)
            assert result.file is not None


def test_a_case_that_kills_its_worker_is_retried_and_told(tmp_path: Path) -> None:
    study = a_study(tmp_path, VARY, base=SHORT, cases=4, files=False)
    deadly = Deadly(study.source, study.content, study.base_source, study.base)
    results = run_cases(deadly, StudyFiles.of(study), range(4), workers=1)
    rows = {result.row["case"]: result.row for result in results}
    assert [rows[number]["verdict"] for number in range(4)] == [
        "feasible", "error", "feasible", "feasible",
    ]  # fmt: skip
    assert rows[1]["error"] == f"worker died, also when the case was tried {RETRIES} times more"


def test_nothing_to_do_starts_nobody(tmp_path: Path) -> None:
    study = a_study(tmp_path)
    assert list(run_cases(study, StudyFiles.of(study), [], workers=2)) == []


class Losing:
    """A client some of whose workers die while they are sent something."""

    def __init__(self, *answers: Exception | None) -> None:
        self._answers = list(answers)

    def register_plugin(self, *_: object, **__: object) -> None:
        answer = self._answers.pop(0)
        if answer is not None:
            raise answer


class Telling:
    """A client whose workers answer so when they are asked for their freefloat."""

    def __init__(self, *answers: str | Exception) -> None:
        self._answers = answers

    def run(self, *_: object, **__: object) -> dict[str, object]:
        return {f"tcp://{number}": answer for number, answer in enumerate(self._answers)}


def test_a_worker_that_dies_when_it_is_sent_the_study_stops_nobody(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("freefloat.studies.runner.time.sleep", lambda _: None)
    study = a_study(tmp_path)
    plugin = study_run._StudyPlugin("name", study, StudyFiles.of(study), own=True)
    lost, full = CommClosedError("Stream is closed"), OSError(errno.ENOSPC, "No space left")
    study_run._send(Losing(lost, lost, None), plugin)
    with pytest.raises(InputError, match=r"workers: one cannot keep .* No space left"):
        study_run._send(Losing(full), plugin)
    with pytest.raises(InputError, match="the connection to it was lost"), study_run._loss_told():
        study_run._send(Losing(*[lost] * 9), plugin)


def test_a_worker_that_dies_before_it_is_ready_is_started_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop: Any = None
    tried = []

    def fails(**keys: object) -> str:
        tried.append(keys)
        if len(tried) < patience:
            raise RuntimeError("Nanny failed to start.")
        return "cluster"

    monkeypatch.setattr("freefloat.studies.cluster.LocalCluster", fails)
    patience = RETRIES + 1
    assert study_cluster._started(2, loop) == "cluster"
    patience = 99
    with pytest.raises(InputError, match=r"workers: they cannot be started \(Nanny failed"):
        study_cluster._started(2, loop)


def test_workers_without_this_freefloat_are_refused_and_those_that_are_gone_are_not() -> None:
    own, lost = metadata.version("freefloat"), CommClosedError("Stream is closed")
    study_cluster._refuse_other_versions(Telling(own, lost))
    with pytest.raises(InputError, match="tcp://1 has no freefloat"):
        study_cluster._refuse_other_versions(Telling(own, metadata.PackageNotFoundError()))
    with pytest.raises(InputError, match=r"tcp://0 has freefloat 0\.0"):
        study_cluster._refuse_other_versions(Telling("0.0"))


def test_a_scheduler_of_others_says_how_often_it_tried(tmp_path: Path) -> None:
    class Ended:
        def result(self, timeout: float) -> None:
            raise KilledWorker("key", None, 7)

    found = study_run._result(Ended(), 3)
    assert found is not None
    assert found.row["error"] == "worker died, also when the case was tried 7 times more"


def test_what_dask_has_to_say_stays_with_it() -> None:
    """Some of its loggers have levels of their own."""
    client = logging.getLogger("distributed.client")
    client.setLevel(logging.WARNING)
    with study_cluster._silent():
        assert not client.isEnabledFor(logging.CRITICAL)
    assert client.level == logging.WARNING


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://a", "tcp://no.such.host:1"])
def test_a_scheduler_that_is_not_there_is_one_clear_error(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("freefloat.studies.cluster._PATIENCE", 1.0)
    study = a_study(tmp_path)
    with pytest.raises(InputError) as caught:
        list(run_cases(study, StudyFiles.of(study), [0], scheduler=address))
    assert caught.value.key == "scheduler"
    assert address in caught.value.problem
    assert "tcp://host:8786" in caught.value.accepted
