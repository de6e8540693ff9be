"""The process that plans for the studio, and how the server starts, watches and replaces it."""

from __future__ import annotations

import asyncio
import multiprocessing
import signal
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import TYPE_CHECKING

from freefloat.beyond.studio.messages import WorkerAnswer, WorkerState, WorkerTask, page_text
from freefloat.concurrency import isolated_starts
from freefloat.errors import FreeFloatError

if TYPE_CHECKING:  # the server, which starts the process, needs no planner
    from freefloat.beyond.studio.analysis import Analysis

_PATIENCE = 180.0
"""Time without an answer after which a busy worker is replaced [s]; compiling takes 30 s."""
_CLOSING = 2.0
"""Time within which a process ends after its termination was requested [s]."""
_PAUSES = 0.0, 1.0, 5.0, 30.0
"""Pauses before a process is started again that died before any answer [s]; the last repeats."""


def work(connection: Connection) -> None:
    """Answer states and tasks until the server closes the connection."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the server, which ends this
    worker, busy = _Worker(connection), False
    try:
        while True:
            worker.receive(wait=not busy)
            busy = worker.step()
    except (EOFError, OSError):
        pass


class _Superseded(Exception):
    """A newer message has arrived."""


class _Worker:
    def __init__(self, connection: Connection) -> None:
        from freefloat.beyond.studio.analysis import RobotCache

        self._connection = connection
        with suppress(ImportError):  # there is no Numba
            self._report_compilation()
        self._robots = RobotCache()
        self._state: WorkerState | None = None
        self._reading, self._outlined = 0, 0
        self._analysis: Analysis | None = None
        self._tasks: deque[WorkerTask] = deque()

    def _report_compilation(self) -> None:
        from numba.core import event

        class Listener(event.Listener):
            def on_start(_, started: event.Event) -> None:
                if started.data["dispatcher"].stats.cache_path is not None:
                    self._send(WorkerAnswer("status", {"busy": True, "compiling": True}))

            def on_end(_, ended: event.Event) -> None: ...

        event.register("numba:compile", Listener())  # type: ignore[no-untyped-call]  # of Numba

    def receive(self, wait: bool) -> None:
        """Take the messages that have arrived, or wait for one; only the newest state counts."""
        while self._connection.poll(None if wait else 0.0):
            wait = False
            message = self._connection.recv()
            if isinstance(message, WorkerTask):
                self._tasks.append(message)
            else:
                self._state, self._reading = message, message.reading

    def step(self) -> bool:
        """Do the most urgent part of the work; return whether there was any."""
        try:
            answer = self._answer()
        except _Superseded:
            return True
        except FreeFloatError as error:
            self._send(WorkerAnswer("problem", {"text": page_text(error)}))
            self._analysis, self._state = None, None  # until the next edit
            return True
        self._send(answer or WorkerAnswer("idle"))
        return answer is not None

    def _send(self, answer: WorkerAnswer) -> None:
        self._connection.send(replace(answer, reading=self._reading))

    def _answer(self) -> WorkerAnswer | None:
        from freefloat.beyond.studio.analyses import analysis_of

        state, analysis = self._state, self._analysis
        if state is None:
            return self._done(self._tasks.popleft()) if self._tasks else None
        if analysis is None or state.reading != self._outlined or not analysis.poses(state):
            self._analysis = analysis = analysis_of(state, self._robots)
            self._outlined = state.reading
            return analysis.outline()
        answer = analysis.urgent(state, self._progress)
        if answer is not None or state.dragging:
            return answer
        if self._tasks:
            return self._done(self._tasks.popleft())
        return analysis.further(self._progress)

    def _done(self, task: WorkerTask) -> WorkerAnswer:
        """Do a task."""
        kind = "page" if task.file is None else "saved"
        if self._analysis is None or self._state is None:
            return WorkerAnswer(kind, {"refused": "the scenario has an error"})
        if task.file is None:
            return self._analysis.page()
        try:
            return self._analysis.save(task.file, self._state.attitude)
        except FreeFloatError as error:
            return WorkerAnswer(kind, {"refused": page_text(error)})

    def _progress(self, _: float) -> None:
        """Abandon a map for a newer message."""
        if self._connection.poll():
            raise _Superseded


class WorkerProcess:
    """Sends states and tasks to a worker process and passes on its answers.

    ``busy`` is whether an answer is under way.
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
