"""Values of the varied keys in the runs of a study, and scenarios with these values."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.tasks import Task
from freefloat.errors import InputError
from freefloat.io.scenario.field_types import Section
from freefloat.io.scenario.scenario import Scenario
from freefloat.io.scenario.schema import MarginSection, ScenarioFile
from freefloat.io.scenario.yaml import section_at, validated
from freefloat.robot.model import FreeFloatingModel
from freefloat.singularities.global_maximum import largest_magnitude
from freefloat.so3 import Array, IntArray
from freefloat.studies.columns import by_entry
from freefloat.studies.sampling import ValuesSection

Values = Mapping[str, Array | list[Any]]
"""Values of runs by key: arrays of random ones, lists of listed ones."""
_RENAMED = {"margin": "margin.section"}
"""Columns of keys with the name of a result."""


@dataclass(frozen=True, eq=False)
class Variation:
    """What varies between the runs of a study; runs are numbered from 0.

    Attributes:
        vary: The values of the varied keys.
        zipped: Whether listed values of several keys are paired, not crossed.
        draws: Number of random draws for each combination of listed values, 1 without random keys.
        seed: Seed of the draws.
    """

    vary: Mapping[str, ValuesSection] = field(repr=False)
    zipped: bool
    draws: int
    seed: int

    @cached_property
    def listed(self) -> dict[str, list[Any]]:
        """The values of keys whose values are listed."""
        values = {key: section.listed() for key, section in self.vary.items()}
        return {key: listed for key, listed in values.items() if listed is not None}

    @cached_property
    def combinations(self) -> int:
        """Number of combinations of listed values."""
        lengths = [len(values) for values in self.listed.values()]
        if self.zipped:
            return lengths[0] if lengths else 1
        return math.prod(lengths)

    @property
    def count(self) -> int:
        """Number of runs."""
        return self.combinations * self.draws

    def places(self, first: int, count: int) -> dict[str, IntArray]:
        """Indices of the listed values in runs ``first`` to ``first + count``, by key."""
        combination = np.arange(first, first + count) // self.draws
        places: dict[str, IntArray] = {}
        for key, listed in reversed(self.listed.items()):  # the last key varies fastest
            places[key] = combination % len(listed)
            combination = combination if self.zipped else combination // len(listed)
        return places

    def values(self, first: int, count: int) -> Values:
        """The values in runs ``first`` to ``first + count``, in the order of the study file."""
        places, listed = self.places(first, count), self.listed
        return {
            key: [listed[key][place] for place in places[key].tolist()]
            if key in listed
            else section.draws(self.seed, key, first, count)
            for key, section in self.vary.items()
        }

    @cached_property
    def _listed_columns(self) -> dict[str, dict[str, npt.NDArray[Any]]]:
        """Listed values of each key by column."""
        return {key: by_entry(_RENAMED.get(key, key), v) for key, v in self.listed.items()}

    def columns(self, first: int, count: int) -> dict[str, npt.NDArray[Any]]:
        """The values in runs ``first`` to ``first + count`` as columns of tables.

        Numbers are named by their key, entries of lists also by their index, as ``momentum.2``;
        other values are texts.
        """
        places, columns = self.places(first, count), dict[str, npt.NDArray[Any]]()
        for key, section in self.vary.items():
            if key in self.listed:
                values = self._listed_columns[key].items()
                columns |= {name: column[places[key]] for name, column in values}
                continue
            draws = section.draws(self.seed, key, first, count)
            if draws.ndim == 1:
                columns[key] = draws
            else:
                columns |= {f"{key}.{index}": column for index, column in enumerate(draws.T)}
        return columns

    def parameters(self, number: int) -> dict[str, Any]:
        """The values in a run: numbers, lists, or whatever a key accepts."""
        values = self.values(number, 1).items()
        return {key: v[0].tolist() if isinstance(v, np.ndarray) else v[0] for key, v in values}


def scenario_from(document: dict[str, Any], source: Path) -> Scenario:
    """The scenario with the given data; the source is its file, for relative paths."""
    content = validated(ScenarioFile, document, source)
    text = yaml.safe_dump(document, sort_keys=False)
    return Scenario(source, text, content, content.sample_texts(source.parent))


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


class _MarginFile(Section):
    """Task and margin of a scenario file."""

    task: Task
    margin: MarginSection


def margin_value(
    document: dict[str, Any], source: Path, robot: Callable[[], FreeFloatingModel]
) -> dict[str, Any]:
    """The margin in place of a fraction of the measure of the base scenario's robot, if any.

    Args:
        document: Data of a scenario.
        source: File of the base scenario.
        robot: Reads its robot, which other margins do not need.

    Raises:
        InputError: If a value is not accepted.
    """
    margin, task = document.get("margin"), document.get("task")
    if task is None or not isinstance(margin, dict) or margin.get("fraction_of") == "run":
        return {}
    content = validated(_MarginFile, {"task": task, "margin": margin}, source)
    measure, fraction = content.margin.measure, content.margin.fraction
    if fraction is None:
        return {}
    try:
        largest = _largest(robot(), content.task, measure)
    except InputError as error:
        problem = f"the robot of the base scenario: {error.key}: {error.problem}"
        raise InputError("margin.fraction", problem, "fraction_of: run, or value") from None
    return {"margin": {"measure": measure, "value": fraction * largest}}


@lru_cache(maxsize=8)
def _largest(robot: FreeFloatingModel, task: Task, measure: str) -> float:
    return largest_magnitude(robot, task, singularity_measure(robot, task, measure))


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
        accepted = f"an index from 0 to {len(node) - 1}" if node else "a base scenario with some"
        raise InputError(path, problem, accepted)
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
