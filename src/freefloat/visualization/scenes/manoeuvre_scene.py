"""The scene of a manoeuvre: its phases one after another."""

from __future__ import annotations

from dataclasses import replace

from freefloat.errors import InputError
from freefloat.motion.motion import Motion
from freefloat.planning.answer import PhaseResult
from freefloat.planning.phases.manoeuvre import Manoeuvre
from freefloat.visualization.scenes.scene import Place, motion_scene
from freefloat.visualization.scenes.scene_builder import Scene


def manoeuvre_scene(manoeuvre: Manoeuvre, title: str) -> Scene:
    """Return the scene of the motions of a manoeuvre, in the frame of its first path.

    Raises:
        InputError: If no phase has a motion.
    """
    motions, places = dict[str, Motion](), list[Place]()
    begin = manoeuvre.phases[0].start
    for number, phase in enumerate(manoeuvre.phases, 1):
        motion = _with_scene(phase, manoeuvre)
        if motion is not None:
            motions[f"{number} {phase.name}"] = motion
            x, y, z = phase.centre.tolist()
            places.append(Place(phase.start - begin, (x, y, z)))
    if not motions:
        raise InputError("manoeuvre", manoeuvre.reason, "a manoeuvre with a motion")
    result = manoeuvre.path
    pointing = () if result.limits is None else result.limits.pointing
    return motion_scene(motions, title, pointing, places)


def _with_scene(phase: PhaseResult, manoeuvre: Manoeuvre) -> Motion | None:
    """The motion of a phase: that of joints without a margin, a reorientation with its scene."""
    motion = phase.motion
    if motion is None or phase.kind == "path":
        return motion
    problem = motion.problem
    problem = replace(problem, margin=replace(problem.margin, threshold=0.0))
    if phase.kind == "reorientation":
        scene = manoeuvre.problem.scene.later(phase.start, -phase.centre)
        problem = replace(problem, scene=scene)
    return replace(motion, problem=problem)
