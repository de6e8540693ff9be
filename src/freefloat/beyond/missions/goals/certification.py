"""Precise motions along paths that were found: exact at their end, with all limits checked."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from freefloat.beyond.missions.goals.goal_motion import last_state
from freefloat.beyond.missions.goals.joint_integration import integrate_spline
from freefloat.beyond.missions.goals.query import Query
from freefloat.beyond.missions.goals.relaxation import Relaxation, TermWeights
from freefloat.limits.kinds.clearance import ClearanceLimit
from freefloat.limits.kinds.joints import JointTorqueLimit
from freefloat.limits.result import LimitResult
from freefloat.motion.law import JointLaw
from freefloat.motion.motion import Motion
from freefloat.so3 import Array

FINAL = TermWeights(1e-3, 1e3)
"""Weights with which paths end nearly as short as limits permit."""
_EXACT = 5e-10
"""Largest residual of a precise motion at its end [rad, m]."""
_CORRECTIONS, _TIMINGS, _EXCHANGES, _ITERATIONS = 8, 8, 6, 10
_FINEST = 32
"""Intervals of a span in which bodies are looked at where they are too near between others."""
_WORK = 100
"""Work of a precise motion and its limits for each span of its path."""
_LESS = 1.02
"""Least factor by which accelerations are reduced where torques are too large."""
_CLOSE, _SPARE = 0.999, 1.0 + 1e-7
"""Usage of limits from which a motion is as short as they permit, and factor on its duration."""
_CLOSE_BY_TIME, _SPARE_BY_TIME = 0.98, 1.005
"""Usage and factor where the motion is another one at another duration."""


@dataclass(frozen=True, eq=False)
class CertifiedMotion:
    """A precise motion that ends at the goal."""

    unknowns: Array  # of its path
    motion: Motion
    results: tuple[LimitResult, ...]  # limits along it; empty where one is violated
    violation: LimitResult | None  # the first limit that is violated; None where all are kept


@dataclass(frozen=True, eq=False)
class Certification:
    """Precise motions to the goal of a query, and their limits."""

    query: Query

    def certified(self, relaxation: Relaxation, unknowns: Array) -> CertifiedMotion | None:
        """The motion along a path, or along one nearby that keeps what this one violates.

        It has a violation where none nearby keeps all limits. None where the path itself cannot end
        exactly at the goal.
        """
        certified: CertifiedMotion | None = None
        for _ in range(_EXCHANGES):
            exact = self.exact(relaxation, unknowns)
            if exact is None:
                return certified
            unknowns, motion = exact
            certified = self.checked(unknowns, motion)
            demanding = self._demanding(relaxation, certified.violation)
            if demanding is None or relaxation.effort.spent:
                return certified
            relaxation = demanding
            unknowns = relaxation.relaxed(unknowns, FINAL, _ITERATIONS).course.unknowns
        return certified

    def checked(self, unknowns: Array, motion: Motion) -> CertifiedMotion:
        """A precise motion with its limits."""
        return CertifiedMotion(
            unknowns, motion, *self.query.checker.results_unless_violated(motion)
        )

    def _demanding(
        self, relaxation: Relaxation, violation: LimitResult | None
    ) -> Relaxation | None:
        """The family with more demanded of what is violated; None where it does not know that."""
        if violation is None:
            return None
        if violation.limit == JointTorqueLimit.name and not relaxation.free_duration:
            least = relaxation.joint_acceleration / max(violation.ratio, _LESS)
            return replace(relaxation, joint_acceleration=least)
        paths = relaxation.paths
        if violation.limit == ClearanceLimit.name and paths.fineness < _FINEST:
            return replace(relaxation, paths=replace(paths, fineness=_FINEST))
        widened = [shape.widen(violation) for shape in relaxation.shapes]
        return relaxation if any(widened) else None

    def exact(self, relaxation: Relaxation, unknowns: Array) -> tuple[Array, Motion] | None:
        """Unknowns and the motion along them, exact at its end and as short as limits permit.

        None where no motion nearby ends at the goal.
        """
        close, spare = (_CLOSE_BY_TIME, _SPARE_BY_TIME) if self.query.by_time else (_CLOSE, _SPARE)
        offset = np.zeros(relaxation.target.size)
        for _ in range(_TIMINGS):
            ending = self._ending_at_goal(relaxation, unknowns, offset)
            if ending is None:
                return None
            unknowns, motion, offset = ending
            timed = self.query.checker.timed(motion)
            searched = relaxation.usage(relaxation.course(unknowns, 0))
            usage = max((result.stretch for result in timed), default=1.0)
            usage = max(usage, searched)  # of joints without limit, too
            if not relaxation.free_duration or not timed or close < usage <= 1.0:
                break
            unknowns = np.append(unknowns[:-1], unknowns[-1] * usage * spare)
            if not self.query.by_time:
                return unknowns, self.along(relaxation, unknowns)
        return unknowns, motion

    def _ending_at_goal(
        self, relaxation: Relaxation, unknowns: Array, offset: Array
    ) -> tuple[Array, Motion, Array] | None:
        """Unknowns nearby whose precise motion ends at the goal, that motion, and an offset.

        The offset are the residuals that the path itself has at its end. Those of the motion
        correct it each time.
        """
        for _ in range(_CORRECTIONS):
            closed = relaxation.closed(unknowns, FINAL, offset)
            if closed is None:
                return None
            unknowns = closed
            motion = self.along(relaxation, unknowns)
            residuals = relaxation.target.residuals(last_state(motion))
            if np.abs(residuals).max(initial=0.0) < _EXACT:
                return unknowns, motion, offset
            offset = offset - residuals
        return None

    def along(self, relaxation: Relaxation, unknowns: Array) -> Motion:
        """The motion along a path, whatever it violates and wherever it ends exactly."""
        relaxation.effort.take(_WORK * relaxation.paths.all_spans)
        law = JointLaw(self.query.setting, relaxation.paths.spline(unknowns), float(unknowns[-1]))
        return integrate_spline(law, self.query.start.attitude)
