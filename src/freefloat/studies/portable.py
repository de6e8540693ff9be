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

from freefloat.errors import InputError
from freefloat.robot.bundled import is_file
from freefloat.robot.mesh_files import MeshFileError, find_mesh
from freefloat.robot.shapes import MeshFile
from freefloat.robot.source import RobotSource
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
        """What is sent: the arm branch that is found once, not the place where the files are."""
        study, source = self.study, self.study.base_source.absolute()  # from any working folder
        here = replace(study, content=study.settled, base_source=source)
        return {"study": here, "files": self.files}

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
        source = _below(self._folder, self.study.base_source)
        for place in (source.parent, *_packages(self.study, source.parent).values()):
            place.mkdir(parents=True, exist_ok=True)  # for names that begin with ..
        return replace(self.study, base_source=source)

    def original(self, message: str) -> str:
        """A message that names the original files, not their copies."""
        return message.replace(self._folder, "") if self.files else message


def _below(folder: str, path: Path) -> Path:
    return folder / path.relative_to(path.anchor)


def study_files(study: Study) -> Files:
    """Read the files that the scenarios of a study name by relative paths.

    Of robots also the files that they include, and their meshes. Results depend on them, and
    workers on other machines need them. Bundled robots and those of example-robot-data are on
    every machine; absolute names must lead to a file there.

    Raises:
        InputError: If a file cannot be read.
    """
    folder = study.base_source.absolute().parent
    robot = _robot_section(study)
    names = list(_file_names(study.base, robot))
    for key, section in study.content.vary.items():
        names += _file_names(section.values, robot, key.rpartition(".")[2])
    packages = _packages(study, folder)
    files = set[Path]()
    for key, name, beside in names:
        path = Path(os.path.normpath(folder / name))
        if is_file(path) and not os.path.isabs(name):
            files.add(path)
            if key == "urdf":
                with suppress(InputError):  # which is an error of the runs
                    source = RobotSource(
                        path, beside.get("root"), packages, beside.get("arguments", {})
                    )
                    files |= set(_robot_files(source))
    return tuple(sorted((str(file), _read(file)) for file in files))


def _robot_section(study: Study) -> dict[str, Any]:
    section = study.base.get("robot")  # runs may have another one
    return section if isinstance(section, dict) else {}


def _packages(study: Study, folder: Path) -> dict[str, Path]:
    """Folders of the packages that the base scenario names."""
    packages = _robot_section(study).get("packages", {})
    return {name: Path(os.path.normpath(folder / place)) for name, place in packages.items()}


def _robot_files(source: RobotSource) -> Iterator[Path]:
    """Yield the declarations of packages above a robot, its included files and its meshes."""
    declarations = (folder / "package.xml" for folder in Path(source.name).parents)
    yield from filter(is_file, declarations)
    robot = parse_urdf(source)
    yield from map(Path, robot.files)
    for shape in (shape for link in robot.links for shape in link.shapes):
        if isinstance(shape.geometry, MeshFile):
            with suppress(MeshFileError):
                yield Path(os.path.abspath(find_mesh(shape.geometry.filename, robot.source)))


def _file_names(
    node: Any, section: dict[str, Any], key: str = ""
) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield keys and names of files in a scenario's data, with the section that has each.

    The data may be values of one of its keys, then the section is that of the unvaried scenario.
    """
    if isinstance(node, dict):
        for inner, value in node.items():
            yield from _file_names(value, node, inner)
    elif isinstance(node, list):
        for value in node:
            yield from _file_names(value, section, key)
    elif isinstance(node, str) and key in ("urdf", "srdf", "mesh", "samples"):
        yield key, node, section


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError("file", str(error.strerror), "a readable file", str(path)) from None
