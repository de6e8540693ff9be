"""Motions of manoeuvres with the joints of arms that rest along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from freefloat.motion.joint_curves import ArmCurve, ArmCurves
from freefloat.motion.motion import Motion
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array


def with_resting_arms(motions: Sequence[Motion | None]) -> list[Motion | None]:
    """The motions of phases, all with the joints of the arms that move along any of them.

    Args:
        motions: Motions of one manoeuvre; None of phases without motion.
    """
    problems = [motion.problem for motion in motions if motion is not None]
    robot = next((problem.model for problem in problems if problem.arms), None)
    if robot is None:
        return list(motions)
    return [
        motion if motion is None or motion.problem.arms else _with_resting_arms(motion, robot)
        for motion in motions
    ]


def _with_resting_arms(motion: Motion, robot: FreeFloatingModel) -> Motion:
    """A motion with the joints that further arms of a robot move, and its own model fixes."""
    problem = motion.problem
    fixed = dict(problem.model.fixed_joints)
    resting = {
        name: [fixed.pop(joint) for joint in robot.joints_of_arm(name)] for name in robot.arms
    }
    model = replace(problem.model, arms=robot.arms, fixed_joints=fixed)
    curves = {
        name: ArmCurve.evenly([values, values], problem.path.duration)
        for name, values in resting.items()
    }
    constant = np.concatenate(list(resting.values()))

    def widened(values: Array) -> Array:
        return np.hstack([values, np.tile(constant, (len(values), 1))])

    curve = motion.curve
    if curve is not None:
        curve = replace(curve, control_points=widened(curve.control_points))
    problem = problem.replace(model=model, arms=ArmCurves(curves))
    return replace(motion, problem=problem, joints=widened(motion.joints), curve=curve)
