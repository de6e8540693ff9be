"""Options that several commands share, completion of names, and the check of output files."""

from __future__ import annotations

import math
import os
import re
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from glob import escape, glob
from itertools import chain, count
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from freefloat.errors import InputError
from freefloat.io.files import (
    RESULT,
    require_folder,
    require_replaceable,
    require_result_name,
    require_writable,
)

_YAML, _ROBOT = (".yaml", ".yml"), (".urdf", ".xacro", ".xml")


def _completion(*kinds: str, suffixes: tuple[str, ...] = ()) -> Callable[[str], list[str]]:
    """The completion of bundled names of some kinds and of files with some suffixes."""

    def complete(incomplete: str) -> list[str]:
        from freefloat.robot import named_files
        from freefloat.robot.named_files import EXAMPLE, example_robots

        known = [name for kind in kinds for name in getattr(named_files, f"bundled_{kind}")()]
        if incomplete and "robots" in kinds:  # without a first letter they would be too many
            with suppress(InputError):
                known += [EXAMPLE + name for name in sorted(example_robots())]
        files = sorted(glob(f"{escape(incomplete)}*")) if suffixes else []
        return [
            *(name for name in known if name.startswith(incomplete)),
            *(name for name in files if name.endswith(suffixes) and Path(name).is_file()),
        ]

    return complete


def option(metavar: str, help: str, *names: str, **settings: Any) -> Any:
    """An option with a value; its name is the parameter's unless others are given."""
    return typer.Option(*names, metavar=metavar, help=help, **settings)


scenario_names = _completion("scenarios", suffixes=_YAML)
study_names = _completion("studies", suffixes=_YAML)
robot_names = _completion("robots", "scenarios", suffixes=_ROBOT + _YAML)
file_names = _completion("robots", "scenarios", "studies")

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only; see the exit code.")]
ScenarioName = Annotated[
    str,
    typer.Argument(metavar="SCENARIO", help="A file or a bundled name: spatial_6dof/line",
                   autocompletion=scenario_names),
]  # fmt: skip
NoOpen = Annotated[
    bool, typer.Option("--no-open", "--no-browser", help="Open no browser; implied by --json.")
]
ResultFile = Annotated[Path | None, option("FILE", "Write an HDF5 file.", "--output", "-o")]
Page = Annotated[
    Path | None, option("FILE", "Write a page that plays the motion offline.", "--html")
]
MotionFile = Annotated[
    Path, typer.Argument(metavar="FILE", help="A plan or motion file, see -o of plan.")
]
Plots = Annotated[Path | None, option("DIR", "Write figures to this folder, as PDF and PNG.")]
Threads = Annotated[int | None, option("T", "Number of cores; default all.", min=1)]


def numbers(text: str) -> list[float]:
    """The numbers of a text, with spaces or commas between them; the parser of list options.

    The metavar of such an option has a word for each number, and ``...`` where there may be any.
    """
    return [float(word) for word in re.split(r"\s*,\s*|\s+", text.strip())]


Attitude = Annotated[
    Sequence[float] | None, option("X Y Z W", "Spacecraft attitude, a quaternion.", parser=numbers)
]
_LIST = re.compile(r"(?=.*\d)[-+.,\de]+|[-+]?(nan|inf)", re.IGNORECASE)
_MISSPELT = re.compile(r"[-+−.,]*\d")


class ListCommand(TyperCommand):
    """A command whose lists of numbers may have spaces or commas: ``--size 1 1 0.5``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse a command line, the values of each list of numbers joined to one word.

        Raises:
            InputError: If one of them is no number, or there are more or fewer than accepted.
        """
        metavars = {name: str(option.metavar) for option in self.params for name in option.opts
                    if " " in (option.metavar or "")}  # fmt: skip
        rest, words = deque(args), list[str]()
        while rest and rest[0] != "--":
            name, _, value = (word := rest.popleft()).partition("=")
            if name in metavars:
                values = [value] if value else []
                while rest and _continues(rest, first=not values):
                    values.append(rest.popleft())
                word = f"{name}={' '.join(values)}"
                if not ctx.resilient_parsing:  # which completes words
                    _require_numbers(name, " ".join(values), metavars[name])
            words.append(word)
        return super().parse_args(ctx, [*words, *rest])


def _continues(words: Sequence[str], first: bool) -> bool:
    """Whether a list goes on with the first of some words, which may be a misspelt number."""
    word, after = words[0], words[1] if len(words) > 1 else ""
    if _LIST.fullmatch(word):
        return True
    if _MISSPELT.match(word):
        return not os.path.exists(word)
    return not word.startswith("-") and (first or bool(_LIST.fullmatch(after)))


def _require_numbers(name: str, text: str, metavar: str) -> None:
    """Raise an InputError unless a text has the numbers of an option."""
    try:
        values = numbers(text)
    except ValueError:
        values = []
    count = len(values) if metavar.endswith("...") else len(metavar.split())
    if not values or len(values) != count or not all(map(math.isfinite, values)):
        accepted = f"finite numbers: {name} {metavar}, also with commas between them"
        raise InputError(
            name.lstrip("-").replace("-", "_"), f"{text or 'nothing'} was given", accepted
        )


def prepare_outputs(
    *inputs: Path, folder: Path | None = None, kind: str = RESULT, **files: Path | None
) -> None:
    """Check output files and a folder before the work whose results they will hold.

    Args:
        inputs: Files that the command reads.
        folder: An output folder, named ``plots`` in errors.
        kind: Kind of the file of the option ``output``. A file replaces files of its kind only.
        files: Output files by option; None where none is wanted.

    Raises:
        InputError: If one cannot be written, would replace a file of another kind, or two files are
            the same.
    """
    names = {path.resolve(): "the input" for path in inputs}
    for option, file in files.items():
        if file is None:
            continue
        own = {"html": "page", "video": file.suffix.lower()[1:]}.get(option, kind)
        if own == RESULT:
            require_result_name(file)
        require_writable(option, file)
        require_replaceable(option, file, own)
        path = file.resolve()
        if path in names:
            raise InputError(option, f"{file} is also {names[path]}", "a file of its own")
        names[path] = f"--{option}"
    if folder is not None:
        require_folder("plots", folder)


def distinct_stems(files: Sequence[Path]) -> list[str]:
    """Names of files without suffix, numbered where several have the same: ``a``, ``a (2)``."""
    names: list[str] = []
    for file in files:
        taken = {name.casefold() for name in names}  # as folders, some systems take a and A for one
        numbered = (f"{file.stem} ({number})" for number in count(2))
        names.append(next(n for n in chain([file.stem], numbered) if n.casefold() not in taken))
    return names
