"""Plans and motions on disk, and back: what was planned, whole, without the files it came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.brief import brief
from freefloat.errors import InputError
from freefloat.io.digest import broken_seals, seal
from freefloat.io.result_file import (
    MOTION,
    PLAN,
    QUATERNION,
    TEXT,
    Origin,
    accepted_file,
    new_result,
    opened_result,
    read_document,
    read_numbers,
    read_origin,
    write_document,
)
from freefloat.io.scenario import Scenario
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import DEGREE
from freefloat.motion.problem import Problem
from freefloat.planning.plan import Plan
from freefloat.so3 import Array, frozen, without_jumps

_LARGEST = 1e12
_UNIT_LENGTH = 1e-9
"""How far from 1 a stored quaternion's length may be."""


def save_plan(
    path: str | Path, plan: Plan, scenario: Scenario, document: Mapping[str, Any]
) -> None:
    """Write a plan.

    Args:
        path: The file; replaced if it exists.
        plan: What to write.
        scenario: Where it came from; its text and its robot are written, too.
        document: What the command line told about it, kept as JSON.

    Raises:
        InputError: If the file cannot be written.
    """
    with new_result(path, PLAN, scenario, plan.problem) as file:
        write_document(file, document)
        file.attrs["feasible"] = plan.feasible
        for entry in plan.ranges:
            values = [(one.low, one.high) for one in entry.ranges]
            group = file.create_dataset(
                f"ranges/branch_{entry.branch}", data=np.reshape(values, (-1, 2))
            )
            group.attrs["label"], group.attrs["unit"] = entry.label, "rad"
        if plan.chosen is not None:
            _write_motion(file, plan.chosen.motion)
        seal(file)


def save_motion(
    path: str | Path, motion: Motion, scenario: Scenario, document: Mapping[str, Any]
) -> None:
    """Write a motion that was not planned, be it singular; arguments as for :func:`save_plan`."""
    with new_result(path, MOTION, scenario, motion.problem) as file:
        write_document(file, document)
        file.attrs["feasible"] = bool(document["min_margin"]["kept"])
        _write_motion(file, motion)
        seal(file)


def _write_motion(file: Any, motion: Motion) -> None:
    group = file.create_group("motion")
    group.attrs["ending"] = motion.ending.name
    group.attrs["joint_names"] = np.array(motion.problem.model.joint_names, dtype=TEXT)
    for name, values, unit in (
        ("time", motion.times, "s"),
        ("attitude", motion.attitudes, QUATERNION),
        ("joints", motion.joints, "rad or m"),
        ("base_position", motion.base_positions, "m"),
    ):
        group.create_dataset(name, data=values).attrs["unit"] = unit


@dataclass(frozen=True, eq=False)
class StoredPlan:
    """A plan or motion file as read.

    Attributes:
        source: The file.
        kind: ``"plan"`` or ``"motion"``.
        feasible: Whether there is a motion that keeps the margin.
        origin: Scenario and robot, as texts.
        document: What was told, as JSON has it: of a plan ``reason``, ``certificate`` and so on.
        ranges: Arm branch to headings [rad], shape (K, 2).
        ending: How the motion ended; None where an infeasible plan has none.
        times: Of the motion's nodes [s], shape (N,).
        attitudes: Unit quaternions x, y, z, w, shape (N, 4).
        joints: Shape (N, n).
        base_positions: Of the spacecraft's root link from the centre of mass [m], shape (N, 3).
        altered: What in the file is not as it was written, see :mod:`freefloat.io.digest`; None
            where the file does not tell.
    """

    __repr__ = brief

    source: str
    kind: str
    feasible: bool
    origin: Origin
    document: dict[str, Any]
    ranges: dict[int, Array]
    ending: Ending | None
    times: Array
    attitudes: Array
    joints: Array
    base_positions: Array
    altered: tuple[str, ...] | None

    def problem(self) -> Problem:
        """What was asked, built again from the texts in the file.

        Raises:
            InputError: If they are broken.
        """
        return self.origin.problem()

    def motion(self) -> Motion | None:
        """The motion, equal to the one written; None where an infeasible plan has none.

        Raises:
            InputError: If the file's scenario or robot are broken, or not those of the motion.
        """
        if self.ending is None:
            return None
        problem = self.problem()
        dof, width = problem.model.dof, self.joints.shape[1]
        if dof != width:
            told = f"its robot has {dof} joints, its motion {width}"
            raise InputError("file", told, accepted_file(PLAN, MOTION), self.source)
        return Motion(problem, self.ending, self.times, self.attitudes, self.joints)

    def named_motions(self) -> dict[str, Motion]:
        """The motion, by the name of the file.

        Raises:
            InputError: As for :meth:`motion`, or if there is none.
        """
        motion = self.motion()
        if motion is None:
            told = f"it has no motion to show: {self.document.get('reason')}"
            raise InputError("file", told, "a feasible plan", self.source)
        return {Path(self.source).stem: motion}


