"""Kinds of results, and what is beyond the paper, by name: imported when they are asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from freefloat.errors import InputError

READERS = {"xacro": "freefloat.beyond.formats.xacro", "mjcf": "freefloat.beyond.formats.mjcf"}
"""Modules whose function ``read`` returns the URDF of a file."""
SRDF = "beyond.formats.srdf:add_pairs"
"""Adds the pairs of an SRDF file to a robot."""
ENGINES = {"mujoco": "beyond.engines.mujoco:MuJoCo"}
"""Classes of other engines that repeat motions, by the name of the engine and of its extra."""


STUDY_COMMANDS = {"track": "beyond.engines.track_runs"}
"""Modules of the commands of studies that are beyond the paper. They have the functions ``chunks``,
of a study and its missing runs: runs that are computed side by side; ``computed``, of a study, a
chunk and a number of threads: its rows; and ``values``, of a study and a run: its row."""


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
class SectionKind:
    """Names of what belongs to a section of scenarios.

    Attributes:
        section: Class of the section, or of each of its entries.
        posed: Class of what scenarios with the section ask for, made of a scenario; its method
            ``plan`` finds it.
    """

    section: str
    posed: str


SECTIONS = {
    "goal": SectionKind(
        "beyond.missions.phase_section:GoalSection", "beyond.missions.goal_phase:PosedGoal"
    ),
    "phases": SectionKind(
        "beyond.missions.phase_section:PhaseSection",
        "beyond.missions.manoeuvre_planner:PosedManoeuvre",
    ),
}
"""Sections of scenario files that ask for more than a path, by key."""


@dataclass(frozen=True)
class ResultKind:
    """Names of what belongs to a kind of results.

    Attributes:
        record: The class.
        figures: Function of a result, a number of threads and the progress.
        scene: Function of a result and a title.
        report: Function of a result and an engine; empty for records that are not saved.
        values: Function of a result that returns the values of a run of a study by column.
        tables: Function of the name of a scenario, of what was found for it and of whether details
            are wanted.
        decode: Function of the tree of a file and its scenario, or its robot without a scenario;
            empty for records of a problem, a search and limits.
        codec: Codec of the record.
        scenario: Function of a result that returns the scenario that poses it; empty where files
            hold none.
    """

    record: str
    figures: str
    scene: str
    report: str = ""
    values: str = ""
    tables: str = ""
    decode: str = ""
    codec: str = "verification.tolerances:CODEC"
    scenario: str = "io.scenario.problem_text:scenario_of_result"


RESULT_KINDS = {
    "plan": ResultKind(
        "planning.plan:Plan", "visualization.figures:plan_figures",
        "visualization.scenes.scene:plan_scene", "verification.path_motions:plan_report",
        "studies.run:plan_values", "cli.plan:plan_tables",
    ),
    "motion": ResultKind(
        "planning.simulation:Simulation", "visualization.figures:simulation_figures",
        "visualization.scenes.scene:simulation_scene",
        "verification.path_motions:simulation_report", "studies.run:simulation_values",
        "cli.simulate:simulation_tables",
    ),
    "goal": ResultKind(
        "beyond.missions.goals.goal_motion:GoalMotion", "beyond.missions.figures:goal_figures",
        "beyond.missions.figures:goal_scene", "beyond.missions.manoeuvre_verification:goal_report",
        "beyond.missions.manoeuvre_files:goal_values", "beyond.missions.tables:goal_tables",
        "beyond.missions.manoeuvre_files:decode_goal",
        scenario="beyond.missions.manoeuvre_files:goal_scenario",
    ),
    "manoeuvre": ResultKind(
        "beyond.missions.manoeuvre:Manoeuvre",
        "beyond.missions.figures:manoeuvre_figures", "beyond.missions.figures:manoeuvre_scene",
        "beyond.missions.manoeuvre_verification:manoeuvre_report",
        "beyond.missions.manoeuvre_files:manoeuvre_values",
        "beyond.missions.tables:manoeuvre_tables",
        "beyond.missions.manoeuvre_files:decode_manoeuvre", "beyond.missions.manoeuvre_files:CODEC",
        "beyond.missions.manoeuvre_files:manoeuvre_scenario",
    ),
    "attitude map": ResultKind(
        "planning.space.attitude_map:AttitudeMap",
        "visualization.figures:attitude_map_figures",
        "visualization.scenes.map_scene:map_scene", "verification.recomputed:map_report",
        "studies.run:map_values",
    ),
    "map": ResultKind(
        "planning.margin_map:HeadingMap", "visualization.figures:heading_map_figures",
        "visualization.scenes.map_scene:heading_scene", "verification.recomputed:map_report",
        "studies.run:map_values",
    ),
    "singularity map": ResultKind(
        "beyond.joint_space.singularity_map:SingularityMap",
        "beyond.joint_space.figures:map_figures", "beyond.joint_space.scene:singularity_scene",
        "beyond.joint_space.verification:singularity_map_report",
        decode="beyond.joint_space.verification:decoded", scenario="",
    ),
}  # fmt: skip
"""Kinds of results that are saved, by the attribute ``kind`` of their records."""
_MOTION = ResultKind(
    "motion.motion:Motion",
    "visualization.figures:drawn_motion_figures",
    "visualization.scenes.scene:single_motion_scene",
)


def kind_of(result: object, *, saved: bool = False) -> ResultKind:
    """The kind of a result; a bare motion has one, too, unless it must be one that is saved.

    Raises:
        InputError: If the object is no result.
    """
    kinds: list[ResultKind] = [*RESULT_KINDS.values(), *(() if saved else (_MOTION,))]
    record = result.__class__
    place = f"{record.__module__}:{record.__name__}"
    for kind in kinds:
        if place == f"freefloat.{kind.record}":
            return kind
    names = ", ".join(kind.record.partition(":")[2] for kind in kinds)
    raise InputError("result", f"a {record.__name__} was given", names)
