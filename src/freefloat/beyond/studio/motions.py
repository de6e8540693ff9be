"""The motion from one attitude for the page: its scene, its outcome and its limits."""

from __future__ import annotations

from typing import Any

import numpy as np

from freefloat.beyond.studio.attitudes import best_columns
from freefloat.concurrency import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.motion.setting import Setting
from freefloat.planning.limits.trials import Trials, screen
from freefloat.planning.margin_map import HeadingMap
from freefloat.planning.motions import SimulatedBranch, integrate_branch
from freefloat.planning.objective import Comparison
from freefloat.planning.objectives import LargestMargin
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.so3 import Array
from freefloat.visualization.page.playback import Playback
from freefloat.visualization.scenes.scene import motion_scene
from freefloat.visualization.slices import rotation_vectors

_TITLE = "motion"
_MOST = 8
"""Precise motions that are compared with the limits before giving up."""


def best_motion(evaluator: FeasibilityEvaluator, attitude: Array) -> SimulatedBranch | None:
    """The precise motion of the arm branch that gets farthest; None without any at the start."""
    results = evaluator.evaluate(attitude[None])
    if not results.exist.any():
        return None
    branch = int(best_columns(results)[0])
    return integrate_branch(evaluator.problem, attitude, branch)


def motion_within_limits(
    evaluator: FeasibilityEvaluator,
    samples: AttitudeMap | HeadingMap,
    limits: Limits,
    progress: Progress,
) -> SimulatedBranch | None:
    """The motion of the largest margin, of those from samples, that keeps the limits.

    Args:
        evaluator: Evaluator of the problem.
        samples: A map of it.
        limits: The limits.
        progress: Called between candidates; may raise an exception to abandon the search.

    Returns:
        None where none was found.
    """
    trials = Trials(evaluator, limits)
    results = samples.results
    compared = Comparison(LargestMargin(), None, limits, evaluator, results.margins)
    for candidate in screen(results, compared, trials.checker.pairs):
        progress(0.0)
        if candidate.violation is not None:
            continue
        passed = trials.at(candidate.attitude, candidate.branch)
        if passed is not None:
            return passed[0]
        if trials.count == _MOST:
            break
    return None


def playback_of(motion: Motion, limits: Limits) -> Playback:
    """The playback of a motion with its cones."""
    return Playback(motion_scene({_TITLE: motion}, limits=limits))


def motion_answer(
    motion: Motion, playback: Playback, title: str, outcome: str | None = None
) -> dict[str, Any]:
    """The motion as the page plays it, with a title and its outcome, by default its ending."""
    return {
        **playback.parts(),
        **place(motion.setting, motion.initial.attitude),
        "title": title,
        "outcome": outcome or motion.outcome,
    }


def place(setting: Setting, attitude: Array) -> dict[str, Any]:
    """An attitude as a quaternion, and where the ball and the dial show it."""
    heading = float(np.degrees(setting.plane.heading(attitude))) if setting.has_headings else None
    return {
        "attitude": attitude.tolist(),
        "rotation_vector": rotation_vectors(attitude).tolist(),
        "heading_deg": heading,
    }


def limits_answer(results: tuple[LimitResult, ...]) -> list[dict[str, Any]]:
    """Limits along the motion, a line each."""
    return [
        {"limit": result.label, "kept": result.kept, "time": result.time,
         "text": f"{result.sentence}, {result.where}, t = {result.time:.4g} s"}
        for result in results
    ]  # fmt: skip
