"""Limits along a motion, each at the instant of its largest ratio."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from freefloat.errors import require_type
from freefloat.limits import extremes
from freefloat.limits.limits import (
    LimitKind,
    LimitResult,
    Limits,
    require_applicable,
    violated,
)
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem

if TYPE_CHECKING:
    from freefloat.limits.pairs import CollisionPairs

_Check = Callable[[Motion], LimitResult]


def check_limits(motion: Motion, limits: Limits) -> tuple[LimitResult, ...]:
    """The results of all limits along a motion, the scene's corridor and joint ranges first.

    Args:
        motion: Along a path or with prescribed joints, which are compared with their ranges as they
            are; see :func:`freefloat.motion.extrema.unwrapped`.
        limits: The limits in addition to the joint ranges.

    Raises:
        InputError: If there are not as many limits as joints.
        ModelError: If a clearance is required and the robot's shapes cannot be used.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> motion = ff.simulate(problem, [0.0, 0.0, 0.0, 1.0]).chosen.motion
        >>> for result in ff.check_limits(motion, ff.Limits(joint_rate=np.array([0.2, 0.01]))):
        ...     print(result.limit, result.kept)
        joint_rate False
    """
    require_type("motion", motion, Motion, "a Motion, such as simulate(...).chosen.motion")
    return LimitChecker(motion.problem, limits).results(motion)


class LimitChecker:
    """The limits of a robot and its scene, prepared for many motions, whatever moves the arm.

    Attributes:
        pairs: The pairs of shapes that may collide; None where no clearance is required.
    """

    def __init__(self, problem: Problem, limits: Limits) -> None:
        """Prepare the limits; raises as :func:`check_limits`.

        Args:
            problem: The problem of the motions, whatever its duration.
            limits: The limits in addition to the joint ranges and the scene's corridor.
        """
        model = problem.model
        require_applicable(model, limits)
        self.pairs: CollisionPairs | None = None
        checks: dict[LimitKind, _Check] = {}
        decisions: dict[LimitKind, _Check] = {}
        if problem.scene.corridor is not None:
            checks[LimitKind.CORRIDOR] = partial(extremes.corridor, problem.scene.corridor)
        if np.isfinite(model.joint_ranges).any():
            checks[LimitKind.JOINT_RANGE] = extremes.joint_range
        if limits.joint_rate is not None:
            checks[LimitKind.JOINT_RATE] = partial(extremes.joint_rate, limits.joint_rate)
        if limits.base_rate is not None:
            checks[LimitKind.BASE_RATE] = partial(extremes.base_rate, limits.base_rate)
        if limits.base_turn is not None:
            checks[LimitKind.BASE_TURN] = partial(extremes.base_turn, limits.base_turn)
        if limits.pointing:
            checks[LimitKind.POINTING] = partial(extremes.pointing, limits.pointing)
        if limits.clearance is not None:
            from freefloat.limits.pairs import CollisionPairs  # coal and trimesh import slowly

            self.pairs = CollisionPairs(model, limits.clearance, scene=problem.scene)
            check = partial(extremes.clearance, limits.clearance, self.pairs)
            checks[LimitKind.CLEARANCE] = check
            decisions[LimitKind.CLEARANCE] = partial(check, decide_only=True)
        if limits.joint_torque is not None:
            checks[LimitKind.JOINT_TORQUE] = partial(extremes.joint_torque, limits.joint_torque)
        self._checks, self._decisions = checks, checks | decisions

    def results(self, motion: Motion, known: Iterable[LimitResult] = ()) -> tuple[LimitResult, ...]:
        """The results of all limits, of which some may be known already."""
        found = {result.limit: result for result in known}
        checks = self._checks.items()
        return tuple(found[kind] if kind in found else check(motion) for kind, check in checks)

    def timed(self, motion: Motion) -> tuple[LimitResult, ...]:
        """The results of limits that depend on the speed."""
        return tuple(check(motion) for kind, check in self._checks.items() if kind.timed)

    def results_unless_violated(
        self, motion: Motion
    ) -> tuple[tuple[LimitResult, ...], LimitResult | None]:
        """The results of all limits, or none and the first violated one, the cheapest first.

        Of a violated clearance the distance is too small, but need not be the smallest one.
        """
        decided = {}
        for kind, decide in self._decisions.items():
            decided[kind] = decide(motion)
            if not decided[kind].kept:
                return (), decided[kind]
        again = {k: c(motion) for k, c in self._checks.items() if c is not self._decisions[k]}
        return tuple((decided | again).values()), None

    def violations(self, motion: Motion, *, timed: bool = True) -> tuple[LimitResult, ...]:
        """The results of all violated limits, clearances as :meth:`results_unless_violated` has.

        Those that depend on the speed may be left out.
        """
        decisions = self._decisions.items()
        return violated(decide(motion) for kind, decide in decisions if timed or not kind.timed)
