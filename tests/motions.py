"""Problems, and motions of them, that several tests speak of."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from freefloat.attitude_law import FixedAttitude
from freefloat.curve import PolynomialCurve
from freefloat.dynamics import Task
from freefloat.integration import integrate_motion
from freefloat.model import FreeFloatingModel
from freefloat.motion import Motion
from freefloat.path import EndEffectorPath
from freefloat.problem import Margin, Problem
from freefloat.rollout import Roller, Rollout
from freefloat.scenario import load_scenario
from freefloat.singularity import measure
from freefloat.spatial import heading_quaternion
from freefloat.timing import TimedPath, Timing

GOOD = [0.46008, 0.09337, 0.73519, -0.48898]
"""Example 2: from here the path is completed."""
BAD = [0.1, 0.5, 0.2, -0.8367]
"""Example 2: from here four of eight branches become singular."""


@cache
def bundled(name: str) -> Problem:
    """The problem of a bundled scenario."""
    return load_scenario(name).problem()


def heading(degrees: float) -> np.ndarray:
    """Quaternion of a planar heading."""
    return heading_quaternion(np.deg2rad(degrees))


def followed(problem: Problem, attitude: object, branch: int, **options: object) -> Motion:
    """The motion of an arm branch."""
    attitude = problem.attitude("attitude", attitude)
    return integrate_motion(problem, attitude, problem.branches(attitude)[branch].joints, **options)


def rolled(motion: Motion, **options: object) -> Rollout:
    """The same motion by the compiled kernels."""
    first = motion.initial
    return Roller(motion.problem, 1).follow(first.attitude[None], first.joints[None], **options)


def lasting(problem: Problem, duration: float, momentum: object = None) -> Problem:
    """The same path by the quintic law in another time [s], and with another momentum."""
    path = TimedPath(problem.path.path, Timing(duration))
    return replace(problem, path=path, momentum=problem.momentum if momentum is None else momentum)


def along(
    model: FreeFloatingModel,
    task: Task,
    start: object,
    end: object,
    axes: np.ndarray,
    duration: float = 100.0,
    momentum: object = (0.0, 0.0, 0.0),
) -> Problem:
    """A line with the hand held still; the margin is zero, of det A."""
    path = EndEffectorPath(PolynomialCurve.line(start, end), FixedAttitude(axes))
    margin = Margin(measure(model, task, "system"), 0.0)
    return Problem(model, TimedPath(path, Timing(duration)), task, momentum, margin)
