"""Kinds of results, and what is beyond the paper, by name: imported when they are asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from freefloat.errors import InputError

READERS = {"xacro": "freefloat.beyond.formats.xacro", "mjcf": "freefloat.beyond.formats.mjcf"}
"""Modules whose function ``read`` returns the URDF of a file."""
ENGINES = {"mujoco": "beyond.engines.engine_runs:MuJoCo"}
"""Classes of other engines that repeat motions, by the name of the engine and of its extra."""


@dataclass(frozen=True)
class StudyCommand:
    """Names of the functions that execute a command of studies.

    Attributes:
        chunks: Function of a study and its missing runs: runs that are computed side by side.
        computed: Function of a study, a chunk and a number of threads: its rows.
        values: Function of a study and a run: its row.
    """

    chunks: str
    computed: str
    values: str


STUDY_COMMANDS = {
    "track": StudyCommand(
        "beyond.engines.track_runs:track_chunks",
        "beyond.engines.track_runs:tracked",
        "beyond.engines.track_runs:track_values",
    )
}
"""Commands of studies that are beyond the paper."""


def named(place: str) -> Any:
    """An object of freefloat, such as ``beyond.studio.command:studio``."""
    module, name = place.split(":")
    return getattr(import_module(f"freefloat.{module}"), name)


def later(place: str) -> Callable[..., Any]:
    """A function that is imported at its first call."""

    def function(*arguments: Any) -> Any:
        return named(place)(*arguments)

    return function


@dataclass(frozen=True)
class ResultKind:
    """Names of what belongs to a kind of results.

    Attributes:
        record: The class.
        figures: Function of a result, a number of threads and the progress.
        scene: Function of a result and a title.
        report: Function of a result and an engine; empty for records that are not saved.
        decode: Function of the tree of a file and its robot; empty where a scenario is needed.
    """

    record: str
    figures: str
    scene: str
    report: str = ""
    decode: str = ""


RESULT_KINDS = {
    "plan": ResultKind(
        "planning.plan:Plan",
        "visualization.figures.figures:plan_figures",
        "visualization.scenes.result_scenes:plan_scene",
        "verification.path_motions:plan_report",
    ),
    "motion": ResultKind(
        "planning.simulation:Simulation",
        "visualization.figures.figures:simulation_figures",
        "visualization.scenes.result_scenes:simulation_scene",
        "verification.path_motions:simulation_report",
    ),
    "goal": ResultKind(
        "planning.goals.goal_motion:GoalMotion",
        "visualization.figures.figures:goal_figures",
        "visualization.scenes.result_scenes:goal_scene",
        "verification.goal_motions:goal_report",
    ),
    "manoeuvre": ResultKind(
        "planning.phases.manoeuvre:Manoeuvre",
        "visualization.figures.figures:manoeuvre_figures",
        "visualization.scenes.result_scenes:manoeuvre_scene",
        "verification.manoeuvre:manoeuvre_report",
    ),
    "attitude map": ResultKind(
        "planning.space.attitude_map:AttitudeMap",
        "visualization.figures.figures:attitude_map_figures",
        "visualization.scenes.map_scene:map_scene",
        "verification.margin_maps:map_report",
    ),
    "map": ResultKind(
        "planning.plane.heading_map:HeadingMap",
        "visualization.figures.figures:heading_map_figures",
        "visualization.scenes.heading_scene:heading_scene",
        "verification.margin_maps:map_report",
    ),
    "singularity map": ResultKind(
        "beyond.joint_space.singularity_map:SingularityMap",
        "beyond.joint_space.figures:map_figures",
        "beyond.joint_space.scene:singularity_scene",
        "beyond.joint_space.verification:singularity_map_report",
        "beyond.joint_space.verification:decoded",
    ),
}
"""Kinds of results that are saved, by the attribute ``kind`` of their records."""
_MOTION = ResultKind(
    "motion.motion:Motion",
    "visualization.figures.figures:drawn_motion_figures",
    "visualization.scenes.result_scenes:single_motion_scene",
)


def kind_of(result: object, *, saved: bool = False) -> ResultKind:
    """The kind of a result; a bare motion has one, too, unless it must be one that is saved.

    Raises:
        InputError: If the object is no result.
    """
    kinds: list[ResultKind] = [*RESULT_KINDS.values(), *(() if saved else (_MOTION,))]
    place = f"{type(result).__module__}:{type(result).__name__}"
    for kind in kinds:
        if place == f"freefloat.{kind.record}":
            return kind
    names = ", ".join(kind.record.partition(":")[2] for kind in kinds)
    raise InputError("result", f"a {type(result).__name__} was given", names)
