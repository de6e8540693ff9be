"""Search for the shortest motion to a goal, among families of paths with more and more loops."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from freefloat.concurrency import Progress
from freefloat.planning.goals.certification import FINAL, Certification, CertifiedMotion
from freefloat.planning.goals.relaxation import Quadratic, Relaxation, Weights
from freefloat.planning.goals.starts import random_path, starts, timed

_STAGES = ((Weights(1.0, 1.0), 25), (Weights(0.1, 100.0), 40), (FINAL, 40))
"""Weights and iterations: first a short path without deep violations, then one without any."""
_RANDOM = 6
"""Random starts of a family."""
_REFINED = 3
"""Of the paths after the first stage those that are refined, at least."""
_ENOUGH = 2
"""Certified motions among which the shortest is chosen."""
_HOPELESS = 20.0
"""Penalty of violations from which a path is not improved."""
_PENALTY = 2.0
"""Largest penalty of violations of a path that is certified."""
_FEWEST, _FRACTION = 2, 0.75
"""Fewest loops that larger ones make of many, and their number over the number before."""
REACHED = 1e-4
"""Largest residual of the end of a path that is certified [rad, m]."""


@dataclass(frozen=True, eq=False)
class GoalSearch:
    """Families of paths to a goal, and what certifies them.

    Attributes:
        families: In the order in which they are tried.
        certification: Of paths that are found.
        progress: Called with the fraction done.
        failures: Motions to the goal that violate a limit.
        rejected: Paths to the goal that violate too much to be certified, with their families.
    """

    families: Sequence[Relaxation]
    certification: Certification
    progress: Progress
    failures: list[CertifiedMotion] = field(default_factory=list)
    rejected: list[tuple[Quadratic, Relaxation]] = field(default_factory=list)

    def nearest(self) -> CertifiedMotion | None:
        """A motion to the goal that violates a limit little; None where none ends at the goal."""
        if not self.failures and self.rejected:
            path, family = min(self.rejected, key=lambda rejected: rejected[0].penalty)
            result = self.certification.uncertified(family, path.course.unknowns)
            return None if result is None or result.violation is None else result
        return min(self.failures, key=_ratio, default=None)

    def nearest_ends(self, seed: int) -> list[Quadratic]:
        """Paths without limits of shape, those that end nearest to the goal first."""
        rng = np.random.default_rng(seed)
        family = replace(self.families[0].coarse, shapes=())
        random = (random_path(family, rng) for _ in range(_RANDOM))
        weights, iterations = _STAGES[1]
        found = [family.relaxed(timed(family, path), weights, iterations) for path in random]
        return sorted(found, key=lambda path: float(np.abs(path.error).sum()))

    def shortest(self, seed: int) -> CertifiedMotion | None:
        """The shortest of some motions that keep all limits; None where none was found."""
        rng = np.random.default_rng(seed)
        best: tuple[Relaxation, CertifiedMotion] | None = None
        for number, family in enumerate(self.families):
            self.progress(number / len(self.families))
            shortest = min(self._certified(family, rng), key=_duration, default=None)
            if best is not None and (shortest is None or _duration(shortest) > _duration(best[1])):
                break
            if shortest is not None:
                best = family, shortest
                if family.paths.loops == 1:
                    break
        return None if best is None else self._with_fewer_loops(*best)

    def _certified(self, family: Relaxation, rng: np.random.Generator) -> Iterator[CertifiedMotion]:
        """Certified motions of a family."""
        coarse = family.coarse
        rough = [coarse.relaxed(start, *_STAGES[0]) for start in starts(coarse, rng, _RANDOM)]
        count = 0
        for number, path in enumerate(sorted(rough, key=lambda path: path.promise)):
            if count >= _ENOUGH or (count and number >= _REFINED):
                return
            result = self._refined(family, path)
            if result is not None:
                count += 1
                yield result

    def _refined(self, family: Relaxation, path: Quadratic) -> CertifiedMotion | None:
        """The certified motion along a path that is improved before; None where there is none."""
        for some, stage in zip((family.coarse, family), _STAGES[1:], strict=True):
            if path.penalty < _HOPELESS:
                path = some.relaxed(timed(some, path.course.unknowns), *stage)
        if np.abs(path.error).max(initial=0.0) > REACHED:
            return None
        if path.penalty > _PENALTY:
            self.rejected.append((path, family))
            return None
        result = self.certification.certified(family, path.course.unknowns)
        if result is not None and result.violation is not None:
            self.failures.append(result)
            return None
        return result

    def _with_fewer_loops(self, family: Relaxation, best: CertifiedMotion) -> CertifiedMotion:
        """The shortest motion of fewer, larger loops, whose turn grows with their area."""
        paths, count = family.paths, family.paths.joint_count * family.paths.inner
        while paths.loops > _FEWEST:
            fewer = replace(paths, loops=max(_FEWEST, int(_FRACTION * paths.loops)))
            unknowns = best.unknowns.copy()
            unknowns[:count] *= np.sqrt(paths.loops / fewer.loops)
            family = replace(family, paths=fewer)
            result = self._refined(
                family, family.coarse.relaxed(timed(family, unknowns), *_STAGES[0])
            )
            if result is None or _duration(result) >= _duration(best):
                break
            best, paths = result, fewer
        return best


def _duration(result: CertifiedMotion) -> float:
    return float(result.motion.times[-1])


def _ratio(result: CertifiedMotion) -> float:
    return np.inf if result.violation is None else result.violation.ratio
