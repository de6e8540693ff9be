"""Longer durations with which motions that are too fast keep their limits."""

from __future__ import annotations

import numpy as np

from freefloat.errors import InputError
from freefloat.limits.result import LimitResult, needed_stretch
from freefloat.planning.candidates import ScreenedCandidate
from freefloat.planning.limits.trials import Trials, is_too_fast
from freefloat.planning.motions import evaluator_for, integrate_branch
from freefloat.rounding import rounded_up
from freefloat.so3 import Array

_STRETCHED = 8
"""Candidates that are integrated with longer durations."""
_STRETCHES = 6
"""Durations that are tried for each candidate."""
_LEAST_SHARE = 0.25
"""Least share of the excess over a limit that longer durations are taken to reduce."""
_STEP = 1.25
"""Smallest ratio of successive durations where attitudes are searched."""
OVER = 1.0 + 1e-5
"""Slightly more than what just keeps a limit."""


def sufficient_stretch(
    trials: Trials, attitudes: Array
) -> tuple[float, ScreenedCandidate] | tuple[None, None]:
    """Factor on the duration with which a candidate keeps everything, and that candidate.

    Without momentum its motion is the same, only slower. With momentum the system rotates farther
    during a longer motion, so does a tumbling body of the scene, and weights of the arm remain; the
    factor is then one with which it was integrated. With momentum and limits of joint rates,
    motions from other attitudes (K, 4) are tried, too.
    """
    problem = trials.problem
    by_more_than_powers = problem.depends_on_timing or problem.scene.tumbles
    by_more_than_powers |= problem.model.gravity > 0.0
    ranked = sorted(trials.too_fast, key=lambda entry: entry[0])
    for needed, simulated in ranked[:_STRETCHED]:
        attitude, branch = simulated.motion.initial.attitude, simulated.branch.index
        candidate = ScreenedCandidate(attitude, branch)
        enough: float | None = needed
        if by_more_than_powers:
            enough = _integrated_stretch(trials, candidate, needed)
        if enough is not None:
            return enough, candidate
    joint_rate = None if trials.limits is None else trials.limits.joint_rate
    if not ranked or joint_rate is None or not problem.depends_on_timing:
        return None, None
    try:
        return _searched_stretch(trials, attitudes, joint_rate, ranked[0][0])
    except InputError:  # the system would rotate too often
        return None, None


def _integrated_stretch(
    trials: Trials, candidate: ScreenedCandidate, needed: float
) -> float | None:
    """Factor with which a candidate's motion, integrated again, keeps everything, if found.

    The search ends at a longer duration that does not bring the motion nearer to that.
    """
    factor, share = 1.0, 1.0  # how much of what is too fast a longer duration makes slower
    for _ in range(_STRETCHES):
        before, factor = factor, rounded_up(OVER * needed ** (1.0 / share) * factor)
        try:
            violated = _violations(trials, candidate, factor)
        except InputError:  # the system would rotate too often
            return None
        if violated == ():
            return factor
        if not violated or not is_too_fast(violated) or needed_stretch(violated) >= needed:
            return None
        after = needed_stretch(violated)
        share = np.clip(np.log(needed / after) / np.log(factor / before), _LEAST_SHARE, 1.0)
        needed = after
    return None


def _searched_stretch(
    trials: Trials, attitudes: Array, joint_rate: Array, factor: float
) -> tuple[float, ScreenedCandidate] | tuple[None, None]:
    """Factor and candidate from the slowest compiled motions of many attitudes."""
    for _ in range(_STRETCHES):
        factor = rounded_up(factor)
        stretched = trials.problem.stretched(factor)
        threads, limits = trials.evaluator.threads, trials.limits
        evaluator = evaluator_for(stretched, threads, limits)
        results = evaluator.evaluate(attitudes)
        ratios = results.motions.rate_usage(joint_rate)
        ratios[~trials.problem.margin.keeps(results.margins)] = np.inf
        for index in np.argsort(ratios, axis=None)[:_STRETCHED]:
            row, branch = np.unravel_index(int(index), ratios.shape)
            candidate = ScreenedCandidate(attitudes[row], int(branch))
            if ratios[row, branch] <= 1.0 and _violations(trials, candidate, factor) == ():
                return factor, candidate
        smallest = float(ratios.min())
        if not np.isfinite(smallest):
            break
        factor *= max(_STEP, smallest)
    return None, None


def _violations(
    trials: Trials, candidate: ScreenedCandidate, factor: float
) -> tuple[LimitResult, ...] | None:
    """Limits that a candidate violates with a longer duration; None for the margin."""
    stretched = trials.problem.stretched(factor)
    simulated = integrate_branch(stretched, candidate.attitude, candidate.branch)
    return trials.checker.violations(simulated.motion) if simulated.feasible else None
