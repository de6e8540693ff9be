"""Resources of this process: chunks of a computation on threads, memory, folder, children."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import resource_tracker

from freefloat.errors import InputError

Progress = Callable[[float], None]
"""Called with the fraction done, in [0, 1], during a long computation."""
_WAIT = 0.2
"""Longest time between two checks of signals [s]."""
_starting = threading.RLock()
"""Held while the environment is that of started processes."""
_SETTINGS = {"PYTHONSAFEPATH": "1", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""Environment of started processes: ``python -c`` imports nothing from the current folder; threads
of BLAS would wait for one another longer than small matrices take."""


def step_of(progress: Progress | None, first: float, last: float) -> Progress:
    """The progress of a step that takes a computation from the fraction ``first`` to ``last``."""

    def report(done: float) -> None:
        if progress is not None:
            progress(first + (last - first) * done)

    return report


def available_cores() -> int:
    """The number of cores on which this process may run."""
    if hasattr(os, "sched_getaffinity"):  # not on macOS and Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def working_folder() -> str:
    """Name of the working folder; empty where that was removed."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        return ""


def require_memory(key: str, count: int, size: int, limit: float = 4e9) -> None:
    """Raise an InputError if a request needs more than a limit or a quarter of the memory.

    Args:
        key: The argument that asks for items.
        count: Number of items.
        size: Estimated memory of an item [bytes].
        limit: Largest memory of all items [bytes].
    """
    installed = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    usable = min(installed / 4.0, limit)
    most = int(usable // size)
    if count > most:
        amounts = min(count, 10**30) * size, usable
        needed, free = (f"{amount / 1e9:,.1f} GB" for amount in amounts)
        problem = f"{count:,} would take {needed} of memory, {free} may be used"
        raise InputError(key, problem, f"at most {most:,}")


def run_chunks(
    work: Callable[[int], None], chunks: range, threads: int, progress: Progress | None = None
) -> None:
    """Process chunks on several threads; an interruption cancels pending chunks.

    The main thread only waits: compiled code and the compiler would not let it be interrupted. A
    chunk being processed then is not waited for; its results are discarded.
    """
    report = progress or (lambda fraction: None)
    single = len(chunks) < 2 or threads == 1
    if single and threading.current_thread() is not threading.main_thread():
        for done, chunk in enumerate(chunks, 1):
            work(chunk)
            report(done / len(chunks))
        return
    pool = ThreadPoolExecutor(threads)
    try:
        pending = {pool.submit(work, chunk) for chunk in chunks}
        while pending:  # a signal just before an endless wait would not end it
            finished, pending = wait(pending, _WAIT, FIRST_COMPLETED)
            for future in finished:
                future.result()
            if finished:
                report(1.0 - len(pending) / len(chunks))
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def isolated_starts() -> Iterator[None]:
    """Start processes that import nothing from the current folder and compute on one thread.

    They begin with ``python -c``, which would import a ``multiprocessing.py`` that lies there.
    """
    with _starting:
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
