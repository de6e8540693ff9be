"""Errors raised for unusable input, and the argument checks that raise them.

An error takes exactly the arguments it is raised with, so that it survives pickling between
processes. Expected outcomes of a computation (singular, infeasible) are data, not errors.
"""

from __future__ import annotations

import difflib
import sys
import traceback
from collections.abc import Iterable
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:  # the command line shows its help without NumPy
    import numpy as np
    import numpy.typing as npt

LARGEST_NUMBER = 1e9
"""No length, time or momentum of a spacecraft comes near; squares beyond it lose all digits."""
LARGEST_SEED = 2**53
"""Largest integer that every reader of JSON keeps."""
_Words = TypeVar("_Words", bound=StrEnum)
_PACKAGE = Path(__file__).parent
_LONGEST = 1000
"""Largest number of characters of a key and of a problem in a message."""
_SHORTEST_PART, _LONGEST_NAME = 3, 100
"""Lengths of misspelt words for which names that contain them, and similar names, are sought."""


class FreeFloatError(Exception):
    """Base class of all errors of freefloat.

    Example:
        >>> try:
        ...     ff.load_scenario("no such scenario")
        ... except ff.errors.FreeFloatError as error:
        ...     print(type(error).__name__)
        InputError
    """

    def _render_traceback_(self) -> list[str]:
        """The traceback in IPython and notebooks: the user's frames, and the message."""
        frames = [
            frame
            for frame in traceback.extract_tb(self.__traceback__)
            if not Path(frame.filename).is_relative_to(_PACKAGE)
            and "IPython" not in Path(frame.filename).parts
        ]
        message = f"{type(self).__name__}: {self}".replace("; accepted: ", "\n  accepted: ")
        return [line.rstrip() for line in traceback.format_list(frames)] + message.splitlines()


class InputError(FreeFloatError):
    """An argument, option or file entry cannot be used.

    Attributes:
        key: The argument, key of a file, or link of a URDF.
        problem: What is wrong with it, including the value.
        accepted: What is accepted instead.
        source: The file that contains it, if any.
        line: The line in that file, if known.

    Example:
        >>> try:
        ...     ff.Timing(-1.0)
        ... except ff.InputError as error:
        ...     print(error.key)
        timing.duration
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
        location = f"{file}: {self.key}" if file else self.key
        return f"{location}: {self.problem}; accepted: {self.accepted}"

    def found_in(self, source: str, prefix: str = "") -> InputError:
        """The same error with the file that contains the key.

        Args:
            source: The file; an error that already names a file keeps it.
            prefix: Put before the key, e.g. ``"path."``.
        """
        file = self.source or source
        return type(self)(prefix + self.key, self.problem, self.accepted, file, self.line)

    def with_key(self, key: str) -> InputError:
        """The same error with another key."""
        return type(self)(key, self.problem, self.accepted, self.source, self.line)


class ModelError(InputError):
    """The robot described by a URDF cannot float freely with an arm."""


class MissingExtraError(InputError):
    """An extra of freefloat, whose name is the key, is not installed."""

    @classmethod
    def of(cls, extra: str) -> MissingExtraError:
        """The error of an extra."""
        return cls(extra, "it needs an extra", f"pip install 'freefloat[{extra}]'")

    def __str__(self) -> str:
        return f"{self.key}: {self.problem}: {self.accepted}"

    def found_in(self, source: str, prefix: str = "") -> InputError:
        """The error itself, because no file is wrong."""
        return self


class MissingNumbaError(MissingExtraError):
    """Numba, which compiles the kernels, is missing or refuses the other packages.

    Without kernels planar paths are simulated, planned and mapped; all else that integrates many
    motions, or moves several arms on paths, raises this error.
    """


class UnreachableError(InputError):
    """No arm configuration reaches the start of the path from the attitude."""


class IntegrationError(FreeFloatError):
    """The integrator failed for a reason other than a dynamic singularity.

    Attributes:
        time: Time of the failure [s].
        reason: The integrator's message.
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


