"""Motions of manoeuvres with the joints of arms that rest along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from freefloat.motion.motion import Motion
from freefloat.robot.model import FreeFloatingModel


def with_resting_arms(motions: Sequence[Motion | None]) -> list[Motion | None]:
    """The motions of phases, all with the joints of the arms that move along any of them.

    Args:
        motions: Motions of one manoeuvre; None of phases without motion.
    """
    settings = [motion.setting for motion in motions if motion is not None]
    robot = next((setting.model for setting in settings if setting.arms), None)
    if robot is None:
        return list(motions)
    return [
        motion if motion is None or motion.setting.arms else _with_resting_arms(motion, robot)
        for motion in motions
    ]


def _with_resting_arms(motion: Motion, robot: FreeFloatingModel) -> Motion:
    """A motion with the joints that further arms of a robot move, and its own model fixes."""
    fixed = dict(motion.model.fixed_joints)
    resting = {
        name: np.array([fixed.pop(joint) for joint in robot.joints_of_arm(name)])
        for name in robot.arms
    }
    model = replace(motion.model, arms=robot.arms, fixed_joints=fixed)
    constant = np.tile(np.concatenate([*resting.values()]), (len(motion.joints), 1))
    law = motion.law.with_arms_at_rest(model, resting)
    return replace(motion, law=law, joints=np.hstack([motion.joints, constant]))
