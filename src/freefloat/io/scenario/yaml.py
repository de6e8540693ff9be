"""YAML files as plain data, checked by a schema; errors name file, line, key and what is accepted.

Tags, aliases and duplicate keys are errors.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import zip_longest
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from freefloat.errors import InputError, did_you_mean
from freefloat.io.scenario.field_types import descriptions

_MAX_SIZE = 1_000_000
"""Bytes; a scenario has a few hundred."""
_MAX_DEPTH = 16
"""Levels of nested lists and mappings; a scenario has five."""
_PREFIX = "tag:yaml.org,2002:"
_SafeLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_File = TypeVar("_File", bound=BaseModel)


def read_text(path: Path) -> str:
    """Text of a file that may hold YAML.

    Raises:
        InputError: If the file cannot be read, is not UTF-8 or is larger than 1 MB.
    """
    accepted = f"a readable UTF-8 text file of at most {_MAX_SIZE} bytes"
    try:
        with path.open("rb") as stream:
            content = stream.read(_MAX_SIZE + 1)
        if content.startswith(b"\x89HDF"):
            accepted = "a scenario; `freefloat view`, `check` and `export` read results"
            raise InputError("file", "it is a result", accepted, str(path))
        if len(content) > _MAX_SIZE:
            raise InputError("file", "it is too large", accepted, str(path))
        return content.decode("utf-8")
    except OSError as error:
        raise InputError("file", str(error.strerror), accepted, str(path)) from None
    except UnicodeDecodeError:
        raise InputError("file", "it is not UTF-8 text", accepted, str(path)) from None


class _PlainLoader(_SafeLoader):  # type: ignore[misc]
    """Safe YAML with numbers such as ``1e-3``, and with unique words as keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys: set[str] = set()
        for key, _ in node.value:
            if key.tag != f"{_PREFIX}str":
                raise yaml.MarkedYAMLError(None, None, "a key is not a word", key.start_mark)
            if key.value in keys:
                problem = f"key {key.value!r} is given twice"
                raise yaml.MarkedYAMLError(None, None, problem, key.start_mark)
            keys.add(key.value)
        return dict(super().construct_mapping(node, deep))


_REPLACED = [f"{_PREFIX}{kind}" for kind in ("int", "float", "timestamp")]
_PlainLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in _REPLACED]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_INTEGER = r"^[-+]?(?:0|[1-9]\d{0,17})$"
_NUMBER = r"^[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|\.inf|\.Inf|\.INF|\.nan|\.NaN|\.NAN)$"
for _kind, _pattern in (("int", _INTEGER), ("float", _NUMBER)):
    _PlainLoader.add_implicit_resolver(
        f"{_PREFIX}{_kind}", re.compile(_pattern), list("-+0123456789.")
    )


def parse_yaml(text: str, path: Path) -> dict[str, Any]:
    """Parse a YAML text whose top level is a mapping.

    Raises:
        InputError: With the line of the error.
    """
    accepted = "keys and values in plain YAML, such as 'task: pose', without tags and aliases"
    data: Any = None
    try:
        _require_plain(text)
        data = yaml.load(text, Loader=_PlainLoader)
        problem = "it is empty" if data is None else f"it is a {type(data).__name__}"
        mark = None
    except yaml.MarkedYAMLError as error:
        problem = str(error.problem or error.context)
        mark = error.problem_mark or error.context_mark
    except yaml.YAMLError as error:
        problem = str(error).splitlines()[0]
        mark = None
    if isinstance(data, dict):
        return data
    if text.lstrip().startswith("<"):
        problem, mark = "it is XML, such as a URDF, which a scenario names as robot.urdf", None
    raise InputError("file", problem, accepted, str(path), None if mark is None else mark.line + 1)