def load_plan(path: str | Path) -> StoredPlan:
    """Read a plan or motion file.

    Returns:
        What the file holds: :meth:`~StoredPlan.motion` is the chosen motion,
        :meth:`~StoredPlan.problem` what was asked, ``document`` what was told of it, such as
        ``reason``, ``branch``, ``min_margin`` and ``certificate``.

    Raises:
        InputError: If it is none, or of another version, or broken.
    """
    with opened_result(path, PLAN, MOTION) as (file, kind):
        nodes = [np.empty(0), np.empty((0, 4)), np.empty((0, 0)), np.empty((0, 3))]
        ending, altered = None, broken_seals(file)
        if kind == MOTION or "motion" in file:
            group = file["motion"]
            ending = Ending[group.attrs["ending"]]
            nodes = [read_numbers(group, name) for name in _NODES]
            _refuse_what_is_no_motion(*nodes)
            nodes[1] = without_jumps(nodes[1])
        times, attitudes, joints, places = map(frozen, nodes)
        ranges = file.get("ranges", {})
        return StoredPlan(
            str(path),
            kind,
            bool(file.attrs["feasible"]),
            read_origin(file, path),
            read_document(file),
            {
                int(name.removeprefix("branch_")): frozen(read_numbers(ranges, name))
                for name in ranges
            },
            ending,
            times,
            attitudes,
            joints,
            places,
            None if altered is None else tuple(altered),
        )


_NODES = ("time", "attitude", "joints", "base_position")


def _refuse_what_is_no_motion(times: Array, attitudes: Array, joints: Array, places: Array) -> None:
    """Raise ValueError unless these are the nodes of whole panels."""
    count = len(times)
    shaped = times.shape == (count,) and attitudes.shape == (count, 4) and joints.ndim == 2
    shaped = shaped and places.shape == (count, 3)
    if not (shaped and len(joints) == count and count % DEGREE == 1):
        raise ValueError("its arrays are not those of a motion")
    arrays = (times, attitudes, joints, places)
    if not all(np.abs(values).max(initial=0.0) <= _LARGEST for values in arrays):
        raise ValueError("its motion holds numbers that are not finite, or beyond 1e12")
    off = np.abs(np.linalg.norm(attitudes, axis=1) - 1.0)
    if off.max() > _UNIT_LENGTH:
        at = int(off.argmax())
        raise ValueError(f"its attitude at t = {times[at]:.6g} s, node {at}, is no unit quaternion")
    if not (np.diff(times) >= 0.0).all() and not (np.diff(times) <= 0.0).all():
        raise ValueError(f"its times go back and forth{_where(times)}")


def _where(times: Array) -> str:
    """The first time that does not go on as most of them do."""
    steps = np.diff(times) * np.sign(times[-1] - times[0] or 1.0)
    return f" at t = {times[int(np.flatnonzero(steps < 0.0)[0]) + 1]:.6g} s"
