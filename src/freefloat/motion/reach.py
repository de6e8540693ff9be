"""Paths that no configuration of the arm can follow: they lead beyond its reach."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.problem import Problem

_LOOKS = 401
"""Places of a path that are looked at."""
_OTHER_UNITS = 50.0
"""A start so many times farther than the reach was hardly written in metres."""


@dataclass(frozen=True)
class OutOfReach:
    """The first place of a path that lies beyond the arm's reach.

    Attributes:
        s: Where the path leaves the reach, 0 where it begins outside.
        position: That place, from the centre of mass of the whole system, inertial axes [m].
        reach: No configuration takes the end-effector farther from there [m].
    """

    s: float
    position: tuple[float, float, float]
    reach: float

    def __str__(self) -> str:
        if self.s > 0.0:
            return f"the path leaves the reach of {self.reach:.4g} m at s = {self.s:.3g}"
        place, distance = [round(x, 6) for x in self.position], math.hypot(*self.position)
        told = (
            f"the path begins out of reach: {place} m is {distance:.4g} m from the centre of mass, "
            f"the arm reaches {self.reach:.4g} m"
        )
        if distance > _OTHER_UNITS * self.reach:
            told += "; lengths are in metres"
        return told


def out_of_reach(problem: Problem) -> OutOfReach | None:
    """The first place of the path that the end-effector cannot be at, whatever the attitude.

    Places too near to the centre of mass, or that joint ranges or the hand's attitude keep the arm
    from, are not found.

    Args:
        problem: Robot and path.

    Returns:
        None where the whole path lies within the reach.
    """
    reach, path = VirtualManipulator.of(problem.model).reach, problem.path.path

    def beyond(s: float) -> float:
        return float(np.linalg.norm(path.curve(s))) - reach

    def found(s: float) -> OutOfReach:
        x, y, z = path.curve(s).tolist()
        return OutOfReach(s, (x, y, z), reach)

    if beyond(0.0) > 0.0:
        return found(0.0)
    places = np.linspace(0.0, 1.0, _LOOKS).tolist()
    outside = next((k for k, s in enumerate(places) if beyond(s) > 0.0), None)
    if outside is None:
        return None
    return found(float(brentq(beyond, places[outside - 1], places[outside])))


def told_reach(problem: Problem) -> str | None:
    """Where the path leads out of reach, in words; None where it does not."""
    beyond = out_of_reach(problem)
    return None if beyond is None else f"{beyond}{light_spacecraft(problem)}"


def unreached_start(problem: Problem) -> str:
    """``the arm reach the start ...``: where the path begins, and how far the arm could get."""
    place = problem.path.pose(0.0).position
    return (
        f"the arm reach the start of the path, {np.round(place, 6).tolist()} m, which is "
        f"{np.linalg.norm(place):.4g} m from the centre of mass (no configuration gets farther "
        f"than {VirtualManipulator.of(problem.model).reach:.4g} m){light_spacecraft(problem)}"
    )


def light_spacecraft(problem: Problem) -> str:
    """What is told of a spacecraft lighter than its arm, which may have been forgotten; or nothing.

    The lighter it is, the nearer the arm's reach ends to the centre of mass.
    """
    base, total = problem.model.bodies[0].mass, problem.model.total_mass
    if base >= 0.5 * total:
        return ""
    return (
        f"; the spacecraft has {base:.4g} kg of {total:.4g} kg: was robot.spacecraft in the "
        "scenario forgotten?"
    )
