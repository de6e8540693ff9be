"""Tables of keys and options, made from the schemas of files and from the commands.

In a page, ``<!-- keys: scenario -->`` becomes the table of the sections of a scenario file,
``<!-- keys: scenario.path -->`` that of all keys below one, ``<!-- commands -->`` the table of
commands, ``<!-- command: plan -->`` the help of one, ``<!-- bundled: robots -->`` the table of the
robots (scenarios, studies) that come with freefloat, and ``<!-- dependencies -->`` that of the
packages that freefloat and its extras install.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib.metadata import metadata, requires
from typing import Any

import typer
from packaging.requirements import Requirement

from freefloat.cli.app import app
from freefloat.cli.models import catalogue
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.studies.study_file import StudyFile

SCHEMAS = {"scenario": ScenarioFile, "study": StudyFile}
MARKER = re.compile(
    r"^<!-- (bundled|keys|command|commands|dependencies)(?:: (\S+))? -->$", re.MULTILINE
)
EVERYWHERE = ("--json", "--quiet")
"""Options that every command has; a page lists them once."""
_LARGEST = 1e9
"""Bounds of this magnitude are those of all numbers."""


def filled(markdown: str) -> str:
    """A page with its markers replaced by what they stand for."""
    kinds = {
        "bundled": bundled_table,
        "keys": keys_table,
        "command": command_help,
        "commands": commands_table,
        "dependencies": dependencies_table,
    }
    return MARKER.sub(lambda match: kinds[match[1]](*filter(None, [match[2]])), markdown)


# --- keys of files ------------------------------------------------------------------------------


def keys_table(name: str) -> str:
    """The table of the keys of a file, or of all keys below one of its sections."""
    file, *path = name.split(".")
    schema = SCHEMAS[file].model_json_schema()
    if not path:
        rows = list(_rows(schema, schema["$defs"], "", nested=False))
    else:
        found = {k: _section(v, schema["$defs"]) for k, v in schema["properties"].items()}
        section = found.pop(path[0])
        elsewhere = {other["title"]: key for key, other in found.items() if other is not None}
        mark = "[]" * (schema["properties"][path[0]].get("type") == "array")
        rows = list(_rows(section, schema["$defs"], f"{path[0]}{mark}.", seen=elsewhere))
    return _table(("key", "value", "default", "meaning"), rows)


def key_names(name: str) -> list[str]:
    """The keys in such a table."""
    return re.findall(r"^\| `(\S+)` \|", keys_table(name), re.MULTILINE)


def _rows(
    section: Any, definitions: Any, prefix: str, nested: bool = True, seen: Any = None
) -> Iterator[tuple[str, ...]]:
    """Rows of a section's keys and, if nested, of the sections in it, the first time they occur."""
    seen = {} if seen is None else seen
    for key, field in section["properties"].items():
        name = f"{prefix}{key}"
        found = _section(field, definitions)
        target = definitions.get(field.get("$ref", "").rpartition("/")[2], {})
        described = [entry.get("description") for entry in (field, target, found or {})]
        if not any(described):
            raise ValueError(f"{name} has no description")
        meaning = prose(next(filter(None, described)))
        first = None if found is None else seen.setdefault(found["title"], name)
        if nested and first not in (None, name):
            meaning += f" Keys as below `{first}`."
        yield f"`{name}`", _kind(field, definitions), _default(field), meaning
        if nested and first == name:
            kind = _kind(field, definitions).partition(" ")[0]
            mark = {"list": "[]", "map": ".NAME"}.get(kind, "")
            yield from _rows(found, definitions, f"{name}{mark}.", seen=seen)


def _default(field: Any) -> str:
    if "default" not in field:
        return "required"
    default = field["default"]
    return "" if default in (None, "", []) or isinstance(default, dict) else f"`{_yaml(default)}`"


