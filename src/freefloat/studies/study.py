"""Studies: a base scenario and the keys of it that vary between runs."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from freefloat.dynamics.momentum import Task
from freefloat.errors import InputError
from freefloat.io.scenario.field_types import Name, Number, Quaternion, Section, Seed
from freefloat.io.scenario.scenario import Scenario
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.yaml import parse_yaml, read_text, validated
from freefloat.robot.names import find_scenario, find_study, is_file
from freefloat.so3 import unit_quaternion
from freefloat.studies.document import error_of_study, scenario_from, with_values
from freefloat.studies.sampling import MAX_RUNS, Count, ValuesSection
from freefloat.studies.track_section import TRACK, TrackSection, require_track_values
from freefloat.studies.variation import Variation

START_KEYS = ("attitude", "heading_deg")
"""Keys that may vary but belong to the commands simulate and track, not to the scenario."""
UNDISTURBED = -1
"""In place of the number of a run: the simulation of the base scenario as it is."""
_MAX_VALUES = 5 * MAX_RUNS
_VALIDATED_RUNS = 1000


class Command(StrEnum):
    """The command that each run executes."""

    PLAN = "plan"
    MAP = "map"
    SIMULATE = "simulate"
    TRACK = "track"


class Combine(StrEnum):
    """How the listed values of several keys are combined."""

    CROSSED = "crossed"
    ZIPPED = "zipped"


class StudyFile(Section):
    """A study: a base scenario, the command to run, and the keys that vary between runs."""

    base: Name
    """A scenario file, relative to the study file, or the name of a bundled scenario."""
    command: Command
    """The command that each run executes."""
    vary: Annotated[dict[Name, ValuesSection], Field(min_length=1, max_length=100)]
    """Scenario keys by their dotted paths, such as momentum or timing.duration (entries of lists
    by their index from 0: momentum.2); with commands simulate and track also attitude and
    heading_deg, with track also those of its section, such as track.noise."""
    combine: Combine = Combine.CROSSED
    """Listed values of several keys: crossed (every combination) or zipped (the first of each,
    the second of each, and so on)."""
    cases: Count | None = None
    """Number of random draws; where keys have listed values too, per combination of these."""
    seed: Seed = 0
    """Seed of all random values."""
    files: Annotated[str, Field(pattern=r"^(none|all|worst [1-9][0-9]{0,6})$")] = "worst 20"
    """Runs whose result files are kept, as the commands write them with -o: ``none``, ``all``, or
    ``worst 20``, those with the smallest margins, and the undisturbed simulation; track has
    none."""
    attitude: Quaternion | None = None
    """Commands simulate and track: initial attitude of the spacecraft, quaternion x, y, z, w.
    Without it, track follows the plan of the scenario."""
    heading_deg: Number | None = None
    """The same for planar tasks: initial heading [degrees]."""
    branch: Annotated[int, Field(strict=True, ge=0)] | Literal["best"] | None = None
    """With attitude or heading_deg: number of the arm branch to integrate, or ``best``, that with
    the largest minimum margin that keeps the limits, in each run. Default: the one that simulate
    chooses for the unvaried scenario at the same attitude."""
    track: TrackSection = TrackSection()
    """Command track: deviations of the simulated robot, and its controller."""


@dataclass(frozen=True, eq=False)
class Study:
    """A study file and its base scenario.

    Attributes:
        source: The study file.
        content: Its data.
        base_source: The base scenario's file.
        base: Data of the base scenario.
    """

    source: str
    content: StudyFile = field(repr=False)
    base_source: Path
    base: dict[str, Any] = field(repr=False)

    @cached_property
    def variation(self) -> Variation:
        """The values of the varied keys."""
        content = self.content
        zipped = content.combine is Combine.ZIPPED
        return Variation(content.vary, zipped, content.cases or 1, content.seed)

    @property
    def count(self) -> int:
        """Number of runs; they are numbered from 0."""
        return self.variation.count

    @property
    def kept_files(self) -> int:
        """Number of runs whose result files are kept, those with the smallest margins."""
        kind, _, number = self.content.files.partition(" ")
        if kind == "none" or self.content.command is Command.TRACK:
            return 0
        return self.count if kind == "all" else int(number)

    def parameters(self, number: int) -> dict[str, Any]:
        """Return the varied keys of a run and their values, in the order of the study file."""
        return {} if number == UNDISTURBED else self.variation.parameters(number)

    @property
    def branch_rule(self) -> str | None:
        """Arm branch that simulations integrate; None for other commands."""
        branch = self.content.branch
        if not self.start(0):
            return None
        if branch is None:
            return "the one that simulate chooses for the unvaried scenario"
        return "the best of each run" if branch == "best" else str(branch)

    def document(self, number: int) -> dict[str, Any]:
        """Return the data of a run's scenario file."""
        values = self.parameters(number).items()
        own = {k: v for k, v in values if k not in START_KEYS and not k.startswith(TRACK)}
        return with_values(self.base, own)

    def scenario(self, number: int) -> Scenario:
        """Return the scenario of a run.

        Raises:
            InputError: If its values are not accepted, or its file of path samples is missing.
        """
        return scenario_from(self.document(number), self.base_source)

    def start(self, number: int) -> dict[str, Any]:
        """Return the start of a simulation: attitude or heading_deg, and branch if it is set."""
        values = {key: getattr(self.content, key) for key in (*START_KEYS, "branch")}
        values |= {k: v for k, v in self.parameters(number).items() if k in START_KEYS}
        if number == UNDISTURBED:
            del values["branch"]
        return {key: value for key, value in values.items() if value is not None}

    def tracking(self, number: int) -> dict[str, Any]:
        """Return the arguments of :func:`~freefloat.verification.tracking.track` in a run."""
        return self.content.track.with_values(self.parameters(number))


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
        if "task" in data:
            raise InputError(
                "task", "the key is now command", "command: plan, map, simulate or track"
            )
        content = validated(StudyFile, data, source, text)
        base = _find_base(content.base, source.parent)
        study = Study(str(source), content, base, parse_yaml(read_text(base), base))
        _check_values(study)
        _check_start(study)
        _check_tracking(study)
        _check_runs(study)
        _check_branch(study)
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


def _check_start(study: Study) -> None:
    """Check that simulations have a start, an attitude or in the plane a heading; track may."""
    content, task = study.content, study.base.get("task")
    starts = [key for key in START_KEYS if getattr(content, key) is not None]
    starts += [key for key in START_KEYS if key in content.vary]
    if content.command not in (Command.SIMULATE, Command.TRACK):
        if starts or content.branch is not None:
            problem = f"command {content.command} does not use it"
            raise InputError([*starts, "branch"][0], problem, "command: simulate or track")
        return
    if content.command is Command.TRACK and not starts:
        if content.branch is not None:
            raise InputError("branch", "track follows the plan of the scenario", "an attitude, too")
        return
    planar = task in [str(task) for task in Task if task.planar]
    expected = "heading_deg" if planar else "attitude"
    if len(starts) != 1:
        keys = " and ".join(starts) or "none"
        raise InputError(expected, f"{keys} was given", f"one {expected}, or it in vary")
    if starts == ["heading_deg"] and not planar and "task" not in content.vary:
        raise InputError("heading_deg", f"the task {task} is not planar", "attitude")


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
