"""Attitudes in space that objectives choose from, refined between the samples of a map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from freefloat.attitude_grids import attitudes_within, even_directions
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import EnsembleResult
from freefloat.limits.limits import Limits
from freefloat.planning.candidates import Ball, Candidate, NearAttitude, Peak, ScoredAttitude
from freefloat.planning.settings import Search, SearchDomain
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.planning.space.climbing import (
    Climb,
    Inside,
    feasible_peaks,
    most_robust_first,
    nearest_feasible,
    separate_best,
)
from freefloat.planning.space.deepest_ball import deepest
from freefloat.planning.space.tolerated_deviations import robust_radius
from freefloat.so3 import Array, BoolArray, IntArray, angle_between, rotated

_STARTS = 12
"""Samples from which attitudes of larger merit are searched for."""
_FINE = 1e-4
"""Clouds smaller than this end a search [rad]."""
_NEAREST_SAMPLES = 4
"""Nearest samples, the last starts tried."""
_FACTORS = 1.02, 1.06
"""Radii of the balls tried, in units of the spare angle: reported radii are slightly smaller."""
_MOST_CLOUDS = 8
"""Clouds on the way to the target, at most."""
_CLOUD = 1024
"""Attitudes of a cloud."""
_RADIUS = 4.0
"""Radius of a cloud, in units of the ball's radius."""
_CENTRES = 8000
"""Centres considered in a cloud."""
_ROUNDS = 20
"""Balls examined in a cloud, at most."""
_SEPARATION = 1.06
"""Angle between a centre and attitudes outside, in units of the ball's radius: known ones do not
lie exactly on the boundary."""
_FEW, _OTHERS = 64, 3
"""Directions in which centres are tried first, and how many beside the nearest."""
_SHELL = 384
"""Attitudes tried on the sphere of a ball."""
_INSIDE = 128
"""Attitudes tried inside a ball."""
_FINEST = 1e-4
"""Accuracy of a centre [rad]."""


