"""Runs executed side by side by Dask workers, on this machine or those of a scheduler."""

from __future__ import annotations

import logging
import signal
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import dask
from distributed import Client, KilledWorker, LocalCluster, WorkerPlugin, as_completed

from freefloat.errors import InputError
from freefloat.studies.run import Run, RunResult, error_result, execute

_RETRIES = 2
"""How often a run is repeated after the death of its worker."""
_TIMEOUT = 10.0
"""Time to wait for a scheduler and its first worker [s]."""
_CONFIG: dict[str, Any] = {
    "distributed.scheduler.allowed-failures": _RETRIES,
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
    with _client(workers, scheduler) as client:
        waiting, submitted, completed = iter(runs), dict[Any, Run](), as_completed(loop=client.loop)

        def submit() -> None:
            while len(submitted) < max(1, sum(client.nthreads().values())):
                run = next(waiting, None)
                if run is None:
                    return
                future = client.submit(execute, run, pure=False, retries=_RETRIES)
                submitted[future.key] = run
                completed.add(future)

        submit()
        for future in completed:
            run = submitted.pop(future.key)
            result = _result(run, future)
            del future
            submit()
            yield result


def _result(run: Run, future: Any) -> RunResult:
    try:
        result: RunResult = future.result()
    except (OSError, CancelledError):  # the connection is lost
        raise
    except KilledWorker:
        return error_result(run, f"worker died, also in {_RETRIES} repetitions")
    except Exception as error:
        return error_result(run, error)
    return result


class _IgnoreInterrupts(WorkerPlugin):
    """Leaves Ctrl-C, which a terminal sends to all processes, to this process."""

    def setup(self, worker: Any) -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Client]:
    if scheduler is None:
        with (
            dask.config.set(_CONFIG),
            LocalCluster(
                n_workers=workers, threads_per_worker=1, memory_limit=0, dashboard_address=None,
                silence_logs=logging.CRITICAL,
            ) as cluster,
            Client(cluster, set_as_default=False) as client,
        ):  # fmt: skip
            client.register_plugin(_IgnoreInterrupts())
            yield client
        return
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
    here = version("freefloat")
    try:
        versions = client.run(version, "freefloat")
    except PackageNotFoundError:
        versions = {"": "none"}
    if set(versions.values()) != {here}:
        problem = f"its workers have version {', '.join(sorted(set(versions.values())))}"
        raise InputError("scheduler", problem, f"workers with freefloat {here} installed")
