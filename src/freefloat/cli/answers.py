"""Answers of planning from files, for commands that want motions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from freefloat.errors import InputError

if TYPE_CHECKING:
    from freefloat.motion.motion import Motion
    from freefloat.planning.answer import Answer


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