def require_type(key: str, value: object, kind: type | UnionType, accepted: str) -> None:
    """Raise an InputError unless a value is an instance of a class."""
    if not isinstance(value, kind):
        quoted = value is None or isinstance(value, str)
        description = repr(value) if quoted else type(value).__name__
        raise InputError(key, f"{description} was given", accepted)


def require_extra(extra: str, module: str) -> None:
    """Raise a MissingExtraError unless a module is installed, which is not imported.

    Args:
        extra: Name of the extra that installs the module.
        module: Name of the module.
    """
    spec = find_spec(module)
    if spec is None or spec.origin is None:  # a folder of that name has no origin
        raise MissingExtraError.of(extra)


def member(key: str, kind: type[_Words], value: str) -> _Words:
    """The member of an enumeration of words that a word names; else an InputError."""
    try:
        return kind(value)
    except ValueError:
        words = [str(word) for word in kind]
        near = did_you_mean(str(value), words)
        raise InputError(key, f"{value!r} was given{near}", ", ".join(words)) from None


def number_array(key: str, values: npt.ArrayLike, accepted: str) -> npt.NDArray[np.float64]:
    """The values as a new array of floats; an InputError for words, complex numbers and dates.

    A quaternion of Pinocchio (``pin.Quaternion``) is its coefficients x, y, z, w.
    """
    import numpy as np

    try:
        array = np.asarray(values)
        objects = array.dtype.kind == "O" and array.size > 0
        if objects and all(hasattr(entry, "coeffs") for entry in array.flat):
            return np.array([entry.coeffs() for entry in array.flat]).reshape(*array.shape, 4)
        if array.dtype.kind in "biufO":
            return np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        pass
    raise InputError(key, f"{values!r} was given", accepted)


def axes_of(values: npt.ArrayLike) -> int:
    """Number of axes of an array; 0 of lists that are none, because their lengths differ."""
    import numpy as np

    try:
        return np.ndim(values)
    except ValueError:
        return 0


def finite_vector(key: str, values: npt.ArrayLike, length: int) -> npt.NDArray[np.float64]:
    """The values as an array of ``length`` finite numbers; else an InputError."""
    import numpy as np

    accepted = "1 finite number" if length == 1 else f"{length} finite numbers"
    array = number_array(key, values, accepted)
    if array.shape != (length,) or not np.isfinite(array).all():
        raise InputError(key, f"{array.tolist()} was given", accepted)
    return array


def finite_number(
    key: str,
    value: Any,
    accepted: str,
    minimum: float = -sys.float_info.max,
    maximum: float = sys.float_info.max,
) -> float:
    """The value as a finite float within bounds; else an InputError."""
    import numpy as np

    value = float(value) if isinstance(value, np.floating) else value  # of the bounds' precision
    number = isinstance(value, int | float | np.integer)
    if not number or isinstance(value, bool) or not minimum <= value <= maximum:
        raise InputError(key, f"{value!r} was given", accepted)
    return float(value)


def whole_number(key: str, value: Any, minimum: int, maximum: float = float("inf")) -> int:
    """The value as an integer within bounds, else an InputError; floats are rejected."""
    import numpy as np

    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or not minimum <= value <= maximum:
        upper = f"to {maximum:,}" if maximum < float("inf") else "or more"
        raise InputError(key, f"{value!r} was given", f"a whole number, {minimum} {upper}")
    return int(value)


def seed_number(key: str, value: Any) -> int:
    """The value as the seed of random numbers, which scenario and result files can hold."""
    return whole_number(key, value, 0, LARGEST_SEED)


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """`` (did you mean X?)`` with the name most similar to a misspelt word, or nothing."""
    names = list(names)
    if len(word) > _LONGEST_NAME:
        return ""
    near = difflib.get_close_matches(word, names, 1)
    if not near and len(word) >= _SHORTEST_PART:
        near = [name for name in names if word in name]
    return f" (did you mean {near[0]}?)" if near else ""


def one_line(text: str, longest: int = _LONGEST) -> str:
    """A text shortened, with everything escaped that would move the cursor of a terminal."""
    if len(text) > longest:
        text = f"{text[: longest * 3 // 4]}...{text[-longest // 5 :]}"
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
