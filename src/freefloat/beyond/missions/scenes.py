"""Scenes of motions to goals and of manoeuvres."""

from __future__ import annotations

from freefloat.beyond.missions.goals.goal_motion import GoalMotion
from freefloat.beyond.missions.phases.manoeuvre import Manoeuvre
from freefloat.errors import InputError
from freefloat.motion.motion import Motion
from freefloat.planning.answer import violation_of
from freefloat.visualization.scenes.scene import Place, motion_scene
from freefloat.visualization.scenes.scene_builder import PageScene


def goal_scene(result: GoalMotion, title: str) -> PageScene:
    """The scene of a motion to a goal; an InputError without one."""
    motion = result.motion
    if motion is None:
        accepted = "a goal with a motion"
        raise InputError("result", f"it has no motion: {result.reason}", accepted)
    violations = {result.kind: result.violation}
    return motion_scene({result.kind: motion}, title, result.limits, violations=violations)


def manoeuvre_scene(manoeuvre: Manoeuvre, title: str) -> PageScene:
    """The scene of the motions of a manoeuvre, in the frame of its first path.

    Raises:
        InputError: If no phase has a motion.
    """
    motions: dict[str, Motion] = {}
    places: list[Place] = []
    violations: dict[str, str] = {}
    for number, phase in enumerate(manoeuvre.phases, 1):
        motion = phase.motion
        if motion is not None:
            name = f"{number} {phase.name}"
            motions[name], violations[name] = motion, violation_of(phase.limit_results)
            x, y, z = phase.centre.tolist()
            places.append(Place(phase.start, (x, y, z)))
    if not motions:
        raise InputError("manoeuvre", manoeuvre.reason, "a manoeuvre with a motion")
    return motion_scene(motions, title, manoeuvre.path.limits, places, violations)
