"""The worker process as the server sees it: started again when it dies or does not answer."""

from __future__ import annotations

import asyncio
import multiprocessing
import threading
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess

from freefloat.beyond.studio.messages import WorkerAnswer, WorkerState, WorkerTask
from freefloat.beyond.studio.worker import work
from freefloat.process_starts import isolated_starts

_PATIENCE = 180.0
"""Time without an answer after which a busy worker is replaced [s]; compiling takes 30 s."""
_CLOSING = 2.0
"""Time in which a process that was told to end must have ended [s]."""
_PAUSES = 0.0, 1.0, 5.0, 30.0
"""Pauses before a process is started again that died before any answer [s]; the last repeats."""


class WorkerProcess:
    """Sends states and tasks to a worker process and passes on its answers.

    Attributes:
        busy: Whether an answer is under way.
    """

    def __init__(self, answered: Callable[[WorkerAnswer], None], lost: Callable[[], None]) -> None:
        """Start a process; needs a running event loop.

        Args:
            answered: Called in the event loop with every answer.
            lost: Called in the event loop when the process died and was replaced.
        """
        self._answered, self._lost = answered, lost
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._starting: asyncio.TimerHandle | None = None
        self.busy, self._failures = False, 0
        self._process, self._connection = self._start()

    @property
    def pid(self) -> int | None:
        """Its number."""
        return self._process.pid

    def send(self, message: WorkerState | WorkerTask) -> None:
        """Send a message; an earlier state is abandoned for a new one."""
        self.busy = True
        self._watch()
        with suppress(OSError):  # it has died: the reader notices
            self._connection.send(message)

    def close(self) -> None:
        """End the process."""
        for timer in (self._timer, self._starting):
            if timer is not None:
                timer.cancel()
        self._answered, self._lost = lambda _: None, lambda: None
        _end(self._process, self._connection)

    def _start(self) -> tuple[SpawnProcess, Connection]:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=work, args=(theirs,), daemon=True)
        with isolated_starts():
            process.start()
        theirs.close()
        threading.Thread(target=self._read, args=(ours,), daemon=True).start()
        return process, ours

    def _read(self, connection: Connection) -> None:
        """Pass on the answers of one process, in a thread."""
        with suppress(RuntimeError):  # the event loop was closed
            try:
                while True:
                    self._loop.call_soon_threadsafe(self._receive, connection, connection.recv())
            except (EOFError, OSError):
                self._loop.call_soon_threadsafe(self._restart, connection)

    def _receive(self, connection: Connection, answer: WorkerAnswer) -> None:
        if connection is not self._connection:
            return
        self.busy, self._failures = answer.kind != "idle", 0
        self._watch()
        self._answered(answer)

    def _watch(self) -> None:
        """Replace the process unless it answers in time."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer = None
        if self.busy:
            self._timer = self._loop.call_later(_PATIENCE, self._restart, self._connection)

    def _restart(self, connection: Connection) -> None:
        if connection is not self._connection or self._loop.is_closed():
            return
        _end(self._process, connection)
        self.busy = False
        pause = _PAUSES[min(self._failures, len(_PAUSES) - 1)]
        self._failures += 1
        self._starting = self._loop.call_later(pause, self._start_again)

    def _start_again(self) -> None:
        self._process, self._connection = self._start()
        self._lost()


def _end(process: SpawnProcess, connection: Connection) -> None:
    """End a process."""
    process.kill()
    process.join(_CLOSING)
    with suppress(OSError):
        connection.close()
