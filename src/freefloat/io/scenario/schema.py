"""Keys of scenario files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, model_validator

from freefloat.dynamics.measures import MeasureName
from freefloat.dynamics.redundancy import LARGEST_GAIN, Metric, Toward
from freefloat.dynamics.tasks import Task
from freefloat.io.scenario.field_types import (
    Factor,
    NotNegative,
    Number,
    Quaternion,
    Section,
    Seed,
    Vector,
    exactly_one_of,
)
from freefloat.io.scenario.limits_section import LimitsSection
from freefloat.io.scenario.path_schema import PathSection, TimingSection
from freefloat.io.scenario.robot_section import RobotSection
from freefloat.io.scenario.scene_section import SceneSection
from freefloat.kinds import SECTIONS, named
from freefloat.paths.samples import samples_text
from freefloat.planning.objectives import NAMED
from freefloat.planning.settings import FEWEST_SAMPLES

GoalSection: Any = named(SECTIONS["goal"].section)
PhaseSection: Any = named(SECTIONS["phases"].section)
ObjectiveName: Any = Literal[*NAMED]


class MarginSection(Section):
    """Required distance from dynamic singularities."""

    measure: MeasureName = "gjm"
    """Singularity measure that the margin is a value of."""
    value: Annotated[float, Field(strict=True, ge=0.0)] | None = None
    """Smallest allowed magnitude of the measure."""
    fraction: Annotated[float, Field(strict=True, ge=0.0, lt=1.0)] | None = None
    """Smallest allowed magnitude of the measure as a fraction of its largest in the joint space."""
    fraction_of: Literal["base", "run"] | None = None
    """In studies, the robot whose largest magnitude counts: of the ``base`` scenario, or of
    each ``run``. For a single scenario both are the same. Default: base."""

    _exactly_one = exactly_one_of("value", "fraction")

    @model_validator(mode="after")
    def _of_a_fraction(self) -> MarginSection:
        if self.fraction_of is not None and self.fraction is None:
            raise ValueError("no fraction_of, where value is given in place of fraction")
        return self


class RedundancySection(Section):
    """Null-space motion of a redundant arm."""

    metric: Metric | dict[str, Factor] = Metric.JOINTS
    """Minimized by the joint rates: ``joints``, their norm; ``energy``, the kinetic energy; or a
    map from joint to weight, the weighted norm, with weight 1 for joints not named."""
    toward: Toward = Toward.NONE
    """Null-space motion toward a larger manipulability, or toward the middle of joint ranges."""
    gain: Annotated[float, Field(strict=True, ge=0.0, le=LARGEST_GAIN)] | None = None
    """Gain of the null-space motion, per path; default 1."""
    bound: Annotated[float, Field(strict=True, gt=0.0, le=LARGEST_GAIN)] | None = None
    """Largest null-space displacement per path [rad, m]; default 3."""

    @model_validator(mode="after")
    def _gain_has_a_goal(self) -> RedundancySection:
        if self.toward is Toward.NONE and (self.gain, self.bound) != (None, None):
            raise ValueError("toward: sigma or middle, where gain or bound is given")
        return self


class WeightsSection(Section):
    """Weights of the terms of an objective, whose sum is as large as possible."""

    margin: NotNegative = 0.0
    """Minimum margin, as a fraction of the largest one among the samples."""
    turn: NotNegative = 0.0
    """Minus the angle from from_attitude, where that is given, and the spacecraft's largest turn
    along the motion, as a fraction of 180 degrees."""
    time: NotNegative = 0.0
    """Minus the duration that limits.joint_rate requires, as a fraction of the duration."""


class SearchSection(Section):
    """Choice among the feasible attitudes."""

    objective: ObjectiveName | WeightsSection = "margin"
    """``margin``: the largest; ``nearest``: to from_attitude; ``robust``: the deepest inside;
    ``still``: the least turn of the spacecraft along the motion; or a map of weights."""
    from_attitude: Quaternion | None = None
    """Present attitude of the spacecraft: x, y, z, w."""
    samples: Annotated[int, Field(strict=True, ge=FEWEST_SAMPLES)] | None = None
    """Number of attitudes sampled where there is no closed form. Default: in the plane 360
    headings; in space 4,096 attitudes for a plan and 36,864 for a map."""
    seed: Seed = 0
    """Seed of the grid of attitudes in space."""
    joints: list[Number] | dict[str, Number] | None = None
    """Present joints of the arm [rad, m], in the order of the chain or a map from joint to value:
    of the arm configurations at every attitude only the closest to them is considered."""
    within_deg: Annotated[float, Field(strict=True, gt=0.0, le=180.0)] | None = None
    """Largest angle from from_attitude of the attitudes that are searched [degrees]."""
    spare_deg: Annotated[float, Field(strict=True, ge=0.0, le=90.0)] = 2.0
    """Objective ``nearest``: the margin is kept within this angle around the attitude [degrees]."""
    reorient: bool = False
    """Whether ``plan`` turns the spacecraft by the arm from from_attitude, where the arm is at
    joints, to the initial attitude of the path."""


class WheelsSection(Section):
    """Wheels of the spacecraft that turn with constant rates."""

    momentum: Vector
    """Angular momentum stored in them x, y, z, axes of the spacecraft [N m s]."""


OF_PATHS = (
    "path", "timing", "task", "margin", "redundancy", "phases", "search.objective",
    "search.samples", "search.within_deg", "search.spare_deg", "search.reorient",
)  # fmt: skip
"""Keys that scenarios with a goal do not have."""
_NOT_FOLLOWED: dict[str, Any] = {
    "task": "position", "timing": {"duration": 1.0},
    "path": {"line": {"from": [0.0, 0.0, 0.0], "to": [0.0, 0.0, 1.0]}},
}  # fmt: skip
"""What a scenario with a goal has in place of its path."""


def _require_goal_or_path(schema: dict[str, Any]) -> None:
    """State in a JSON schema that a scenario has a goal, or task, path and timing."""
    keys = [key for key in schema["required"] if key in OF_PATHS]
    schema["required"] = [key for key in schema["required"] if key not in OF_PATHS]
    schema["oneOf"] = [{"required": ["goal"]}, {"required": keys}]


class ScenarioFile(Section):
    """A scenario: robot, task, momentum, path, timing, margin, search, limits and scene.

    One with ``goal`` has neither task, path, timing nor margin.
    """

    model_config = ConfigDict(json_schema_extra=_require_goal_or_path)

    robot: RobotSection
    task: Task
    """What the path prescribes: ``pose``; ``pointing``, the position and the direction of the
    end-effector's z axis; ``position``; ``planar-pose`` or ``planar-position``."""
    momentum: Vector = (0.0, 0.0, 0.0)
    """Angular momentum x, y, z about the centre of mass, inertial axes [N m s]."""
    wheels: WheelsSection = WheelsSection(momentum=(0.0, 0.0, 0.0))
    drift: Vector = (0.0, 0.0, 0.0)
    """Velocity of the centre of mass x, y, z [m/s]. Path, scene and points that are pointed at are
    given in a frame that does not move, whose origin is the centre of mass at time zero."""
    path: PathSection
    timing: TimingSection
    goal: GoalSection | None = None
    """In place of path, timing, task and margin: what shall hold at the end of a motion of the
    joints, from search.from_attitude and search.joints."""
    margin: MarginSection = MarginSection(measure="gjm", value=0.0)
    redundancy: RedundancySection | None = None
    """For redundant arms only; default: joint rates of minimum norm."""
    search: SearchSection = SearchSection()
    limits: LimitsSection = LimitsSection()  # type: ignore[valid-type] # made of the limits
    scene: SceneSection = SceneSection()
    phases: list[PhaseSection] = Field(default=[], max_length=100)
    """What follows the path; each begins with the state at which the one before ends."""

    def sample_texts(self, folder: Path) -> dict[str, str]:
        """Texts of the CSV files of the first path and of phases, by the names given to them.

        The names are relative to a folder; an InputError if a file cannot be read.
        """
        paths = [self.path, *(phase.path for phase in self.phases)]
        names = [path.samples for path in paths if path is not None and path.samples is not None]
        return {name: samples_text(folder / name) for name in names}

    @model_validator(mode="before")
    @classmethod
    def _goal_or_path(cls, data: Any) -> Any:
        """A scenario with a goal needs no path."""
        if not isinstance(data, dict) or data.get("goal") is None:
            return data
        return {**_NOT_FOLLOWED, **data}
