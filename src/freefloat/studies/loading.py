"""Reading of study files, with the checks that come before any run."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.attitude_grids import attitude_grid
from freefloat.dynamics.tasks import Task
from freefloat.errors import FreeFloatError, InputError
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.yaml import parse_yaml, read_text, validated
from freefloat.robot.named_files import find_scenario, find_study, is_file
from freefloat.robot.parts import inertia_matrix
from freefloat.so3 import unit_quaternion
from freefloat.studies.sampling import MAX_RUNS
from freefloat.studies.study import Study
from freefloat.studies.study_file import (
    START_KEYS,
    STARTS,
    TRACK,
    Combine,
    Command,
    StudyFile,
    TrackSection,
)
from freefloat.studies.variation import error_of_study
from freefloat.studies.varied_robots import INERTIA, SCALE_MASS

_MAX_VALUES = 5 * MAX_RUNS
_VALIDATED_RUNS = 1000
_ATTITUDES = ("attitude", "from_attitude", "quaternion")
"""Last words of keys of unit quaternions."""


def load_study(name: str | Path) -> Study:
    """Read a study, a file or the name of a bundled one, and its base scenario.

    Raises:
        InputError: If a key or value is not accepted, or no run is valid.

    Example:
        >>> study = ff.load_study("planar_3dof/grid")
        >>> study.count
        15
    """
    source = find_study(str(name))
    text = read_text(source)
    data = parse_yaml(text, source)
    if "branch" in data:
        raise InputError("branch", "it is replaced by start", STARTS, str(source))
    try:
        content = validated(StudyFile, data, source, text)
        base = _find_base(content.base, source.parent)
        study = Study(str(source), content, base, parse_yaml(read_text(base), base))
        _check_values(study)
        _check_use(study)
        _check_start(study)
        valid = _valid_run(study)
        _check_extreme(study)
        _check_unvaried(study)
        _check_branch(study, valid)
        _check_robot(study, valid)
    except InputError as error:
        raise error.found_in(str(source)) from None
    return study


def _find_base(name: str, folder: Path) -> Path:
    if is_file(folder / name):
        return folder / name
    try:
        return find_scenario(name)
    except InputError as error:
        raise InputError("base", error.problem, error.accepted) from None


def _check_values(study: Study) -> None:
    """Check that listed and random values make an accepted number of runs."""
    content, vary = study.content, study.content.vary
    for key, section in vary.items():
        if section.so3 is not None and section.so3.center is not None:
            unit_quaternion(f"vary.{key}.so3.center", section.so3.center)
    if content.attitude is not None:
        unit_quaternion("attitude", content.attitude)
    numbers = sum(section.numbers for section in vary.values())
    if numbers > _MAX_VALUES:
        raise InputError("vary", f"{numbers:,} numbers are listed", f"at most {_MAX_VALUES:,}")
    lengths = {key: len(values) for key, values in study.variation.listed.items()}
    if content.combine is Combine.ZIPPED and len(set(lengths.values())) > 1:
        raise InputError("combine", f"the lists have the lengths {lengths}", "equal lengths")
    random = [key for key, section in vary.items() if section.random]
    if bool(random) != (content.cases is not None):
        accepted = f"the number of draws of {', '.join(random)}" if random else "no such key"
        raise InputError("cases", f"{content.cases}, with {len(random)} random keys", accepted)
    for key, used in (("seed", random), ("combine", len(lengths) > 1)):
        if key in content.model_fields_set and not used:
            raise InputError(key, "it has no effect on these keys", "a study without it")
    if study.count > MAX_RUNS:
        raise InputError("vary", f"{study.count:,} runs", f"at most {MAX_RUNS:,}")
    for key, other in itertools.permutations(vary, 2):
        if other.startswith(f"{key}."):
            raise InputError(f"vary.{other}", f"{key}, which holds it, varies too", "one of them")
        if other.lower() == key.lower():  # columns of a database
            raise InputError(f"vary.{other}", f"{key} varies too", "names that differ in letters")


def _check_use(study: Study) -> None:
    """Check that the command uses the keys that are given."""
    content, command = study.content, study.content.command
    if study.base.get("goal") is not None and command is not Command.PLAN:
        raise InputError("command", f"{command}, but the base scenario has a goal", "plan")
    starting = (Command.SIMULATE, Command.TRACK)
    users: dict[str, Sequence[Command]] = dict.fromkeys((*START_KEYS, "start"), starting)
    users |= {"track": [Command.TRACK], "phases": [Command.PLAN]}
    users["search"] = [Command.PLAN, Command.MAP]
    if not study.initial_attitude(0):  # the plan is followed
        users["search"] = [*users["search"], Command.TRACK]
    keys = {name: name for name in StudyFile.model_fields if name in content.model_fields_set}
    for key, name in (
        keys | {f"vary.{key}": key.partition(".")[0] for key in content.vary}
    ).items():
        if command not in (accepted := users.get(name, [command])):
            problem = f"command {command} does not use it"
            raise InputError(key, problem, f"command: {' or '.join(accepted)}")


def _check_start(study: Study) -> None:
    """Check that simulations have an attitude or a heading; track may."""
    content, task = study.content, study.base.get("task")
    if content.command not in (Command.SIMULATE, Command.TRACK):
        return
    starts = [key for key in START_KEYS if getattr(content, key) is not None]
    starts += [f"vary.{key}" for key in START_KEYS if key in content.vary]
    if content.command is Command.TRACK and not starts:
        if content.start is not None:
            raise InputError("start", "track follows the plan of the scenario", "an attitude, too")
        return
    planar = task in [str(task) for task in Task if task.planar] or study.base_robot.on_table
    expected = "heading_deg" if planar else "attitude"
    if len(starts) != 1:
        keys = " and ".join(starts) or "none"
        given = f"{keys} {'are both' if starts else 'was'} given"
        raise InputError(expected, given, f"one of {expected} and vary.{expected}")
    if starts[0].endswith("heading_deg") and not planar and "task" not in content.vary:
        problem = f"the task {task} is not planar, nor is the robot on a table"
        raise InputError("heading_deg", problem, "attitude")


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
    columns = variation.columns(0, study.count) if drawn else {}
    runs = {key: _extreme_runs(key, columns) for key in drawn}
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
    value, (whole, _, last) = study.parameters(number)[key], key.rpartition(".")
    owner = whole if last.isdecimal() and whole else key  # the list of which it is an entry
    name = owner.rpartition(".")[2]
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
        value = document
        for word in owner.split("."):
            value = value[int(word) if isinstance(value, list) else word]
    if name == INERTIA:
        inertia_matrix(owner, value)
    elif name in _ATTITUDES and np.shape(value) == (4,):
        unit_quaternion(owner, value)


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


def _check_branch(study: Study, number: int) -> None:
    """Check that the arm of a run, which is the arm of all, has the arm branch at some attitude."""
    branch = None if study.content.start is None else study.content.start.branch
    varied = {key.partition(".")[0] for key in study.content.vary}
    if not isinstance(branch, int) or varied & {"robot", "task"}:
        return
    try:
        attitudes = attitude_grid(1)
        count = study.scenario(number).problem().many_branches(attitudes).joints.shape[1]
    except FreeFloatError:  # which is the result of each run
        return
    if branch >= count:
        raise InputError("start.branch", f"{branch} was given", f"0 to {count - 1}, or best")
