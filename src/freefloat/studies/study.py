"""Studies: a scenario with some of its keys varied, as a list of cases."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from freefloat.brief import brief
from freefloat.dynamics.momentum import Task
from freefloat.errors import InputError
from freefloat.io.schema import ScenarioFile
from freefloat.io.validation import validated
from freefloat.io.yaml import parse_yaml, read_text
from freefloat.robot.names import find_scenario, find_study, is_file
from freefloat.studies.key_paths import refuse_unknown_path, with_values
from freefloat.studies.sampling import drawn, listed, numbers_listed, refuse_bad_draw
from freefloat.studies.schema import MOST_CASES, Case, Combine, StudyFile

_MOST_NUMBERS = 5 * MOST_CASES
"""Listed in a study, all its keys together."""
_LOOKED_AT = 1000
"""Cases that are held against the schema before a study is begun."""
STARTS = ("attitude", "heading_deg")
"""Keys that may be varied and are not the scenario's, but tell where a simulation starts."""


@dataclass(frozen=True, eq=False)
class Study:
    """A study file that passed the schema, and the scenario that it is about.

    Attributes:
        source: The study file.
        content: Its data.
        base_source: The scenario file.
        base: Its data, as read.
    """

    __repr__ = brief

    source: str
    content: StudyFile
    base_source: Path
    base: dict[str, Any]

    @cached_property
    def _listed(self) -> dict[str, list[Any]]:
        found = {key: listed(draw) for key, draw in self.content.vary.items()}
        return {key: values for key, values in found.items() if values is not None}

    @cached_property
    def combinations(self) -> int:
        """How many combinations of listed values there are."""
        lengths = [len(values) for values in self._listed.values()]
        if self.content.combine is Combine.ZIPPED:
            return lengths[0] if lengths else 1
        return math.prod(lengths)

    @property
    def count(self) -> int:
        """How many cases there are; they are numbered from 0."""
        return self.combinations * (self.content.cases or 1)

    def parameters(self, number: int) -> dict[str, Any]:
        """The varied keys of one case and their values, in the order of the study file."""
        place = number // (self.content.cases or 1)
        chosen: dict[str, Any] = {}
        for key, values in reversed(self._listed.items()):  # the last key runs fastest
            if self.content.combine is Combine.ZIPPED:
                chosen[key] = values[place]
            else:
                place, index = divmod(place, len(values))
                chosen[key] = values[index]
        return {
            key: chosen[key] if key in chosen else drawn(draw, self.content.seed, key, number)
            for key, draw in self.content.vary.items()
        }

    def document(self, number: int) -> dict[str, Any]:
        """The data of one case's scenario file."""
        own = {key: value for key, value in self.parameters(number).items() if key not in STARTS}
        return with_values(self.base, own)

    def start(self, number: int) -> dict[str, Any]:
        """Where the simulation of one case starts: its attitude or heading_deg, and branch."""
        own, content = self.parameters(number), self.content
        given = {key: own.get(key, getattr(content, key)) for key in STARTS}
        given["branch"] = content.branch
        return {key: value for key, value in given.items() if value is not None}

    def listed_documents(self) -> Iterator[dict[str, Any]]:
        """The base, and the base with every listed value of a key that may name a file."""
        yield self.base
        for key, values in self._listed.items():
            if key.partition(".")[0] in ("robot", "path"):
                for value in values:
                    if not isinstance(value, int | float):  # no number names a file
                        yield with_values(self.base, {key: value})


def load_study(name: str | Path) -> Study:
    """Read a study and the scenario that it is about.

    Args:
        name: A file, or the name of a bundled study.

    Raises:
        InputError: Naming the file, the key, what was given and what is accepted.
    """
    source = find_study(str(name))
    content = validated(StudyFile, parse_yaml(read_text(source), source), source)
    try:
        base = _find_base(content.base, source.parent)
    except InputError as error:
        raise error.found_in(str(source)) from None
    study = Study(str(source), content, base, parse_yaml(read_text(base), base))
    try:
        _refuse_bad_keys(study)
        _refuse_bad_counts(study)
        _refuse_bad_start(study)
        study.document(0)
        if study.count > MOST_CASES:
            raise InputError("vary", f"{study.count:,} cases", f"at most {MOST_CASES:,}")
    except InputError as error:
        raise error.found_in(str(source)) from None
    _refuse_without_any_scenario(study)
    return study


