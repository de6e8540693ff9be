"""Mesh files that a URDF names, and the packages of ROS in which they are."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote, urlsplit

from freefloat.errors import InputError, one_line
from freefloat.robot.bundled import examples_folder, is_file, read_text

_PACKAGE_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
"""The name in a ``package.xml`` of ROS."""
PACKAGES = "above the file, on ROS_PACKAGE_PATH or under AMENT_PREFIX_PATH"
"""Where packages of ROS are looked for."""
NAMED_PACKAGE = "--package {0}=FOLDER (robot.packages in a scenario)"
"""What names the folder of a package."""


class MeshFileError(Exception):
    """A mesh file that does not exist or cannot be read; the message is one line.

    Attributes:
        reason: What is wrong with it.
        remedy: What to do, where that is known.
    """

    def __init__(self, reason: str, remedy: str = "") -> None:
        super().__init__(one_line(f"{reason}; {remedy}" if remedy else reason))
        self.reason, self.remedy = one_line(reason), one_line(remedy)


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
    remedy = ""
    if split.scheme in ("package", "model"):
        named = NAMED_PACKAGE.format(split.netloc)
        remedy = f"{named}; or a folder {split.netloc} {PACKAGES}"
    raise MeshFileError("no such file", remedy)


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
