"""Result files, altered for tests."""

import hashlib
import io
from collections.abc import Callable
from typing import Any

import h5py

BLOCK = 512


def altered(content: bytes, change: Callable[[Any], object]) -> bytes:
    """A result file with something changed, and the digest of its new content."""
    stream = io.BytesIO(content[BLOCK:])
    with h5py.File(stream, "r+") as file:
        change(file)
    return with_digest(stream.getvalue())


def with_digest(content: bytes) -> bytes:
    """An HDF5 file behind a user block with its digest."""
    block = f"freefloat SHA-256 {hashlib.sha256(content).hexdigest()}\n"
    return block.encode().ljust(BLOCK, b"\0") + content


def replaced(name: str, change: Callable[[Any], Any]) -> Callable[[Any], None]:
    """A change of an array, or of a text, in a file."""

    def replace(file: Any) -> None:
        item, attributes = file[name], dict(file[name].attrs)
        value = change(item.asstr()[()] if item.dtype == object else item[()])
        del file[name]
        file.create_dataset(
            name, data=value, dtype=h5py.string_dtype() if isinstance(value, str) else None
        )
        file[name].attrs.update(attributes)

    return replace
