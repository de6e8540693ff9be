"""Tasks of a study on the workers of a Dask scheduler."""

from __future__ import annotations

import asyncio
import logging
import struct
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from distributed import Client, KilledWorker, Security, as_completed, get_worker
from distributed.comm.addressing import get_address_host_port
from distributed.comm.core import connect

from freefloat.errors import InputError
from freefloat.studies.columns import Columns
from freefloat.studies.disturbances import Chunk
from freefloat.studies.ensembles import computed
from freefloat.studies.workers import PortableStudy, Result, Task

_TIMEOUT = 10.0
"""Time to wait for a scheduler and its first worker [s]."""


def completed_by_scheduler(
    work: Callable[[PortableStudy, Task], Result],
    study: PortableStudy,
    tasks: Iterable[Task],
    address: str,
) -> Generator[tuple[Task, Result | None]]:
    """Yield tasks of a study and their results as they are completed, None if that kills workers.

    The scheduler has as many tasks at a time as there are threads, of chunks one for each worker
    and one more. It repeats a task whose worker dies.

    Args:
        work: What a worker does with the study and a task.
        study: The study, which workers receive once.
        tasks: The tasks.
        address: Address of the scheduler. Certificates for ``tls://`` come from Dask's
            configuration.

    Raises:
        InputError: If the scheduler does not answer, is lost, or lacks workers with this version.
    """
    with _connected(address) as client:
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


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    """Connect to a scheduler.

    Raises:
        InputError: If it does not answer, is lost, or lacks workers with this version.
    """
    accepted = "the address of a running Dask scheduler with workers, such as tls://host:8786"
    for name in ("distributed", "distributed.client"):  # interrupted, connections end in any order
        logging.getLogger(name).setLevel(logging.CRITICAL)
    expected = version("freefloat")
    try:
        security = Security()
        with ThreadPoolExecutor(1) as thread:  # a notebook's thread has a running event loop
            thread.submit(asyncio.run, _await_answer(address, security)).result()
        with Client(address, security=security, timeout=_TIMEOUT, set_as_default=False) as client:
            client.wait_for_workers(1, timeout=_TIMEOUT)
            try:
                versions = set(client.run(version, "freefloat").values())
            except PackageNotFoundError:
                versions = {"none"}
            if versions != {expected}:
                accepted = f"workers with freefloat {expected} installed"
                raise ValueError(f"its workers have {', '.join(sorted(versions))}")
            yield client
    except (OSError, ValueError, TypeError, CancelledError) as error:
        problem = f"{address}: {str(error) or type(error).__name__}"
        raise InputError("scheduler", problem, accepted) from None


async def _await_answer(address: str, security: Security) -> None:
    """Connect once; a client of an invalid address, or of a server that is silent, never ends."""
    get_address_host_port(address)
    arguments = security.get_connection_args("client")
    try:
        comm = await asyncio.wait_for(connect(address, _TIMEOUT, **arguments), _TIMEOUT)
    except TimeoutError:
        raise OSError(f"it does not answer within {_TIMEOUT:g} s") from None
    except (MemoryError, struct.error, RuntimeError) as error:
        # bytes of another server, read as frames; or encryption that is required
        raise OSError(str(error)) from None
    comm.abort()
