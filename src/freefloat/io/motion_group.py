"""Motions in HDF5 files."""

from __future__ import annotations

from typing import Any

import numpy as np

from freefloat.ik.branches import ArmBranch
from freefloat.io.hdf5 import TEXT, read_numbers
from freefloat.motion.extrema import closest_approach
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.panels import DEGREE
from freefloat.motion.problem import Problem
from freefloat.planning.simulation import SimulatedBranch
from freefloat.so3 import Array, without_jumps

QUATERNION = "1, quaternion x y z w"
"""Unit of attitudes."""
_MAX = 1e12
_UNIT_LENGTH = 1e-9
"""Deviation from 1 of the length of a stored quaternion."""


def write_motion(file: Any, name: str, motion: Motion) -> Any:
    """Write a motion as a group of an open file; the group."""
    group = file.create_group(name)
    group.attrs["ending"] = motion.ending.name
    group.attrs["joint_names"] = np.array(motion.problem.model.joint_names, dtype=TEXT)
    for key, values, unit in (
        ("time", motion.times, "s"),
        ("attitude", motion.attitudes, QUATERNION),
        ("joints", motion.joints, "rad or m"),
        ("base_position", motion.base_positions, "m"),
    ):
        group.create_dataset(key, data=values).attrs["unit"] = unit
    return group


def read_motion(group: Any, problem: Problem) -> Motion:
    """Motion of a group, along the path of a problem.

    Raises:
        ValueError: If the arrays are not those of a motion of the problem's robot.
    """
    times, attitudes, joints, positions = (
        read_numbers(group, key) for key in ("time", "attitude", "joints", "base_position")
    )
    _require_motion(times, attitudes, joints, positions)
    if joints.shape[1] != problem.model.dof:
        raise ValueError(f"its robot has {problem.model.dof} joints, its motion {joints.shape[1]}")
    motion = Motion(problem, Ending[group.attrs["ending"]], times, without_jumps(attitudes), joints)
    distance = np.linalg.norm(positions - motion.base_positions, axis=1)
    if distance.max() > _CENTRE * max(1.0, float(np.abs(positions).max())):
        node = int(distance.argmax())
        raise ValueError(
            f"its base position at t = {times[node]:.6g} s moves the centre of mass by "
            f"{distance[node]:.3g} m"
        )
    return motion


_CENTRE = 1e-9
"""Distance [m] by which a stored base position may move the centre of mass."""


def write_branch(file: Any, name: str, branch: SimulatedBranch) -> None:
    """Write the motion of an arm branch."""
    group = write_motion(file, name, branch.motion)
    group.attrs["branch"], group.attrs["label"] = branch.branch.index, branch.branch.label


def read_branch(group: Any, problem: Problem, index: int) -> SimulatedBranch:
    """The motion of an arm branch.

    Args:
        group: Of the file.
        problem: Of the motion.
        index: Number of the branch, if the group does not have it.
    """
    motion = read_motion(group, problem)
    index = int(group.attrs.get("branch", index))
    branch = ArmBranch(index, str(group.attrs.get("label", index)), motion.initial.joints)
    return SimulatedBranch(branch, motion, closest_approach(motion, problem.margin.measure))


def _require_motion(times: Array, attitudes: Array, joints: Array, positions: Array) -> None:
    """Raise a ValueError unless these are the nodes of whole panels."""
    count = len(times)
    shaped = times.shape == (count,) and attitudes.shape == (count, 4) and joints.ndim == 2
    shaped = shaped and positions.shape == (count, 3) and len(joints) == count
    if not (shaped and count % DEGREE == 1):
        raise ValueError("its arrays are not those of a motion")
    if not all(
        np.abs(values).max(initial=0.0) <= _MAX for values in (times, attitudes, joints, positions)
    ):
        raise ValueError("its motion holds numbers that are not finite, or beyond 1e12")
    error = np.abs(np.linalg.norm(attitudes, axis=1) - 1.0)
    if error.max() > _UNIT_LENGTH:
        raise ValueError(f"its attitude at node {error.argmax()} is no unit quaternion")
    if not (np.diff(times) >= 0.0).all() and not (np.diff(times) <= 0.0).all():
        raise ValueError("its times do not rise")
