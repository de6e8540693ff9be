"""Processes that work on studies: of our own on this machine, or those of a Dask scheduler."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import metadata
from multiprocessing import resource_tracker
from typing import Any

import dask
import psutil
from distributed import Client, LocalCluster
from distributed.utils import LoopRunner
from tornado.ioloop import IOLoop

from freefloat.errors import InputError

RETRIES = 2
"""How often a case is tried again after its worker died."""
_PATIENCE = 10.0
"""Seconds to wait for a scheduler, and for the first of its workers."""
_QUIET = logging.CRITICAL + 1
_LOGGER = "distributed"
_CONFIG: dict[str, Any] = {
    "distributed.scheduler.allowed-failures": RETRIES,
    "distributed.worker.memory.target": False,  # cases keep nothing that could be put on disk
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    "distributed.worker.profile.enabled": False,  # a hundred looks a second, each stops the case
    "distributed.admin.tick.interval": "1s",  # else fifty interruptions a second
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.memory.monitor-interval": "1s",
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


@contextmanager
def own_cluster(workers: int) -> Iterator[Client]:
    """Processes on this machine with one thread each, reachable from this machine alone.

    Leaving ends them at once, whatever they are at. Dask's own watching is turned down: with as
    many workers as cores it takes its time from the cases.

    Args:
        workers: How many.

    Raises:
        InputError: If they cannot be started.
    """
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
    before = set(_spawned())
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
        for child in set(_spawned()) - before:  # begun so late that no nanny knows of it
            with suppress(psutil.Error):
                child.kill()


def _spawned() -> list[psutil.Process]:
    """Processes that multiprocessing started from this one."""
    found = []
    for child in psutil.Process().children():
        with suppress(psutil.Error):
            if "--multiprocessing-fork" in child.cmdline():
                found.append(child)
    return found


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
def cluster_at(address: str) -> Iterator[Client]:
    """The workers of somebody else's scheduler.

    Args:
        address: Of the scheduler, ``tcp://...``.

    Raises:
        InputError: If it is not there, or has no workers with this freefloat.
    """
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
