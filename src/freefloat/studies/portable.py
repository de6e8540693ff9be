"""Studies that workers on other machines execute: with the files that their scenarios name."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from freefloat.errors import InputError, ModelError
from freefloat.robot.bundled import is_file
from freefloat.robot.mesh_files import MeshFileError, find_mesh
from freefloat.robot.shapes import MeshFile
from freefloat.robot.urdf import parse_urdf
from freefloat.studies.study import Study

Files = tuple[tuple[str, bytes], ...]
"""Absolute paths of files and their contents."""


@dataclass(frozen=True, eq=False)
class PortableStudy:
    """A study with the files that its scenarios name.

    Attributes:
        study: The study.
        files: The files; empty where they are read at their own places.
    """

    study: Study
    files: Files = field(default=(), repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Return what is sent: not the place where the files are."""
        return {"study": self.study, "files": self.files}

    @cached_property
    def _folder(self) -> str:
        """A folder with copies of the files, each at its own path below it."""
        folder = tempfile.mkdtemp(prefix="freefloat-")
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        for path, content in self.files:
            copy = _below(folder, Path(path))
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(content)
        return folder

    @cached_property
    def here(self) -> Study:
        """The study on this machine."""
        if not self.files:
            return self.study
        source = _below(self._folder, self.study.base_source.absolute())
        source.parent.mkdir(parents=True, exist_ok=True)  # for names that begin with ..
        return replace(self.study, base_source=source)

    def original(self, message: str) -> str:
        """A message that names the original files, not their copies."""
        return message.replace(self._folder, "") if self.files else message


def _below(folder: str, path: Path) -> Path:
    return folder / path.relative_to(path.anchor)


def study_files(study: Study) -> Files:
    """Read the files that the scenarios of a study name by relative paths, and their meshes.

    Results depend on them, and workers on other machines need them. Bundled robots and those of
    example-robot-data are on every machine; absolute names must lead to a file there.

    Raises:
        InputError: If a file cannot be read.
    """
    folder = study.base_source.absolute().parent
    names = set(_file_names(study.base))
    for key, section in study.content.vary.items():
        names |= set(_file_names(section.values, key.rpartition(".")[2]))
    files = set[Path]()
    for key, name in names:
        path = Path(os.path.normpath(folder / name))
        if is_file(path) and not os.path.isabs(name):
            files |= {path, *(_mesh_files(path) if key == "urdf" else ())}
    return tuple(sorted((str(file), _read(file)) for file in files))


def _mesh_files(urdf: Path) -> Iterator[Path]:
    """Yield the mesh files of a URDF; what is wrong with it is an error of its runs."""
    with suppress(ModelError):
        for link in parse_urdf(urdf).links:
            for shape in link.shapes:
                if isinstance(shape.geometry, MeshFile):
                    with suppress(MeshFileError):
                        mesh = find_mesh(shape.geometry.filename, str(urdf))
                        yield Path(os.path.abspath(mesh))


def _file_names(node: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Yield keys and names of files in a scenario's data, and in values of one of its keys."""
    if isinstance(node, dict):
        for inner, value in node.items():
            yield from _file_names(value, inner)
    elif isinstance(node, list):
        for value in node:
            yield from _file_names(value, key)
    elif isinstance(node, str) and key in ("urdf", "mesh", "samples"):
        yield key, node


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError("file", str(error.strerror), "a readable file", str(path)) from None
