"""Motions along loops: exact at their end, as fast as limits of rates and torques permit."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.dynamics.base_rates import base_rate_bound
from freefloat.limits.check import LimitChecker
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.joint_loops import JointLoops, integrate_loops
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.paths.time_laws import TimeLaw
from freefloat.paths.timing import Timing
from freefloat.planning.joints.loop_search import LoopSearch
from freefloat.scene.scene import Scene
from freefloat.so3 import Array

_EXACT = 1e-9
"""Error of the attitude at the end at which the correction of loops ends [rad]."""
_CORRECTIONS, _TIMINGS = 12, 8
_CLOSE = 0.98
"""Ratio of rates to their limits from which a motion with momentum is as fast as they permit."""
_SPARE = 1.005
"""Factor on the duration of these: other loops are needed at another duration."""
_HARMONICS = 2
LAW = TimeLaw.TRAPEZOIDAL
"""The law that is fastest within limits of rates."""


@dataclass(frozen=True, eq=False)
class LoopMotion:
    """A motion along loops that ends at the goal.

    Attributes:
        loops: The loops.
        motion: Along them.
        results: Of all limits.
    """

    loops: JointLoops
    motion: Motion = field(repr=False)
    results: tuple[LimitResult, ...]

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.motion.times[-1])


class LoopMotions:
    """Motions along loops between two attitudes.

    Attributes:
        search: Search for loops with one rotation.
        rotation: From one attitude to the other, in the initial spacecraft frame.
    """

    def __init__(
        self, problem: Problem, limits: Limits, joints: Array, start: Array, goal: Array
    ) -> None:
        """Prepare the limits; raises an InputError where they cannot be applied."""
        self._problem, self._limits = replace(problem, scene=Scene()), limits
        self._checker = LimitChecker(self._problem, limits)
        self._start = start
        self.rotation = Rotation.from_quat(start).inv() * Rotation.from_quat(goal)
        rates = np.ones(problem.model.dof) if limits.joint_rate is None else limits.joint_rate
        finite = rates[np.isfinite(rates)]
        weights = np.where(np.isfinite(rates), rates, finite.max(initial=1.0))
        # an ellipse in the plane of two joints is a simple loop, a longer series need not be
        harmonics = 1 if problem.model.dof == 2 else _HARMONICS
        self.search = LoopSearch(
            problem.model, joints, weights, harmonics,
            pairs=self._checker.pairs, clearance=limits.clearance or 0.0,
        )  # fmt: skip

    @property
    def timed(self) -> bool:
        """Whether limits determine the duration."""
        return self._limits.timed

    @property
    def least_duration(self) -> float:
        """A lower bound of the duration, or the duration that nothing else determines [s]."""
        if not self.timed:
            return float(self._problem.path.duration)
        rate, joint_rate = self._limits.base_rate, self._limits.joint_rate
        rates = [np.inf if rate is None else rate]
        if joint_rate is not None:
            rates.append(base_rate_bound(self._problem.system, joint_rate))
        return float(self.rotation.magnitude() / min(rates))

    @property
    def unreachable(self) -> Array:
        """Rotation vector of the part of the rotation that no loops have [rad], shape (3,)."""
        axes, vector = self.search.axes, self.rotation.as_rotvec()
        return np.asarray(vector - axes.T @ (axes @ vector))

    def shape_violation(self, coefficients: Array) -> LimitResult | None:
        """The first violated limit of one loop that depends on its shape; None where all are kept.

        Limits that depend on the attitude are those of the first loop, without momentum.
        """
        problem = self._with_duration(1.0, still=True)
        motion = integrate_loops(problem, self.search.loops(coefficients, 1), self._start)
        return next(iter(self._checker.violations(motion, timed=False)), None)

    def along(self, coefficients: Array, count: int, duration: float) -> LoopMotion | None:
        """The motion along loops near those with some coefficients; None where there is none.

        Args:
            coefficients: Of the loop, see :class:`LoopSearch`.
            count: Number of loops.
            duration: In seconds; of a motion whose duration limits determine, a guess.
        """
        spare, close = (_SPARE, _CLOSE) if self._problem.depends_on_timing else (1.0 + 1e-7, 0.999)
        for _ in range(_TIMINGS):
            problem = self._with_duration(duration)
            exact = self._ending_at_goal(problem, coefficients, count)
            if exact is None:
                return None
            coefficients, loops = exact, self.search.loops(exact, count)
            motion = integrate_loops(problem, loops, self._start)
            timed = self._checker.timed(motion)
            usage = max((result.stretch for result in timed), default=1.0)
            if not self.timed or not np.isfinite(usage) or close < usage <= 1.0:
                break
            duration *= usage * spare
        return LoopMotion(loops, motion, self._checker.results(motion, timed))

    def guess(self, effort: float, count: int) -> float:
        """Duration that limits of joint rates permit, or that of the problem's path [s]."""
        if self._limits.joint_rate is None:
            return self._problem.path.duration
        fastest = max(Timing(1.0, LAW).s(t, 1) for t in np.linspace(0.0, 1.0, 101).tolist())
        return float(2.0 * np.pi * effort * count * fastest)

    def _with_duration(self, duration: float, *, still: bool = False) -> Problem:
        path = replace(self._problem.path, timing=Timing(duration, LAW))
        if not still:
            return replace(self._problem, path=path)
        return replace(self._problem, path=path, momentum=np.zeros(3), wheel_momentum=np.zeros(3))

    def _ending_at_goal(self, problem: Problem, coefficients: Array, count: int) -> Array | None:
        """Coefficients of loops whose precise motion ends at the goal.

        Each time, the rotation that the loops would have without momentum is corrected by the error
        of the precise motion. Without momentum, one loop tells that of all.
        """
        number = count if problem.depends_on_timing else 1
        goal = Rotation.from_quat(self._start) * self.rotation ** (number / count)
        asked = self.rotation ** (1.0 / count)
        for _ in range(_CORRECTIONS):
            corrected = self.search.corrected(asked, coefficients)
            if corrected is None:
                return None
            coefficients = corrected
            loops = self.search.loops(coefficients, number)
            final = integrate_loops(problem, loops, self._start).final.attitude
            error = (Rotation.from_quat(final).inv() * goal).as_rotvec()
            if np.linalg.norm(error) < _EXACT / count:
                return coefficients
            asked = asked * Rotation.from_rotvec(error / number)
        return None
