"""Limits of runs: which of them ensembles know, and which recorded motions show."""

from __future__ import annotations

import numpy as np

from freefloat.ensemble.known_limits import KNOWN, KnownLimits
from freefloat.io.scenario.scenario import Scenario
from freefloat.limits.kinds.corridor import CorridorLimit
from freefloat.limits.limits import GIVEN
from freefloat.limits.recorded_limits import RecordedLimits
from freefloat.motion.pointing import AttitudeLimits


def limits_of_runs(
    scenario: Scenario, *, mounts: bool, moved: bool
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
