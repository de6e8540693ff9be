"""Runs of a study in processes of this machine, which end with this one; nothing listens."""

from __future__ import annotations

import logging
import os
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from queue import SimpleQueue
from threading import Thread
from typing import TypeVar

from freefloat.errors import InputError
from freefloat.process_starts import interrupts_deferred, isolated_starts
from freefloat.studies.portable import PortableStudy

FEW = 32
"""Largest number of tasks that this process executes, too: others take seconds to start."""
Task = TypeVar("Task")
Result = TypeVar("Result")
_studies: list[PortableStudy] = []
"""In a worker, the study that it was started with."""


def completed_in_pool(
    work: Callable[[PortableStudy, Task], Result],
    study: PortableStudy,
    tasks: Sequence[Task],
    workers: int,
) -> Generator[tuple[Task, Result | None]]:
    """Yield tasks of a study and their results as they are completed.

    Where a worker dies, the tasks that were begun are repeated one at a time; the result of one
    whose worker dies again is None.

    Args:
        work: What is done with the study and a task.
        study: The study, which workers receive once.
        tasks: The tasks.
        workers: Number of processes; of few tasks this one is among them.

    Raises:
        InputError: If workers end before they have started.
    """
    waiting, few = deque(tasks), len(tasks) <= FEW
    processes = min(workers, len(tasks)) - few
    begun, _ = yield from _completed(work, study, waiting, processes, few)
    while begun:
        said = "a worker process was killed; the runs that were begun are repeated one by one"
        logging.getLogger("freefloat").warning(said)
        suspects = deque(begun)
        while suspects:
            again, started = yield from _completed(work, study, suspects, 1)
            if again and not started:
                accepted = 'a script that calls it below `if __name__ == "__main__":`'
                raise InputError("workers", "worker processes end as they start", accepted)
            yield from ((task, None) for task in again)
        begun, _ = yield from _completed(work, study, waiting, min(workers, len(waiting)))


def _completed(
    work: Callable[[PortableStudy, Task], Result],
    study: PortableStudy,
    waiting: deque[Task],
    processes: int,
    here: bool = False,
) -> Generator[tuple[Task, Result], None, tuple[list[Task], bool]]:
    """Yield waiting tasks and their results.

    Returns:
        The tasks that were begun when a worker died, and whether any worker had started.

    Args:
        work: What is done with the study and a task.
        study: The study.
        waiting: The tasks, which are removed as they are begun.
        processes: Number of workers.
        here: Whether this process executes tasks, too.
    """
    completed = SimpleQueue[tuple[Task, Result | BaseException] | None]()
    begun, missing = list[Task](), len(waiting)

    def remaining() -> Iterator[Task]:
        """Tasks that no process has begun, each for the one that takes it."""
        with suppress(IndexError):
            while True:
                yield waiting.popleft()

    def feed(pool: ProcessPoolExecutor, start: Future[None]) -> None:
        """Give a worker one task after another, in a thread."""
        if here:  # a worker that starts slowly takes no task from this process
            start.exception()
        for task in remaining():
            try:
                completed.put((task, pool.submit(_execute, work, task).result()))
            except BaseException as error:  # which the main thread raises
                completed.put((task, error))
                break
        completed.put(None)

    with _pool(study, processes) as (pool, starts):
        for start in starts:
            Thread(target=feed, args=(pool, start), daemon=True).start()
        for task in remaining() if here else ():
            yield task, work(study, task)
            missing -= 1
        active = processes
        while missing and active:
            item = completed.get()
            if item is None:
                active -= 1
                continue
            missing -= 1
            task, outcome = item
            if isinstance(outcome, BrokenExecutor):
                begun.append(task)
            elif isinstance(outcome, BaseException):
                raise outcome
            else:
                yield task, outcome
        started = any(start.done() and start.exception() is None for start in starts)
    return begun, started


@contextmanager
def _pool(
    study: PortableStudy, processes: int
) -> Iterator[tuple[ProcessPoolExecutor, list[Future[None]]]]:
    """Workers and their first tasks; they end with the block or this process, not by Ctrl-C."""
    context = get_context("spawn")
    lifeline, held = context.Pipe(duplex=False)
    starts: list[Future[None]] = []
    with isolated_starts():
        pool = ProcessPoolExecutor(
            processes or 1, context, initializer=_begin, initargs=(lifeline, study)
        )
    try:
        with isolated_starts(), interrupts_deferred():
            starts += [pool.submit(_start) for _ in range(processes)]
        yield pool, starts
    finally:
        with interrupts_deferred():
            held.close()
            pool.shutdown(cancel_futures=True)
            lifeline.close()


def _begin(lifeline: Connection, study: PortableStudy) -> None:
    """Begin a worker: one thread computes, another ends it with the process that started it."""
    Thread(target=_end_with, args=(lifeline,), daemon=True).start()
    _studies.append(study)


def _end_with(lifeline: Connection) -> None:
    with suppress(EOFError, OSError):
        lifeline.recv()
    os._exit(1)


def _start() -> None:
    """The first task of each worker."""


def _execute(work: Callable[[PortableStudy, Task], Result], task: Task) -> Result:
    """Execute a task in a worker."""
    return work(_studies[0], task)
