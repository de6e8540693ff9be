"""The robots and scenarios that come with the package, by name."""

from __future__ import annotations

import difflib
from pathlib import Path

from freefloat.errors import InputError


def models_folder() -> Path:
    """Where the bundled robots are: in an installed package, or beside ``src`` in a checkout."""
    package = Path(__file__).resolve().parent
    installed = package / "models"
    return installed if installed.is_dir() else package.parents[1] / "models"


def bundled_scenarios() -> tuple[str, ...]:
    """Names of the bundled scenarios, such as ``spatial_6dof/line``."""
    folder = models_folder()
    return tuple(sorted(f"{path.parent.name}/{path.stem}" for path in folder.glob("*/*.yaml")))


def bundled_robots() -> tuple[str, ...]:
    """Names of the bundled robots, such as ``spatial_6dof``."""
    return tuple(sorted(path.stem for path in models_folder().glob("*/*.urdf")))


def find_scenario(name: str) -> Path:
    """The scenario file of a path or a bundled name.

    Raises:
        InputError: Listing the bundled names when there is neither.
    """
    path = Path(name)
    if is_file(path):
        return path
    if name in bundled_scenarios():
        return models_folder() / f"{name}.yaml"
    raise unknown("scenario", name, bundled_scenarios(), "a scenario file, or one of")


def find_robot(name: str, folder: Path) -> Path:
    """The URDF of a path, relative to a folder, or else of a bundled robot's name or file name.

    Raises:
        InputError: Listing the bundled names when there is neither.
    """
    path = folder / name
    if is_file(path):
        return path
    stem = name.removesuffix(".urdf")
    if stem in bundled_robots():
        return models_folder() / stem / f"{stem}.urdf"
    raise unknown("urdf", name, bundled_robots(), "a URDF file, or one of")


def is_file(path: Path) -> bool:
    """Whether there is such a file; no name is too long or too odd to ask."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def unknown(key: str, name: str, names: tuple[str, ...], what: str) -> InputError:
    """The error for a name that does not exist, with the nearest one that does."""
    near = difflib.get_close_matches(name, names, 1)
    hint = f" (did you mean {near[0]}?)" if near else ""
    shown = name if len(name) <= 80 else name[:77] + "..."
    problem = f"no such file or name: {shown}{hint}"
    if name and len(name) < 256 and "\0" not in name and Path(name).is_dir():
        problem = f"{name} is a directory"
    return InputError(key, problem, f"{what} {', '.join(names)}")
