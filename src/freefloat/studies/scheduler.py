"""Connection to a Dask scheduler, whose workers execute the runs of a study."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version

from distributed import Client, Security
from distributed.comm.addressing import get_address_host_port
from distributed.comm.core import connect

from freefloat.errors import InputError

_TIMEOUT = 10.0
"""Time to wait for a scheduler and its first worker [s]."""


@contextmanager
def remote_client(scheduler: str) -> Iterator[Client]:
    """Connect to a scheduler.

    Raises:
        InputError: If it does not answer, is lost, or lacks workers with this version.
    """
    accepted = "the address of a running Dask scheduler with workers, such as tcp://host:8786"
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    expected = version("freefloat")
    try:
        asyncio.run(_await_answer(scheduler))
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


async def _await_answer(scheduler: str) -> None:
    """Connect once; a client of an invalid address, or of a server that is silent, never ends."""
    get_address_host_port(scheduler)
    arguments = Security().get_connection_args("client")
    try:
        comm = await asyncio.wait_for(connect(scheduler, _TIMEOUT, **arguments), _TIMEOUT)
    except TimeoutError:
        raise OSError(f"it does not answer within {_TIMEOUT:g} s") from None
    except Exception as error:  # distributed raises errors of many kinds if another server answers
        raise OSError(str(error) or type(error).__name__) from None
    comm.abort()
