"""The process that plans for the studio: it works on the newest state that it was sent."""

from __future__ import annotations

import signal
from collections import deque
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

from freefloat.beyond.studio.messages import WorkerAnswer, WorkerState, WorkerTask, page_text
from freefloat.errors import FreeFloatError

if TYPE_CHECKING:  # the server, which starts the process, needs no planner
    from freefloat.beyond.studio.analysis import Analysis


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
        """Take the messages that have arrived; of several states only the newest counts.

        Args:
            wait: Whether to wait for the first one.
        """
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
        kind = "saved" if task.kind == "save" else "page"
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
