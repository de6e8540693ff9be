"""Verdicts on motions, and all sentences on why an attitude is chosen, or why there is none.

The sentences are made of values; what finds those values is in the modules that plan.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt
import scipy

from freefloat.dynamics.joint_space import sampled_reach
from freefloat.dynamics.measures import measure_title
from freefloat.dynamics.plane import Plane
from freefloat.ensemble.endings import COMPLETED, FAILED, LIMITED, SINGULAR, UNREACHED
from freefloat.errors import InputError, UnreachableError
from freefloat.limits.result import LimitResult, all_violations, violated
from freefloat.motion.extrema import ClosestApproach
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import Problem
from freefloat.motion.singularity import SingularEvent
from freefloat.rounding import digits_apart
from freefloat.so3 import Array

RETIMED = "the attitude whose motion has this timing"
NOT_UNIQUE = "; the optimum is not unique, attitudes around it have the same margin"
FASTEST = "with its fastest timing"
NO_FASTEST = "no timing was found that is the fastest of its own motion"
FIRST_GUESS = "{reason} (at {duration:g} s, with which the search for the fastest timing begins)"
PRECEDED = "the state at the end of the phase before"
_OTHER_UNITS = 50.0
"""A start this many times farther than the reach was hardly written in metres."""
_PATH_POINTS = 401


class Cause(StrEnum):
    """What decides whether a motion is feasible."""

    KEPT = "kept"
    SINGULAR = "singular"
    MARGIN = "margin"
    LIMIT = "limit"
    JUMP = "jump"


@dataclass(frozen=True)
class Verdict:
    """Whether a motion is feasible, or what it violates.

    Attributes:
        cause: What decides; a motion is feasible where everything is kept.
        name: Name of the measure, or of all limits that are violated: ``joint_range and pointing``.
        where: Joint, link or pair of links of the first.
        time: Instant that decides [s].
        value: Value at that instant.
        allowed: Bound of a measure.
        sentence: How limits are violated, or what is kept.
    """

    cause: Cause = Cause.KEPT
    name: str = ""
    where: str = ""
    time: float = 0.0
    value: float = 0.0
    allowed: float = 0.0
    sentence: str = ""

    @property
    def label(self) -> str:
        """The name in words."""
        return self.name.replace("_", " ")

    @property
    def feasible(self) -> bool:
        """Whether margin and limits are kept."""
        return self.cause is Cause.KEPT

    def __str__(self) -> str:
        """The verdict as a sentence without its full stop."""
        return _SENTENCES[self.cause].format(verdict=self)

    @property
    def digits(self) -> int:
        """Digits of the value and of what is required of it."""
        return digits_apart(self.value, self.allowed, 4)

    @property
    def brief(self) -> str:
        """The verdict in a cell of a table."""
        return _CELLS[self.cause].format(verdict=self)


_SENTENCES = {
    Cause.KEPT: "{verdict.sentence}",
    Cause.SINGULAR: "the arm becomes singular at t = {verdict.time:.4g} s",
    Cause.MARGIN: "{verdict.name} falls to {verdict.value:.{verdict.digits}g} at t = "
    "{verdict.time:.4g} s, {verdict.allowed:.{verdict.digits}g} is required",
    Cause.LIMIT: "{verdict.sentence}",
    Cause.JUMP: "joint rates would change by {verdict.value:.3g} rad/s or m/s where it begins; "
    "a phase with joints before it brings the arm to rest",
}
_CELLS = {
    Cause.KEPT: "keeps margin and limits",
    Cause.SINGULAR: "singular at {verdict.time:.4f} s",
    Cause.MARGIN: "below the margin at {verdict.time:.4f} s",
    Cause.LIMIT: "keeps the margin, violates {verdict.label}",
    Cause.JUMP: "joint rates jump",
}


def verdict_on(
    motion: Motion, results: Iterable[LimitResult] = (), approach: ClosestApproach | None = None
) -> Verdict:
    """The verdict on a motion with the results of limits along it.

    Its closest approach to a dynamic singularity is given where the margin is to be kept.
    """
    if motion.ending is Ending.SINGULAR:
        return Verdict(Cause.SINGULAR, time=motion.final.time)
    margin = motion.setting.margin
    if approach is not None and not (motion.completed and margin.keeps(approach.value)):
        name, time, value = measure_title(approach.measure), approach.time, approach.value
        return Verdict(Cause.MARGIN, name, "", time, value, margin.threshold)
    compared = tuple(results)
    violations = violated(compared)
    if violations:
        first, names = violations[0], dict.fromkeys(result.limit for result in violations)
        return Verdict(
            Cause.LIMIT, " and ".join(names), first.where, first.time, first.worst,
            sentence=all_violations(violations),
        )  # fmt: skip
    return Verdict(sentence="margin and limits are kept" if compared else "the margin is kept")


def out_of_reach(problem: Problem) -> float | None:
    """Path parameter from which the end-effector cannot reach the path, whatever the attitude.

    It is 0 where the path begins out of reach, None where all of it lies within the reach. Points
    that are too near to the centre of mass, or that joint ranges or the end-effector's orientation
    exclude, are not found.
    """

    def excess(s: float) -> float:
        t = problem.path.timing.time_at(s) if problem.robot_varies else 0.0
        return float(np.linalg.norm(problem.path.pose_at(s).position)) - problem.reach(t)

    samples = np.linspace(0.0, 1.0, _PATH_POINTS).tolist()
    outside = next((k for k, s in enumerate(samples) if excess(s) > 0.0), None)
    if not outside:
        return outside
    return float(scipy.optimize.brentq(excess, *samples[outside - 1 : outside + 1]))


def reach_message(problem: Problem) -> str | None:
    """Where the path leads out of reach, with a likely cause; None where it does not."""
    s = out_of_reach(problem)
    if s is None:
        return None
    reach = problem.reach()
    hint = light_spacecraft_hint(problem)
    if s > 0.0:
        return f"the path leaves the reach of at most {reach:.4g} m at s = {s:.3g}{hint}"
    start = problem.path.pose(0.0).position
    distance = float(np.linalg.norm(start))
    units = "; lengths are in metres" if distance > _OTHER_UNITS * reach else ""
    return (
        f"the path begins out of reach: {np.round(start, 6).tolist()} m is {distance:.4g} m from "
        f"the centre of mass, the arm reaches {reach:.4g} m{units}{hint}"
    )


def unreached_start_message(problem: Problem, origin: str) -> str:
    """The sentence that the arm does not reach the start of the path, with the distances.

    The ``origin`` names attitudes from which it does not, such as ``"no heading"``.
    """
    start = problem.path.pose(0.0).position
    return (
        f"the arm reaches the start of the path, {np.round(start, 6).tolist()} m, from {origin}; "
        f"it is {np.linalg.norm(start):.4g} m from the centre of mass, {_reach_found(problem)}"
        f"{light_spacecraft_hint(problem)}"
    )


def _reach_found(problem: Problem) -> str:
    """How near and far the end-effector gets, or a bound where joints slide without limit."""
    try:
        near, far = sampled_reach(problem.model_at(), problem.task)
    except InputError:
        return f"and no configuration gets farther than {problem.reach():.4g} m"
    return f"and the end-effector reaches {near:.4g} to {far:.4g} m"


def unreachable(problem: Problem, attitude: Array) -> UnreachableError:
    """The error of an attitude from which the arm does not reach the start of the path."""
    if out_of_reach(problem) == 0.0:
        message = str(reach_message(problem))
        return UnreachableError("path", message, "a path that begins within the reach")
    starts = [np.round(pose.position, 6).tolist() for pose in problem.path.poses(0.0)]
    ends = "end-effector at the start of the path"
    if len(starts) > 1:
        ends = "end-effectors at the starts of their paths"
    key, given = "attitude", f"{np.round(attitude, 6).tolist()}"
    if problem.has_headings:
        key, given = "heading", f"{np.degrees(problem.plane.heading(attitude)):.6g} deg"
    message = (
        f"from {given} no arm configuration puts the {ends}, "
        f"{' and '.join(map(str, starts))} m from the centre of mass"
    )
    accepted = f"another {key}, from which the arm reaches it, or a path that begins nearer"
    return UnreachableError(key, message + light_spacecraft_hint(problem), accepted)


def light_spacecraft_hint(problem: Problem) -> str:
    """The last clause of a message on a spacecraft lighter than its arm; empty for heavier ones."""
    base, total = problem.model.bodies[0].mass, problem.model.total_mass
    if base >= 0.5 * total:
        return ""
    return f"; the spacecraft has {base:.4g} kg of {total:.4g} kg: is robot.spacecraft missing?"


def margin_text(approach: ClosestApproach) -> str:
    """The measure and its smallest magnitude along a motion."""
    return f"{measure_title(approach.measure)} {approach.value:.6g}"


def none_completes(
    tried: str, endings: npt.NDArray[np.int8], last: SingularEvent | None = None
) -> str:
    """That no motion ``tried``, such as ``"none of 24 headings"``, completes the path, and why.

    Endings belong to arm branches, shape (K, B); the last singularity, which ends the longest
    motion, is given where it is known.
    """
    within = " within its limits" if (endings == LIMITED).any() else ""
    return f"{tried} completes the path{within}: {ending_fractions(endings, last)}"


def ending_fractions(endings: npt.NDArray[np.int8], last: SingularEvent | None = None) -> str:
    """How attitudes fail: by the arm branch that gets farthest.

    Arguments are as for :func:`none_completes`.
    """
    latest = ""
    if last is not None:
        latest = f", at the latest at t = {last.time:.4g} s: {last.kind.description}"
    words = {
        UNREACHED: "have no arm configuration at the start",
        FAILED: "reach the step limit",
        SINGULAR: f"end in a singularity{latest}",
        LIMITED: "violate a limit of pointing or turn",
        COMPLETED: "complete the path below the margin",
    }
    ranks = np.array([list(words).index(code) for code in endings.ravel().tolist()])
    best = ranks.reshape(endings.shape).max(axis=1)
    fractions = np.bincount(best, minlength=len(words)) / len(best)
    return "; ".join(
        f"{100.0 * fraction:.3g} % {text}"
        for fraction, text in zip(fractions.tolist(), words.values(), strict=True)
        if fraction > 0.0
    )


def point_text(plane: Plane, point: complex) -> str:
    """A point of a plane through the centre of mass [m]; of the x-y plane without its z."""
    place = plane.axes[:, :2] @ [point.real, point.imag] + 0.0
    shown = place[:2] if plane.is_level else place
    return f"({', '.join(f'{entry:.4g}' for entry in shown)}) m"