def _yaml(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_yaml, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def _section(field: Any, definitions: Any) -> Any:
    """The section that a field may hold: itself, in a list, or in a map; else None.

    Of several sections it has the keys of all, of which none is required.
    """
    if "properties" in field:
        return field
    target = definitions.get(field.get("$ref", "").rpartition("/")[2])
    inner = (target, *field.get("anyOf", []), field.get("items"), field.get("additionalProperties"))
    entries = (_section(entry, definitions) for entry in inner if isinstance(entry, dict))
    found = list(filter(None, entries))
    if len(found) < 2:
        return found[0] if found else None
    fields = (pair for section in found for pair in section["properties"].items())
    return found[0] | {"properties": {key: {"default": None} | field for key, field in fields}}


def _kind(field: Any, definitions: Any) -> str:
    """What a field accepts, in words."""
    options = field.get("anyOf", field.get("oneOf"))
    if options:
        kinds = [_kind(option, definitions) for option in options]
        return ", or ".join(dict.fromkeys(kind for kind in kinds if kind != "null"))
    if "$ref" in field:
        return _kind(definitions[field["$ref"].rpartition("/")[2]], definitions)
    if "enum" in field:
        return ", ".join(f"`{value}`" for value in field["enum"])
    if "const" in field:
        return f"`{field['const']}`"
    kind = field.get("type", "value")
    if "properties" in field:
        return "section"
    if kind == "object":
        return f"map from name to {_kind(field['additionalProperties'], definitions)}"
    if "prefixItems" in field:
        (entry,) = {_kind(entry, definitions) for entry in field["prefixItems"]}
        return f"{len(field['prefixItems'])} {_plural(entry)}"
    if kind == "array":
        return f"list of {_plural(_kind(field['items'], definitions))}"
    words = {"string": "text", "boolean": "`true`, `false`", "integer": "whole number"}
    return words.get(kind, kind) + _bounds(field)


def _plural(kind: str) -> str:
    """The plural of a kind: numbers > 0, lists of 3 numbers."""
    kinds = kind.split(", or ")
    words = [f"lists of {word}" if word[0].isdigit() else word for word in kinds]
    return " or ".join(re.sub(r"^(whole )?(\w+)(?=$| [^o])", r"\1\2s", word) for word in words)


def _bounds(field: Any) -> str:
    signs = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    bounds = [
        f"{sign} {field[key]:g}"
        for key, sign in signs.items()
        if abs(field.get(key, _LARGEST)) < _LARGEST
    ]
    return f" {', '.join(bounds)}" if bounds else ""


# --- commands -----------------------------------------------------------------------------------


def commands() -> dict[str, Any]:
    """The commands by name."""
    return dict(typer.main.get_command(app).commands)


def commands_table() -> str:
    """The table of all commands."""
    rows = [
        (f"[`freefloat {name}`](#{name})", prose(command.help.partition("\n\n")[0]))
        for name, command in commands().items()
    ]
    return _table(("command", "does"), rows)


def command_help(name: str) -> str:
    """Usage, description, arguments, options and examples of a command."""
    command = commands()[name]
    paragraphs = command.help.split("\n\n")
    examples = [text.removeprefix("Example: ") for text in paragraphs if text[:8] == "Example:"]
    arguments = [entry for entry in command.params if entry.param_type_name == "argument"]
    options = [entry for entry in command.params if entry.param_type_name == "option"]
    usage = " ".join(entry.metavar + ("..." if entry.nargs == -1 else "") for entry in arguments)
    rows = [(f"`{entry.metavar}`", "", prose(entry.help)) for entry in arguments]
    rows += [_option_row(entry) for entry in options if entry.opts[0] not in EVERYWHERE]
    text = [prose(entry) for entry in paragraphs if not entry.startswith("Example:")]
    lines = [f"`{' '.join(filter(None, ['freefloat', name, usage, '[OPTIONS]']))}`", *text]
    if rows:
        lines.append(_table(("argument or option", "default", "meaning"), rows))
    lines.append("\n".join(["```sh", *(" ".join(example.split()) for example in examples), "```"]))
    return "\n\n".join(lines)


def _option_row(option: Any) -> tuple[str, ...]:
    names = ", ".join(option.opts)
    value = "" if option.is_flag else f" {option.metavar}"
    shown = "" if option.is_flag or option.default is None else f"`{option.default}`"
    return f"`{names}{value}`", shown, prose(option.help)


def bundled_table(kind: str) -> str:
    """The table of the bundled robots, scenarios or studies."""
    entries = catalogue()[kind]
    details = [key for key in entries[0].details if key != "source"]
    rows = [
        (
            f"`{entry.name}`",
            prose(entry.description),
            *(f"`{entry.details[key]}`" for key in details),
        )
        for entry in entries
    ]
    return _table(("name", "description", *details), rows)


# --- dependencies --------------------------------------------------------------------------------


def dependencies_table() -> str:
    """The table of required packages, those of users' extras included, and licences."""
    rows = []
    for requirement in map(Requirement, requires("freefloat") or ()):
        marker = str(requirement.marker or "")
        extra = "".join(re.findall('extra == "(.*)"', marker))
        if extra not in ("docs", "test"):
            name, bounds = requirement.name, str(requirement.specifier)
            rows.append((f"`{name}`", f"`{bounds}`" * bool(bounds), extra, _licence(name)))
    return _table(("package", "versions", "extra", "licence"), rows)


def _licence(package: str) -> str:
    """The licence that a package states: an SPDX expression, a classifier, or a short text."""
    stated = metadata(package)
    classes = [line.split(" :: ") for line in stated.get_all("Classifier", [])]
    names = [words[-1] for words in classes if words[0] == "License" and len(words) > 2]
    first = (stated["License"] or "").partition("\n")[0].strip()
    text = "" if first.startswith("Copyright") else first
    return stated["License-Expression"] or ", ".join(names) or text or "in its files"


# --- Markdown -----------------------------------------------------------------------------------


def prose(text: str) -> str:
    """The text of a docstring as Markdown on one line."""
    words = " ".join(text.split()).replace("``", "`")
    parts = words.split("`")
    parts[::2] = [re.sub(r"([*|<])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
