"""Motions that arrive at a state at time zero, found backward in time.

When they begin is known only once they are found, and with it where the bodies of the scene are
then. Backward in time, momentum, wheels, drift and the rates of these bodies have opposite signs,
and the motion begins at time zero.
"""

from __future__ import annotations

from dataclasses import replace

from freefloat.beyond.missions.goals.goal import Goal
from freefloat.beyond.missions.goals.goal_motion import GoalMotion, earlier
from freefloat.beyond.missions.goals.mover import move_from
from freefloat.beyond.missions.goals.query import GoalStart, Query
from freefloat.concurrency import Progress
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits
from freefloat.motion.joint_curves import JointSpline
from freefloat.motion.joint_integration import integrate_spline
from freefloat.motion.law import JointLaw
from freefloat.motion.setting import JointSetting
from freefloat.scene.scene import Scene
from freefloat.scene.tumbling import Tumbling
from freefloat.so3 import Array


def arrive(
    setting: JointSetting,
    present: tuple[Array, Array],
    state: GoalStart,
    limits: Limits,
    *,
    duration: float | None = None,
    first_duration: float,
    seed: int = 0,
    progress: Progress | None = None,
) -> GoalMotion:
    """Find a motion of the joints from rest that ends with a state at time zero.

    Args:
        setting: Robot, momentum, drift and scene at time zero, from the centre of mass then.
        present: Attitude of the spacecraft and joints where it begins.
        state: The state at the end.
        limits: Limits to keep, from the centre of mass at time zero.
        duration: Duration [s]; None for the shortest one found that limits permit.
        first_duration: Duration with which the search for that one begins [s].
        seed: Seed of the random paths.
        progress: Called with the fraction done, in [0, 1].

    Returns:
        The motion, from its first centre of mass.
    """
    attitude, joints = present
    query = Query(
        _backward(setting), state._replace(joint_rates=-state.joint_rates),
        Goal(attitude=attitude, joints=joints, duration=duration), limits,
        goal_words="the given beginning", first_duration=first_duration,
    )  # fmt: skip
    back = move_from(query, seed=seed, progress=progress)
    rates = state.joint_rates if state.joint_rates.any() else None
    goal = Goal(None, state.attitude, state.joints, duration=duration, joint_rates=rates)
    outcome = replace(back, setting=setting, goal=goal, motion=None, limit_results=())
    return outcome if back.law is None else _forward(outcome, back.law, attitude)


def _forward(outcome: GoalMotion, back: JointLaw, attitude: Array) -> GoalMotion:
    """The outcome with the motion whose joints are those of a motion backward in time."""
    there = earlier(outcome.setting, back.duration)
    limits = outcome.limits.seen_from(-back.duration * there.drift)
    curve = JointSpline(back.curve.control_points[::-1])
    motion = integrate_spline(JointLaw(there, curve, back.duration), attitude)
    results = LimitChecker(there, limits).results(motion)
    return replace(outcome, setting=there, limits=limits).with_motion(motion, results)


def _backward(setting: JointSetting) -> JointSetting:
    """The setting backward in time."""
    bodies = tuple(
        replace(body, motion=replace(body.motion, rate=-body.motion.rate))
        if isinstance(body.motion, Tumbling) else body
        for body in setting.scene.bodies
    )  # fmt: skip
    return replace(
        setting, momentum=-setting.momentum, wheel_momentum=-setting.wheel_momentum,
        drift=-setting.drift, scene=Scene(bodies, setting.scene.corridor),
    )  # fmt: skip
