"""Cases side by side on Dask: sent, awaited, and taken up again where a worker dies."""

from __future__ import annotations

import shutil
import signal
import time
import uuid
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from distributed import Client, Future, KilledWorker, WorkerPlugin, get_worker
from distributed.client import ClosedClientError
from distributed.comm.core import CommClosedError

from freefloat.errors import InputError
from freefloat.studies.cluster import cluster_at, cores, own_cluster
from freefloat.studies.files import StudyFiles
from freefloat.studies.result import CaseResult, error_row
from freefloat.studies.study import Study

_FRESH = 5.0
"""Seconds for which the number of workers is believed."""
_DEAD = 300.0
"""Seconds without any worker after which none is waited for any more."""
_ATTEMPTS = 5
"""How often the study is sent while workers come and go."""


class _StudyPlugin(WorkerPlugin):
    """A study and its files, sent to every worker once and unpacked in its folder."""

    def __init__(self, name: str, study: Study, files: StudyFiles, own: bool) -> None:
        self.name, self._study, self._files, self._own = name, study, files, own

    def setup(self, worker: Any) -> None:
        """Unpack the files on a worker that joins."""
        # it takes a second to import: the coordinator does without it
        from freefloat.studies.run import CaseRunner

        if self._own:  # Ctrl-C is the coordinator's business
            with suppress(ValueError):
                signal.signal(signal.SIGINT, signal.SIG_IGN)
        self._folder = Path(worker.local_directory).absolute() / self.name
        self.runner = CaseRunner(self._study, self._files.unpack(self._folder))

    def teardown(self, worker: Any) -> None:
        """Leave nothing behind."""
        shutil.rmtree(self._folder, ignore_errors=True)


def _run_case(name: str, number: int) -> CaseResult:
    """On a worker: run one case of the study of that name."""
    plugin: Any = get_worker().plugins[name]
    result: CaseResult = plugin.runner.run(number)
    return result


def run_cases(
    study: Study,
    files: StudyFiles,
    numbers: Sequence[int],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Generator[CaseResult]:
    """Run cases side by side, one on each worker's thread, and give them as they finish.

    No more are sent than there are threads: a worker that dies takes one case with it. Closing the
    generator ends its own workers at once, whatever they are at.

    Args:
        study: The study.
        files: Its files; workers need no others.
        numbers: Of the cases, run in this order.
        workers: How many processes to start here; the cores there are when left out.
        scheduler: Address of a Dask scheduler whose workers are used instead, ``tcp://...``.

    Raises:
        InputError: If the scheduler is not there, or has no workers with this freefloat.
    """
    if not numbers:
        return
    name = f"freefloat-{uuid.uuid4().hex}"
    count = min(workers or cores(), len(numbers))
    here = own_cluster(count) if scheduler is None else cluster_at(scheduler)
    with _loss_told(), here as client:
        _send(client, _StudyPlugin(name, study, files, scheduler is None))
        try:
            yield from _finished(client, name, numbers)
        finally:
            if scheduler is not None:
                with suppress(Exception):  # a scheduler that is gone needs no farewell
                    client.unregister_worker_plugin(name)


def _send(client: Client, plugin: _StudyPlugin) -> None:
    """Give the study to all workers; those that join later get it from the scheduler."""
    for _ in range(_ATTEMPTS):
        try:
            client.register_plugin(plugin, name=plugin.name)
            return
        except CommClosedError:  # a worker died with it in its hands
            time.sleep(0.2)
        except OSError as error:
            problem = f"one cannot keep the files of the study: {error.strerror}"
            accepted = "workers whose temporary folder may be written to and has room"
            raise InputError("workers", problem, accepted) from None
    raise CommClosedError("the study cannot be sent")


@contextmanager
def _loss_told() -> Iterator[None]:
    """Tell of a scheduler that is gone in our own words."""
    try:
        yield
    except (CommClosedError, ClosedClientError, CancelledError):
        raise InputError(
            "scheduler", "the connection to it was lost",
            "a scheduler that stays; the same command goes on where this one ended",
        ) from None  # fmt: skip


def _finished(client: Client, name: str, numbers: Sequence[int]) -> Iterator[CaseResult]:
    """Results as they come, a new case sent for each before it is written."""
    waiting, flying, ended = iter(numbers), dict[int, Future[Any]](), SimpleQueue[int]()
    threads = _Threads(client)

    def send() -> None:
        while len(flying) < threads.count():
            number = next(waiting, None)
            if number is None:
                return
            future = client.submit(_run_case, name, number, key=f"{name}-{number}", pure=False)
            flying[number] = future
            await_end(number)

    def await_end(number: int) -> None:
        flying[number].add_done_callback(lambda _: ended.put(number))

    send()
    while flying:
        try:
            number = ended.get(timeout=_FRESH)
        except Empty:
            threads.refuse_none()
            continue
        result = _result(flying[number], number)
        if result is None:
            await_end(number)
            continue
        del flying[number]  # its worker may forget it now
        send()
        yield result


class _Threads:
    """How many cases can run at once."""

    def __init__(self, client: Client) -> None:
        self._client, self._count = client, 1
        self._asked, self._alive = -_FRESH, time.monotonic()

    def count(self) -> int:
        """The number of threads, 1 at least."""
        now = time.monotonic()
        if now - self._asked > _FRESH:
            with suppress(OSError):  # a scheduler that is gone is told of with the results
                self._count = sum(self._client.nthreads().values())
            self._asked = now
            self._alive = now if self._count else self._alive
        return max(1, self._count)

    def refuse_none(self) -> None:
        """Give up where there has been no worker for long."""
        self.count()
        if time.monotonic() - self._alive > _DEAD:
            raise InputError(
                "workers", f"there has been none for {_DEAD:.0f} s",
                "workers that stay; the same command goes on where this one ended",
            )  # fmt: skip


def _result(future: Future[Any], number: int) -> CaseResult | None:
    """What became of a case; None where its worker died with it, and it is run again."""
    try:
        found: CaseResult = future.result(timeout=_FRESH)
    except TimeoutError:
        return None
    except KilledWorker as error:  # its number is the scheduler's, which may be somebody else's
        cause = f"worker died, also when the case was tried {error.allowed_failures} times more"
        return CaseResult(error_row(number, cause))
    except (CommClosedError, ClosedClientError, CancelledError):
        raise
    except Exception as error:  # what the worker could not even begin
        return CaseResult(error_row(number, f"{type(error).__name__}: {error}"))
    return found
