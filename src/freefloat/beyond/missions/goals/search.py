"""Search for the shortest motion to a goal, among families of paths with more and more loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from freefloat.beyond.missions.goals.certification import FINAL, Certification, CertifiedMotion
from freefloat.beyond.missions.goals.quadratic import Quadratic, SolverBudget
from freefloat.beyond.missions.goals.relaxation import Relaxation, TermWeights
from freefloat.beyond.missions.goals.starts import random_path, starts
from freefloat.concurrency import Progress
from freefloat.limits.result import LimitResult, violated
from freefloat.motion.motion import Motion
from freefloat.rotations import Rotation
from freefloat.so3 import Array, rotation_vector_between

_STAGES = ((TermWeights(1.0, 1.0), 6), (TermWeights(0.1, 100.0), 15), (FINAL, 20))
"""Weights and iterations: first a short path without deep violations, then one without any."""
_SKETCH = (TermWeights(1.0, 1.0), 4)
"""Weights and iterations of a path that is shown while its goal is changed."""
_RANDOM, _RANDOM_LOOPS = 6, 3
"""Random starts of a family without loops, and of one with loops, whose starts differ less."""
_REPEATED = 2
"""Single loops that are repeated, and paths of the family before whose loops are made smaller."""
_REFINED = 3
"""Number of paths of a family after the first stage that are refined before other families."""
_TOGETHER = 2
"""Number of paths that are refined before the shorter one is certified."""
_ACCEPTABLE = 1e-2
"""Penalty of violations after the first stage of a path that violates hardly anything."""
_HOPELESS = 20.0
"""Penalty of violations from which a path is not improved."""
_SHORTENED = 1.3
"""Duration, over the duration of the best motion known, from which a path is not improved."""
_PENALTY = 2.0
"""Largest penalty of violations of a path that is certified."""
_FEWEST, _FRACTION = 2, 0.75
"""Fewest loops that larger ones make of many, and their number over the number before."""
REACHED = 1e-4
"""Largest residual of the end of a path that is certified [rad, m]."""


@dataclass(frozen=True, eq=False)
class GoalSearch:
    """Families of paths to a goal, and what certifies them."""

    families: Sequence[Relaxation]  # in the order in which they are tried
    certification: Certification
    progress: Progress  # called with the fraction done
    failures: list[CertifiedMotion] = field(default_factory=list)  # that violate a limit
    rejected: list[tuple[Quadratic, Relaxation]] = field(default_factory=list)
    """Paths to the goal that violate too much to be certified, with their families."""

    def nearest(self) -> CertifiedMotion | None:
        """Of the motions that violate a limit, the motion that does so least; None without any."""
        return min(self.failures, key=_ratio, default=None)

    def nearest_ends(self, seed: int) -> list[Quadratic]:
        """Paths without limits of shape; paths that end nearest to the goal come first."""
        rng = np.random.default_rng(seed)
        family = replace(self.families[0].coarse, shapes=(), effort=SolverBudget())
        random = (random_path(family, rng) for _ in range(_RANDOM))
        weights, iterations = _STAGES[1]
        paths = [family.relaxed(family.with_duration(path), weights, iterations) for path in random]
        for number, path in enumerate(paths):
            closed = family.closed(path.course.unknowns, weights)
            if closed is not None:
                paths[number] = family.linearized(closed, weights)
        return sorted(paths, key=lambda path: float(np.abs(path.error).sum()))

    def least_violations(self, paths: Sequence[Quadratic]) -> tuple[LimitResult, ...]:
        """Violated limits along the path, among some, that comes nearest to keeping them."""
        family, certification = self.families[0].coarse, self.certification
        motions = (certification.along(family, path.course.unknowns) for path in paths)
        broken = [violated(certification.query.checker.results(motion)) for motion in motions]
        return min(broken, key=lambda results: max((entry.ratio for entry in results), default=0.0))

    def sketch(self, seed: int) -> Motion | None:
        """The motion along the most promising path of a coarse family; None without any."""
        coarse, rng = self.families[0].coarse, np.random.default_rng(seed)
        begins = map(coarse.with_duration, starts(coarse, rng, 1))
        rough = [coarse.relaxed(begin, *_SKETCH) for begin in begins]
        path = min(rough, key=lambda path: path.promise, default=None)
        if path is None:
            return None
        exact = self.certification.exact(coarse, path.course.unknowns)
        return None if exact is None else exact[1]

    def shortest(self, seed: int) -> CertifiedMotion | None:
        """The shortest of some motions that keep all limits; None where none was found.

        The most promising paths of every family come first, the others only if none of them leads
        to a motion. The search ends where its effort is spent.
        """
        rng = np.random.default_rng(seed)
        best: tuple[Relaxation, CertifiedMotion] | None = None
        left: list[tuple[Relaxation, list[Quadratic]]] = []
        rough: list[Quadratic] = []
        for family in self.families:
            rough = self._rough(family, rng, rough)
            left.append((family, rough[_REFINED:]))
            shortest = self._shortest(family, rough[:_REFINED], best and best[1])
            if best is not None and shortest is None:
                break
            if shortest is not None:
                best = family, shortest
                if family.paths.loops == 1:
                    break
        for family, paths in left if best is None else ():
            shortest = self._shortest(family, paths, None)
            if shortest is not None:
                best = family, shortest
                break
        return self._of_rejected() if best is None else self._with_fewer_loops(*best)

    def _of_rejected(self) -> CertifiedMotion | None:
        """Where no path was certified, the motion along the path that violates limits least."""
        if self.failures or not self.rejected:
            return None
        path, family = min(self.rejected, key=lambda rejected: rejected[0].penalty)
        exact = self.certification.exact(family, path.course.unknowns)
        return None if exact is None else self._kept(self.certification.checked(*exact))

    def _rough(
        self, family: Relaxation, rng: np.random.Generator, before: Sequence[Quadratic]
    ) -> list[Quadratic]:
        """Paths of a family after the first stage.

        The two most promising come first, then those that violate hardly anything. A family of
        loops also begins at the best paths of the family before, with half as many.
        """
        if self._effort.spent:
            return []
        coarse, loops = family.coarse, family.paths.loops
        if loops > 1 and family.paths.closed:
            loop = _one_loop(coarse)
            single = [loop.relaxed(begin, *_STAGES[0]) for begin in starts(loop, rng, _RANDOM)]
            single.sort(key=lambda path: path.promise)
            begins = [coarse.paths.repeated(path.course.unknowns) for path in single[:_REPEATED]]
        else:
            begins = list(starts(coarse, rng, _RANDOM if loops == 1 else _RANDOM_LOOPS))
        if loops > _FEWEST:
            unknowns = [path.course.unknowns for path in before[:_REPEATED]]
            begins += [_with_loops(coarse, each, 0.5) for each in unknowns]
        rough = [coarse.relaxed(coarse.with_duration(begin), *_STAGES[0]) for begin in begins]
        rough.sort(key=lambda path: path.promise)
        first, others = rough[:_TOGETHER], rough[_TOGETHER:]
        return first + sorted(others, key=lambda path: path.penalty > _ACCEPTABLE)

    def _shortest(
        self, family: Relaxation, rough: Sequence[Quadratic], best: CertifiedMotion | None
    ) -> CertifiedMotion | None:
        """A motion along one of some rough paths that is shorter than the best one known."""
        for first in range(0, len(rough), _TOGETHER):
            together = rough[first : first + _TOGETHER]
            refined = [self._refined(family, path, best) for path in together]
            paths = [path for path in refined if path is not None]
            for path in sorted(paths, key=lambda path: path.course.duration):
                result = self._certified(family, path)
                if result is not None and (best is None or _duration(result) < _duration(best)):
                    return result
        return None

    @property
    def _effort(self) -> SolverBudget:
        return self.families[0].effort

    def _refined(
        self, family: Relaxation, path: Quadratic, best: CertifiedMotion | None
    ) -> Quadratic | None:
        """A path that is improved until it may be certified; None where it cannot be.

        A path that lasts longer than the best motion known is left out.
        """
        self.progress(self._effort.fraction)
        if self._effort.spent:
            return None
        longest = _duration(best) if best is not None and family.free_duration else np.inf
        for some, stage in zip((family.coarse, family), _STAGES[1:], strict=True):
            if path.penalty < _HOPELESS and path.course.duration < _SHORTENED * longest:
                path = some.relaxed(some.with_duration(path.course.unknowns), *stage)
        if path.course.duration > longest or np.abs(path.error).max(initial=0.0) > REACHED:
            return None
        if path.penalty > _PENALTY:
            self.rejected.append((path, family))
            return None
        return path

    def _certified(self, family: Relaxation, path: Quadratic) -> CertifiedMotion | None:
        """The motion along a path, if it keeps all limits."""
        return self._kept(self.certification.certified(family, path.course.unknowns))

    def _kept(self, result: CertifiedMotion | None) -> CertifiedMotion | None:
        """A result that keeps all limits; others are noted."""
        if result is not None and result.violation is not None:
            self.failures.append(result)
            return None
        return result

    def _with_fewer_loops(self, family: Relaxation, best: CertifiedMotion) -> CertifiedMotion:
        """The shortest motion of fewer, larger loops, whose turn grows with their area."""
        paths = family.paths
        while paths.loops > _FEWEST and not self._effort.spent:
            fewer = replace(paths, loops=max(_FEWEST, int(_FRACTION * paths.loops)))
            unknowns = _with_loops(family, best.unknowns, paths.loops / fewer.loops)
            family = replace(family, paths=fewer)
            rough = family.coarse.relaxed(family.with_duration(unknowns), *_STAGES[0])
            path = self._refined(family, rough, best)
            result = None if path is None else self._certified(family, path)
            if result is None or _duration(result) >= _duration(best):
                break
            best, paths = result, fewer
        return best


def _one_loop(family: Relaxation) -> Relaxation:
    """The family of one loop, which turns the spacecraft by its share of the whole turn."""
    begin, target, loops = family.attitude, family.target, family.paths.loops
    end = begin if target.attitude is None else target.attitude
    turn = Rotation.from_rotvec(rotation_vector_between(begin, end) / loops).as_matrix()
    target = replace(target, attitude=turn @ begin)
    return replace(family, paths=replace(family.paths, loops=1), target=target)


def _with_loops(family: Relaxation, unknowns: Array, ratio: float) -> Array:
    """Unknowns whose deviations are scaled so that a loop turns the spacecraft by a ratio more."""
    count, changed = family.paths.joint_count * family.paths.inner, unknowns.copy()
    changed[:count] *= np.sqrt(ratio)
    return changed


def _duration(result: CertifiedMotion) -> float:
    return float(result.motion.times[-1])


def _ratio(result: CertifiedMotion) -> float:
    return np.inf if result.violation is None else result.violation.ratio
