"""The keys of a scenario by their dotted paths: which there are, and values put in their places."""

from __future__ import annotations

import types
from collections.abc import Iterator
from copy import deepcopy
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel

from freefloat.errors import InputError, did_you_mean


def refuse_unknown_path(schema: type[BaseModel], path: str) -> None:
    """Refuse a dotted path that leads to no key of a file.

    Args:
        schema: The file's.
        path: Words with dots between; entries of lists are numbers from 0.

    Raises:
        InputError: With the path as its key, naming the first word that is wrong and what would do
            in its place.
    """
    here: list[Any] = [schema]
    for word in path.split("."):
        inner = [found for one in here for found in _inner(one, word)]
        if not inner:
            known = list(dict.fromkeys(name for one in here for name in _words(one)))
            told = f"there is no such key: {word!r}{did_you_mean(word, known)}"
            raise InputError(path, told, ", ".join(known) or "nothing below it")
        here = inner


def _plain(annotation: Any) -> Iterator[Any]:
    """The kinds of value that a key may have, unions and annotations taken apart."""
    origin = get_origin(annotation)
    if origin is Annotated:
        yield from _plain(get_args(annotation)[0])
    elif origin in (Union, types.UnionType):
        for one in get_args(annotation):
            yield from _plain(one)
    else:
        yield annotation


def _inner(annotation: Any, word: str) -> Iterator[Any]:
    """What a word leads to in each kind of value that knows it."""
    for kind in _plain(annotation):
        origin, parts = get_origin(kind), get_args(kind)
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            for name, info in kind.model_fields.items():
                if word == (info.alias or name):
                    yield info.annotation
        elif origin is dict:
            names = list(_words(kind))
            if word in names or (not names and word):
                yield parts[1]
        elif origin is list and word.isdecimal():
            yield parts[0]
        elif origin is tuple and word.isdecimal() and int(word) < len(parts):
            yield parts[int(word)]


def _words(annotation: Any) -> Iterator[str]:
    """The words that lead on, where they are few."""
    for kind in _plain(annotation):
        origin, parts = get_origin(kind), get_args(kind)
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from (info.alias or name for name, info in kind.model_fields.items())
        elif origin is dict and get_origin(parts[0]) is Literal:
            yield from get_args(parts[0])
        elif origin is tuple:
            yield from map(str, range(len(parts)))


def with_values(document: dict[str, Any], values: dict[str, Any]) -> dict[str, Any]:
    """A copy of a file's data with values put where their paths lead.

    Sections that are not there are made.

    Args:
        document: The data.
        values: By dotted path.

    Raises:
        InputError: With the path as its key, if something else stands in its way.
    """
    copy = deepcopy(document)
    for path, value in values.items():
        *way, last = path.split(".")
        node: Any = copy
        for word in way:
            node = _entered(node, word, path)
        if isinstance(node, dict):
            node[last] = deepcopy(value)
        else:
            _entered(node, last, path)
            node[int(last)] = deepcopy(value)
    return copy


def _entered(node: Any, word: str, path: str) -> Any:
    if isinstance(node, dict):
        return node.setdefault(word, {})
    if isinstance(node, list):
        if word.isdecimal() and int(word) < len(node):
            return node[int(word)]
        accepted = f"numbers from 0 to {len(node) - 1}"
        raise InputError(path, f"the base scenario has {len(node)} entries there", accepted)
    raise InputError(
        path, f"the base scenario has {node!r} above {word!r}", "a path through keys or lists"
    )
