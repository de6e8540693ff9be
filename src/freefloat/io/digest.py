"""Digests of all that a result file holds, so that a part that was changed later can be named.

They are no signature: who changes a file on purpose can write new ones. What a file claims is
proved from its contents, see :mod:`freefloat.verification.check`.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np

_NAME = "digests"


def seal(file: Any) -> None:
    """Write the digests of everything in an open HDF5 file, the last thing that is written."""
    file.create_dataset(_NAME, data=json.dumps(_digests(file)))


def broken_seals(file: Any) -> list[str] | None:
    """The parts of an open HDF5 file that are not what they were when it was written.

    Returns:
        Names, those of attributes as ``"group@attribute"``; None where the file has no digests.

    Raises:
        ValueError: If the digests are no JSON object.
    """
    if _NAME not in file:
        return None
    written, found = json.loads(file[_NAME].asstr()[()]), _digests(file)
    if not isinstance(written, dict):
        raise ValueError("its digests are no JSON object")
    return sorted(
        name for name in written.keys() | found.keys() if written.get(name) != found.get(name)
    )


def _digests(file: Any) -> dict[str, str]:
    found: dict[str, str] = {}

    def add(name: str, item: Any) -> None:
        if name == _NAME:
            return
        for key, value in item.attrs.items():
            found[f"{name}@{key}"] = _digest(value)
        if hasattr(item, "dtype"):
            found[name] = _digest(item.asstr()[()] if item.dtype == object else item[()])

    add("", file)
    file.visititems(add)
    return found


def _digest(value: Any) -> str:
    """SHA-256 of a text or of an array with its shape."""
    array = np.asarray(value)
    if array.dtype.kind in "OSU":
        content = json.dumps(array.astype(str).tolist()).encode()
    else:
        content = repr((array.dtype.str, array.shape)).encode() + array.tobytes()
    return hashlib.sha256(content).hexdigest()
