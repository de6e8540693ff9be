"""Environment of started processes, and Ctrl-C while they start."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

_SETTINGS = {"PYTHONSAFEPATH": "1", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""Environment of started processes: ``python -c`` imports nothing from the current folder; threads
of BLAS would wait for one another longer than small matrices take."""


@contextmanager
def isolated_starts() -> Iterator[None]:
    """Start processes that import nothing from the current folder and compute on one thread.

    They begin with ``python -c``, which would import a ``multiprocessing.py`` that lies there.
    """
    before = {name: os.environ.get(name) for name in _SETTINGS}
    os.environ.update(_SETTINGS)
    try:
        resource_tracker.ensure_running()
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Defer Ctrl-C to the end of the block; processes started in it do not receive it.

    A terminal sends it to all processes, but only this one may end, and after the others.
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
