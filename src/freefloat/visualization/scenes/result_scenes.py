"""The scene of any result: a function for each kind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from freefloat.errors import InputError, require_type
from freefloat.kinds import kind_of, named
from freefloat.limits.limits import Limits
from freefloat.motion.motion import Motion
from freefloat.planning.plan import Plan
from freefloat.planning.simulation import Simulation
from freefloat.visualization.scenes.scene import motion_scene
from freefloat.visualization.scenes.scene_builder import PageScene


def result_scene(shown: Any, title: str) -> PageScene:
    """The scene of a result, or of motions by name.

    Raises:
        InputError: If the result is of another class, or without a motion.
    """
    if isinstance(shown, Mapping):
        for name, motion in shown.items():
            accepted = "a Motion for each name, such as simulate(...).chosen.motion"
            require_type(f"motions.{name}", motion, Motion, accepted)
        return motion_scene(dict(shown), title)
    scene: PageScene = named(kind_of(shown).scene)(shown, title)
    return scene


def single_motion_scene(motion: Motion, title: str) -> PageScene:
    """The scene of a motion."""
    return motion_scene({"motion": motion}, title)


def simulation_scene(simulation: Simulation, title: str) -> PageScene:
    """The scene of all arm branches, the chosen one first."""
    branches = sorted(simulation.branches, key=lambda branch: branch is not simulation.chosen)
    motions = {branch.title: branch.motion for branch in branches}
    violations = {simulation.chosen.title: simulation.violation}
    return motion_scene(motions, title, _pointing(simulation.limits), violations=violations)


def plan_scene(plan: Plan, title: str) -> PageScene:
    """The scene of the chosen motion of a plan; an InputError without one."""
    if plan.chosen is None:
        raise InputError("plan", f"it has no motion: {plan.reason}", "a plan with a motion")
    name = plan.chosen.title
    violations = {name: "" if plan.feasible else plan.violation or "infeasible"}
    motions = {name: plan.chosen.motion}
    return motion_scene(motions, title, _pointing(plan.limits), violations=violations)


def _pointing(limits: Limits | None) -> tuple[Any, ...]:
    return () if limits is None else limits.pointing
