"""Few tasks, executed by this process and by others that start meanwhile.

Workers of Dask take seconds to start, longer than a dozen plans.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from queue import SimpleQueue
from threading import Thread
from typing import TypeVar

from freefloat.studies.interrupts import interrupts_deferred
from freefloat.studies.portable import PortableStudy

FEW = 32
"""Largest number of tasks that are few."""
Task = TypeVar("Task")
Result = TypeVar("Result")


def few_tasks(
    work: Callable[[PortableStudy, Task], Result],
    study: PortableStudy,
    tasks: Sequence[Task],
    workers: int,
) -> Generator[tuple[Task, Result]]:
    """Yield tasks of a study and their results as they are completed.

    A task whose process is killed is left out.

    Args:
        work: What is done with the study and a task.
        study: The study, which other processes receive once.
        tasks: The tasks.
        workers: Number of processes, this one included.
    """
    waiting, completed = deque(tasks), SimpleQueue[tuple[Task, Result]]()

    def remaining() -> Iterator[Task]:
        """Tasks that no process has begun, each for the one that takes it."""
        with suppress(IndexError):
            while True:
                yield waiting.popleft()

    def feed(process: Connection) -> None:
        with suppress(EOFError, OSError):  # the process was killed
            process.send((work, study))
            for task in remaining():
                process.send(task)
                completed.put((task, process.recv()))

    with _processes(workers - 1) as processes:
        threads = [Thread(target=feed, args=(process,), daemon=True) for process in processes]
        for thread in threads:
            thread.start()
        for task in remaining():
            yield task, work(study, task)
            while not completed.empty():
                yield completed.get()
        for thread in threads:
            thread.join()
        while not completed.empty():
            yield completed.get()


@contextmanager
def _processes(count: int) -> Iterator[list[Connection]]:
    """Connections to other processes that execute tasks."""
    context, processes, connections = get_context("spawn"), [], []
    try:
        with interrupts_deferred():
            for _ in range(count):
                here, there = context.Pipe()
                process = context.Process(target=_execute, args=(there,), daemon=True)
                process.start()
                there.close()  # so that the end of the process is the end of the connection
                processes.append(process)
                connections.append(here)
        yield connections
    finally:
        for process in processes:
            process.kill()
            process.join()


def _execute(connection: Connection) -> None:
    """Execute tasks until the other end of the connection is closed."""
    with suppress(EOFError, OSError):
        work, study = connection.recv()
        while True:
            connection.send(work(study, connection.recv()))
