"""What can go wrong through misuse: one tree, evidence on the object, a way out in the message.

Every error takes exactly the arguments it is raised with, so all of them survive pickling between
processes. Expected endings of a computation (singular, infeasible) are data, not errors.
"""

import difflib
import traceback
from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import TypeVar

_Words = TypeVar("_Words", bound=StrEnum)
_PACKAGE = Path(__file__).parent


class FreeFloatError(Exception):
    """Base of everything that freefloat raises on purpose."""

    def _render_traceback_(self) -> list[str]:
        """What IPython and notebooks print: the lines of the user's own, and what is wrong."""
        frames = traceback.extract_tb(self.__traceback__)
        own = [one for one in frames if not Path(one.filename).is_relative_to(_PACKAGE)
               and "IPython" not in Path(one.filename).parts]  # fmt: skip
        told = f"{type(self).__name__}: {self}".replace("; accepted: ", "\n  accepted: ")
        return [line.rstrip() for line in traceback.format_list(own)] + told.splitlines()


class InputError(FreeFloatError):
    """Something that was given cannot be used.

    Attributes:
        key: What was given: an argument, a key of a file, a link of a URDF.
        problem: What is wrong with it, naming the value given.
        accepted: What would be accepted instead.
        source: The file it stands in, where it stands in one.
        line: The line in that file, where it is known.
    """

    def __init__(
        self,
        key: str,
        problem: str,
        accepted: str,
        source: str | None = None,
        line: int | None = None,
    ) -> None:
        super().__init__(key, problem, accepted, source, line)
        self.key = one_line(key, _LONGEST)
        self.problem = one_line(problem, _LONGEST)
        self.accepted = one_line(accepted, 8 * _LONGEST)
        self.source = source
        self.line = line

    def __str__(self) -> str:
        file = one_line(self.source or "", 8 * _LONGEST)
        file = f"{file}:{self.line}" if file and self.line else file
        place = f"{file}: {self.key}" if file else self.key
        return f"{place}: {self.problem}; accepted: {self.accepted}"

    def found_in(self, source: str, prefix: str = "") -> "InputError":
        """The same error, told with the file it was found in and its key inside that file.

        Args:
            source: The file.
            prefix: Put before the key, e.g. ``"path."``.

        Returns:
            A new error of the same class; where this one already names a file, that file is kept.
        """
        file = self.source or source
        return type(self)(prefix + self.key, self.problem, self.accepted, file, self.line)


def require_type(key: str, given: object, kind: type, accepted: str) -> None:
    """Raise an InputError unless what was given is of a kind.

    Args:
        key: Named in the error.
        given: What was given; a text is told as it is, anything else by its type.
        kind: What it must be.
        accepted: How to come by one, in words.
    """
    if not isinstance(given, kind):
        told = repr(given) if given is None or isinstance(given, str) else type(given).__name__
        raise InputError(key, f"{told} was given", accepted)


def member(key: str, kind: type[_Words], given: str) -> _Words:
    """A member of an enumeration of words, or the one with that word.

    Args:
        key: Named in the error.
        kind: The enumeration.
        given: A member, or a text.

    Raises:
        InputError: Listing the words when it is none of them.
    """
    try:
        return kind(given)
    except ValueError:
        known = [str(one) for one in kind]
        near = did_you_mean(str(given), known)
        raise InputError(key, f"{given!r} was given{near}", ", ".join(known)) from None


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`` (did you mean X?)`` with the name that a misspelt word is nearest to, or nothing."""
    names = list(known)
    if len(word) > _MOST:
        return ""
    near = difflib.get_close_matches(word, names, 1)
    if not near and len(word) > _FEWEST:
        near = [name for name in names if word in name]
    return f" (did you mean {near[0]}?)" if near else ""


_FEWEST = 2
"""So many letters are part of too many names."""
_MOST = 100
"""No name is as long as that; to look for it would take a while."""


_LONGEST = 1000
"""Characters of a key and of a problem that are told."""


def one_line(text: str, longest: int = _LONGEST) -> str:
    """A text from who knows where as a terminal may get it: nothing in it moves the cursor."""
    if len(text) > longest:
        text = f"{text[: longest * 3 // 4]}...{text[-longest // 5 :]}"
    if text.isprintable():
        return text
    return "".join(
        one if one.isprintable() else one.encode("unicode_escape").decode() for one in text
    )


class ModelError(InputError):
    """The robot described by a URDF cannot float freely with an arm."""


class UnreachableError(InputError):
    """The arm cannot put its end-effector where the path begins, from the attitude given."""


class IntegrationError(FreeFloatError):
    """The integrator gave up for a reason that is not a dynamic singularity.

    Attributes:
        time: Where it gave up [s].
        reason: In its own words.
        advice: What to try.
    """

    def __init__(
        self, time: float, reason: str, advice: str = "a smaller tolerance or a smoother path"
    ) -> None:
        super().__init__(time, reason, advice)
        self.time = time
        self.reason = reason
        self.advice = advice

    def __str__(self) -> str:
        return (
            f"the motion could not be integrated beyond t = {self.time:.6g} s: {self.reason}; "
            f"try {self.advice}"
        )
