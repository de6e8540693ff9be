"""Options that several commands share, completion of names, and the check of output files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from glob import escape, glob
from pathlib import Path
from typing import Annotated

import typer

from freefloat.errors import InputError
from freefloat.io.files import make_folder, require_result_name, require_writable

_YAML, _ROBOT = (".yaml", ".yml"), (".urdf", ".xacro", ".xml")


def _completion(*kinds: str, suffixes: tuple[str, ...] = ()) -> Callable[[str], list[str]]:
    """The completion of bundled names of some kinds and of files with some suffixes."""

    def complete(incomplete: str) -> list[str]:
        from freefloat.robot import bundled
        from freefloat.robot.robot_packages import EXAMPLE, example_robots

        known = [name for kind in kinds for name in getattr(bundled, f"bundled_{kind}")()]
        if incomplete and "robots" in kinds:  # without a first letter they would be too many
            with suppress(InputError):
                known += [EXAMPLE + name for name in sorted(example_robots())]
        files = sorted(glob(f"{escape(incomplete)}*")) if suffixes else []
        return [
            *(name for name in known if name.startswith(incomplete)),
            *(name for name in files if name.endswith(suffixes) and Path(name).is_file()),
        ]

    return complete


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
    bool,
    typer.Option("--no-open", "--no-browser", help="Open no browser; implied by --json."),
]
ResultFile = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="FILE", help="Write an HDF5 file.")
]
Page = Annotated[
    Path | None,
    typer.Option("--html", metavar="FILE", help="Write a page that plays the motion offline."),
]
MotionFile = Annotated[
    Path, typer.Argument(metavar="FILE", help="A plan or motion file, see -o of plan.")
]
Plots = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Write figures to this folder, as PDF and PNG.")
]
Threads = Annotated[
    int | None, typer.Option(min=1, metavar="T", help="Number of cores; default all.")
]
Quaternion = tuple[float, float, float, float]
Attitude = Annotated[
    Quaternion | None,
    typer.Option(metavar="X Y Z W", help="Spacecraft attitude, a quaternion."),
]


_BEGINNINGS = {"html": (b"<!doctype html",), "output": (b"freefloat sha-256 ", b"\x89hdf")}
"""Beginnings of files that outputs may replace, lower case."""


def comma_separated(key: str, text: str) -> list[float]:
    """Numbers from a text; the key is named in errors.

    Raises:
        InputError: If they are not numbers.
    """
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        raise InputError(key, f"{text!r} was given", "numbers separated by commas") from None


def prepare_outputs(
    *inputs: Path, folder: Path | None = None, results: bool = True, **files: Path | None
) -> None:
    """Check output files, and make a folder, before the work whose results they will hold.

    Args:
        inputs: Files that the command reads.
        folder: An output folder, named ``plots`` in errors.
        results: Whether ``output`` is a result file, which replaces other result files only.
        files: Output files by option; None where none is wanted.

    Raises:
        InputError: If one cannot be written, would replace a file of another kind, or two files are
            the same.
    """
    names = {path.resolve(): "the input" for path in inputs}
    for option, file in files.items():
        if file is None:
            continue
        if option == "output" and results:
            require_result_name(file)
        require_writable(option, file)
        if option == "html" or (option == "output" and results):
            _require_replaceable(option, file)
        path = file.resolve()
        if path in names:
            raise InputError(option, f"{file} is also {names[path]}", "a file of its own")
        names[path] = f"--{option}"
    if folder is not None:
        make_folder("plots", folder)


def _require_replaceable(option: str, file: Path) -> None:
    """Raise an InputError if an output would replace a file of another kind, such as a robot."""
    if not file.exists():
        return
    with file.open("rb") as content:
        begin = content.read(64).lstrip().lower()
    if begin and not begin.startswith(_BEGINNINGS[option]):
        kind = {"html": "page", "output": "result file"}[option]
        problem = f"{file} exists and is no {kind}: it is not replaced"
        raise InputError(option, problem, "another name")


def distinct_stems(files: Sequence[Path]) -> list[str]:
    """Names of files without suffix, numbered where several have the same: ``a``, ``a (2)``."""
    stems = [file.stem for file in files]
    counts = [stems[: index + 1].count(stem) for index, stem in enumerate(stems)]
    pairs = zip(stems, counts, strict=True)
    return [stem if count == 1 else f"{stem} ({count})" for stem, count in pairs]
