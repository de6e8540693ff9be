"""What a plan or motion file says in words and numbers, beside what its motion says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np

from freefloat.io.plan_file import StoredPlan
from freefloat.io.result_file import PLAN
from freefloat.io.scenario import Scenario
from freefloat.motion.closest_approach import closest_approach
from freefloat.motion.motion import Motion
from freefloat.motion.simulation import singularity
from freefloat.planning.documents import (
    Document,
    margin_document,
)
from freefloat.so3 import angle_between, heading_of

_SHARE, _FLOOR = 1e-6, 1e-9
"""By how much a number may differ, relative and absolute: rounding on another machine."""
_ERRORS = 10.0
"""Numbers that are errors themselves may differ by this factor, and by a little:"""
_LITTLE = 1e-7
_NEAR = 1e-6
"""Joints at the start are those of an arm branch when they differ by less [rad, m]."""


@dataclass(frozen=True)
class Difference:
    """A thing that is told otherwise than it is.

    Attributes:
        key: In the file's document, with dots; or what else in the file.
        told: What the file says.
        found: What is so.
    """

    key: str
    told: Any
    found: Any

    def __str__(self) -> str:
        return f"{self.key} says {_brief(self.told)}, but it is {_brief(self.found)}"


def _brief(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.9g}"
    text = str(value)
    return text if len(text) < 60 else f"{text[:57]}..."


def differences(stored: StoredPlan, wish: Scenario, motion: Motion) -> list[Difference]:
    """Everything that a file tells of its motion and that is not so.

    Args:
        stored: The file as read.
        wish: Its scenario.
        motion: Its motion.
    """
    document = stored.document
    found = [
        *_compared("", document, _expected(stored, wish, motion)),
        *_residuals(document.get("residuals"), motion),
        *_machine(stored, wish),
    ]
    branch = _branch(document.get("branch"), motion)
    return [*found, *([branch] if branch else [])]


def _expected(stored: StoredPlan, wish: Scenario, motion: Motion) -> Document:
    """The parts of the document that the motion alone decides."""
    problem = motion.problem
    margin = margin_document(motion, closest_approach(motion, problem.margin.measure))
    expected = {
        "completed": motion.completed,
        "ending": motion.ending.value,
        "singular": singularity(motion),
        "min_margin": margin,
        "joint_names": list(problem.model.joint_names),
        "initial": motion.initial.to_dict(),
        "final": motion.final.to_dict(),
        "duration": problem.path.duration,
        "ended_at": motion.final.time,
    }
    if stored.kind != PLAN:
        return expected
    search, initial = wish.search(), motion.initial.attitude
    heading = float(np.degrees(heading_of(initial))) if problem.task.planar else None
    away = None
    if search.from_attitude is not None:
        away = float(np.degrees(angle_between(initial, search.from_attitude)))
    headings = [{"branch": branch, "ranges": _degrees(stored.ranges[branch])}
                for branch in sorted(stored.ranges)]  # fmt: skip
    told = {
        "feasible": stored.feasible,
        "objective": str(search.objective),
        "heading_deg": heading,
        "deviation_deg": away,
        "attitude_ranges_deg": headings,
    }
    return {**expected, **told}


def _degrees(ranges: Any) -> list[list[float]]:
    """Ranges of heading [rad] in degrees from 0 to 360, those across zero in two parts."""
    parts = []
    for low, high in np.degrees(ranges).tolist():
        parts += [[low, high]] if high <= 360.0 else [[0.0, high - 360.0], [low, 360.0]]
    return sorted(parts)


def _compared(key: str, told: Any, found: Any) -> Iterator[Difference]:
    """Differences of two documents; keys that only the file has are of no concern."""
    if isinstance(found, dict) and isinstance(told, dict):
        for name, value in found.items():
            inner = f"{key}.{name}".lstrip(".")
            if name not in told:
                yield Difference(inner, "nothing", value)
            else:
                yield from _compared(inner, told[name], value)
    elif isinstance(found, list) and isinstance(told, list):
        if key.endswith("attitude") and _opposite(told, found):
            found = [-one for one in found]
        for place, (one, other) in enumerate(zip_longest(told, found, fillvalue="nothing")):
            yield from _compared(f"{key}[{place}]", one, other)
    elif not same_number(told, found) and (type(told) is not type(found) or told != found):
        yield Difference(key, told, found)


def _opposite(told: list[Any], found: list[Any]) -> bool:
    """Whether two quaternions have other signs: they may be one attitude nevertheless."""
    numbers = all(isinstance(one, int | float) for one in told) and len(told) == len(found)
    return numbers and sum(a * b for a, b in zip(told, found, strict=True)) < 0.0


def same_number(told: Any, found: Any, share: float = _SHARE, floor: float = _FLOOR) -> bool:
    """Whether two things are numbers and equal but for rounding."""
    numbers = all(isinstance(one, int | float) and not isinstance(one, bool)
                  for one in (told, found))  # fmt: skip
    return numbers and bool(abs(told - found) <= floor + share * abs(found))


def _residuals(told: Any, motion: Motion) -> Iterator[Difference]:
    """Errors are told to their order: their digits are rounding."""
    found = motion.residuals()
    for name in ("end_effector_position", "end_effector_attitude", "momentum"):
        value, own = getattr(found, name), told.get(name) if isinstance(told, dict) else None
        if value is None and own is None:
            continue
        ordered = isinstance(own, float) and value is not None
        if not (ordered and value / _ERRORS - _LITTLE <= own <= value * _ERRORS + _LITTLE):
            yield Difference(f"residuals.{name}", own, value)


def _machine(stored: StoredPlan, wish: Scenario) -> Iterator[Difference]:
    """The hand and the joints held still are told twice: by the scenario and beside the robot."""
    robot = wish.content.robot
    origin = stored.origin
    if origin.end_effector != robot.end_effector:
        yield Difference("end_effector", origin.end_effector, robot.end_effector)
    held = dict(robot.held)
    if dict(origin.held) != held:
        yield Difference("held", dict(origin.held), held)


def _branch(told: Any, motion: Motion) -> Difference | None:
    """The arm branch by its number, where branches have numbers."""
    problem = motion.problem
    if problem.redundant:
        return None
    joints, nearest = motion.initial.joints, None
    for one in problem.branches(motion.initial.attitude, motion.initial.time):
        if problem.model.joint_distance(one.joints, joints) < _NEAR:
            nearest = one.index
    return None if told == nearest else Difference("branch", told, nearest)
