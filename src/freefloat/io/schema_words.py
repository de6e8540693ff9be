"""What a schema accepts at a place of a file, in words: keys, how many numbers, which names."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel

from freefloat.io.schema_types import Inertia
from freefloat.robot.parts import INERTIA

_COUNTS = {2: "two", 3: "three", 4: "four", 6: "six"}


def described_at(schema: type[BaseModel], location: tuple[int | str, ...]) -> str | None:
    """What a section, a list of numbers or a name may be.

    Args:
        schema: Of the whole file.
        location: Of a value in it, as pydantic's errors tell it.

    Returns:
        None where there is more to say than a few words.
    """
    here = _annotation_at(schema, location)
    if here == Inertia:
        return INERTIA
    if isinstance(here, type) and issubclass(here, BaseModel):
        return f"keys: {', '.join(keys_of(here))}"
    if isinstance(here, type) and issubclass(here, Enum):
        return ", ".join(str(one) for one in here)
    parts = get_args(here)
    if get_origin(here) is tuple and all(_bare(part) is float for part in parts):
        return f"{_COUNTS[len(parts)]} numbers"
    return None


def keys_of(section: type[BaseModel]) -> list[str]:
    """The keys of a section as they are written."""
    return [info.alias or name for name, info in section.model_fields.items()]


def sections_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """The sections that a value may be."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in getattr(annotation, "__args__", ()):
        yield from sections_in(part)


def _annotation_at(schema: type[BaseModel], location: tuple[int | str, ...]) -> Any:
    """The type of a value; of an entry of a tuple that of the tuple."""
    here: Any = schema
    for part in location:
        if isinstance(part, int):
            here = _bare(get_args(here)[0]) if get_origin(here) is list else here
            continue
        section = next(sections_in(here), None)
        fields = {} if section is None else section.model_fields
        for name, info in fields.items():
            if part in (name, info.alias):
                here = _bare(info.annotation)
    return here


def _bare(annotation: Any) -> Any:
    """A type without what restricts it, and without None."""
    if get_origin(annotation) is Annotated:
        return _bare(get_args(annotation)[0])
    parts = get_args(annotation)
    if type(None) in parts:
        kept = [part for part in parts if part is not type(None)]
        return _bare(kept[0]) if len(kept) == 1 else annotation
    return annotation
