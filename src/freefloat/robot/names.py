"""Robots and scenarios by name: the bundled ones, and the robots of example-robot-data."""

from __future__ import annotations

import sysconfig
from collections import Counter
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from freefloat.errors import InputError, did_you_mean

_EXAMPLES = "example-robot-data"
EXAMPLE = f"{_EXAMPLES}:"
"""Before the name of a robot of that package."""


def models_folder() -> Path:
    """Where the bundled robots are: in an installed package, or beside ``src`` in a checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "models"
    return installed if installed.is_dir() else package.parents[1] / "models"


def bundled_scenarios() -> tuple[str, ...]:
    """Names of the bundled scenarios, such as ``spatial_6dof/line``."""
    folder = models_folder()
    return tuple(sorted(f"{path.parent.name}/{path.stem}" for path in folder.glob("*/*.yaml")))


def bundled_studies() -> tuple[str, ...]:
    """Names of the bundled studies, such as ``spatial_6dof/montecarlo``."""
    files = models_folder().glob("*/studies/*.yaml")
    return tuple(sorted(f"{path.parents[1].name}/{path.stem}" for path in files))


def bundled_robots() -> tuple[str, ...]:
    """Names of the bundled robots, such as ``spatial_6dof``."""
    return tuple(sorted(path.stem for path in models_folder().glob("*/*.urdf")))


def find_scenario(name: str) -> Path:
    """The scenario file of a path or a bundled name.

    Raises:
        InputError: Listing the bundled names when there is neither.
    """
    return _find("scenario", name, bundled_scenarios(), ".")


def find_study(name: str) -> Path:
    """The study file of a path or a bundled name.

    Raises:
        InputError: Listing the bundled names when there is neither.
    """
    return _find("study", name, bundled_studies(), "studies")


def _find(kind: str, name: str, known: tuple[str, ...], below: str) -> Path:
    """A file, or the one of a bundled name, which stands in a folder below its robot's."""
    path = Path(name)
    if is_file(path):
        return path
    if name in known:
        robot, _, own = name.partition("/")
        return models_folder() / robot / below / f"{own}.yaml"
    raise unknown(kind, name, known, f"a {kind} file, or one of")


def find_robot(name: str, folder: Path) -> Path:
    """The URDF of a path, relative to a folder, or else of a bundled robot's name or file name.

    Args:
        name: The path or name; ``example-robot-data:NAME`` stands for a robot of that package.
        folder: What the path is relative to.

    Raises:
        InputError: Listing the names there are when it is none of them.
    """
    if name.startswith(EXAMPLE):
        return _find_example(name)
    path = folder / name
    if is_file(path):
        return path
    stem = name.removesuffix(".urdf")
    if stem in bundled_robots():
        return models_folder() / stem / f"{stem}.urdf"
    error = unknown("urdf", name, (*bundled_robots(), f"{EXAMPLE}NAME"), "a URDF file, or one of")
    raise InputError(error.key, error.problem + _example_meant(stem), error.accepted)


def _example_meant(name: str) -> str:
    """A hint where a robot of example-robot-data was named without its package."""
    with suppress(InputError):
        short = name.removesuffix("_robot")
        if short in example_robots():
            return f" (did you mean {EXAMPLE}{short}?)"
    return ""


def example_robots() -> dict[str, Path]:
    """The URDFs of the package example-robot-data by name: the file's, without ``_robot``.

    A name that several files have is told with its folder, as in ``anymal_c_simple/anymal``.

    Raises:
        InputError: If the package is not installed.
    """
    folder = examples_folder()
    files = sorted(folder.glob("*/**/*.urdf"))
    count = Counter(path.stem for path in files)
    named = {}
    for path in files:
        owner = path.relative_to(folder).parts[0].removesuffix("_description")
        named[path.stem if count[path.stem] == 1 else f"{owner}/{path.stem}"] = path
    for name in [name for name in named if name.endswith("_robot")]:
        named[name.removesuffix("_robot")] = named.pop(name)  # ur3.urdf has no link: the other one
    return named


def examples_folder() -> Path:
    """Where pip, or else conda or the system, has put the robots of example-robot-data.

    Raises:
        InputError: If the package is not installed.
    """
    shared = [Path(sysconfig.get_path("data")) / "share"]
    with suppress(PackageNotFoundError):
        shared.insert(0, Path(str(distribution(_EXAMPLES).locate_file("cmeel.prefix/share"))))
    for folder in shared:
        if (folder / _EXAMPLES / "robots").is_dir():
            return folder / _EXAMPLES / "robots"
    raise InputError(
        "urdf", f"the package {_EXAMPLES} is not installed", f"pip install {_EXAMPLES}, or a file"
    )


def _find_example(name: str) -> Path:
    robots = example_robots()
    short = name.removeprefix(EXAMPLE).removesuffix("_robot")
    if short in robots:
        return robots[short]
    names = tuple(EXAMPLE + one for one in sorted(robots))
    raise unknown("urdf", name, names, "one of")


def is_file(path: Path) -> bool:
    """Whether there is such a file; no name is too long or too odd to ask."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def unknown(key: str, name: str, names: tuple[str, ...], what: str) -> InputError:
    """The error for a name that does not exist, with the nearest one that does."""
    shown = name if len(name) <= 240 else name[:237] + "..."
    problem = f"no such file or name: {shown}{did_you_mean(name, names)}"
    if name and len(name) < 256 and "\0" not in name and Path(name).is_dir():
        problem = f"{name} is a directory"
    return InputError(key, problem, f"{what} {', '.join(names)}")
