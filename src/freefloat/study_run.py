"""Cases on Dask: on workers of our own, or on those of a scheduler that is there already."""

from __future__ import annotations

import logging
import os
import shutil
import signal
import time
import uuid
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from importlib import metadata
from multiprocessing import resource_tracker
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

import dask
from distributed import (
    Client,
    Future,
    KilledWorker,
    LocalCluster,
    WorkerPlugin,
    get_worker,
)
from distributed.client import ClosedClientError
from distributed.comm.core import CommClosedError
from distributed.utils import LoopRunner
from tornado.ioloop import IOLoop

from freefloat.case_result import CaseResult, error_row
from freefloat.errors import InputError
from freefloat.study import Study
from freefloat.study_files import StudyFiles

RETRIES = 2
"""How often a case is tried again after its worker died."""
_PATIENCE = 10.0
"""Seconds to wait for a scheduler, and for the first of its workers."""
_FRESH = 5.0
"""Seconds for which the number of workers is believed."""
_DEAD = 300.0
"""Seconds without any worker after which none is waited for any more."""
_ATTEMPTS = 5
"""How often the study is sent while workers come and go."""
_QUIET = logging.CRITICAL + 1
_LOGGER = "distributed"
_CONFIG: dict[str, Any] = {
    "distributed.scheduler.allowed-failures": RETRIES,
    "distributed.worker.memory.target": False,  # cases keep nothing that could be put on disk
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    "distributed.worker.profile.enabled": False,  # a hundred looks a second, each stops the case
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.scheduler.work-stealing": False,
    "distributed.scheduler.active-memory-manager.start": False,
    "distributed.nanny.pre-spawn-environ.NUMBA_NUM_THREADS": "1",
    "distributed.nanny.pre-spawn-environ.OPENBLAS_NUM_THREADS": "1",
    "distributed.nanny.pre-spawn-environ.OMP_NUM_THREADS": "1",
    "distributed.nanny.pre-spawn-environ.MKL_NUM_THREADS": "1",
    "distributed.deploy.lost-worker-timeout": "1 day",  # it is replaced, however busy the machine
    "logging.distributed": "critical",
}


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0))


class _StudyPlugin(WorkerPlugin):
    """A study and its files, sent to every worker once and unpacked in its folder."""

    def __init__(self, name: str, study: Study, files: StudyFiles, own: bool) -> None:
        self.name, self._study, self._files, self._own = name, study, files, own

    def setup(self, worker: Any) -> None:
        """Unpack the files on a worker that joins."""
        from freefloat.case import CaseRunner  # takes a second: the coordinator does without it

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
    here = _own_cluster(count) if scheduler is None else _cluster_at(scheduler)
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


@contextmanager
def _own_cluster(workers: int) -> Iterator[Client]:
    """Processes on this machine with one thread each, reachable from this machine alone."""
    with (
        dask.config.set(_CONFIG),
        _silent(),
        _deaf_loop() as loop,
        _started(workers, loop) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        cluster.scheduler.http_server.stop()
        try:
            yield client
        finally:
            _kill(cluster)


@contextmanager
def _deaf_loop() -> Iterator[IOLoop]:
    """A loop whose thread, and the processes that it starts, do not hear Ctrl-C: we do."""
    resource_tracker.ensure_running()  # started later it would open that thread's ears
    heard = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        runner = LoopRunner()
        runner.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, heard)
    try:
        yield runner.loop
    finally:
        runner.stop()


def _started(workers: int, loop: IOLoop, more: int = RETRIES) -> LocalCluster:
    """Such processes; once more from the beginning where one of them dies before it is ready."""
    try:
        return LocalCluster(
            n_workers=workers, threads_per_worker=1, host="127.0.0.1", silence_logs=_QUIET,
            loop=loop, dashboard_address="127.0.0.1:0", scheduler_kwargs={"dashboard": False},
        )  # fmt: skip
    except (OSError, RuntimeError) as error:
        if more == 0:
            problem = f"they cannot be started ({error.__cause__ or error})"
            raise InputError("workers", problem, "a machine with room for them") from None
    except KeyboardInterrupt:  # of half a cluster Dask would take leave with tracebacks
        logging.getLogger("asyncio").setLevel(_QUIET)
        for cluster in list(LocalCluster._instances):
            cluster.shutdown_on_close = False
        raise
    return _started(workers, loop, more - 1)


def _kill(cluster: LocalCluster) -> None:
    """End the workers now: what they are at is not wanted any more."""
    for nanny in list(cluster.workers.values()):
        nanny.close_gracefully()  # so that it starts no other
        pid = nanny.pid
        if pid is not None:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)


@contextmanager
def _cluster_at(address: str) -> Iterator[Client]:
    """The workers of somebody else's scheduler."""
    accepted = "the address of a running Dask scheduler with workers, such as tcp://host:8786"
    with _silent():
        try:
            client = Client(address, timeout=_PATIENCE, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            problem = f"{address}: {str(error) or type(error).__name__}"
            raise InputError("scheduler", problem, accepted) from None
        with client:
            try:
                client.wait_for_workers(1, timeout=_PATIENCE)
            except TimeoutError:
                problem = f"{address} has no workers"
                raise InputError("scheduler", problem, f"dask worker {address}") from None
            _refuse_other_versions(client)
            yield client


def _refuse_other_versions(client: Client) -> None:
    own = metadata.version("freefloat")
    found = client.run(metadata.version, "freefloat", on_error="return")
    for worker, theirs in found.items():
        if isinstance(theirs, OSError):  # it is gone
            continue
        if theirs != own:
            told = f"freefloat {theirs}" if isinstance(theirs, str) else "no freefloat"
            problem = f"worker {worker} has {told}"
            raise InputError("scheduler", problem, f"workers that have freefloat {own} installed")


@contextmanager
def _silent() -> Iterator[None]:
    """Keep Dask's own log to itself: what matters is told in rows and errors."""
    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] == _LOGGER]
    loggers = [logging.getLogger(name) for name in (_LOGGER, *names)]  # some have their own levels
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(_QUIET)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
