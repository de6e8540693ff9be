"""Clients of Dask: of workers on this machine, or of a scheduler elsewhere."""

from __future__ import annotations

import asyncio
import logging
import struct
from collections.abc import Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import dask
from distributed import Client, LocalCluster, Security
from distributed.comm.addressing import get_address_host_port
from distributed.comm.core import connect

from freefloat.errors import InputError
from freefloat.studies.interrupts import interrupts_deferred

_TIMEOUT = 10.0
"""Time to wait for a scheduler and its first worker [s]."""
REPETITIONS = 2
"""Number of repetitions of a run after its worker was killed."""
_CONFIG: dict[str, Any] = {
    "distributed.scheduler.allowed-failures": REPETITIONS,
    "distributed.scheduler.worker-ttl": None,  # compiled code may hold the interpreter for long
    "distributed.deploy.lost-worker-timeout": "1 day",  # restarts are slow on a busy machine
    "distributed.worker.profile.enabled": False,
}


@contextmanager
def local_client(workers: int) -> Iterator[Client]:
    """Start workers on this machine."""
    _silence()
    with dask.config.set(_CONFIG), ExitStack() as stack:
        with interrupts_deferred():
            cluster = LocalCluster(
                n_workers=workers, threads_per_worker=1, memory_limit=0, dashboard_address=None,
                silence_logs=logging.CRITICAL, scheduler_kwargs={"dashboard_address": ":0"},
            )  # fmt: skip
            stack.enter_context(cluster)
            client = stack.enter_context(Client(cluster, set_as_default=False))
        yield client


@contextmanager
def remote_client(scheduler: str) -> Iterator[Client]:
    """Connect to a scheduler.

    Raises:
        InputError: If it does not answer, is lost, or lacks workers with this version.
    """
    accepted = "the address of a running Dask scheduler with workers, such as tcp://host:8786"
    _silence()
    expected = version("freefloat")
    try:
        with ThreadPoolExecutor(1) as thread:  # a notebook's thread has a running event loop
            thread.submit(asyncio.run, _await_answer(scheduler)).result()
        with Client(scheduler, timeout=_TIMEOUT, set_as_default=False) as client:
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
        problem = f"{scheduler}: {str(error) or type(error).__name__}"
        raise InputError("scheduler", problem, accepted) from None


def _silence() -> None:
    """Silence Dask in this process: an interruption ends its connections in any order.

    A cluster that closes restores its ``silence_logs`` before its last connections end.
    """
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)


async def _await_answer(scheduler: str) -> None:
    """Connect once; a client of an invalid address, or of a server that is silent, never ends."""
    get_address_host_port(scheduler)
    arguments = Security().get_connection_args("client")
    try:
        comm = await asyncio.wait_for(connect(scheduler, _TIMEOUT, **arguments), _TIMEOUT)
    except TimeoutError:
        raise OSError(f"it does not answer within {_TIMEOUT:g} s") from None
    except (MemoryError, struct.error) as error:  # bytes of another server, read as frames
        raise OSError(str(error)) from None
    comm.abort()
