"""Study files: what they may contain, and names of varied keys for people."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import Field

from freefloat.errors import finite_number
from freefloat.io.scenario.field_types import (
    Name,
    NotNegative,
    Number,
    Positive,
    Quaternion,
    Section,
    Seed,
    exactly_one_of,
)
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.yaml import description_at
from freefloat.motion.problem import Problem
from freefloat.so3 import Array
from freefloat.studies.sampling import Count, ValuesSection

STARTS = "start: {branch: N}, start: {branch: best} or start: {joints: [...]}"
"""What chooses the arm branch, in messages."""
START_KEYS = ("attitude", "heading_deg")
"""Keys that may vary but belong to the commands simulate and track, not to the scenario."""
TRACK = "track."
"""What the names of its keys begin with in ``vary``."""

TRACK_SEED = f"{TRACK}seed"
"""The key that repeats a run with other random numbers."""
_VECTORS = ("momentum", "wheels.momentum", "drift", "attitude")
"""Keys whose entries are components."""
_ROBOT = "robot."
_NAMES = {
    "wheels.momentum": "wheel momentum", "timing.duration": "duration", "scale mass": "mass factor",
    "margin.value": "required margin", "heading_deg": "heading [deg]",
}  # fmt: skip


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


class StartSection(Section):
    """The arm branch of runs with an attitude or a heading."""

    branch: Annotated[int, Field(strict=True, ge=0)] | Literal["best"] | None = None
    """Number of the arm branch, or ``best``: in each run that with the largest minimum margin that
    keeps the limits."""
    joints: Annotated[list[Number], Field(min_length=1)] | dict[str, Number] | None = None
    """In place of branch, joint values [rad, m], as search.joints: of the unvaried scenario's arm
    branches the one nearest to them, in each run the one nearest to that; of a redundant arm the
    configuration to which Newton's method converges."""

    _exactly_one = exactly_one_of("branch", "joints")

    def __str__(self) -> str:
        if self.joints is not None:
            return f"the one nearest to {self.joints}"
        return "the best of each run" if self.branch == "best" else str(self.branch)


class TrackSection(Section):
    """Robot and controller of the command track, see ``ff.track``."""

    mass_error: NotNegative = 0.0
    """Standard deviation of the logarithm of the factor on mass and inertia of every body; 0.05 is
    about 5 %."""
    noise: NotNegative = 0.0
    """Standard deviation of measured angles [rad], and of positions [m]."""
    friction: NotNegative = 0.0
    """Dry friction in every joint [N m or N]."""
    seed: Seed = 0
    """Seed of mass errors and noise; vary it to repeat a run with others."""
    gain: NotNegative = 1.0
    """Gain of the controller on the error of the pose [1/s]."""
    period: Positive = 0.1
    """Period of the controller [s]."""
    tolerance: NotNegative = 0.02
    """Allowed distance from the path [m] and angle from its orientation [rad]."""


class StudyFile(Section):
    """A study: a base scenario, the command to run, and the keys that vary between runs."""

    base: Name
    """A scenario file, relative to the study file, or the name of a bundled scenario."""
    command: Command
    """The command that each run executes."""
    vary: Annotated[dict[Name, ValuesSection], Field(min_length=1, max_length=100)]
    """Scenario keys by their dotted paths, such as momentum or timing.duration (entries of lists
    by their index from 0: momentum.2); with commands simulate and track also attitude and
    heading_deg, with track also the keys of its section, such as track.noise."""
    combine: Combine = Combine.CROSSED
    """Listed values of several keys: crossed (every combination) or zipped (the first of each,
    the second of each, and so on)."""
    cases: Count | None = None
    """Number of random draws; where keys have listed values too, per combination of listed ones."""
    seed: Seed = 0
    """Seed of all random values."""
    files: Annotated[str, Field(pattern=r"^(none|all|worst [1-9][0-9]{0,6})$")] = "worst 20"
    """Runs whose result files are kept, as the commands write them with -o: ``none``, ``all``, or
    ``worst 20``, runs with the smallest margins, and the undisturbed simulation; track has
    none."""
    attitude: Quaternion | None = None
    """Commands simulate and track: initial attitude of the spacecraft, quaternion x, y, z, w.
    Without it, track follows the plan of the scenario."""
    heading_deg: Number | None = None
    """Commands simulate and track, planar tasks, tables: heading of the spacecraft [degrees]."""
    start: StartSection | None = None
    """With attitude or heading_deg, the arm branch. Default: the one that simulate chooses for the
    unvaried scenario; where attitudes vary, but not about one attitude, the best of each run, with
    search.joints the one nearest to these."""
    track: TrackSection = TrackSection()
    """Command track: deviations of the simulated robot, and its controller."""


def initial_attitude(problem: Problem, start: Mapping[str, Any]) -> Array:
    """The attitude (4,) of a start with ``attitude`` or ``heading_deg``.

    Raises:
        InputError: If it is none of the problem.
    """
    heading = start.get("heading_deg")
    if heading is not None:
        heading = math.radians(finite_number("heading_deg", heading, "a finite number of degrees"))
    return problem.attitude(start.get("attitude"), heading=heading)


def readable_name(key: str) -> str:
    """The name of a varied key, or of an entry: ``momentum x`` of ``momentum.0``; else the key."""
    vector, _, entry = key.rpartition(".")
    if vector in _VECTORS and entry in ("0", "1", "2", "3"):
        return f"{_NAMES.get(vector, vector)} {'xyzw'[int(entry)]}"
    if vector == "robot.scale_mass":
        return f"mass factor of {entry}"
    if key.startswith((TRACK, _ROBOT)):
        key = key.removeprefix(TRACK).removeprefix(_ROBOT).replace("_", " ").replace(".", " ")
    return _NAMES.get(key, key)


def heading(key: str) -> str:
    """The name of a varied key with its unit, which the schema describes."""
    schema, name = StudyFile if key.startswith(TRACK) else ScenarioFile, readable_name(key)
    description = description_at(schema, key.split(".")) or ""
    unit = re.search(r"\[[^\]]*\]", description)
    return name if unit is None or "[" in name else f"{name} {unit[0]}"
