"""The scene of any result: a function for each kind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from freefloat.errors import InputError, require_type
from freefloat.kinds import kind_of, named
from freefloat.limits.limits import Limits
from freefloat.motion.motion import Motion
from freefloat.planning.goals.goal_motion import GoalMotion
from freefloat.planning.phases.manoeuvre import Manoeuvre
from freefloat.planning.plan import Plan
from freefloat.planning.simulation import Simulation
from freefloat.visualization.scenes.scene import Place, motion_scene
from freefloat.visualization.scenes.scene_builder import Scene


def result_scene(result: Any, title: str) -> Scene:
    """The scene of a result, or of motions by name.

    Raises:
        InputError: If the result is of another class, or without a motion.
    """
    if isinstance(result, Mapping):
        for name, motion in result.items():
            accepted = "a Motion for each name, such as simulate(...).chosen.motion"
            require_type(f"motions.{name}", motion, Motion, accepted)
        return motion_scene(dict(result), title)
    scene: Scene = named(kind_of(result).scene)(result, title)
    return scene


def single_motion_scene(motion: Motion, title: str) -> Scene:
    """The scene of a motion."""
    return motion_scene({"motion": motion}, title)


def simulation_scene(simulation: Simulation, title: str) -> Scene:
    """The scene of all arm branches, the chosen one first."""
    branches = sorted(simulation.branches, key=lambda branch: branch is not simulation.chosen)
    motions = {branch.title: branch.motion for branch in branches}
    return motion_scene(motions, title, _pointing(simulation.limits))


def plan_scene(plan: Plan, title: str) -> Scene:
    """The scene of the chosen motion of a plan; an InputError without one."""
    if plan.chosen is None:
        raise InputError("plan", f"it has no motion: {plan.reason}", "a plan with a motion")
    name = plan.chosen.title + ("" if plan.feasible else f", {plan.violation or 'infeasible'}")
    return motion_scene({name: plan.chosen.motion}, title, _pointing(plan.limits))


def goal_scene(result: GoalMotion, title: str) -> Scene:
    """The scene of a motion to a goal; an InputError without one."""
    motion = result.phases[0].shown_motion
    if motion is None:
        accepted = "a goal with a motion"
        raise InputError("result", f"it has no motion: {result.reason}", accepted)
    return motion_scene({result.kind: motion}, title, _pointing(result.limits))


def manoeuvre_scene(manoeuvre: Manoeuvre, title: str) -> Scene:
    """The scene of the motions of a manoeuvre, in the frame of its first path.

    Raises:
        InputError: If no phase has a motion.
    """
    motions: dict[str, Motion] = {}
    places: list[Place] = []
    for number, phase in enumerate(manoeuvre.phases, 1):
        motion = phase.shown_motion
        if motion is not None:
            motions[f"{number} {phase.name}"] = motion
            x, y, z = phase.centre.tolist()
            places.append(Place(phase.start, (x, y, z)))
    if not motions:
        raise InputError("manoeuvre", manoeuvre.reason, "a manoeuvre with a motion")
    result = manoeuvre.path
    pointing = () if result.limits is None else result.limits.pointing
    return motion_scene(motions, title, pointing, places)


def _pointing(limits: Limits | None) -> tuple[Any, ...]:
    return () if limits is None else limits.pointing
