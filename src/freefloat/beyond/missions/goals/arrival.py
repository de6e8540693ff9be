"""Motions that arrive at a state at time zero, found backward in time.

When they begin is known only once they are found, and with it where the bodies of the scene are
then. Backward in time, momentum, wheels, drift and the rates of these bodies have opposite signs,
and the motion begins at time zero.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from freefloat.beyond.missions.goals.goal import Goal
from freefloat.beyond.missions.goals.goal_motion import GoalMotion, earlier
from freefloat.beyond.missions.goals.mover import move_from
from freefloat.beyond.missions.goals.query import GoalStart, Query
from freefloat.concurrency import Progress
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits
from freefloat.motion.joint_curves import JointSpline
from freefloat.motion.joint_integration import integrate_spline
from freefloat.motion.problem import Problem
from freefloat.scene.scene import Scene
from freefloat.scene.tumbling import Tumbling
from freefloat.so3 import Array


def arrive(
    problem: Problem,
    present: tuple[Array, Array],
    state: GoalStart,
    limits: Limits,
    *,
    duration: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> GoalMotion:
    """Find a motion of the joints from rest that ends with a state at time zero.

    Args:
        problem: Robot, momentum, drift and scene at time zero, from the centre of mass then.
        present: Attitude of the spacecraft and joints where it begins.
        state: The state at the end.
        limits: Limits to keep, from the centre of mass at time zero.
        duration: Duration [s]; None for the shortest one found that limits permit.
        seed: Seed of the random paths.
        progress: Called with the fraction done, in [0, 1].

    Returns:
        The motion, from its first centre of mass.
    """
    attitude, joints = present
    query = Query(
        _backward(problem), state._replace(joint_rates=-state.joint_rates),
        Goal(attitude=attitude, joints=joints, duration=duration), limits,
        goal_words="the given beginning",
    )  # fmt: skip
    back = move_from(query, seed=seed, progress=progress)
    rates = state.joint_rates if state.joint_rates.any() else None
    goal = Goal(None, state.attitude, state.joints, duration=duration, joint_rates=rates)
    outcome = replace(back, problem=problem, goal=goal, motion=None, limit_results=())
    if back.motion is None or back.motion.curve is None:
        return outcome
    return _forward(outcome, back.motion.curve, back.duration or 0.0, attitude)


def _forward(
    outcome: GoalMotion, back: JointSpline, duration: float, attitude: Array
) -> GoalMotion:
    """The outcome with the motion whose joints are those of a motion backward in time."""
    problem, spline = outcome.problem, JointSpline(back.control_points[::-1])
    there = replace(earlier(problem, duration), path=problem.path.lasting(duration))
    limits = outcome.limits.seen_from(-duration * problem.path.drift)
    motion = integrate_spline(there, spline, attitude)
    results = LimitChecker(there, limits).results(motion)
    return replace(outcome, limits=limits).with_motion(motion, results)


def _backward(problem: Problem) -> Problem:
    """The problem backward in time."""
    bodies = tuple(
        replace(body, motion=replace(body.motion, rate=-body.motion.rate))
        if isinstance(body.motion, Tumbling) else body
        for body in problem.scene.bodies
    )  # fmt: skip
    return replace(
        problem, momentum=-problem.momentum, wheel_momentum=-problem.wheel_momentum,
        path=replace(problem.path, drift=-np.asarray(problem.path.drift)),
        scene=Scene(bodies, problem.scene.corridor),
    )  # fmt: skip
