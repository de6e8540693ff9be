"""Files that the scenarios of a study name: robots, meshes and path samples."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from freefloat.errors import InputError
from freefloat.robot.names import MeshFileError, find_mesh, is_file
from freefloat.studies.run import Files
from freefloat.studies.study import Study

_MAX_BYTES = 100_000_000
_MESH = re.compile(rb"""<mesh\s[^>]*filename\s*=\s*["']([^"'&]+)["']""")


def study_files(study: Study) -> Files:
    """Read the files that the scenarios of a study name by relative paths, and their meshes.

    Results depend on them, and workers on other machines need them. Bundled robots and those of
    example-robot-data are on every machine; absolute names must lead to a file there.

    Raises:
        InputError: If a file cannot be read or is too large.
    """
    folder = study.base_source.absolute().parent
    names = set(_names(study.base))
    for key, section in study.content.vary.items():
        names |= set(_names(section.values, key.rpartition(".")[2]))
    contents: dict[str, bytes] = {}
    for name in names:
        path = Path(os.path.normpath(folder / name))
        if is_file(path) and not os.path.isabs(name):
            contents[str(path)] = _read(path)
            for mesh in _meshes(path, contents[str(path)]):
                contents[str(mesh)] = _read(mesh)
    return tuple(sorted(contents.items()))


def _names(node: Any, key: str = "") -> Iterator[str]:
    """Names of files in a scenario's data, and in values of one of its keys."""
    if isinstance(node, dict):
        for inner, value in node.items():
            yield from _names(value, inner)
    elif isinstance(node, list):
        for value in node:
            yield from _names(value, key)
    elif isinstance(node, str) and key in ("urdf", "mesh", "samples"):
        yield node


def _meshes(urdf: Path, content: bytes) -> Iterator[Path]:
    for name in _MESH.findall(content):
        with suppress(MeshFileError, UnicodeDecodeError):
            yield Path(os.path.abspath(find_mesh(name.decode(), str(urdf))))


def _read(path: Path) -> bytes:
    accepted = f"a readable file of at most {_MAX_BYTES:,} bytes"
    try:
        with path.open("rb") as stream:
            content = stream.read(_MAX_BYTES + 1)
    except OSError as error:
        raise InputError("file", str(error.strerror), accepted, str(path)) from None
    if len(content) > _MAX_BYTES:
        raise InputError("file", "it is too large", accepted, str(path))
    return content
