"""What a schema finds wrong in a file, in our words: the key, what was given, what is accepted."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from freefloat.errors import InputError, did_you_mean
from freefloat.io.schema_words import described_at, keys_of, sections_in

_File = TypeVar("_File", bound=BaseModel)


def validated(schema: type[_File], data: Any, source: Path) -> _File:
    """Data as a schema has it.

    Raises:
        InputError: Naming the file, the key, what was given and what is accepted.
    """
    try:
        return schema.model_validate(data)
    except ValidationError as error:
        raise _first_error(error, schema, source) from None


_WORDS = {
    "float_type": "a number",
    "int_type": "an integer",
    "bool_type": "true or false",
    "string_type": "text",
    "finite_number": "a finite number",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "keys and values",
    "model_type": "keys and values",
    "model_attributes_type": "keys and values",
    "string_too_short": "a name",
}
"""What is accepted, for the kinds of pydantic's errors whose own words are Python's."""
_PYDANTICS = ("constrained-float", "float")
"""Steps of a location that are pydantic's, not the file's; so is any with a bracket."""


def _first_error(error: ValidationError, schema: type[BaseModel], source: Path) -> InputError:
    """Pydantic's first error in our words; unknown and missing keys before wrong values."""
    order = {"extra_forbidden": 0, "missing": 1}
    found = sorted(error.errors(), key=lambda e: order.get(e["type"], 2))
    first = found[0]
    kind, details = first["type"], first.get("ctx", {})
    if kind == "extra_forbidden":
        return _unknown_key(schema, first["loc"], source)
    location = [str(part) for part in first["loc"] if "[" not in str(part)]
    steps = [part for part in location if part not in _PYDANTICS]
    key = ".".join(steps) or "file"
    if kind == "missing":
        if len(first["loc"]) > 1 and isinstance(first["loc"][-1], int):
            short = ".".join(steps[:-1])
            return InputError(short, "it is too short", _wanted(schema, first), str(source))
        return InputError(key, "it is missing", _wanted(schema, first), str(source))
    accepted = _WORDS.get(kind) or str(first["msg"]).removeprefix("Value error, ")
    if kind in ("tuple_type", "model_type", "model_attributes_type"):
        accepted = described_at(schema, first["loc"]) or accepted
    if kind == "too_long":
        most = f"{details['max_length']} entries at most"
        accepted = described_at(schema, first["loc"]) or most
    if kind == "too_short":
        accepted = f"{details['min_length']} entries or more"
    if len(location) != len(steps):  # one number, or a map
        accepted = "a number from 1e-06 to 1e+06, or a map from link to such a number"
        if steps[0] == "limits":
            accepted = "a number above 0, a map from joint to such a number, or urdf"
    accepted = accepted.removeprefix("Input should be ")
    known = re.findall("'([^']*)'", details.get("expected", ""))  # of an enumeration
    hint = did_you_mean(_short(first["input"]).strip("'"), known)
    return InputError(key, f"{_short(first['input'])} was given{hint}", accepted, str(source))


def _unknown_key(
    schema: type[BaseModel], location: tuple[int | str, ...], source: Path
) -> InputError:
    """The last step is as it was written, whatever it looks like."""
    *within, given = map(str, location)
    steps = [step for step in within if "[" not in step and step not in _PYDANTICS]
    keys = _keys_at(schema, location[:-1])
    told = f"there is no such key{did_you_mean(given, keys)}"
    return InputError(".".join([*steps, given]), told, ", ".join(keys), str(source))


def _wanted(schema: type[BaseModel], error: Mapping[str, Any]) -> str:
    return described_at(schema, error["loc"]) or "a value, see freefloat schema"


def _short(given: Any) -> str:
    text = "nothing" if given is None else repr(given)
    return text if len(text) <= 80 else text[:77] + "..."


def _keys_at(schema: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """The keys that the section at a location knows."""
    for part in location:
        for name, info in schema.model_fields.items():
            if part in (name, info.alias):
                schema = next(sections_in(info.annotation), schema)
    return keys_of(schema)