@dataclass(frozen=True, eq=False)
class SampledChoices:
    """See :class:`~freefloat.planning.objective.Choices`."""

    evaluator: FeasibilityEvaluator
    samples: AttitudeMap
    search: Search
    limits: Limits | None

    @property
    def spare(self) -> float:
        """Angle within which the margin is to be kept [rad]."""
        return self.search.spare

    def largest_margins(self) -> Sequence[Candidate]:
        """Candidates with locally largest minimum margins."""
        peaks = most_robust_first(self.samples, feasible_peaks(self.evaluator, self.samples))
        largest = max((peak.minimum_margin for peak in peaks), default=0.0)

        def margins(_: Array, motions: EnsembleResult) -> Array:
            kept = motions.keeps(self.samples.problem.margin.threshold)
            return np.where(kept, motions.minimum, -np.inf)

        better = self._better_at_present(largest, margins)
        return [*(Peak(entry.attitude, entry.branch, entry.merit) for entry in better), *peaks]

    def largest_merits(self) -> Sequence[Candidate]:
        """Candidates with locally largest merits."""
        samples = self.samples
        merit = self.search.comparison(self.evaluator, self.limits, samples.margins)
        table = merit(samples.attitudes, samples.results.motions)
        branches = [None] if samples.problem.redundant else [*range(table.shape[1])]
        starts = separate_best(samples.attitudes, table, branches, _STARTS, samples.spacing)
        scored = self._climb(merit).to_top(starts, samples.spacing)
        largest = max((entry.merit for entry in scored), default=-np.inf)
        return [*self._better_at_present(largest, merit), *scored]

    def deepest(self) -> Sequence[Candidate]:
        """Candidates deepest inside the feasible set, with the radius of the ball around them."""
        evaluator, samples = self.evaluator, self.samples
        deep = deepest(evaluator, samples)
        if deep is not None and deep.radius > samples.spacing:
            return [deep]
        centres: list[Candidate] = [*self.present()]
        if deep is None:
            centres += feasible_peaks(evaluator, samples)
        radius = partial(robust_radius, evaluator, reach=samples.spacing)
        balls = [Ball(c.attitude, c.branch, radius(c.attitude, c.branch)) for c in centres]
        balls += [] if deep is None else [deep]
        return sorted(balls, key=lambda ball: -ball.radius)

    def nearest(self) -> Sequence[Candidate]:
        """Candidates nearest to ``from_attitude`` that keep the margin within ``spare``, if any."""
        evaluator, samples, present = self.evaluator, self.samples, self._present
        if self.spare:
            nearest = nearest_with_spare(evaluator, samples, present, self.spare)
        else:
            nearest = nearest_feasible(evaluator, samples, present) or [
                NearAttitude(p.attitude, p.branch, float(angle_between(p.attitude, present)))
                for p in feasible_peaks(evaluator, samples)
            ]
        return sorted(nearest, key=lambda candidate: candidate.deviation)

    def present(self) -> Sequence[Candidate]:
        """``from_attitude`` itself, with the arm branches that keep the margin there, if any."""
        if self.search.present is None:
            return []
        margins = self.evaluator.evaluate(self._present[None]).margins[0]
        kept = np.flatnonzero(self.samples.problem.margin.keeps(margins)).tolist()
        kept.sort(key=lambda branch: -margins[branch])
        branches = [None][: len(kept)] if self.samples.problem.redundant else kept
        return [NearAttitude(self._present, branch, 0.0) for branch in branches]

    def _climb(self, merit: Callable[[Array, EnsembleResult], Array]) -> Climb:
        return Climb(partial(self.evaluator.largest, merit=merit), self.search.domain, _FINE)

    def _better_at_present(
        self, largest: float, merit: Callable[[Array, EnsembleResult], Array]
    ) -> list[ScoredAttitude]:
        """Attitudes climbed to from ``from_attitude``, where merits there exceed the largest."""
        present = self.search.present
        if present is None:
            return []
        merits = merit(present[None], self.evaluator.evaluate(present[None]).motions)[0]
        better = [
            ScoredAttitude(present, branch, float(merits[branch]))
            for branch in np.flatnonzero(merits > largest).tolist()
        ]
        if better and self.samples.problem.redundant:
            better = [ScoredAttitude(present, None, max(entry.merit for entry in better))]
        return self._climb(merit)(better, self.samples.spacing / 2.0)

    @property
    def _present(self) -> Array:
        return np.asarray(self.search.present)


def nearest_with_spare(
    evaluator: FeasibilityEvaluator, samples: AttitudeMap, target: Array, spare: float
) -> list[NearAttitude]:
    """The attitude near a target that keeps the margin within an angle ``spare`` [rad] around it.

    There all singularities are avoided, also singularities at which the measure does not vanish.
    Empty where no such attitude was found.
    """
    domain = samples.search.domain
    best: NearAttitude | None = None
    branches: dict[int | None, NearAttitude] = {}
    for near in nearest_feasible(evaluator, samples, target):
        branches.setdefault(near.branch, near)
    for near in branches.values():
        if best is not None and best.deviation <= near.deviation:
            break  # no attitude of this branch is nearer
        inside = samples.attitudes[samples.regular(near.branch)]
        order = np.argsort(angle_between(inside, target))[:_NEAREST_SAMPLES]
        for start in (near.attitude, *inside[order]):
            centre = _nearest_centre(evaluator, start, near.branch, target, spare, samples.spacing)
            if centre is not None and domain.contains(centre.attitude):
                best = centre if best is None or centre.deviation < best.deviation else best
                break
    return [] if best is None else [best]


