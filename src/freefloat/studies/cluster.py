"""Runs executed side by side by Dask workers, on this machine or those of a scheduler."""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from importlib.metadata import PackageNotFoundError, version
from multiprocessing import resource_tracker
from typing import Any

import dask
from distributed import Client, KilledWorker, LocalCluster, as_completed

from freefloat.errors import InputError
from freefloat.studies.run import Run, RunResult, error_result, execute

_REPETITIONS = 2
"""How often a run is repeated after the death of its worker."""
_TIMEOUT = 10.0
"""Time to wait for a scheduler and its first worker [s]."""
_CONFIG: dict[str, Any] = {
    "distributed.scheduler.allowed-failures": _REPETITIONS,
    "distributed.scheduler.worker-ttl": None,  # compiled code may hold the interpreter for long
    "distributed.deploy.lost-worker-timeout": "1 day",  # restarts are slow on a busy machine
    "distributed.worker.profile.enabled": False,
}


def execute_all(
    runs: Iterable[Run], *, workers: int = 1, scheduler: str | None = None
) -> Generator[RunResult]:
    """Execute runs side by side and yield their results as they finish.

    As many runs are submitted at a time as there are threads. A run whose worker dies is repeated.

    Args:
        runs: The runs.
        workers: Number of processes started on this machine.
        scheduler: Address of a Dask scheduler whose workers are used instead, ``tcp://...``.

    Raises:
        InputError: If the scheduler does not answer, is lost, or lacks workers with this version.
    """
    with _local_client(workers) if scheduler is None else _remote_client(scheduler) as client:
        waiting, submitted, completed = iter(runs), dict[Any, Run](), as_completed(loop=client.loop)

        def submit() -> None:
            while len(submitted) < max(1, sum(client.nthreads().values())):
                run = next(waiting, None)
                if run is None:
                    return
                future = client.submit(execute, run, pure=False)
                submitted[future.key] = run
                completed.add(future)

        submit()
        for future in completed:
            result = _result(submitted.pop(future.key), future)
            del future  # its result is released
            submit()
            yield result


def _result(run: Run, future: Any) -> RunResult:
    try:
        result: RunResult = future.result()
    except (OSError, CancelledError):  # the connection is lost
        raise
    except KilledWorker:
        return error_result(run, f"worker died, also in {_REPETITIONS} repetitions")
    except Exception as error:
        return error_result(run, error)
    return result


@contextmanager
def _local_client(workers: int) -> Iterator[Client]:
    with dask.config.set(_CONFIG), ExitStack() as stack:
        with _interrupts_deferred():
            cluster = LocalCluster(
                n_workers=workers, threads_per_worker=1, memory_limit=0, dashboard_address=None,
                silence_logs=logging.CRITICAL,
            )  # fmt: skip
            stack.enter_context(cluster)
            client = stack.enter_context(Client(cluster, set_as_default=False))
        yield client


@contextmanager
def _interrupts_deferred() -> Iterator[None]:
    """Defer Ctrl-C to the end of the block; processes started by its threads do not receive it.

    A terminal sends it to all processes, but only this one may end, and after its workers.
    """
    resource_tracker.ensure_running()  # its start would unblock the signal
    received: list[int] = []
    if main := threading.current_thread() is threading.main_thread():
        handler = signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        if main:
            signal.signal(signal.SIGINT, handler)
    if received:
        signal.raise_signal(signal.SIGINT)


@contextmanager
def _remote_client(scheduler: str) -> Iterator[Client]:
    accepted = "the address of a running Dask scheduler with workers, such as tcp://host:8786"
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        with Client(scheduler, timeout=_TIMEOUT, set_as_default=False) as client:
            client.wait_for_workers(1, timeout=_TIMEOUT)
            _check_versions(client)
            yield client
    except (OSError, ValueError, TypeError, CancelledError) as error:
        problem = f"{scheduler}: {str(error) or type(error).__name__}"
        raise InputError("scheduler", problem, accepted) from None


def _check_versions(client: Client) -> None:
    expected = version("freefloat")
    try:
        versions = set(client.run(version, "freefloat").values())
    except PackageNotFoundError:
        versions = {"none"}
    if versions != {expected}:
        problem = f"its workers have version {', '.join(sorted(versions))}"
        raise InputError("scheduler", problem, f"workers with freefloat {expected} installed")
