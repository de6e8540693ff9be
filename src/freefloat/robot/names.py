"""Files by name: bundled robots, scenarios and studies, example-robot-data, meshes of a URDF."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote, urlsplit

from freefloat.errors import InputError, did_you_mean, one_line
from freefloat.robot.robot_packages import (
    DESCRIPTIONS,
    EXAMPLE,
    described_robot,
    example_robot,
    example_robots,
    examples_folder,
)

_LARGEST = 20_000_000
"""Size limit of a text file [bytes]."""
_PACKAGE_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
"""The name in a ``package.xml`` of ROS."""
PACKAGES = "above the file, on ROS_PACKAGE_PATH or under AMENT_PREFIX_PATH"
"""Where packages of ROS are looked for."""
NAMED_PACKAGE = "--package {0}=FOLDER (robot.packages in a scenario)"
"""What names the folder of a package."""


def models_folder() -> Path:
    """The folder of the bundled robots: in an installed package, or beside ``src``."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "models"
    return installed if installed.is_dir() else package.parents[1] / "models"


def bundled_scenarios() -> tuple[str, ...]:
    """Names of the bundled scenarios, such as ``spatial_6dof/line``."""
    folder = models_folder()
    return tuple(sorted(f"{path.parent.name}/{path.stem}" for path in folder.glob("*/*.yaml")))


def is_scenario(name: str) -> bool:
    """Whether a name is that of a scenario, bundled or a file."""
    return name in bundled_scenarios() or name.endswith((".yaml", ".yml"))


def bundled_studies() -> tuple[str, ...]:
    """Names of the bundled studies, such as ``spatial_6dof/montecarlo``."""
    files = models_folder().glob("*/studies/*.yaml")
    return tuple(sorted(f"{path.parents[1].name}/{path.stem}" for path in files))


def bundled_robots() -> tuple[str, ...]:
    """Names of the bundled robots, such as ``spatial_6dof``."""
    return tuple(sorted(path.stem for path in models_folder().glob("*/*.urdf")))


def bundled_bodies() -> dict[str, Path]:
    """The URDFs of the bundled bodies of scenes, such as ``client``, by name."""
    return {path.stem: path for path in sorted(models_folder().glob("*/bodies/*.urdf"))}


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
    if is_file(Path(name)):
        return Path(name)
    if name in known:
        robot, _, stem = name.partition("/")
        return models_folder() / robot / below / f"{stem}.yaml"
    raise unknown(kind, name, known, f"a {kind} file, or one of")


def find_robot(name: str, folder: Path) -> Path:
    """The URDF file of a path, or else of the name of a bundled robot or body of a scene.

    Args:
        name: The path or name; ``example-robot-data:NAME`` and ``robot_descriptions:NAME`` are
            robots of these packages.
        folder: The folder that the path is relative to.

    Raises:
        InputError: Listing the known names when it is none of them.
    """
    if name.startswith(EXAMPLE):
        return example_robot(name.removeprefix(EXAMPLE))
    if name.startswith(DESCRIPTIONS):
        return described_robot(name.removeprefix(DESCRIPTIONS))
    path = folder / name
    stem = name.removesuffix(".urdf")
    if is_file(path):
        return path
    if stem in bundled_robots():
        return models_folder() / stem / f"{stem}.urdf"
    if stem in bundled_bodies():
        return bundled_bodies()[stem]
    names = [*bundled_robots(), *bundled_bodies(), f"{EXAMPLE}NAME"]
    with suppress(InputError):
        short = stem.removesuffix("_robot")
        names += [EXAMPLE + short] if short in example_robots() else []
    raise unknown("urdf", name, names, "a URDF file, or one of")


def is_file(path: Path) -> bool:
    """Whether there is such a file; False for names that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_text(path: Path) -> str:
    """The text of a UTF-8 file, line ends as they are.

    Raises:
        ValueError: Saying why it cannot be read, or that it is larger than 20 MB.
    """
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):  # devices never end
            raise ValueError("it is not a regular file")
        if path.stat().st_size > _LARGEST:
            raise ValueError(f"it has more than {_LARGEST:,} bytes")
        return path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise ValueError(str(error.strerror)) from None
    except UnicodeDecodeError:
        raise ValueError("it is not UTF-8 text") from None


def unknown(key: str, name: str, names: Sequence[str], what: str) -> InputError:
    """The error for an unknown name, with the most similar known one."""
    problem = f"no such file or name: {name[:240]}{did_you_mean(name, names)}"
    return InputError(key, problem, f"{what} {', '.join(names)}")


class MeshFileError(Exception):
    """A mesh file that does not exist or cannot be read; the message is one line."""

    def __init__(self, reason: str) -> None:
        super().__init__(one_line(reason))


def find_mesh(name: str, urdf: str) -> Path:
    """The mesh file that a name in a URDF refers to.

    Args:
        name: ``package://NAME/...``, ``model://NAME/...``, ``file://...``, an absolute path, or one
            relative to the URDF's folder.
        urdf: The URDF's file; for XML text names are relative to the current folder.

    Raises:
        MeshFileError: If there is no such file.
    """
    try:
        split = urlsplit(name.replace("\\", "/"))
    except ValueError as error:
        raise MeshFileError(f"its name is no address ({error})") from None
    if split.scheme in ("package", "model"):
        places = list(_in_package(split.netloc, unquote(split.path).lstrip("/"), Path(urdf)))
    elif split.scheme == "file":
        places = [Path(unquote(split.path))]
    elif len(split.scheme) > 1:  # one letter is a drive
        raise MeshFileError(f"{split.scheme}:// files are not fetched")
    else:
        places = [Path(name) if Path(name).is_absolute() else Path(urdf).absolute().parent / name]
    for place in places:
        if is_file(place):
            return place
    hint = ""
    if split.scheme in ("package", "model"):
        named = NAMED_PACKAGE.format(split.netloc)
        hint = f" in a folder {split.netloc} {PACKAGES}; {named} names one"
    raise MeshFileError(f"no such file{hint}")


def _in_package(package: str, rest: str, urdf: Path) -> Iterator[Path]:
    """Paths that a file of a package may have, in order of precedence."""
    yield from (folder / rest for folder in _package_folders(package, urdf))
    with suppress(InputError):
        examples = examples_folder()
        if package == examples.parent.name:
            yield examples.parent / rest
        yield examples / package / rest


def find_package(package: str, file: Path) -> Path | None:
    """The folder of a package of ROS, above a file or where ROS has it; None without."""
    return next(filter(Path.is_dir, _package_folders(package, file)), None)


def _package_folders(package: str, file: Path) -> Iterator[Path]:
    """Folders that a package of ROS may have, in order of precedence."""
    ros, ament = (
        [Path(word) for word in os.environ.get(variable, "").split(os.pathsep) if word]
        for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
    )
    for folder in [*file.absolute().parents, *ros]:
        if folder.name == package or _declared_package(folder) == package:
            yield folder
        yield folder / package
    yield from (folder / "share" / package for folder in ament)


def _declared_package(folder: Path) -> str | None:
    """The name that the ``package.xml`` of a folder declares."""
    declaration = folder / "package.xml"
    if not is_file(declaration):
        return None
    with suppress(ValueError):
        name = _PACKAGE_NAME.search(read_text(declaration))
        return name and name[1]
    return None
