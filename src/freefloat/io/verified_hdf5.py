"""HDF5 files whose user block holds the SHA-256 of all that follows it.

The digest is verified before the file is parsed: a file that was damaged by accident is an error,
and never reaches the HDF5 library. A digest is no signature: whoever alters a file on purpose can
write another one.
"""

from __future__ import annotations

import hashlib
import io
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from freefloat.errors import InputError
from freefloat.io.files import written_beside
from freefloat.records import Quantity, Tree

_BLOCK = 512
"""Bytes of the user block."""
_MARK = b"freefloat SHA-256 "
_UNREADABLE = (OSError, KeyError, ValueError, TypeError, AttributeError, RuntimeError)
"""Errors that h5py raises for content that is missing or of another kind."""
_MAX_DEPTH = 16
"""Nested groups; result files have ten."""
_MAX_RATIO, _MAX_SMALL = 20, 50_000_000
"""Bytes that a file may take in memory: so many for each byte on disk, and so many more."""
_NUMBERS, _STRINGS = "biuf", "O"
"""Kinds of arrays in result files, as NumPy abbreviates them."""


class AlteredFileError(InputError):
    """A result file is not as freefloat wrote it."""


def write_hdf5(path: Path, tree: Tree) -> None:
    """Write a tree to an HDF5 file, whole, or not at all: it is built in memory first.

    Dictionaries become groups, arrays datasets with their unit, other values attributes. A
    dictionary in two places is one group with two names.

    Raises:
        InputError: If the file cannot be written.
    """
    stream = io.BytesIO()
    with h5py.File(stream, "w", userblock_size=_BLOCK) as file:
        _write(file, tree, {})
    with stream.getbuffer() as buffer, buffer[_BLOCK:] as content:
        block = _MARK + hashlib.sha256(content).hexdigest().encode() + b"\n"
        with written_beside(path) as temporary, temporary.open("wb") as output:
            output.write(block.ljust(_BLOCK, b"\0"))
            output.write(content)


def _write(group: Any, tree: Tree, known: dict[int, Any]) -> None:
    known[id(tree)] = group
    for name, value in tree.items():
        if isinstance(value, dict) and id(value) in known:
            group[name] = known[id(value)]
        elif isinstance(value, dict):
            _write(group.create_group(name), value, known)
        elif isinstance(value, Quantity):
            packed = "gzip" if value.values.dtype == np.uint8 else None
            text = h5py.string_dtype() if value.values.dtype == object else None
            data = group.create_dataset(name, data=value.values, dtype=text, compression=packed)
            if value.unit:
                data.attrs["unit"] = value.unit
        elif value is not None:
            group.attrs[name] = value


def read_hdf5(path: Path, accepted: str) -> Tree:
    """The tree of a file of :func:`write_hdf5`, which is verified first.

    Raises:
        InputError: If it is no such file.
        AlteredFileError: If its digest is not the digest of its content.
    """
    try:
        if not path.is_file():
            problem = "it is a folder" if path.is_dir() else "no such file"
            raise InputError("file", problem, accepted, str(path))
        stated, digest = _digests(path)
        if stated is None:
            raise InputError("file", "it is not a result file", accepted, str(path))
        if digest != stated:
            problem = "it was altered: its SHA-256 is not the stated one"
            raise AlteredFileError("file", problem, accepted, str(path))
        with h5py.File(path, "r") as file:
            return _Reader(path.stat().st_size).group(file)
    except _UNREADABLE as error:
        problem = f"it cannot be read ({' '.join(str(error).split())})"
        raise InputError("file", problem, accepted, str(path)) from None


def is_whole(path: Path) -> bool:
    """Whether a file is there, and as it was written."""
    try:
        return path.is_file() and len(set(_digests(path))) == 1
    except OSError:
        return False


def _digests(path: Path) -> tuple[str | None, str]:
    """The digest that a file states, None where it states none, and the digest of its content."""
    with path.open("rb") as stream:
        block = stream.read(_BLOCK)
        stream.seek(_BLOCK)
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    stated = block[len(_MARK) :].split(b"\n")[0].decode("ascii", "replace")
    return (stated if block.startswith(_MARK) else None), digest


class _Reader:
    """Objects of a file, each read once, however many names it has, within a bound of memory."""

    def __init__(self, size: int) -> None:
        """Prepare to read a file of a size [bytes]."""
        self._size, self._left = size, _MAX_SMALL + _MAX_RATIO * size
        self._known: dict[int, Any] = {}

    def group(self, group: Any, depth: int = 0) -> Tree:
        """The tree of a group; a ValueError for what :func:`write_hdf5` does not write."""
        if depth > _MAX_DEPTH:
            raise ValueError(f"its group {group.name} is nested too deeply")
        place = h5py.h5o.get_info(group.id).addr
        if place not in self._known:
            self._known[place] = {name: self._attribute(group, name) for name in group.attrs}
            for name in group:
                self._known[place][name] = self._item(group, name, depth)
        tree: Tree = self._known[place]
        return tree

    def _item(self, group: Any, name: str, depth: int) -> Any:
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise ValueError(f"its part {name} is a link")
        item = group[name]
        if isinstance(item, h5py.Group):
            return self.group(item, depth + 1)
        place = h5py.h5o.get_info(item.id).addr
        if place not in self._known:
            self._known[place] = Quantity(self._values(item, name), self._unit(item, name))
        return self._known[place]

    def _unit(self, item: Any, name: str) -> str:
        """The unit of a dataset, which has no other attribute."""
        if set(item.attrs) - {"unit"}:
            raise ValueError(f"its part {name} has an unknown attribute")
        return str(self._attribute(item, "unit")) if "unit" in item.attrs else ""

    def _attribute(self, group: Any, name: str) -> Any:
        scalar = group.attrs.get_id(name).shape == ()
        value = group.attrs[name] if scalar else None
        if not isinstance(value, str | np.generic):
            raise ValueError(f"its part {name} is no number or text")
        self._count(name, len(value) if isinstance(value, str) else 0)
        return value.item() if isinstance(value, np.generic) else value

    def _values(self, item: Any, name: str) -> Any:
        text = h5py.check_string_dtype(item.dtype) is not None
        if item.dtype.kind not in (_STRINGS if text else _NUMBERS):
            raise ValueError(f"its part {name} contains no numbers or texts")
        if item.is_virtual or item.external:
            raise ValueError(f"its part {name} is in another file")
        self._count(name, item.nbytes or 0)
        return self._texts(item, name) if text else np.asarray(item[()])

    def _texts(self, item: Any, name: str) -> Any:
        """Texts of a dataset: each may be as long as the file, in which it is stored once."""
        if item.shape == ():
            self._count(name, len(text := item.asstr()[()]))
            return np.asarray(text, dtype=object)
        if len(item.shape) != 1:
            raise ValueError(f"its part {name} is a table of texts")
        values, step = np.empty(item.shape, dtype=object), 1 + _MAX_SMALL // self._size
        for first in range(0, len(item), step):
            values[first : first + step] = item.asstr()[first : first + step]
            self._count(name, sum(map(len, values[first : first + step])))
        return values

    def _count(self, name: str, size: int) -> None:
        self._left -= size
        if self._left < 0:
            raise ValueError(f"its part {name} states a size that the file does not hold")
