"""Robots of the packages example-robot-data and robot_descriptions."""

from __future__ import annotations

import difflib
import sysconfig
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, PackagePath, distribution
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules

from freefloat.errors import InputError, one_line

_EXAMPLES = "example-robot-data"
EXAMPLE = f"{_EXAMPLES}:"
"""Prefix of the names of that package's robots."""
DESCRIPTIONS = "robot_descriptions:"
"""Prefix of the names of robots of the package robot_descriptions."""
_NEAREST = 5
"""Number of names that are listed for an unknown one of a package of robots."""


def example_robot(name: str) -> Path:
    """The URDF of a robot of the package example-robot-data, see :func:`example_robots`.

    Raises:
        InputError: If the package is not installed, or has no such robot.
    """
    robots = example_robots()
    short = name.removesuffix("_robot")
    if short not in robots:
        raise _unknown(EXAMPLE, short, sorted(robots))
    return robots[short]


def described_robot(name: str) -> Path:
    """The URDF or MJCF file of a robot of the package robot_descriptions.

    That package downloads a robot when it is first asked for.

    Args:
        name: With or without ``_description``, such as ``panda``.

    Raises:
        InputError: If the package is not installed, has no such robot or cannot download it.
    """
    short = name.removesuffix("_description")
    known = described_robots()
    if short not in known:
        raise _unknown(DESCRIPTIONS, short, known)
    module = f"robot_descriptions.{short}_description"
    try:
        robot = import_module(module)
    except Exception as error:  # of any kind: it runs git
        problem = f"robot_descriptions cannot load {name} ({one_line(str(error))})"
        raise InputError("urdf", problem, "a robot that it can download") from None
    for key in ("URDF_PATH", "MJCF_PATH"):
        if hasattr(robot, key):
            return Path(getattr(robot, key))
    raise InputError("urdf", f"{module} names no file", "a robot with a URDF or MJCF file")


def described_robots() -> tuple[str, ...]:
    """Names of the robots of the package robot_descriptions, without ``_description``.

    Raises:
        InputError: If the package is not installed.
    """
    package = find_spec("robot_descriptions")
    if package is None:
        problem = "the package robot_descriptions is not installed"
        raise InputError("urdf", problem, "pip install robot_descriptions, or a file")
    modules = (module.name for module in iter_modules(package.submodule_search_locations))
    suffix = "_description"
    return tuple(sorted(name.removesuffix(suffix) for name in modules if name.endswith(suffix)))


def _unknown(prefix: str, name: str, known: Sequence[str]) -> InputError:
    """The error for an unknown robot of a package, with the most similar ones."""
    near = difflib.get_close_matches(name[:240], known, _NEAREST, cutoff=0.0)
    problem = f"{prefix.removesuffix(':')} has no robot {name[:240]!r}"
    accepted = f"one of its {len(known)} robots, such as"
    return InputError("urdf", problem, f"{accepted} {', '.join(prefix + robot for robot in near)}")


def example_robots() -> dict[str, Path]:
    """The URDFs of the package example-robot-data by file name without ``_robot``.

    A name that several files have includes the folder, as in ``anymal_c_simple/anymal``.

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


@cache
def examples_folder() -> Path:
    """The folder of the robots of the package example-robot-data.

    Its wheel lists it among its files; it has no Python module, which is the package
    example-robot-data-loaders. conda and the system have it in the folder of shared data.

    Raises:
        InputError: If the package is not installed.
    """
    listed: Sequence[PackagePath] = ()
    with suppress(PackageNotFoundError):
        listed = distribution(_EXAMPLES).files or ()
    declared = (file for file in listed if file.match(f"{_EXAMPLES}/package.xml"))
    folders = [Path(str(file.locate())).parent for file in declared]
    for folder in (*folders, Path(sysconfig.get_path("data")) / "share" / _EXAMPLES):
        if (folder / "robots").is_dir():
            return folder / "robots"
    problem = f"the package {_EXAMPLES} is not installed"
    raise InputError("urdf", problem, f"pip install {_EXAMPLES}, or a file")
