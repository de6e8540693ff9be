"""Tasks on Dask workers, on this machine or those of a scheduler."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from typing import Any, TypeVar

from distributed import KilledWorker, as_completed, get_worker

from freefloat.studies.chunks import computed
from freefloat.studies.columns import Columns
from freefloat.studies.dask_clients import local_client, remote_client
from freefloat.studies.ensembles import Chunk
from freefloat.studies.portable import PortableStudy

Task = TypeVar("Task")
Result = TypeVar("Result")


def completed_tasks(
    work: Callable[[PortableStudy, Task], Result],
    study: PortableStudy,
    tasks: Iterable[Task],
    workers: int | None,
    scheduler: str | None = None,
) -> Generator[tuple[Task, Result | None]]:
    """Yield tasks of a study and their results as they are completed, None if that kills workers.

    The scheduler has as many tasks at a time as there are threads, of chunks one for each worker
    and one more. A task whose worker dies is repeated.

    Args:
        work: What a worker does with the study and a task.
        study: The study, which workers receive once.
        tasks: The tasks.
        workers: Number of processes on this machine.
        scheduler: Address of a scheduler whose workers are used instead.

    Raises:
        InputError: If the scheduler does not answer, is lost, or lacks workers with this version.
    """
    client_of = local_client(workers or 1) if scheduler is None else remote_client(scheduler)
    with client_of as client:
        shared = client.submit(_same, study, pure=False)  # computed again if its worker dies
        waiting = iter(tasks)
        submitted: dict[Any, Task] = {}
        completed = as_completed(loop=client.loop)

        def submit() -> None:
            threads = client.nthreads().values()
            places = len(threads) + 1 if work is computed_by_worker else sum(threads)
            while len(submitted) < max(1, places):
                try:
                    task = next(waiting)
                except StopIteration:
                    return
                future = client.submit(work, shared, task, pure=False)
                submitted[future.key] = task
                completed.add(future)

        submit()
        for future in completed:
            task = submitted.pop(future.key)
            try:
                result = future.result()
            except KilledWorker:
                result = None
            del future  # its result is released
            submit()
            yield task, result


def _same(study: PortableStudy) -> PortableStudy:
    return study


def computed_by_worker(study: PortableStudy, chunk: Chunk) -> Columns:
    """Compute the runs of a chunk on the threads of this worker."""
    return computed(study, chunk, get_worker().state.nthreads)
