"""Data of a run's scenario: the base scenario with the values of the run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

import yaml

from freefloat.errors import InputError
from freefloat.io.scenario.sampled_paths import sample_texts
from freefloat.io.scenario.scenario import Scenario
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.yaml import section_at, validated


def scenario_from(document: dict[str, Any], source: Path) -> Scenario:
    """The scenario with the given data; the source is its file, for relative paths."""
    content = validated(ScenarioFile, document, source)
    text = yaml.safe_dump(document, sort_keys=False)
    return Scenario(source, text, content, sample_texts(content, source.parent))


def with_values(document: dict[str, Any], values: dict[str, Any]) -> dict[str, Any]:
    """A copy of a scenario's data with values set at dotted paths.

    Missing sections are added, and missing lists with the schema's default.

    Raises:
        InputError: With the path as its key, if it leads through something that is no section.
    """
    copy = deepcopy(document)
    for path, value in values.items():
        *sections, last = path.split(".")
        node: Any = copy
        for count, section in enumerate(sections, 1):
            node = _entry(node, section, path, _default(sections[:count]))
        _entry(node, last, path, None)
        node[last if isinstance(node, dict) else int(last)] = deepcopy(value)
    return copy


def _default(keys: Sequence[str]) -> Any:
    """The default of a list in a scenario, else an empty section."""
    field = section_at(ScenarioFile, keys[:-1]).model_fields.get(keys[-1])
    default = None if field is None else field.get_default(call_default_factory=True)
    return list(default) if isinstance(default, tuple | list) else {}


def _entry(node: Any, name: str, path: str, default: Any) -> Any:
    if isinstance(node, dict):
        return node.setdefault(name, default)
    if not isinstance(node, list):
        problem = f"the base scenario has {node!r} above {name!r}"
        raise InputError(path, problem, "a path through keys or lists")
    if not (name.isdecimal() and int(name) < len(node)):
        problem = f"the base scenario has {len(node)} entries there"
        raise InputError(path, problem, f"an index from 0 to {len(node) - 1}")
    return node[int(name)]


def error_of_study(error: InputError, varied: Iterable[str], study: str) -> InputError | None:
    """An error of the scenario as one of the study file, None unless a varied key has it.

    A key of a list has it, too, where an entry of the list varies.
    """
    for key in varied:
        if f"{error.key}.".startswith(f"{key}."):
            return InputError(f"vary.{error.key}", error.problem, error.accepted, study)
        whole, _, entry = key.rpartition(".")
        if whole == error.key and entry.isdecimal():
            return InputError(f"vary.{key}", error.problem, error.accepted, study)
    return None
