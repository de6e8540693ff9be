"""Limits of runs: which of them ensembles know, and the arm branch that they leave to choose."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from freefloat.ensemble.known_limits import KNOWN, KnownLimits
from freefloat.ensemble.simulate_many import simulate_many
from freefloat.errors import MissingNumbaError
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.kinds.corridor import CorridorLimit
from freefloat.limits.limits import GIVEN
from freefloat.limits.recorded_limits import RecordedLimits
from freefloat.motion.pointing import AttitudeLimits
from freefloat.so3 import Array


def limits_of_runs(
    scenario: Scenario, *, mounts: bool = False, moved: bool = False
) -> tuple[KnownLimits, RecordedLimits, tuple[str, ...]]:
    """The limits that ensembles know, those that recorded motions show, and names of the others.

    Args:
        scenario: The scenario.
        mounts: Whether mounts vary, so that axes and bodies of the arm's first link do.
        moved: Whether durations or robots vary, so that the bodies of a scene are elsewhere.
    """
    limits, problem = scenario.limits(), scenario.problem()
    bounds = {kind.name: getattr(limits, kind.name) for kind in GIVEN}
    given = {
        name for name, bound in bounds.items()
        if bound is not None and np.size(bound) > 0 and not isinstance(bound, str)
    }  # fmt: skip
    if problem.scene.corridor is not None:
        given.add(CorridorLimit.name)
    recorded = (
        RecordedLimits(problem) if mounts else RecordedLimits.of(problem, limits, moved=moved)
    )
    attitude = AttitudeLimits(
        pointing=() if mounts else limits.pointing, base_turn=limits.base_turn
    )
    known = KnownLimits(problem.model, limits.joint_rate, limits.base_rate, attitude)
    seen = {*KNOWN, *recorded.names} - ({"pointing"} if mounts else set())
    return known, recorded, tuple(sorted(given - seen))


def chosen_joints(scenario: Scenario, attitude: Array) -> Array:
    """Initial joints (n,) of the motion that simulate chooses; without limits of an ensemble."""
    problem, (known, recorded, others) = scenario.problem(), limits_of_runs(scenario)
    limited = bool(known.names or recorded.names or others)
    if not limited and scenario.content.search.joints is None and problem.model.has_one_arm:
        with suppress(MissingNumbaError):
            motions = simulate_many(problem, attitude, threads=1)
            if motions.reached.all():
                return np.asarray(motions.joints[0])
    return scenario.simulate(attitude).chosen.branch.joints
