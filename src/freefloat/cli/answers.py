"""Answers of planning: from files, for commands that want motions, and in cells of notebooks."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.text import Text

from freefloat.errors import InputError
from freefloat.kinds import kind_of, named

if TYPE_CHECKING:
    from freefloat.motion.motion import Motion
    from freefloat.planning.answer import Answer

_WIDTH = 120
_PAGE = '<pre style="line-height: 1.3; white-space: pre; overflow-x: auto">{code}</pre>'


def load_answer(file: Path) -> Answer:
    """The answer of a file.

    Raises:
        InputError: If the file holds a map, or an answer without any motion.
    """
    from freefloat.io.records.results import load

    result: Any = load(file)
    if not hasattr(result, "phases"):
        accepted = "files with motions: of plan or simulate"
        raise InputError("file", f"it is a {result.kind} file", accepted, str(file))
    if all(phase.motion is None for phase in result.phases):
        problem = f"it has no motion: {result.reason}"
        raise InputError("file", problem, "a file with a motion", str(file))
    answer: Answer = result
    return answer


def load_motion(file: Path) -> tuple[Motion, str]:
    """The motion of a file, and what it violates.

    Raises:
        InputError: If the file does not hold exactly one motion.
    """
    answer = load_answer(file)
    motions = [phase.motion for phase in answer.phases if phase.motion is not None]
    if len(motions) > 1:
        accepted = "files with one motion each, several together, or one of any kind"
        raise InputError("file", f"it is a {answer.kind} file", accepted, str(file))
    return motions[0], answer.violation


def answer_html(answer: Answer) -> str:
    """The short tables of an answer as HTML."""
    console = Console(record=True, file=io.StringIO(), width=_WIDTH, highlight=False, markup=False)
    for renderable in named(kind_of(answer).tables)(answer.kind, answer, False):
        console.print(renderable, soft_wrap=isinstance(renderable, str | Text))
    return console.export_html(inline_styles=True, code_format=_PAGE)
