"""The state of the studio: the scenario, its history and the newest answers, for all browsers."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from freefloat.beyond.studio.edits import edited
from freefloat.beyond.studio.messages import (
    Choose,
    Edit,
    EditStep,
    Explain,
    Open,
    WorkerAnswer,
    WorkerState,
    WorkerTask,
    page_text,
    parse_message,
)
from freefloat.beyond.studio.worker import WorkerProcess
from freefloat.errors import FreeFloatError, InputError
from freefloat.io.scenario.loading import load_scenario
from freefloat.io.scenario.scenario import Scenario
from freefloat.io.scenario.yaml import parse_yaml
from freefloat.robot.named_files import bundled_scenarios
from freefloat.rotations import Rotation
from freefloat.so3 import heading_quaternion

_MOST_STEPS = 200
"""Edits that can be undone."""
_MOMENTARY = ("error", "saved")
"""Types of messages that a browser which connects later does not need."""

Send = Callable[[dict[str, Any]], None]


class Session:
    """What all browsers look at; they send messages and receive what changed.

    Attributes:
        newest: The newest message of each type, for a browser that connects.
    """

    def __init__(self, scenario: str, folder: Path, broadcast: Send) -> None:
        """Open a file or a bundled scenario, with the folder of plans; needs a running event loop.

        The broadcast sends a message to all browsers. Raises an InputError if it is no scenario.
        """
        self._folder, self._broadcast = folder, broadcast
        self._history, self._place = [Document.opened(scenario)], 0
        self._own = None if scenario in bundled_scenarios() else scenario
        self._gesture, self._dragging = "", False
        self._attitude: tuple[float, ...] | None = None
        self._choice, self._reading = 0, 1
        self._outline: dict[str, Any] | None = None
        self._reasons: tuple[str, ...] = ()
        self._sets, self._lost_before = 0, False
        self._pages: list[asyncio.Future[str | None]] = []
        self.newest: dict[str, dict[str, Any]] = {}
        self.worker = WorkerProcess(self._answered, self._lost)
        self._changed()

    @property
    def _document(self) -> Document:
        return self._history[self._place]

    def receive(self, text: str | bytes, reply: Send) -> None:
        """Handle a message of a browser; what is wrong with it is replied."""
        try:
            self._handle(parse_message(text), reply)
        except FreeFloatError as error:
            reply({"type": "error", "text": page_text(error)})

    def release(self) -> None:
        """End a gesture whose browser has gone."""
        if self._dragging:
            self._gesture, self._dragging = "", False
            self._changed()

    async def page(self) -> str | None:
        """The page that plays the motion shown; None where there is none."""
        future: asyncio.Future[str | None] = asyncio.get_running_loop().create_future()
        self._pages.append(future)
        self.worker.send(WorkerTask(None))
        return await future

    def _handle(self, message: Edit | Open | Choose | Explain | EditStep, reply: Send) -> None:
        match message:
            case Open(scenario=name):
                if name != self._own and name not in bundled_scenarios():
                    raise InputError("scenario", f"{name!r} was given", "a name from the list")
                self._add(Document.opened(name))
                self._attitude = None
                self._changed(read=True)
            case Choose():
                normal = self.newest.get("outline", {}).get("normal") or (0.0, 0.0, 1.0)
                self._attitude = _attitude(message, normal)
                self._choice += 1
                self._changed()
            case Explain(samples=number, sample=sample):
                if number == self._sets and sample < len(self._reasons):
                    reply({"type": "reason", "sample": sample, "text": self._reasons[sample]})
            case EditStep(type="save"):
                self.worker.send(WorkerTask(self._folder / f"{self._document.source.stem}.h5"))
            case EditStep(type=kind):
                self._step(-1 if kind == "undo" else 1)
            case _:
                self._edit(message)

    def _edit(self, edit: Edit) -> None:
        """Apply an edit; edits of one gesture are one step of the history."""
        content = edited(self._document.content, edit, self._outline)
        if content == self._document.content:
            self._dragging = not edit.done
            self._changed()
            return
        if edit.gesture == self._gesture and self._place > 0:
            del self._history[self._place :]
            self._place -= 1
        self._gesture, self._dragging = edit.gesture, not edit.done
        self._add(self._document.with_content(content))
        self._changed()

    def _add(self, document: Document) -> None:
        """Make a document the present one, after which there is none to redo."""
        self._history = [*self._history[: self._place + 1], document][-_MOST_STEPS:]
        self._place = len(self._history) - 1

    def _step(self, steps: int) -> None:
        """Undo or redo."""
        place = self._place + steps
        if 0 <= place < len(self._history):
            self._place = place
            self._changed(read=True)

    def _changed(self, read: bool = False) -> None:
        """Send the state to the worker and to the browsers.

        ``read`` is whether another scenario is shown, whose outline is not known.
        """
        if read:
            self._gesture, self._dragging, self._outline = "", False, None
            for kind in ("outline", "attitudes", "motion", "limits"):
                self.newest.pop(kind, None)
            self._reading += 1
        document = self._document
        self._lost_before = False
        present = self._attitude, self._choice, self._dragging, self._reading
        self.worker.send(WorkerState(document.text, document.source, *present))
        self._tell({
            "type": "state",
            "scenario": document.name,
            "scenarios": [*([self._own] if self._own else []), *bundled_scenarios()],
            "text": document.text,
            "ends": document.ends,
            "choice": self._choice,
            "outlined": self._outline is not None,
            "undo": self._place > 0,
            "redo": self._place + 1 < len(self._history),
        })  # fmt: skip
        self._tell({"type": "status", "busy": True})

    def _answered(self, answer: WorkerAnswer) -> None:
        """Keep an answer of the worker and pass it on, unless another scenario was opened."""
        content = dict(answer.content)
        if answer.reading != self._reading and answer.kind not in ("page", "saved"):
            return
        match answer.kind:
            case "idle":
                self._lost_before = False
                self._tell({"type": "status", "busy": False})
                return
            case "page":
                self._deliver(content.get("html"))
                return
            case "outline":
                self._outline = content
                self.newest.pop("problem", None)
            case "attitudes":
                self._sets, self._reasons = self._sets + 1, answer.reasons
                content["number"] = self._sets
            case "motion":
                self.newest.pop("limits", None)
        self._tell({"type": answer.kind, **content})

    def _deliver(self, html: str | None) -> None:
        """Give the page to those who wait for it."""
        waiting, self._pages = self._pages, []
        for future in waiting:
            if not future.done():
                future.set_result(html)

    def _lost(self) -> None:
        """The worker died: send the state again, unless it dies of it."""
        self._deliver(None)
        text = "the planning process ended and was started again"
        self._tell({"type": "error", "text": text})
        if self._lost_before:
            self._tell({"type": "status", "busy": False})
        else:
            self._changed()
        self._lost_before = True

    def _tell(self, message: dict[str, Any]) -> None:
        if message["type"] not in _MOMENTARY:
            self.newest[message["type"]] = message
        self._broadcast(message)


def _attitude(message: Choose, normal: Sequence[float]) -> tuple[float, ...] | None:
    """The quaternion of a point of the ball or of the dial."""
    if message.rotation_vector is not None:
        quaternion = Rotation.from_rotvec(message.rotation_vector).as_quat()
    elif message.heading_deg is not None:
        quaternion = heading_quaternion(np.radians(message.heading_deg), normal)
    else:
        return None
    return tuple(quaternion.tolist())


@dataclass(frozen=True, eq=False)
class Document:
    """A scenario with edits."""

    name: str  # what it was opened as
    source: Path  # file of the scenario
    text: str = field(repr=False)  # with the comments of the file while it is not edited
    content: dict[str, Any] = field(repr=False)  # data of the text, without null
    ends: dict[str, list[float]] = field(repr=False)  # ends of the sliders

    @classmethod
    def opened(cls, name: str) -> Document:
        """Open a file or a bundled scenario; raises an InputError if it is none."""
        scenario = load_scenario(name)
        text, source = scenario.text, scenario.source
        content = _without_null(parse_yaml(text, source))
        return cls(name, source, text, content, _slider_ends(scenario))

    def with_content(self, content: dict[str, Any]) -> Document:
        """The document with other content."""
        text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
        return Document(self.name, self.source, text, content, self.ends)


def _without_null(value: Any) -> Any:
    """The data without keys whose value is null, which mean the same as no keys."""
    if isinstance(value, dict):
        return {key: _without_null(part) for key, part in value.items() if part is not None}
    return [_without_null(part) for part in value] if isinstance(value, list) else value


def _slider_ends(scenario: Scenario) -> dict[str, list[float]]:
    """Ends of the sliders of a scenario that was opened: momentum [N m s], duration [s]."""
    momentum = max(1.0, 2.0 * max(map(abs, scenario.content.momentum)))
    with scenario.error_context():
        duration = scenario.content.timing.to_timing().duration
        goal = scenario.content.goal
        duration = duration if goal is None else goal.duration or duration
    return {"momentum": [-momentum, momentum], "duration": [0.2 * duration, 4.0 * duration]}
