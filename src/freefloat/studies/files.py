"""The files that a study's scenarios lead to: read once, sent once, unpacked where the work is."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from freefloat.errors import InputError
from freefloat.robot.mesh_paths import MeshFileError, find_mesh
from freefloat.robot.names import examples_folder, find_robot, is_file
from freefloat.robot.urdf_text import UrdfText
from freefloat.studies.study import Study

_LARGEST = 100_000_000
"""Bytes of one file."""
_ROBOT, _FILE = "robot", "file"
"""How a name is looked for: as a robot, or as a file beside the scenario."""


@dataclass(frozen=True, eq=False)
class StudyFiles:
    """Files by their absolute paths, and the names that lead to them.

    Attributes:
        contents: Absolute path to bytes.
        places: How a name is looked for and the name, as scenarios have them, to an absolute path.
        meshes: URDF to the names of its mesh files and their absolute paths.
    """

    contents: Mapping[str, bytes]
    places: Mapping[tuple[str, str], str]
    meshes: Mapping[str, Mapping[str, str]]

    @classmethod
    def of(cls, study: Study) -> StudyFiles:
        """Read all that the scenarios of a study name.

        What only some cases name may be missing: those cases will tell.

        Raises:
            InputError: If a file cannot be read that the base scenario names.
        """
        folder = study.base_source.parent
        places: dict[tuple[str, str], str] = {}
        for number, document in enumerate(study.listed_documents()):
            for key, kind, name in _names(document):
                if (kind, name) in places:
                    continue
                try:
                    found = find_robot(name, folder) if kind == _ROBOT else folder / name
                    if not is_file(found):
                        raise InputError(key, f"no such file: {name}", "a file")
                except InputError as error:
                    if number == 0 and not _varied(study, key):
                        told = InputError(key, error.problem, error.accepted)
                        raise told.found_in(str(study.base_source)) from None
                    continue
                places[kind, name] = os.path.abspath(found)
        contents = {path: _read(path) for path in sorted({*places.values()})}
        meshes = {path: _meshes(path, contents[path])
                  for (kind, _), path in places.items() if kind == _ROBOT}  # fmt: skip
        for path in {path for names in meshes.values() for path in names.values()}:
            contents[path] = _read(path)
        return cls(contents, places, meshes)

    def digests(self) -> dict[str, str]:
        """SHA-256 of every file by the name that scenarios have for it; of meshes by their own."""
        named = {name: path for (_, name), path in self.places.items()}
        for names in self.meshes.values():
            named |= names
        return {name: sha256(self.contents[path]).hexdigest() for name, path in named.items()}

    def unpack(self, folder: Path) -> UnpackedFiles:
        """Write all files into a folder, each below it at its own path."""
        for path, content in self.contents.items():
            place = _below(folder, path)
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(content)
        for urdf, names in self.meshes.items():
            _lead_to_copies(folder, urdf, names)
        return UnpackedFiles(folder, self.places)


@dataclass(frozen=True, eq=False)
class UnpackedFiles:
    """Copies of a study's files: below a folder, each at its own absolute path.

    Attributes:
        folder: The folder.
        places: As those of :class:`StudyFiles`.
    """

    folder: Path
    places: Mapping[tuple[str, str], str]

    def below(self, path: Path) -> Path:
        """Where the copy of a file is or would be."""
        return _below(self.folder, os.path.abspath(path))

    def led_to_copies(self, document: dict[str, Any]) -> dict[str, Any]:
        """A scenario's data with its files' names changed into those of the copies."""
        copy = deepcopy(document)
        for key, kind, name in list(_names(copy)):
            if (kind, name) not in self.places:
                continue
            *way, last = key.split(".")
            node: Any = copy
            for word in way:
                node = node[int(word)] if isinstance(node, list) else node[word]
            node[last] = str(_below(self.folder, self.places[kind, name]))
        return copy

    def told(self, text: str) -> str:
        """A text with the originals' paths instead of the copies'."""
        return text.replace(str(self.folder), "")


def _below(folder: Path, path: str) -> Path:
    return folder / Path(path).relative_to(Path(path).anchor)


def _varied(study: Study, key: str) -> bool:
    """Whether a key of the base, or one that it is part of, is varied."""
    return any(f"{key}.".startswith(f"{one}.") for one in study.content.vary)


def _names(document: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """The keys of a scenario's data that name files, how those are looked for, and the names."""
    robot, path = _section(document, "robot"), _section(document, "path")
    attached = robot.get("attached")
    found: list[tuple[str, str, Any]] = [("robot.urdf", _ROBOT, robot.get("urdf"))]
    for index, one in enumerate(attached if isinstance(attached, list) else []):
        if isinstance(one, dict):
            found.append((f"robot.attached.{index}.urdf", _ROBOT, one.get("urdf")))
    for part in ("spacecraft", "payload"):
        found.append((f"robot.{part}.mesh", _FILE, _section(robot, part).get("mesh")))
    found.append(("path.samples", _FILE, path.get("samples")))
    yield from (one for one in found if isinstance(one[2], str))


def _section(document: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = document.get(key)
    return found if isinstance(found, dict) else {}


def _read(path: str) -> bytes:
    accepted = f"a readable file of at most {_LARGEST:,} bytes"
    try:
        with Path(path).open("rb") as stream:
            content = stream.read(_LARGEST + 1)
    except OSError as error:
        raise InputError("file", str(error.strerror), accepted, path) from None
    if len(content) > _LARGEST:
        raise InputError("file", "it is too large", accepted, path)
    return content


def _meshes(urdf: str, content: bytes) -> dict[str, str]:
    """The mesh files that a URDF names and that do not come with freefloat, where they are."""
    found: dict[str, str] = {}
    with suppress(InputError, UnicodeDecodeError):
        for mesh in UrdfText.of(content.decode()).robot.iter("mesh"):
            name = mesh.get("filename", "")
            with suppress(MeshFileError):
                place = os.path.abspath(find_mesh(name, urdf))
                if not _comes_along(place):
                    found[name] = place
    return found


def _comes_along(path: str) -> bool:
    """Whether a file is one of the package example-robot-data, which is wherever freefloat is."""
    try:
        return Path(path).is_relative_to(examples_folder().parent)
    except InputError:
        return False


def _lead_to_copies(folder: Path, urdf: str, meshes: Mapping[str, str]) -> None:
    """Rename the meshes of a copied URDF that are not found from where it is now."""
    copy = _below(folder, urdf)
    renamed: dict[str, Path] = {}
    for name, path in meshes.items():
        place = _below(folder, path)
        with suppress(MeshFileError):
            if find_mesh(name, str(copy)) == place:
                continue
        renamed[name] = place
    text = copy.read_bytes()
    for name, place in renamed.items():
        for quote in ('"', "'"):
            text = text.replace(f"{quote}{name}{quote}".encode(), f"{quote}{place}{quote}".encode())
    copy.write_bytes(text)
