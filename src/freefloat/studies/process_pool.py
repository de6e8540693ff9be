"""Runs of a study in processes of this machine, which end with this one; nothing listens."""

from __future__ import annotations

import logging
import os
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
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
_ENDED = 2
"""Number of workers that end as they start, one after the other, after which no other is tried."""
_KILLED = "a worker process was killed; its run is begun again"
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

    Where a worker dies, another one repeats its task; if that dies, too, the result is None.

    Args:
        work: What is done with the study and a task.
        study: The study, which workers receive once.
        tasks: The tasks.
        workers: Number of processes; of few tasks this one is among them.

    Raises:
        InputError: If workers end before they have started.
    """
    waiting, missing, few = deque(tasks), len(tasks), len(tasks) <= FEW
    completed = SimpleQueue[tuple[Task | None, Result | BaseException]]()

    def remaining() -> Iterator[Task]:
        """Tasks that no process has begun, each for the one that takes it."""
        with suppress(IndexError):
            while True:
                yield waiting.popleft()

    def feed(worker: ProcessPoolExecutor, start: Future[None]) -> None:
        """Give a worker one task after another, in a thread."""
        task = None
        try:
            start.result()  # a worker that starts slowly takes no task from others
            for task in remaining():
                completed.put((task, worker.submit(_execute, work, task).result()))
        except BaseException as error:  # which the main thread raises
            completed.put((task, error))

    with ExitStack() as stack:

        def begin() -> None:
            worker = stack.enter_context(_worker(study))
            Thread(target=feed, args=worker, daemon=True).start()

        for _ in range(min(workers, missing) - few):
            begin()
        for task in remaining() if few else ():
            yield task, work(study, task)
            missing -= 1
        repeated, ended = list[Task](), 0
        while missing:
            begun, outcome = completed.get()
            if isinstance(outcome, BrokenExecutor):
                ended = ended + 1 if begun is None else 0
                if ended == _ENDED:
                    accepted = 'a script that calls it below `if __name__ == "__main__":`'
                    raise InputError("workers", "worker processes end as they start", accepted)
                logging.getLogger("freefloat").warning(_KILLED)
                if begun is not None and begun not in repeated:
                    repeated.append(begun)
                    waiting.appendleft(begun)
                elif begun is not None:
                    yield begun, None
                    missing -= 1
                begin()
            elif isinstance(outcome, BaseException):
                raise outcome
            elif begun is not None:
                yield begun, outcome
                missing -= 1


@contextmanager
def _worker(study: PortableStudy) -> Iterator[tuple[ProcessPoolExecutor, Future[None]]]:
    """A worker and its first task; it ends with the block or this process, not by Ctrl-C."""
    context = get_context("spawn")
    lifeline, held = context.Pipe(duplex=False)
    with isolated_starts():
        worker = ProcessPoolExecutor(1, context, initializer=_begin, initargs=(lifeline, study))
    try:
        with isolated_starts(), interrupts_deferred():
            start = worker.submit(_start)
        yield worker, start
    finally:
        with interrupts_deferred():
            held.close()
            worker.shutdown(cancel_futures=True)
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
