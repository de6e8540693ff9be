"""Messages of the page, which the server accepts only in these forms, and of the worker."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from freefloat.errors import FreeFloatError, InputError
from freefloat.io.scenario.field_types import (
    NotNegative,
    Number,
    Positive,
    RollPitchYaw,
    Section,
    Vector,
)


class _Message(Section):
    model_config = ConfigDict(strict=True)


class Open(_Message):
    """Show another scenario."""

    type: Literal["open"]
    scenario: Annotated[str, Field(max_length=200)]


class _Edit(_Message):
    """A change of the scenario.

    Edits of one gesture, such as the drag of a handle, are undone together.
    """

    gesture: Annotated[str, Field(max_length=40)]
    done: bool


class MoveHandle(_Edit):
    """Move a handle of the path to a position [m], inertial axes."""

    type: Literal["handle"]
    handle: Annotated[int, Field(ge=0, lt=1000)]
    position: Vector


class TurnEnd(_Edit):
    """Set the orientation at the end of the path: roll, pitch, yaw [rad]."""

    type: Literal["orientation"]
    value: RollPitchYaw


class SetMomentum(_Edit):
    """Set the angular momentum [N m s]."""

    type: Literal["momentum"]
    value: Vector


class SetDuration(_Edit):
    """Set the duration [s]."""

    type: Literal["duration"]
    value: Positive


class SetMargin(_Edit):
    """Set the margin, or its fraction where the scenario states that."""

    type: Literal["margin"]
    value: NotNegative


class Choose(_Message):
    """Choose the initial attitude: a point of the ball or of the dial; the best one without."""

    type: Literal["choose"]
    rotation_vector: Vector | None = None
    heading_deg: Number | None = None


class Explain(_Message):
    """Ask why a sample of the attitudes shown is feasible or not."""

    type: Literal["explain"]
    samples: Annotated[int, Field(ge=0)]
    sample: Annotated[int, Field(ge=0)]


class EditStep(_Message):
    """Undo or redo an edit, or save the plan."""

    type: Literal["undo", "redo", "save"]


Edit = MoveHandle | TurnEnd | SetMomentum | SetDuration | SetMargin
Message = Annotated[Edit | Open | Choose | Explain | EditStep, Field(discriminator="type")]
_MESSAGE: TypeAdapter[Any] = TypeAdapter(Message)


def parse_message(text: str | bytes) -> Edit | Open | Choose | Explain | EditStep:
    """The message in a JSON text; raises an InputError if it is none."""
    try:
        return _MESSAGE.validate_json(text)  # type: ignore[no-any-return]
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        key = ".".join(map(str, first["loc"])) or "message"
        raise InputError(key, first["msg"], "a message of the studio's page") from None


def page_text(error: FreeFloatError) -> str:
    """An error for the page, which names a file without its folder."""
    if isinstance(error, InputError) and error.source:
        file = Path(error.source).name
        return str(InputError(error.key, error.problem, error.accepted, file, error.line))
    return str(error)


@dataclass(frozen=True)
class WorkerState:
    """What the worker is to show."""

    text: str  # the scenario
    source: Path  # file of the scenario, to which its paths are relative
    attitude: tuple[float, ...] | None = None  # the initial one, x, y, z, w; None for the best
    choice: int = 0  # number of the choice of the attitude
    dragging: bool = False  # whether an edit is under way: motions wait until it is done
    reading: int = 0  # number of scenarios shown other than by edits, whose outlines are wanted


@dataclass(frozen=True)
class WorkerTask:
    """What the worker is to do: save the plan, or without a file build the page of the motion."""

    file: Path | None  # the file to save to; if it exists, another one with a number


@dataclass(frozen=True)
class WorkerAnswer:
    """Part of the worker's answer to a state, or to a task."""

    kind: str  # outline, attitudes, motion, limits, problem, saved, page or idle
    content: Mapping[str, Any] = field(default_factory=dict)  # what browsers are sent, JSON
    reasons: tuple[str, ...] = ()  # on each sample of attitudes, which the server keeps
    reading: int = 0  # reading of the newest state