def _nearest_centre(
    evaluator: FeasibilityEvaluator,
    start: Array,
    branch: int | None,
    target: Array,
    spare: float,
    spacing: float,
) -> NearAttitude | None:
    """The centre of a ball inside the feasible set, moved from a start toward the target."""
    for factor in _FACTORS:
        best: Array | None = None
        place = start
        for _ in range(_MOST_CLOUDS):
            centre = _centre_nearby(evaluator, place, branch, target, factor * spare)
            if centre is None:
                break
            gain = float(angle_between(place, target) - angle_between(centre, target))
            best = place = centre
            if gain < spare / 4.0:
                break
        if best is None:
            return None
        radius = robust_radius(evaluator, best, branch, min(spacing, 2.0 * factor * spare))
        if radius >= spare:
            return NearAttitude(best, branch, float(angle_between(best, target)), radius)
    return None


def _centre_nearby(
    evaluator: FeasibilityEvaluator, place: Array, branch: int | None, target: Array, radius: float
) -> Array | None:
    """The centre nearest to the target, near a place, of a ball inside the feasible set.

    The nearest centres that keep away from the attitudes found outside are tried in a few
    directions, the nearest of them in many; what is outside in their balls limits the next ones.
    """
    size, reduction = min(_RADIUS * radius, np.pi), evaluator.sample_reduction
    cloud = attitudes_within(place, size, _CLOUD // reduction)
    outside = new = cloud[~evaluator.regular(cloud, branch)]
    apart = partial(_apart, place=place, reach=size - radius, angle=_SEPARATION * radius)
    centres = np.vstack([target, attitudes_within(place, size - radius, _CENTRES, 1)])
    centres = centres[np.argsort(angle_between(centres, target))]
    for number in range(1, _ROUNDS + 1):
        centres = centres[apart(centres, outside=new)]
        if not len(centres):
            return None
        centre = _refined(centres[0], partial(apart, outside=outside), target, radius)
        directions = even_directions(_FEW * number)[-_FEW:]
        tried = np.vstack([centre, _separate(centres, centre, radius / 2.0)])
        vectors = radius * np.tile(directions, (len(tried), 1))
        ball = rotated(np.repeat(tried, _FEW, axis=0), vectors)
        failed = ~evaluator.regular(ball, branch)
        new = ball[failed]
        if not failed[:_FEW].any():
            ball = _ball(centre, radius, reduction)
            failed = ~evaluator.regular(ball, branch)
            if not failed.any():
                return centre
            new = np.vstack([new, ball[failed]])
        outside = np.vstack([outside, new])
    return None


def _separate(centres: Array, first: Array, angle: float) -> Array:
    """Some centres, of (K, 4) in order, not within an angle of the first or each other, (C, 4)."""
    chosen: list[Array] = []
    while len(chosen) < _OTHERS:
        centres = centres[angle_between(centres, chosen[-1] if chosen else first) > angle]
        if not len(centres):
            break
        chosen.append(centres[0])
    return np.reshape(chosen, (-1, 4))


def _apart(
    attitudes: Array, *, place: Array, reach: float, outside: Array, angle: float
) -> BoolArray:
    """Which attitudes are within reach of a place and at an angle or more from all outside."""
    cosines = np.abs(attitudes @ outside.T).max(axis=1, initial=0.0)
    near = angle_between(attitudes, place) <= reach
    return np.asarray(near & (cosines <= np.cos(angle / 2.0)))


def _refined(centre: Array, apart: Inside, target: Array, radius: float) -> Array:
    """The attitude near a centre that is nearest to a target and apart from attitudes outside."""

    def merit(attitudes: Array, _: IntArray | None) -> Array:
        return np.where(apart(attitudes), -angle_between(attitudes, target), -np.inf)

    start = ScoredAttitude(centre, None, -float(angle_between(centre, target)))
    return Climb(merit, SearchDomain(), _FINEST)([start], radius / 4.0)[0].attitude


def _ball(centre: Array, radius: float, reduction: int) -> Array:
    """Attitudes of a ball: its centre first, many on its sphere, some inside, shape (K, 4)."""
    directions = even_directions(_SHELL // reduction)
    shell = rotated(centre, radius * directions)
    return np.vstack([centre, shell, attitudes_within(centre, radius, _INSIDE // reduction)])
