"""Where the mesh files of a robot are: found by the names a URDF gives them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote, urlsplit

from freefloat.errors import InputError, one_line
from freefloat.robot.names import examples_folder, is_file


class MeshFileError(Exception):
    """A mesh file that is not there or cannot be read; its text says why, in one line."""

    def __init__(self, reason: str) -> None:
        super().__init__(one_line(reason))


def find_mesh(name: str, urdf: str) -> Path:
    """The mesh file that a URDF means.

    Args:
        name: ``package://NAME/...``, ``model://NAME/...``, ``file://...``, an absolute path, or one
            relative to the URDF's folder.
        urdf: The URDF's file; the current folder counts as the folder of text from no file.

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
    raise MeshFileError(f"no such file{_hint(split.scheme, split.netloc)}")


def _hint(scheme: str, package: str) -> str:
    if scheme not in ("package", "model"):
        return ""
    return f" in a folder {package} above the URDF, on ROS_PACKAGE_PATH or under AMENT_PREFIX_PATH"


def _in_package(package: str, rest: str, urdf: Path) -> Iterator[Path]:
    """Where a file of a package may be, the likeliest place first."""
    ros = [Path(word) for word in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if word]
    for folder in [*urdf.absolute().parents, *ros]:
        if folder.name == package:
            yield folder / rest
        yield folder / package / rest
    for word in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if word:
            yield Path(word) / "share" / package / rest
    with suppress(InputError):
        examples = examples_folder()
        if package == examples.parent.name:
            yield examples.parent / rest
        yield examples / package / rest