def _find_base(name: str, folder: Path) -> Path:
    if is_file(folder / name):
        return folder / name
    try:
        return find_scenario(name)
    except InputError as error:
        raise InputError("base", error.problem, error.accepted) from None


def _refuse_bad_keys(study: Study) -> None:
    content = study.content
    for key, draw in content.vary.items():
        refuse_bad_draw(key, draw)
        if key in STARTS:
            continue
        try:
            refuse_unknown_path(ScenarioFile, key)
        except InputError as error:
            raise error.found_in(study.source, "vary.") from None
    for one, other in itertools.permutations(content.vary, 2):
        if other.startswith(f"{one}."):
            raise InputError(f"vary.{other}", f"{one} is varied, too, and holds it", "one of them")


def _refuse_bad_counts(study: Study) -> None:
    content = study.content
    total = sum(map(numbers_listed, content.vary.values()))
    if total > _MOST_NUMBERS:
        accepted = f"at most {_MOST_NUMBERS:,} of them"
        raise InputError("vary", f"{total:,} numbers are listed", accepted)
    lengths = {key: len(values) for key, values in study._listed.items()}
    if content.combine is Combine.ZIPPED and len(set(lengths.values())) > 1:
        told = ", ".join(f"{key} {length}" for key, length in lengths.items())
        raise InputError("combine", f"zipped, but of different lengths: {told}", "equal lengths")
    random = [key for key, draw in content.vary.items() if draw.random]
    if random and content.cases is None:
        raise InputError("cases", "it is missing", f"how many are drawn of {', '.join(random)}")
    if not random and content.cases is not None:
        raise InputError(
            "cases", f"{content.cases} was given, but nothing is drawn at random",
            f"nothing: what is listed makes {study.combinations} cases",
        )  # fmt: skip


def _refuse_bad_start(study: Study) -> None:
    content = study.content
    told = [key for key in STARTS if getattr(content, key) is not None]
    varied = [key for key in STARTS if key in content.vary]
    if content.task is not Case.SIMULATE:
        odd = [*told, *varied, *(["branch"] if content.branch is not None else [])]
        if odd:
            accepted = "task: simulate, or a study without it"
            raise InputError(odd[0], f"task {content.task} has no use for it", accepted)
        return
    planar = study.base.get("task") in [str(task) for task in Task if task.planar]
    wanted, other = ("heading_deg", "attitude") if planar else ("attitude", "heading_deg")
    if len(told) + len(varied) != 1:
        given = " and ".join([*told, *(f"vary.{key}" for key in varied)]) or "none"
        raise InputError(wanted, f"{given} was given", f"one {wanted}, or it in vary")
    if "task" not in content.vary and not planar and other in (*told, *varied):
        raise InputError(other, f"task {study.base.get('task')} is not planar", wanted)


def _refuse_without_any_scenario(study: Study) -> None:
    """Refuse a study none of whose cases passes the schema, with what is wrong in the first.

    Of very many cases some are looked at, evenly spread. Where what is wrong was varied, the study
    is told and not the scenario.
    """
    first: InputError | None = None
    step = -(-study.count // _LOOKED_AT)
    for number in range(0, study.count, step):
        try:
            validated(ScenarioFile, study.document(number), study.base_source)
            return
        except InputError as error:
            first = first or error
    if first is None:
        return
    if any(f"{first.key}.".startswith(f"{key}.") for key in study.content.vary):
        own = InputError(f"vary.{first.key}", f"case 0: {first.problem}", first.accepted)
        raise own.found_in(study.source)
    raise first
