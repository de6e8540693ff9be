"""Independent chunks of a computation on several threads."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed

Progress = Callable[[float], None]
"""Called with the fraction done, in [0, 1], during a long computation."""


def available_cores() -> int:
    """The number of cores on which this process may run."""
    if hasattr(os, "sched_getaffinity"):  # not on macOS and Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_chunks(
    work: Callable[[int], None], chunks: range, threads: int, progress: Progress | None = None
) -> None:
    """Process chunks on several threads; an interruption cancels pending chunks."""
    report = progress or (lambda fraction: None)
    if len(chunks) < 2 or threads == 1:
        for done, chunk in enumerate(chunks, 1):
            work(chunk)
            report(done / len(chunks))
        return
    with ThreadPoolExecutor(threads) as pool:
        futures = [pool.submit(work, chunk) for chunk in chunks]
        try:
            for done, future in enumerate(as_completed(futures), 1):
                future.result()
                report(done / len(futures))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
