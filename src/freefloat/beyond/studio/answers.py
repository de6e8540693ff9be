"""What the page shows: the set of initial attitudes, and the motion from one of them."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.concurrency import Progress
from freefloat.ensemble import endings
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import BranchResults
from freefloat.limits.limits import Limits
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.motion.setting import Setting
from freefloat.planning.answer import violation_of
from freefloat.planning.limits.trials import Trials, screen
from freefloat.planning.margin_map import HeadingMap
from freefloat.planning.motions import SimulatedBranch, integrate_branch
from freefloat.planning.objective import Comparison
from freefloat.planning.objectives import LargestMargin
from freefloat.planning.plane.arcs import BranchRanges
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.rounding import digits_apart
from freefloat.so3 import Array, IntArray
from freefloat.visualization.page.playback import Playback
from freefloat.visualization.scenes.description import MarginColours
from freefloat.visualization.scenes.scene import motion_scene
from freefloat.visualization.slices import rotation_vectors

_GREY = (0.45, 0.50, 0.60)
"""Colour of attitudes at which the start of the path is not reached."""
_ORDER = (
    endings.UNREACHED, endings.FAILED, endings.SINGULAR, endings.LIMITED, endings.COMPLETED,
)  # fmt: skip
"""Endings, the best last."""
_TITLE = "motion"
_MOST = 8
"""Precise motions that are compared with the limits before giving up."""


def best_columns(results: BranchResults) -> IntArray:
    """The arm branch, of each attitude, whose motion gets farthest, shape (N,)."""
    return np.asarray(np.argmax(_scores(results), axis=1))


def best_sample(results: BranchResults) -> int:
    """The attitude, of N, from which a motion gets farthest."""
    return int(np.argmax(_scores(results).max(axis=1, initial=0.0)))


def _scores(results: BranchResults) -> Array:
    """How far motions get, shape (N, B): the ending; then the margin, or the time of the end."""
    motions = results.motions
    ranks = np.select([motions.endings == code for code in _ORDER], range(len(_ORDER)))
    values = np.where(motions.endings >= endings.COMPLETED, motions.ended_at, 0.0)
    values = np.where(motions.endings == endings.COMPLETED, motions.minimum, values)
    return np.asarray(ranks + values / (1.0 + values))


def packed(values: npt.ArrayLike, kind: str) -> str:
    """Numbers as the page unpacks them: base64 of the bytes of a NumPy type."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode()


def ball(result: AttitudeMap) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The samples over SO(3) as rotation vectors, by their best arm branch, and the reasons."""
    columns = best_columns(result.results)
    vectors = rotation_vectors(result.attitudes)
    content = {
        "kind": "ball",
        "points": packed(vectors, "<f4"),
        "extent_deg": float(np.degrees(np.linalg.norm(vectors, axis=1).max())),
        **_colours(result.problem, result.results, columns, _scale(result)),
        "scale": _scale(result).to_dict(),
        "text": f"{result.feasible_percentage} of {result.samples:,} attitudes are feasible",
        "samples": result.samples,
    }
    return content, tuple(_reasons(result.problem, result.results, columns))


def dial(
    result: HeadingMap, ranges: Sequence[BranchRanges] | None
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Headings of every arm branch with their colours, and exact ranges where they are known."""
    branches = []
    reasons: list[str] = []
    labels = result.branch_labels()
    known = {entry.branch: entry.degrees for entry in ranges or ()}
    rows: list[tuple[int | None, IntArray]]
    rows = [(b, np.full(result.samples, k)) for k, b in enumerate(result.branches)]
    if rows and result.problem.redundant:
        rows = [(None, best_columns(result.results))]
    for branch, columns in rows:
        branches.append({
            "label": labels[branch],
            "ranges": known.get(branch or 0, []) if ranges is not None else None,
            **_colours(result.problem, result.results, columns, _scale(result)),
        })  # fmt: skip
        reasons += _reasons(result.problem, result.results, columns)
    content = {
        "kind": "dial",
        "headings": np.degrees(result.headings).round(6).tolist(),
        "branches": branches,
        "scale": _scale(result).to_dict(),
        "text": f"{100.0 * result.feasible_fraction:.3g}% of the headings are feasible",
        "samples": result.samples * len(branches),
    }
    return content, tuple(reasons)


def _scale(result: AttitudeMap | HeadingMap) -> MarginColours:
    return MarginColours.over(result.problem.margin, [result.margins.ravel()], result.limited)


def _colours(
    problem: Problem, results: BranchResults, columns: IntArray, scale: MarginColours
) -> dict[str, Any]:
    """Colours (N, 3), bytes, and states: 0 start not reached, 1 infeasible, 2 feasible."""
    rows = np.arange(len(columns))
    margins: Array = results.margins[rows, columns]
    reached = results.exist[rows, columns]
    feasible = problem.margin.keeps(margins)
    shades = scale(np.where(feasible, margins, -1.0))
    shades[~reached] = _GREY
    return {
        "colours": packed(np.rint(255.0 * shades), "u1"),
        "states": packed(np.where(feasible, 2, reached), "u1"),
    }


def _reasons(problem: Problem, results: BranchResults, columns: IntArray) -> Iterator[str]:
    """A sentence on the motion of each attitude from an arm branch."""
    rows = np.arange(len(columns))
    motions, margin = results.motions, problem.margin
    name, required = margin.measure.title, margin.threshold
    values = [
        getattr(motions, field)[rows, columns].tolist()
        for field in ("endings", "ended_at", "minimum", "minimum_at")
    ]
    for ending, ended_at, minimum, minimum_at in zip(*values, strict=True):
        match ending:
            case endings.COMPLETED if problem.margin.keeps(minimum):
                yield f"feasible: |{name}| stays at {minimum:.4g} or above"
            case endings.COMPLETED:
                n = digits_apart(minimum, required, 4)
                yield (
                    f"|{name}| falls to {minimum:.{n}g} at t = {minimum_at:.4g} s, "
                    f"below the margin {required:.{n}g}"
                )
            case endings.SINGULAR:
                yield f"becomes singular at t = {ended_at:.4g} s"
            case endings.LIMITED:
                yield "violates a limit of pointing or of the spacecraft's turn"
            case endings.UNREACHED:
                yield "no arm configuration reaches the start of the path"
            case _:
                yield f"the motion could not be integrated beyond t = {ended_at:.4g} s"


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
    """The motion of the largest margin, of motions from samples, that keeps the limits.

    None where none was found. The progress, called between candidates, may raise an exception to
    abandon the search.
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


def playback_of(
    motion: Motion, limits: Limits, title: str, results: Sequence[LimitResult] = ()
) -> Playback:
    """The playback of a motion with its cones, a title, and the limits that it violates."""
    violations = {_TITLE: violation_of(results)}
    return Playback(motion_scene({_TITLE: motion}, title, limits, violations=violations))


def place(setting: Setting, attitude: Array) -> dict[str, Any]:
    """An attitude as a quaternion, and where the ball and the dial show it."""
    heading = float(np.degrees(setting.plane.heading(attitude))) if setting.has_headings else None
    return {
        "attitude": attitude.tolist(),
        "rotation_vector": rotation_vectors(attitude).tolist(),
        "heading_deg": heading,
    }
