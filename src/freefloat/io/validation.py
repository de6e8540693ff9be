"""Data checked by a pydantic schema, with errors that name file, line, key and what is accepted."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from freefloat.errors import InputError, did_you_mean
from freefloat.io.yaml import line_of

_File = TypeVar("_File", bound=BaseModel)
_ORDER = {"extra_forbidden": 0, "missing": 1}
"""Unknown keys are reported before missing ones, those before wrong values."""
_CONTAINERS = {
    "dict_type": "keys and values", "model_type": "keys and values",
    "model_attributes_type": "keys and values", "tuple_type": "a list", "list_type": "a list",
}  # fmt: skip
"""Accepted values, for the errors in which pydantic names types of Python."""


def validated(schema: type[_File], data: Any, source: Path, text: str | None = None) -> _File:
    """Instance of a schema made from data.

    Args:
        schema: Of the file.
        data: Content of the file.
        source: Its name, for errors.
        text: Its YAML text, for the lines of errors.

    Raises:
        InputError: The first error: file, line, key, value given and values accepted.
    """
    try:
        return schema.model_validate(data)
    except ValidationError as error:
        keys, problem, accepted = _first_error(error, schema, data)
    line = None if text is None else line_of(text, keys)
    raise InputError(".".join(map(str, keys)) or "file", problem, accepted, str(source), line)


@contextmanager
def error_context(source: Path | None, prefix: str = "", only: str | None = None) -> Iterator[None]:
    """Context in which errors name a file and the key in it, unless they name a file already.

    Args:
        source: The file.
        prefix: Put before the key of the error, such as ``"path."``.
        only: Key of the errors that this applies to; default: all.
    """
    try:
        yield
    except InputError as error:
        if source is None or error.source is not None or only not in (None, error.key):
            raise
        raise error.found_in(str(source), prefix) from None


def _first_error(
    error: ValidationError, schema: type[BaseModel], data: Any
) -> tuple[list[str | int], str, str]:
    """Key path, problem and accepted values of the first error."""
    errors = sorted(error.errors(include_url=False), key=lambda one: _ORDER.get(one["type"], 2))
    first = errors[0]
    for inner in errors:  # of alternatives, the one that the value was meant for
        inner_keys, keys = _keys_in(data, inner["loc"]), _keys_in(data, first["loc"])
        if len(inner_keys) > len(keys) and inner_keys[: len(keys)] == keys:
            first = inner if isinstance(inner_keys[-1], str) else first
    kind, location, value = first["type"], first["loc"], first["input"]
    keys = _keys_in(data, location)
    if kind == "extra_forbidden":
        known = [info.alias or name for name, info in _section_at(schema, keys[:-1])]
        hint = did_you_mean(str(keys[-1]), known)
        return keys, f"there is no such key{hint}", ", ".join(known)
    description = _description(schema, location)
    if kind == "missing" and isinstance(location[-1], str):
        return [*keys, location[-1]], "it is missing", description or "a value"
    alternatives = [one for one in errors if _keys_in(data, one["loc"]) == keys]
    indices = [one["loc"][-1] for one in alternatives if one["type"] == "missing"]
    message = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    accepted = _CONTAINERS.get(kind, message)
    if len(indices) == len(alternatives):
        accepted = f"{1 + max(index for index in indices if isinstance(index, int))} entries"
    elif len(alternatives) > 1 and description:  # of a union
        accepted = description
    shown = "nothing" if value is None else repr(value)
    shown = shown if len(shown) <= 80 else f"{shown[:77]}..."
    hint = did_you_mean(str(value), re.findall("'([^']*)'", accepted))
    return keys, f"{shown} was given{hint}", accepted


def _keys_in(data: Any, location: Sequence[str | int]) -> list[str | int]:
    """The part of a pydantic location that leads through the data, not through union members."""
    keys: list[str | int] = []
    for step in location:
        try:
            data = data[step]
        except (KeyError, IndexError, TypeError):
            continue
        keys.append(step)
    return keys


def _section_at(schema: Any, keys: Sequence[str | int]) -> Iterator[tuple[str, Any]]:
    """Fields of the section that a key path leads to."""
    for key in keys:
        for name, info in schema.model_fields.items():
            if key in (name, info.alias):
                schema = next(_sections_in(info.annotation), schema)
    yield from schema.model_fields.items()


def _sections_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """The section classes in a type."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in getattr(annotation, "__args__", ()):
        yield from _sections_in(part)


def _description(schema: type[BaseModel], location: Sequence[str | int]) -> str | None:
    """Description of the innermost described field on a pydantic location."""
    found: str | None = None
    for index, key in enumerate(location):
        for name, info in _section_at(schema, location[:index]):
            if key in (name, info.alias):
                found = info.description
    return None if found is None else " ".join(found.split())
