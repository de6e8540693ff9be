"""Mutations of HDF5 result files: parts removed, changed, enlarged, replaced by links."""

from __future__ import annotations

import io
import json
from contextlib import suppress
from random import Random
from typing import Any

import h5py
import numpy as np

from fuzzing.mutations import (
    BYTES,
    NUMBERS,
    XML,
    YAML,
    Mutator,
    a_value,
    a_word,
    attempted,
    mutated,
    tree,
)
from tests.result_files import BLOCK, with_digest

_TEXT = h5py.string_dtype()
_MAX_SIZE = 10**6
"""Largest number of values that a mutation reads."""


def parts(random: Random, content: bytes) -> bytes:
    """Change one to three parts of the file."""
    stream = io.BytesIO(content[BLOCK:])
    with h5py.File(stream, "r+") as file:
        for _ in range(random.choice([1, 1, 1, 2, 3])):
            names: list[str] = []
            file.visit(names.append)
            with suppress(Exception):  # not every change fits every part
                random.choice(_CHANGES)(random, file, random.choice(names))
    return with_digest(stream.getvalue())


def _remove(random: Random, file: Any, name: str) -> None:
    del file[name]


def _rename(random: Random, file: Any, name: str) -> None:
    other = random.choice([*file, "odd", "result/odd", "result/chosen/odd", "result/ranges/7"])
    if other not in file:
        file.move(name, other)


def _numbers(random: Random, file: Any, name: str) -> None:
    """Replace some values of an array."""
    if file[name].size > _MAX_SIZE:
        return
    values = file[name][()].astype(float)
    for _ in range(random.choice([1, 2, values.size])):
        values.flat[random.randrange(values.size)] = float(random.choice(NUMBERS))
    _replace(file, name, values)


def _shape(random: Random, file: Any, name: str) -> None:
    """Change numbers of rows, columns, axes."""
    if file[name].size > _MAX_SIZE:
        return
    values = file[name][()]
    _replace(file, name, random.choice([
        values[:0], values[:-1], values[:1], values.T, values[..., None], values.ravel(),
        values[..., :-1], np.concatenate([values, values]), values[::-1],
    ]))  # fmt: skip


def _type(random: Random, file: Any, name: str) -> None:
    """Replace a part by one of another type."""
    word = a_word(random).replace("\0", "").encode("utf-8", "replace")
    values: list[Any] = [
        word, np.void(b"abc"), 3, 1.5, True, 1j, np.array([word, word], dtype=object),
        h5py.Empty("f8"), np.zeros(3, dtype=[("a", "f8"), ("b", "i4")]), np.zeros((0, 4)),
        np.float16(1), np.zeros(3, dtype=">i2"),
    ]  # fmt: skip
    _replace(file, name, random.choice(values))


def _huge(random: Random, file: Any, name: str) -> None:
    """State a size that the file does not hold."""
    _drop(file, name)
    shape = random.choice([(10**8,), (10**12,), (10**9, 4), (2**40, 2**20), (10**7, 7)])
    chunks = tuple(min(length, 1000) for length in shape)  # else the file grows, too
    file.create_dataset(name, shape, "f8", chunks=chunks, compression=random.choice([None, "gzip"]))


def _elsewhere(random: Random, file: Any, name: str) -> None:
    """Replace a part by a link, or by data in another file."""
    _drop(file, name)
    change = random.randrange(4)
    if change == 0:
        file[name] = h5py.ExternalLink(random.choice(["other.h5", "/etc/passwd", "fifo"]), "/x")
    elif change == 1:
        file[name] = h5py.SoftLink(random.choice(["/", name, "/nowhere", "/result", "/held"]))
    elif change == 2:
        file[name] = file["/"]
    else:
        place = random.choice(["/etc/passwd", "../outside/secret", "/dev/zero"])
        file.create_dataset(name, (16,), "u1", external=[(place, 0, 16)])


def _attribute(random: Random, file: Any, name: str) -> None:
    item = file if random.random() < 0.6 else file[name]
    if not len(item.attrs):
        return
    key = random.choice(list(item.attrs))
    if random.random() < 0.3:
        del item.attrs[key]
        return
    word = a_word(random).replace("\0", "")[:10_000].encode("utf-8", "replace")
    values: list[Any] = [word, 1, 2, -1, np.nan, np.inf, np.zeros(3), h5py.Empty("f8"), True,
                         np.array([word], dtype=object), "SINGULAR", "COMPLETED"]  # fmt: skip
    item.attrs[key] = random.choice(values)


def _text(random: Random, file: Any, name: str) -> None:
    """Change a text like a file of its kind."""
    kinds = {"document": (_a_json,), "held": (_a_json,), "scenario": YAML, "robot": XML}
    name = random.choice([kind for kind in kinds if kind in file] or [name])
    text = file[name].asstr()[()].encode()
    changed = mutated(random, text, kinds.get(name, BYTES)).replace(b"\0", b"")
    _replace(file, name, changed)


def _a_json(random: Random, content: bytes) -> bytes:
    data = json.loads(content)
    changed = a_value(random) if not data or random.random() < 0.05 else tree(random, data)
    return json.dumps(changed).encode()


def _drop(file: Any, name: str) -> None:
    if name in file:
        del file[name]


def _replace(file: Any, name: str, value: Any) -> None:
    attributes = dict(file[name].attrs) if name in file else {}
    _drop(file, name)
    file.create_dataset(name, data=value, dtype=_TEXT if isinstance(value, bytes) else None)
    file[name].attrs.update(attributes)


_CHANGES = (
    _remove, _rename, _numbers, _numbers, _shape, _type, _huge, _elsewhere, _attribute, _attribute,
    *(_text,) * 6,
)  # fmt: skip
HDF5: tuple[Mutator, ...] = (*BYTES, *(parts,) * 6)


def mutated_result(random: Random, content: bytes) -> bytes:
    """A result file after one mutation, or sometimes after two."""
    content = attempted(random.choice(HDF5), random, content)
    return random.choice(BYTES)(random, content) if random.random() < 0.1 else content
