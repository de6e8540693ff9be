"""Studies: a base scenario and the keys of it that vary between runs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.tasks import Task
from freefloat.errors import FreeFloatError, InputError
from freefloat.io.scenario.field_types import Name, Number, Quaternion, Section, Seed
from freefloat.io.scenario.robot_section import RobotFile
from freefloat.io.scenario.scenario import Scenario
from freefloat.io.scenario.schema import MarginSection
from freefloat.io.scenario.yaml import validated
from freefloat.limits.kinds.clearance import have_shapes
from freefloat.limits.values import OFF
from freefloat.robot.model import FreeFloatingModel
from freefloat.singularities.global_maximum import largest_magnitude
from freefloat.studies.document import scenario_from, with_values
from freefloat.studies.sampling import Count, ValuesSection
from freefloat.studies.track_section import TRACK, TrackSection
from freefloat.studies.variation import Variation

START_KEYS = ("attitude", "heading_deg")
"""Keys that may vary but belong to the commands simulate and track, not to the scenario."""
CLEARANCE = "limits.clearance"
UNDISTURBED = -1
"""In place of the number of a run: the simulation of the base scenario as it is."""


_CONTACT_UNCHECKED = (
    "contact between bodies is not considered; limits: {clearance: 0} in the base scenario "
    "considers it"
)


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
        """The varied keys of a run and their values, in the order of the study file."""
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

    @cached_property
    def contact_unchecked(self) -> str | None:
        """Why runs do not consider contact, where it is to be said, and what makes them."""
        varied = self.variation.listed.get("limits", [self.base.get("limits")])
        stated = CLEARANCE in self.content.vary or all(map(_states_clearance, varied))
        if stated or self.content.command is not Command.SIMULATE:
            return None
        try:
            scenario = self.scenario(UNDISTURBED)
            touching = have_shapes(scenario.model(), scenario.scene())
        except FreeFloatError:  # which is the result of each run
            return None
        return _CONTACT_UNCHECKED if touching else None

    @property
    def compares_bodies(self) -> bool:
        """Whether simulations may have a clearance, which takes far longer than other limits."""
        varied = [*self.variation.listed.get("limits", [self.base.get("limits")])]
        varied += [{"clearance": value} for value in self.variation.listed.get(CLEARANCE, [])]
        stated = (limits["clearance"] for limits in varied if _states_clearance(limits))
        return any(clearance is not False and clearance != OFF for clearance in stated)

    @cached_property
    def base_robot(self) -> FreeFloatingModel:
        """The robot of the base scenario.

        Raises:
            InputError: If it cannot be read.
        """
        data = {"robot": self.base.get("robot")}
        return validated(RobotFile, data, self.base_source).robot.to_model(self.base_source)

    @property
    def varies_robot(self) -> bool:
        """Whether a key of the robot varies."""
        return any(key.split(".")[0] == "robot" for key in self.content.vary)

    def posed(self, document: dict[str, Any]) -> dict[str, Any]:
        """The data of a scenario as runs pose it.

        Simulations do not consider contact unless a clearance is stated: ensembles know none. Where
        robots vary, a fraction of the largest measure of the base scenario's robot is a value.

        Raises:
            InputError: If there is such a fraction, and a value is not accepted.
        """
        if self.varies_robot:
            document = document | self._margin_value(document)
        limits = document.get("limits") or {}
        simulated = self.content.command is Command.SIMULATE
        if not simulated or not isinstance(limits, dict) or _states_clearance(limits):
            return document
        return document | {"limits": limits | {"clearance": OFF}}

    def _margin_value(self, document: dict[str, Any]) -> dict[str, Any]:
        """The margin in place of a fraction of the measure of the base scenario's robot, if any."""
        margin, task = document.get("margin"), document.get("task")
        if task is None or not isinstance(margin, dict) or margin.get("fraction") is None:
            return {}
        question = {"task": task, "margin": margin}
        content = validated(_MarginFile, question, self.base_source)
        measure, fraction = content.margin.measure, content.margin.fraction
        if fraction is None or content.margin.fraction_of == "run":
            return {}
        try:
            largest = _largest(self.base_robot, content.task, measure)
        except InputError as error:
            problem = f"the robot of the base scenario: {error.key}: {error.problem}"
            raise InputError("margin.fraction", problem, "fraction_of: run, or value") from None
        return {"margin": {"measure": measure, "value": fraction * largest}}

    def document(self, number: int) -> dict[str, Any]:
        """The base scenario's data with the values of a run."""
        values = self.parameters(number).items()
        own = {k: v for k, v in values if k not in START_KEYS and not k.startswith(TRACK)}
        return with_values(self.base, own)

    def inputs(self, number: int) -> dict[str, Any]:
        """What determines a run's motion: its document, the base scenario, and the start."""
        return {
            "document": self.posed(self.document(number)), "base": self.posed(self.base),
            "start": self.start(number),
        }  # fmt: skip

    def scenario(self, number: int) -> Scenario:
        """The scenario of a run.

        Raises:
            InputError: If its values are not accepted, or its file of path samples is missing.
        """
        return self.scenario_of(self.document(number))

    def scenario_of(self, document: dict[str, Any]) -> Scenario:
        """The scenario that runs pose with some data; an unvaried robot is read once.

        Raises:
            InputError: As :meth:`scenario`.
        """
        scenario = scenario_from(self.posed(document), self.base_source.absolute())
        if document.get("robot") != self.base.get("robot"):
            return scenario
        return replace(scenario, robot=self.base_robot)

    def start(self, number: int) -> dict[str, Any]:
        """The start of a simulation: attitude or heading_deg, and branch if it is set."""
        values = {key: getattr(self.content, key) for key in (*START_KEYS, "branch")}
        values |= {k: v for k, v in self.parameters(number).items() if k in START_KEYS}
        if number == UNDISTURBED:
            del values["branch"]
        return {key: value for key, value in values.items() if value is not None}

    def tracking(self, number: int) -> dict[str, Any]:
        """The arguments of :func:`~freefloat.beyond.engines.tracking.track` in a run."""
        return self.content.track.with_values(self.parameters(number))


class _MarginFile(Section):
    """Task and margin of a scenario file."""

    task: Task
    margin: MarginSection


@lru_cache(maxsize=8)
def _largest(robot: FreeFloatingModel, task: Task, measure: str) -> float:
    return largest_magnitude(robot, task, singularity_measure(robot, task, measure))


def _states_clearance(limits: Any) -> bool:
    return isinstance(limits, dict) and limits.get("clearance") is not None
