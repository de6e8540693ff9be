"""YAML files as plain data: no tags, no aliases, no duplicate keys; errors name the line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from freefloat.errors import InputError

_MAX_SIZE = 1_000_000
"""Bytes; a scenario has a few hundred."""
_MAX_DEPTH = 16
"""Levels of nested lists and mappings; a scenario has five."""
_TEXT = "tag:yaml.org,2002:str"
_SafeLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _PlainLoader(_SafeLoader):  # type: ignore[misc]
    """Safe YAML with numbers such as ``1e-3``, and with unique words as keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys: set[str] = set()
        for key, _ in node.value:
            problem = None
            if not isinstance(key, yaml.ScalarNode) or key.tag != _TEXT:
                problem = f"key {getattr(key, 'value', '')!r} is not a word"
            elif key.value in keys:
                problem = f"key {key.value!r} is given twice"
            if problem is not None:
                raise yaml.constructor.ConstructorError(None, None, problem, key.start_mark)
            keys.add(str(key.value))
        return dict(super().construct_mapping(node, deep))


_REPLACED = tuple(f"tag:yaml.org,2002:{kind}" for kind in ("int", "float", "timestamp"))
_PlainLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in _REPLACED]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_PlainLoader.add_implicit_resolver(
    "tag:yaml.org,2002:int", re.compile(r"^[-+]?(?:0|[1-9]\d{0,17})$"), list("-+0123456789")
)
_PlainLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(
        r"^[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|\.inf|\.Inf|\.INF|\.nan|\.NaN|\.NAN)$"
    ),
    list("-+0123456789."),
)


def parse_yaml(text: str, path: Path) -> dict[str, Any]:
    """Parse a YAML text whose top level is a mapping.

    Args:
        text: Content of the file.
        path: Its name, for errors.

    Raises:
        InputError: With the line of the error.
    """
    try:
        _refuse_references(text, path)
        data = yaml.load(text, Loader=_PlainLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise _error(mark, path, str(error.problem or error.context), "valid YAML") from None
    except yaml.YAMLError as error:
        raise _error(None, path, str(error).splitlines()[0], "valid YAML") from None
    if not isinstance(data, dict):
        problem = "it is empty" if data is None else f"it is a {type(data).__name__}"
        raise _error(None, path, problem, "keys and values, such as 'task: pose'")
    return data


def _refuse_references(text: str, path: Path) -> None:
    """Raise an InputError for aliases, tags and deep nesting, before anything is constructed."""
    depth = 0
    for event in yaml.parse(text, Loader=_SafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > _MAX_DEPTH:
            accepted = f"at most {_MAX_DEPTH} nested levels"
            raise _error(event.start_mark, path, "it is nested too deeply", accepted)
        if isinstance(event, yaml.AliasEvent):
            raise _error(event.start_mark, path, f"alias *{event.anchor}", "values written out")
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise _error(event.start_mark, path, f"tag {tag}", "plain values")


def _error(mark: Any, path: Path, problem: str, accepted: str) -> InputError:
    return InputError("file", problem, accepted, str(path), None if mark is None else mark.line + 1)


def line_of(text: str, keys: Sequence[str | int]) -> int | None:
    """Line of the value that a sequence of keys and list indices leads to, or of its parent.

    Args:
        text: A valid YAML text.
        keys: Keys and indices from the top level.
    """
    node: Any = yaml.compose(text, Loader=_SafeLoader)
    if node is None:
        return None
    line = node.start_mark.line + 1
    for step in keys:
        if isinstance(node, yaml.MappingNode):
            pairs = [pair for pair in node.value if pair[0].value == step]
            if not pairs:
                break
            line, node = pairs[0][0].start_mark.line + 1, pairs[0][1]
        elif isinstance(node, yaml.SequenceNode) and isinstance(step, int):
            node = node.value[step]
            line = node.start_mark.line + 1
    return int(line)


def read_text(path: Path) -> str:
    """Text of a file that may hold YAML.

    Raises:
        InputError: If the file cannot be read, is not UTF-8 or is larger than 1 MB.
    """
    accepted = f"a readable UTF-8 text file of at most {_MAX_SIZE} bytes"
    try:
        with path.open("rb") as stream:
            content = stream.read(_MAX_SIZE + 1)
        if len(content) > _MAX_SIZE:
            raise InputError("file", "it is too large", accepted, str(path))
        return content.decode("utf-8")
    except OSError as error:
        raise InputError("file", str(error.strerror), accepted, str(path)) from None
    except UnicodeDecodeError:
        raise InputError("file", "it is not UTF-8 text", accepted, str(path)) from None
