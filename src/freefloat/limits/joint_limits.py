"""Limits along motions whose joints are prescribed, with their rates and accelerations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from freefloat.limits import extremes
from freefloat.limits.limits import LimitResult, Limits, require_applicable
from freefloat.limits.torques import InverseDynamics
from freefloat.motion.extrema import Function
from freefloat.motion.joint_integration import JointCurve, base_velocity
from freefloat.motion.motion import Motion
from freefloat.paths.scene import Scene
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

if TYPE_CHECKING:
    from freefloat.limits.pairs import CollisionPairs

_NO_SCENE = Scene()


class JointLimitChecker:
    """The limits of a robot, prepared for many motions whose joints are prescribed.

    ``base_turn`` is not considered: the spacecraft is meant to turn.

    Attributes:
        pairs: Pairs of links that keep the clearance; None without one.
    """

    def __init__(self, model: FreeFloatingModel, limits: Limits, scene: Scene = _NO_SCENE) -> None:
        """Prepare the limits, of clearance also from a scene.

        Raises:
            InputError: If there are not as many limits as joints, or a link is unknown.
            ModelError: If a clearance is required and the robot's shapes cannot be used.
        """
        require_applicable(model, limits)
        self._limits = limits
        self.pairs: CollisionPairs | None = None
        if limits.clearance is not None:
            from freefloat.limits.pairs import CollisionPairs  # coal and trimesh import slowly

            self.pairs = CollisionPairs(model, limits.clearance, scene=scene)

    def results(self, motion: Motion, curve: JointCurve) -> tuple[LimitResult, ...]:
        """The results of all limits along a motion, at the instants of their largest ratios."""
        return self.shaped(motion) + self.timed(motion, curve)

    def shaped(self, motion: Motion, *, decide_only: bool = False) -> tuple[LimitResult, ...]:
        """The results of limits that do not depend on rates.

        To decide only, the clearance need not be the smallest one.
        """
        limits, results = self._limits, []
        if np.isfinite(motion.problem.model.joint_ranges).any():
            results.append(extremes.joint_range(motion))
        if limits.pointing:
            results.append(extremes.pointing(limits.pointing, motion))
        if limits.clearance is not None and self.pairs is not None:
            allowed, pairs = limits.clearance, self.pairs
            results.append(extremes.clearance(allowed, pairs, motion, decide_only=decide_only))
        return tuple(results)

    def timed(self, motion: Motion, curve: JointCurve) -> tuple[LimitResult, ...]:
        """The results of limits of rates and torques."""
        limits, results = self._limits, []
        rates = _rates(motion, curve)
        if limits.joint_rate is not None:
            results.append(extremes.joint_rate(limits.joint_rate, motion, rates))
        if limits.base_rate is not None:
            results.append(extremes.base_rate(limits.base_rate, motion, rates))
        if limits.joint_torque is not None:
            forces = _forces(motion, curve)
            results.append(extremes.joint_torque(limits.joint_torque, motion, forces))
        return tuple(results)


def _rates(motion: Motion, curve: JointCurve) -> extremes.Rates:
    """The spacecraft's angular velocity and the joint rates by panel and its parameter."""
    problem, timing = motion.problem, motion.problem.path.timing

    def rates(panel: int, x: float) -> tuple[Array, Array]:
        t, attitude, _ = motion.at(panel, x)
        segment = motion.timing_segment(panel)
        s, speed = timing.s(t, 0, segment), timing.s(t, 1, segment)
        joints, joint_rates = curve.at(s), curve.at(s, 1) * speed
        return base_velocity(problem, attitude, joints, joint_rates), joint_rates

    return rates


def _forces(motion: Motion, curve: JointCurve) -> Function:
    """Joint torques, then the wrench on the base, by panel and its parameter."""
    dynamics = InverseDynamics(motion.problem)

    def forces(panel: int, x: float) -> Array:
        t, attitude, _ = motion.at(panel, x)
        effort = dynamics.effort_along(curve, t, attitude, motion.timing_segment(panel))
        return np.concatenate([effort.joint_torques, effort.base_wrench])

    return forces
