"""Execution of runs one by one by Dask workers, on this machine or those of a scheduler."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from typing import Any

from distributed import KilledWorker, as_completed

from freefloat.studies.clients import REPETITIONS, local_client, remote_client
from freefloat.studies.run import Run, RunResult, error_result, execute


def execute_all(
    runs: Iterable[Run], *, workers: int = 1, scheduler: str | None = None
) -> Generator[RunResult]:
    """Execute runs side by side and yield their results as they finish.

    As many runs are submitted at a time as there are threads. A run whose worker dies is repeated.

    Raises:
        InputError: If the scheduler does not answer, is lost, or lacks workers with this version.
    """
    with local_client(workers) if scheduler is None else remote_client(scheduler) as client:
        waiting = iter(runs)
        submitted: dict[Any, Run] = {}
        completed = as_completed(loop=client.loop)

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
    except KilledWorker:
        return error_result(run, f"its worker was killed, also in {REPETITIONS} repetitions")
    return result