def _require_plain(text: str) -> None:
    """Raise a YAMLError for aliases, tags and deep nesting, before anything is constructed."""
    depth = 0
    event: Any
    for event in yaml.parse(text, Loader=_SafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        problem = None
        if depth > _MAX_DEPTH:
            problem = f"it is nested in more than {_MAX_DEPTH} levels"
        elif isinstance(event, yaml.AliasEvent):
            problem = f"it has an alias, *{event.anchor}"
        elif getattr(event, "tag", None) is not None:
            problem = f"it has a tag, {event.tag}"
        if problem is not None:
            raise yaml.MarkedYAMLError(None, None, problem, event.start_mark)


def _line_of(text: str, keys: Sequence[str | int]) -> int:
    """Line of the value that keys and list indices lead to, or of its innermost parent."""
    node: Any = yaml.compose(text, Loader=_SafeLoader)
    line = node.start_mark.line + 1
    for step in keys:
        if isinstance(node, yaml.MappingNode):
            pairs = [pair for pair in node.value if pair[0].value == step]
            if not pairs:
                break
            line = pairs[0][0].start_mark.line + 1
            node = pairs[0][1]
        elif isinstance(node, yaml.SequenceNode) and isinstance(step, int):
            node = node.value[step]
            line = node.start_mark.line + 1
    return int(line)


def validated(schema: type[_File], data: Any, source: Path, text: str | None = None) -> _File:
    """Instance of a schema made from the data of a file; its text gives the lines of errors.

    Raises:
        InputError: The first error: file, line, key, value given and values accepted.
    """
    try:
        return schema.model_validate(data)
    except ValidationError as error:
        keys, problem, accepted = _first_error(error, schema, data)
    line = None if text is None else _line_of(text, keys)
    raise InputError(".".join(map(str, keys)) or "file", problem, accepted, str(source), line)


@contextmanager
def error_context(source: Path, prefix: str = "", options: Sequence[str] = ()) -> Iterator[None]:
    """Context in which errors name a file and the key in it, unless they name a file already.

    Args:
        source: The file.
        prefix: Put before the key of the error, such as ``"path."``.
        options: Keys of errors that it leaves as they are: the file does not have them.
    """
    try:
        yield
    except InputError as error:
        if error.source is not None or error.key in options:
            raise
        raise error.found_in(str(source), prefix) from None


@contextmanager
def file_keys(**names: str) -> Iterator[None]:
    """Context in which errors name keys of a file instead of arguments of a call.

    Args:
        names: Key in the file by name of the argument.
    """
    try:
        yield
    except InputError as error:
        argument, dot, rest = error.key.partition(".")
        if argument not in names:
            raise
        raise error.with_key(names[argument] + dot + rest) from None


_ORDER = {"extra_forbidden": 0, "missing": 1}
"""Unknown keys are reported before missing ones, those before wrong values."""
_CONTAINERS = {
    "dict_type": "keys and values", "model_type": "keys and values",
    "model_attributes_type": "keys and values", "tuple_type": "a list", "list_type": "a list",
}  # fmt: skip
"""Accepted values, for the errors in which pydantic names types of Python."""


def _first_error(
    error: ValidationError, schema: type[BaseModel], data: Any
) -> tuple[list[str | int], str, str]:
    """Key path, problem and accepted values of the first error."""
    errors = sorted(error.errors(include_url=False), key=lambda entry: _ORDER.get(entry["type"], 2))
    paths = [_keys_in(data, entry["loc"]) for entry in errors]
    first, keys = errors[0], paths[0]
    for entry, path in zip(errors, paths, strict=True):  # the alternative that was meant
        unknown = first["type"] == "extra_forbidden"
        within = len(path) > len(keys) and path[: len(keys)] == keys
        if (within and (unknown or isinstance(path[-1], str))) or (
            unknown and path == keys and entry["type"] != "extra_forbidden"
        ):
            first, keys = entry, path
    kind, location, value = first["type"], first["loc"], first["input"]
    alternatives = [entry for entry, path in zip(errors, paths, strict=True) if path == keys]
    if kind == "extra_forbidden":
        sections = [section_at(schema, entry["loc"][:-1]) for entry in alternatives]
        fields = {name: info for section in sections for name, info in section.model_fields.items()}
        known = [info.alias or name for name, info in fields.items()]
        hint = did_you_mean(str(keys[-1]), known)
        return keys, f"there is no such key{hint}", ", ".join(known)
    description = description_at(schema, location)
    if kind == "missing" and isinstance(location[-1], str):
        accepted = f"a value: {description}" if description else "a value"
        return [*keys, location[-1]], "it is missing", accepted
    indices = [int(entry["loc"][-1]) for entry in alternatives if entry["type"] == "missing"]
    bounds = [entry for entry in alternatives if entry["type"].startswith(("greater", "less"))]
    message = (bounds or [first])[0]["msg"].removeprefix("Value error, ")
    message = message.removeprefix("Input should be ")
    accepted = message if bounds else _CONTAINERS.get(kind, message)
    if kind == "too_short":
        accepted = f"at least {first['ctx']['min_length']} of them"
    if len(indices) == len(alternatives):
        accepted = f"{1 + max(indices)} entries" + (f": {description}" if description else "")
    elif description and (len(alternatives) > 1 or kind == "string_pattern_mismatch"):
        bound = f"{message}: " if bounds else ""
        accepted = bound + description  # of a union, or in place of a regular expression
    elif kind == "tuple_type" and description:
        accepted = f"a list: {description}"
    shown = "nothing" if value is None else repr(value)
    if isinstance(value, dict) and value:
        shown = f"a section with {', '.join(map(str, value))}"
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


def section_at(schema: type[BaseModel], location: Sequence[str | int]) -> type[BaseModel]:
    """The section that a location leads to."""
    for *_, below in _fields_on(schema, location):
        schema = below
    return schema


def description_at(schema: type[BaseModel], location: Sequence[str | int]) -> str | None:
    """The description of the innermost field on a location, in the source of its section."""
    description = None
    for section, name, _ in list(_fields_on(schema, location))[-1:]:
        description = descriptions(section).get(name)
    return None if description is None else " ".join(description.replace("``", "").split())


def _fields_on(
    schema: type[BaseModel], location: Sequence[str | int]
) -> Iterator[tuple[type[BaseModel], str, type[BaseModel]]]:
    """Section and name of each field on a location, and the section to which it leads.

    Behind a field of several kinds of sections the location has the name of one of them.
    """
    for key, kind in zip_longest(location, location[1:]):
        for name, info in schema.model_fields.items():
            if key in (name, info.alias):
                sections = [*_sections_in(info.annotation)]
                meant = [section for section in sections if section.__name__ == kind]
                below = next(iter(meant or sections), schema)
                yield schema, name, below
                schema = below
                break


def _sections_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """The section classes in a type."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in getattr(annotation, "__args__", ()):
        yield from _sections_in(part)
