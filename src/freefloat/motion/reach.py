"""Paths that lead beyond the reach of the arm, whatever the attitude."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.problem import Problem

_SAMPLES = 401
_OTHER_UNITS = 50.0
"""A start this many times farther than the reach was hardly written in metres."""


def out_of_reach(problem: Problem) -> float | None:
    """Path parameter from which the end-effector cannot reach the path, whatever the attitude.

    Points that are too near to the centre of mass, or that joint ranges or the end-effector's
    orientation exclude, are not found.

    Returns:
        0 where the path begins out of reach, None where all of it lies within the reach.
    """
    reach = VirtualManipulator.of(problem.model).reach

    def excess(s: float) -> float:
        return float(np.linalg.norm(problem.path.pose_at(s).position)) - reach

    samples = np.linspace(0.0, 1.0, _SAMPLES).tolist()
    outside = next((k for k, s in enumerate(samples) if excess(s) > 0.0), None)
    if not outside:
        return outside
    return float(brentq(excess, *samples[outside - 1 : outside + 1]))


def reach_message(problem: Problem) -> str | None:
    """Where the path leads out of reach, with a likely cause; None where it does not."""
    s = out_of_reach(problem)
    if s is None:
        return None
    reach = VirtualManipulator.of(problem.model).reach
    hint = light_spacecraft_hint(problem)
    if s > 0.0:
        return f"the path leaves the reach of {reach:.4g} m at s = {s:.3g}{hint}"
    start = problem.path.pose(0.0).position
    distance = float(np.linalg.norm(start))
    units = "; lengths are in metres" if distance > _OTHER_UNITS * reach else ""
    return (
        f"the path begins out of reach: {np.round(start, 6).tolist()} m is {distance:.4g} m from "
        f"the centre of mass, the arm reaches {reach:.4g} m{units}{hint}"
    )


def unreached_start_message(problem: Problem, origin: str) -> str:
    """The sentence that the arm does not reach the start of the path, with the distances.

    Args:
        problem: The problem.
        origin: From where it does not, such as ``"no heading"``.
    """
    start, reach = problem.path.pose(0.0).position, VirtualManipulator.of(problem.model).reach
    return (
        f"the arm reaches the start of the path, {np.round(start, 6).tolist()} m, from {origin}; "
        f"it is {np.linalg.norm(start):.4g} m from the centre of mass, and no configuration gets "
        f"farther than {reach:.4g} m{light_spacecraft_hint(problem)}"
    )


def light_spacecraft_hint(problem: Problem) -> str:
    """The last clause of a message on a spacecraft lighter than its arm; empty for heavier ones."""
    base, total = problem.model.bodies[0].mass, problem.model.total_mass
    if base >= 0.5 * total:
        return ""
    return f"; the spacecraft has {base:.4g} kg of {total:.4g} kg: is robot.spacecraft missing?"
