"""Checks of the runs of a study: what none of them accepts is found before any is executed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.errors import InputError
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.yaml import validated
from freefloat.robot.parts import inertia_matrix
from freefloat.so3 import unit_quaternion
from freefloat.studies.study import Study
from freefloat.studies.study_file import START_KEYS, STARTS, TRACK, TrackSection
from freefloat.studies.variation import error_of_study
from freefloat.studies.varied_robots import INERTIA, SCALE_MASS

_VALIDATED_RUNS = 1000
_ATTITUDES = ("attitude", "from_attitude", "quaternion")
"""Last words of keys of unit quaternions."""


def check_runs(study: Study) -> None:
    """Check that values are accepted in runs, and the scenario where it chooses the arm branch.

    Raises:
        InputError: The first error.
    """
    valid = _valid_run(study)
    _check_extreme(study)
    _check_unvaried(study)
    _check_robot(study, valid)


def _valid_run(study: Study) -> int:
    """The number of a valid run; of many runs a sample is validated.

    Raises:
        InputError: If there is none: the error of run 0, of the study or of the base scenario.
    """
    errors: list[InputError] = []
    for number in range(0, study.count, -(-study.count // _VALIDATED_RUNS)):
        try:
            validated(ScenarioFile, study.document(number), study.base_source)
            return number
        except InputError as error:
            errors.append(error)
    first = errors[0]
    of_study = error_of_study(first, study.content.vary, study.source)
    if of_study is not None:
        raise InputError(of_study.key, f"run 0: {of_study.problem}", of_study.accepted)
    of_base = _error_of_base(study)
    if of_base is not None and (of_base.key, of_base.problem) == (first.key, first.problem):
        raise first
    below = [f"vary.{key}" for key in study.content.vary if key.startswith(f"{first.key}.")]
    raise InputError([*below, "vary"][0], f"run 0: {first.key}: {first.problem}", first.accepted)


def _check_extreme(study: Study) -> None:
    """Check that numbers of varied keys are accepted in the runs where they are extreme.

    These are the smallest and largest number of each component, the shortest and longest
    quaternion; of the section track also the values of lists. Other values of lists, and what is
    accepted only together with others, are a matter of each run.

    Raises:
        InputError: The first error, with its run.
    """
    variation = study.variation
    drawn = [key for key, section in study.content.vary.items() if section.values is None]
    every = variation.columns(0, study.count) if drawn else {}
    runs = {key: _extreme_runs(key, every) for key in drawn}
    for key, places in variation.places(0, study.count).items():
        if key.startswith(TRACK):
            runs[key] = np.unique(places, return_index=True)[1].tolist()
    for key, number in ((key, number) for key, numbers in runs.items() for number in numbers):
        try:
            _check(study, key, number)
        except InputError as error:
            if found := error_of_study(error, [key], study.source):
                problem = f"run {number} of {study.count:,}: {found.problem}"
                raise InputError(found.key, problem, found.accepted) from None


def _extreme_runs(key: str, every: Mapping[str, npt.NDArray[Any]]) -> list[int]:
    """Numbers of the runs in which one of the components of a key is extreme, or their norm."""
    columns = [column for name, column in every.items() if key in (name, name.rpartition(".")[0])]
    if len(columns) == 4:
        columns = [*columns, np.linalg.norm(columns, axis=0)]
    return sorted({int(find(column)) for column in columns for find in (np.argmin, np.argmax)})


def _check(study: Study, key: str, number: int) -> None:
    """Check the value of a key in a run."""
    value, (owner, name) = study.parameters(number)[key], _owner(key)
    if key.startswith(TRACK):
        try:
            validated(TrackSection, {key.removeprefix(TRACK): value}, study.base_source)
        except InputError as error:
            raise error.with_key(key) from None
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


def _check_robot(study: Study, number: int) -> None:
    """Check that the robot of a run has the links and joints that factors and limits name.

    What other varied values name is a matter of each run.
    """
    if "robot.urdf" in study.content.vary:
        return
    scenario = study.scenario(number)
    try:
        scenario.model()
        scenario.limits()
    except InputError as error:
        found = error_of_study(error, study.content.vary, study.source)
        if found is None or found.key.startswith(f"vary.{SCALE_MASS}"):
            raise (found or error) from None


def _error_of_base(study: Study) -> InputError | None:
    try:
        validated(ScenarioFile, study.base, study.base_source)
    except InputError as error:
        return error
    return None


def _check_unvaried(study: Study) -> None:
    """Check that the unvaried scenario is valid where it chooses the arm branch."""
    start = study.content.start or study.default_start
    if not study.initial_attitude(0) or (start is not None and start.joints is None):
        return
    if (error := _error_of_base(study)) is not None:
        problem = f"the unvaried scenario has no motion: {error.key}: {error.problem}"
        raise InputError("start", problem, STARTS)
    if study.content.start is not None:
        _ = study.start_problem  # whose robot has the joints
