"""Ctrl-C, and modules in the current folder, while processes start."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

_SAFE_PATH = "PYTHONSAFEPATH"


@contextmanager
def isolated_starts() -> Iterator[None]:
    """Start processes that import nothing from the current folder before this one's modules.

    They begin with ``python -c``, which would import a ``multiprocessing.py`` that lies there.
    """
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        resource_tracker.ensure_running()
        yield
    finally:
        if before is None:
            os.environ.pop(_SAFE_PATH, None)
        else:
            os.environ[_SAFE_PATH] = before


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
