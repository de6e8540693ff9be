"""Reading of study files, with the checks that come before any run."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

from freefloat.dynamics.tasks import Task
from freefloat.errors import InputError
from freefloat.io.scenario.yaml import parse_yaml, read_text, validated
from freefloat.robot.bundled import find_scenario, find_study, is_file
from freefloat.so3 import unit_quaternion
from freefloat.studies.run_checks import check_runs
from freefloat.studies.sampling import MAX_RUNS
from freefloat.studies.study import Study
from freefloat.studies.study_file import START_KEYS, STARTS, Combine, Command, StudyFile

_MAX_VALUES = 5 * MAX_RUNS


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
        check_runs(study)
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
    given = {name: name for name in StudyFile.model_fields if name in content.model_fields_set}
    for key, name in (
        given | {f"vary.{key}": key.partition(".")[0] for key in content.vary}
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
