"""Checks of the runs with extreme values: what is not accepted is found before any run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from freefloat.errors import InputError
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.yaml import validated
from freefloat.robot.parts import inertia_matrix
from freefloat.so3 import Array, IntArray, unit_quaternion
from freefloat.studies.document import error_of_study
from freefloat.studies.robot_values import INERTIA
from freefloat.studies.study import START_KEYS, Study
from freefloat.studies.track_section import TRACK, require_track_values

_BLOCK = 65_536
"""Runs whose values are drawn at a time."""
_ATTITUDES = ("attitude", "from_attitude", "quaternion")
"""Last words of keys of unit quaternions."""


def check_extreme_runs(study: Study) -> None:
    """Check that numbers of varied keys are accepted in the runs where they are extreme.

    These are the smallest and largest number of each component, the shortest and longest
    quaternion. Values that the study lists one by one, and what is accepted only together with
    others, are a matter of each run.

    Raises:
        InputError: The first error, with its run.
    """
    for key, section in study.content.vary.items():
        if section.values is not None:
            continue
        for number in sorted(set(_extreme_runs(study, key))):
            try:
                _check(study, key, number)
            except InputError as error:
                found = error_of_study(error, [key], study.source)
                if found is not None:
                    problem = f"run {number} of {study.count:,}: {found.problem}"
                    raise InputError(found.key, problem, found.accepted) from None


def _check(study: Study, key: str, number: int) -> None:
    """Check the value of a key in a run."""
    value, (owner, name) = study.parameters(number)[key], _owner(key)
    if key.startswith(TRACK):
        require_track_values(key, [value], study.source)
    elif key not in START_KEYS:
        document = study.document(number)
        content = validated(ScenarioFile, document, study.base_source)
        if key.startswith("timing."):
            content.timing.to_timing()
        value = _value_at(document, owner)
    if name == INERTIA:
        inertia_matrix(owner, value)
    elif name in _ATTITUDES and np.shape(value) == (4,):
        unit_quaternion(owner, value)


def _owner(key: str) -> tuple[str, str]:
    """The key of the list of which a key is an entry, or the key itself, and its last word."""
    whole, _, last = key.rpartition(".")
    owner = whole if last.isdecimal() and whole else key
    return owner, owner.rpartition(".")[2]


def _value_at(document: Any, key: str) -> Any:
    """The value of a key in the data of a scenario, which has it."""
    for name in key.split("."):
        document = document[int(name) if isinstance(document, list) else name]
    return document


def _extreme_runs(study: Study, key: str) -> Iterator[int]:
    """Numbers of the runs in which the value of a key is extreme."""
    extremes: dict[Any, tuple[float, int]] = {}
    for numbers, values in _blocks(study, key):
        columns: dict[Any, Array] = dict(enumerate(values.reshape(len(values), -1).T))
        if values.shape[1:] == (4,):
            columns["norm"] = np.linalg.norm(values, axis=1)
        for name, column in columns.items():
            for sign in (1.0, -1.0):
                place = int(np.argmin(sign * column))
                found = sign * float(column[place]), int(numbers[place])
                extremes[name, sign] = min(extremes.get((name, sign), found), found)
    yield from (number for _, number in extremes.values())


def _blocks(study: Study, key: str) -> Iterator[tuple[IntArray, Array]]:
    """Numbers of runs and their values of a key; of a range or grid the first run with each."""
    listed = study.variation.listed.get(key)
    if listed is not None:
        places, numbers = np.unique(study.variation.places(0, study.count)[key], return_index=True)
        yield numbers, np.array(listed, dtype=float)[places]
        return
    section, seed = study.content.vary[key], study.content.seed
    for first in range(0, study.count, _BLOCK):
        count = min(_BLOCK, study.count - first)
        yield np.arange(first, first + count), section.draws(seed, key, first, count)
