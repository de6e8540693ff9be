"""Reading of study files, with the checks that come before any run."""

from __future__ import annotations

import itertools
from pathlib import Path

from freefloat.dynamics.tasks import Task
from freefloat.errors import InputError
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.yaml import parse_yaml, read_text, validated
from freefloat.robot.bundled import find_scenario, find_study, is_file
from freefloat.so3 import unit_quaternion
from freefloat.studies.document import error_of_study, scenario_from, with_values
from freefloat.studies.extreme_runs import check_extreme_runs
from freefloat.studies.robot_values import SCALE_MASS
from freefloat.studies.sampling import MAX_RUNS
from freefloat.studies.study import START_KEYS, Combine, Command, Study, StudyFile
from freefloat.studies.track_section import TRACK, require_track_values

_MAX_VALUES = 5 * MAX_RUNS
_VALIDATED_RUNS = 1000


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
    try:
        content = validated(StudyFile, data, source, text)
        base = _find_base(content.base, source.parent)
        study = Study(str(source), content, base, parse_yaml(read_text(base), base))
        _check_values(study)
        _check_goal(study)
        _check_start(study)
        _check_use(study)
        _check_tracking(study)
        _check_runs(study)
        check_extreme_runs(study)
        _check_branch(study)
        _check_links(study)
        _check_limits(study)
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


def _check_goal(study: Study) -> None:
    """Check that a base scenario with a goal in place of a path is planned."""
    command = study.content.command
    if study.base.get("goal") is not None and command is not Command.PLAN:
        raise InputError("command", f"{command}, but the base scenario has a goal", "plan")


def _check_start(study: Study) -> None:
    """Check that simulations have a start, an attitude or a heading; track may."""
    content, task = study.content, study.base.get("task")
    starts = [key for key in START_KEYS if getattr(content, key) is not None]
    starts += [f"vary.{key}" for key in START_KEYS if key in content.vary]
    if content.command not in (Command.SIMULATE, Command.TRACK):
        if starts or content.branch is not None:
            problem = f"command {content.command} does not use it"
            raise InputError([*starts, "branch"][0], problem, "command: simulate or track")
        return
    if content.command is Command.TRACK and not starts:
        if content.branch is not None:
            raise InputError("branch", "track follows the plan of the scenario", "an attitude, too")
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


def _check_use(study: Study) -> None:
    """Check that the command uses the varied keys; a simulation has neither search nor phases."""
    command = study.content.command
    users = {"phases": [Command.PLAN], "search": [Command.PLAN, Command.MAP]}
    if not study.start(0):  # track, which follows the plan then
        users["search"].append(Command.TRACK)
    for key in study.content.vary:
        used_by = users.get(key.partition(".")[0], [command])
        if command not in used_by:
            problem = f"command {command} does not use it"
            raise InputError(f"vary.{key}", problem, f"command: {' or '.join(used_by)}")


def _check_tracking(study: Study) -> None:
    """Check that only the command track has its section, and the values of its varied keys."""
    content = study.content
    varied = [key for key in content.vary if key.startswith(TRACK)]
    if content.command is not Command.TRACK and (varied or "track" in content.model_fields_set):
        problem = f"command {content.command} does not use it"
        raise InputError([*varied, "track"][0], problem, "command: track")
    for key in varied:
        require_track_values(
            key, study.variation.listed.get(key, [study.parameters(0)[key]]), study.source
        )


def _check_runs(study: Study) -> None:
    """Check that a run is valid; of many runs a sample is validated."""
    errors: list[InputError] = []
    for number in range(0, study.count, -(-study.count // _VALIDATED_RUNS)):
        try:
            validated(ScenarioFile, study.document(number), study.base_source)
            return
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


def _check_links(study: Study) -> None:
    """Check that links with factors on their masses belong to the robot."""
    vary, section = study.content.vary, study.base.get("robot")
    varied = [key for key in vary if key.startswith(f"{SCALE_MASS}.")]
    named = [(f"vary.{key}", key.removeprefix(f"{SCALE_MASS}.")) for key in varied]
    factors = section.get("scale_mass") if isinstance(section, dict) else None
    listed = study.variation.listed.get(SCALE_MASS, ())
    maps = [(SCALE_MASS, factors), *((f"vary.{SCALE_MASS}", value) for value in listed)]
    for key, value in maps:
        named += [(f"{key}.{link}", link) for link in value] if isinstance(value, dict) else []
    if not named or "robot.urdf" in vary or _error_of_base(study) is not None:
        return
    unscaled = with_values(study.base, {SCALE_MASS: 1.0})
    links = scenario_from(unscaled, study.base_source).model().link_places
    for key, link in named:
        if link not in links:
            source = study.source if key.startswith("vary.") else str(study.base_source)
            raise InputError(key, "the robot has no such link", ", ".join(links), source)


def _check_limits(study: Study) -> None:
    """Check that the robot has what limits of the base scenario name, unless that varies."""
    vary = study.content.vary
    if not study.base.get("limits") or "robot.urdf" in vary or _error_of_base(study) is not None:
        return
    try:
        scenario_from(study.base, study.base_source).limits()
    except InputError as error:
        if not any(f"{error.key}.".startswith(f"{key}.") for key in vary):
            raise


def _error_of_base(study: Study) -> InputError | None:
    try:
        validated(ScenarioFile, study.base, study.base_source)
    except InputError as error:
        return error
    return None


def _check_branch(study: Study) -> None:
    """Check that the unvaried scenario has a motion where the arm branch depends on it."""
    if study.start(0) and study.content.branch is None:
        error = _error_of_base(study)
        if error is not None:
            problem = f"the unvaried scenario has no motion: {error.key}: {error.problem}"
            raise InputError("branch", problem, "best, or the number of an arm branch")
