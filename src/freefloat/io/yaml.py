"""YAML read as plain data: no tags, no aliases, no key twice, every error with its line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

from freefloat.errors import InputError

_LARGEST = 1_000_000
"""Bytes; a scenario has a few hundred."""
_DEEPEST = 16
"""Levels of lists and mappings in each other; a scenario has five."""

_SafeLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The compiled one reads a megabyte in seconds, the other in half a minute."""


class _PlainLoader(_SafeLoader):  # type: ignore[misc]
    """Safe YAML with decimal numbers such as ``1e-3`` and words as keys, each given once."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag != "tag:yaml.org,2002:str":
                raise yaml.constructor.ConstructorError(
                    None, None, f"key {_written(key)} is not a word", key.start_mark
                )
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"key {key.value!r} is given twice", key.start_mark
                )
            seen.add(str(key.value))
        return dict(super().construct_mapping(node, deep))


def _written(key: yaml.Node) -> str:
    return key.value if isinstance(key, yaml.ScalarNode) else "of several parts"


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
    """Parse a YAML text whose top is a mapping.

    Args:
        text: What the file says.
        path: Its name, for errors.

    Returns:
        Its data.

    Raises:
        InputError: With the line of whatever is wrong.
    """
    try:
        depth = 0
        for event in yaml.parse(text, Loader=_SafeLoader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > _DEEPEST:
                raise _at(
                    event.start_mark,
                    path,
                    "it is nested too deeply",
                    f"valid YAML of {_DEEPEST} levels",
                )
            if isinstance(event, yaml.AliasEvent):
                raise _at(event.start_mark, path, f"alias *{event.anchor}", "values written out")
            tag = getattr(event, "tag", None)
            if tag is not None:
                raise _at(event.start_mark, path, f"tag {tag}", "plain values")
        data = yaml.load(text, Loader=_PlainLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise _at(mark, path, str(error.problem or error.context), "valid YAML") from None
    except yaml.YAMLError as error:
        problem = str(error).splitlines()[0]
        raise InputError("file", problem, "valid YAML", str(path)) from None
    if not isinstance(data, dict):
        found = "it is empty" if data is None else f"its top is a {type(data).__name__}"
        raise InputError("file", found, "keys and values, such as 'task: pose'", str(path))
    return data


def _at(mark: Any, path: Path, problem: str, accepted: str) -> InputError:
    line = f"line {mark.line + 1}" if mark is not None else "file"
    return InputError(line, problem, accepted, str(path))


def read_text(path: Path) -> str:
    """The text of a file that may hold YAML.

    Raises:
        InputError: If it cannot be read, is no UTF-8 or far too large.
    """
    accepted = f"a readable UTF-8 text file of at most {_LARGEST} bytes"
    try:
        with path.open("rb") as stream:
            content = stream.read(_LARGEST + 1)
        if len(content) > _LARGEST:
            raise InputError("file", "it is too large", accepted, str(path))
        return content.decode("utf-8")
    except OSError as error:
        raise InputError("file", str(error.strerror), accepted, str(path)) from None
    except UnicodeDecodeError:
        raise InputError("file", "it is not UTF-8 text", accepted, str(path)) from None
