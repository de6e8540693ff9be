"""Trajectories as tables: CSV, JSON and MATLAB."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterable
from itertools import chain, count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from freefloat.io.files import cell_text
from freefloat.io.trajectory import Trajectory
from freefloat.so3 import Array

_FIELD = 32
"""Length of an arm's name in keys: MATLAB accepts 63 characters in all."""
_FIXED = "fixed"
"""What keys of positions in the frame of the path have added."""
_FRAMES = (
    "positions from the centre of mass of the whole system, inertial axes; attitudes are unit "
    "quaternions x y z w that rotate spacecraft or end-effector axes into inertial ones"
)
_FIXED_FRAME = (
    "; centre_of_mass_position and positions named fixed are in a frame that does not move, in "
    "which the centre of mass has the velocity drift; velocities are relative to the centre of mass"
)


class _Columns(NamedTuple):
    """Columns of one quantity."""

    key: str
    values: Array
    names: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def unit(self) -> str | list[str]:
        """A single unit if all columns have the same."""
        return self.units[0] if len(set(self.units)) == 1 else list(self.units)


def _groups(trajectory: Trajectory) -> list[_Columns]:
    setting = trajectory.motion.setting
    measure, model = setting.margin.measure, setting.model
    fields = _arm_fields(track.arm for track in trajectory.end_effectors)

    def space(key: str, values: Array, unit: str, arm: str = "") -> _Columns:
        axes = "xyzw"[: values.shape[1]]
        words = key.replace("end_effector", "end-effector").replace("_", " ")
        names = tuple(f"{arm} {words} {a}".strip() for a in axes)
        return _Columns(f"{key}_{fields[arm]}" if arm else key, values, names, (unit,) * len(axes))

    def joints(key: str, word: str, values: Array, revolute: str, prismatic: str) -> _Columns:
        names = tuple(f"{name} {word}" for name in model.joint_names)
        kinds = (body.prismatic for body in model.bodies[1:])
        return _Columns(key, values, names, tuple(prismatic if k else revolute for k in kinds))

    centre = trajectory.centre_of_mass_positions
    fixed: list[_Columns] = []
    if trajectory.displaced:
        fixed = [
            space("centre_of_mass_position", centre, "m"),
            space(f"base_position_{_FIXED}", centre + trajectory.base_positions, "m"),
            *(space(f"end_effector_position_{_FIXED}", centre + track.positions, "m", track.arm)
              for track in trajectory.end_effectors),
        ]  # fmt: skip
    tracks = [
        group
        for track in trajectory.end_effectors
        for group in (
            space("end_effector_position", track.positions, "m", track.arm),
            space("end_effector_attitude", track.orientations, "1", track.arm),
        )
    ]
    return [
        _Columns("time", trajectory.times[:, None], ("time",), ("s",)),
        space("attitude", trajectory.attitudes, "1"),
        space("base_position", trajectory.base_positions, "m"),
        space("base_velocity", trajectory.base_velocities, "m/s"),
        space("base_angular_velocity", trajectory.angular_velocities, "rad/s"),
        joints("joints", "position", trajectory.joints, "rad", "m"),
        joints("joint_rates", "velocity", trajectory.joint_rates, "rad/s", "m/s"),
        joints("joint_accelerations", "acceleration", trajectory.joint_accelerations,
               "rad/s^2", "m/s^2"),
        joints("joint_torques", "torque", trajectory.joint_torques, "N m", "N"),
        *tracks,
        _Columns("measure", trajectory.measure[:, None], (measure.name,), (measure.unit,)),
        *fixed,
    ]  # fmt: skip


def _arm_fields(arms: Iterable[str]) -> dict[str, str]:
    """What keys of arms have added: their names as in fields of a MATLAB struct, distinct."""
    fields: dict[str, str] = {}
    for arm in arms:
        word = re.sub(r"\W", "_", arm, flags=re.ASCII)[:_FIELD]
        numbered = chain([word], (f"{word}_{number}" for number in count(2)))
        taken = {*fields.values(), _FIXED}
        fields[arm] = next(name for name in numbered if name not in taken)
    return fields


def csv_text(trajectory: Trajectory) -> str:
    """CSV text: a row for each time; the first row has the names and units of the columns."""
    groups = _groups(trajectory)
    stream = io.StringIO(newline="")
    rows = csv.writer(stream, lineterminator="\n")
    named = [pair for group in groups for pair in zip(group.names, group.units, strict=True)]
    rows.writerow([cell_text(f"{name} [{unit}]") for name, unit in named])
    rows.writerows(np.hstack([group.values for group in groups]).tolist())
    return stream.getvalue()


def json_text(trajectory: Trajectory) -> str:
    """JSON text: robot and problem, units, and an array for each quantity; null for nan."""
    groups = _groups(trajectory)
    arrays = {}
    for group in groups:
        values = group.values[:, 0] if group.key in ("time", "measure") else group.values
        arrays[group.key] = np.where(np.isnan(values), np.array(None), values).tolist()
    units = {group.key: group.unit for group in groups}
    document = {**_head(trajectory), "units": units, "trajectory": arrays}
    return json.dumps(document, allow_nan=False) + "\n"


def write_mat(path: Path, trajectory: Trajectory) -> None:
    """Write a MATLAB file with one struct ``trajectory``: a row for each time; and ``units``."""
    from scipy.io import savemat

    groups = _groups(trajectory)
    struct = {
        **{key: _cells(value) for key, value in _head(trajectory).items()},
        **{group.key: group.values for group in groups},
        "units": {group.key: _cells(group.unit) for group in groups},
    }
    with path.open("wb") as stream:
        savemat(stream, {"trajectory": struct}, long_field_names=True)


def _cells(value: Any) -> Any:
    """A list as a MATLAB cell array of texts, or as a row of numbers."""
    if not isinstance(value, list):
        return value
    return np.array(value, dtype=object if isinstance(value[0], str) else float)


def _head(trajectory: Trajectory) -> dict[str, Any]:
    motion = trajectory.motion
    setting = motion.setting
    verdict = {"feasible": trajectory.feasible, "reason": trajectory.reason}
    return {
        "robot": setting.model.description.source,
        "end_effector": setting.model.end_effector,
        "joint_names": list(setting.model.joint_names),
        "momentum": setting.momentum.tolist(),
        "wheel_momentum": setting.wheel_momentum.tolist(),
        "drift": setting.drift.tolist(),
        "measure_name": setting.margin.measure.name,
        "completed": motion.completed,
        "ending": motion.outcome,
        **({} if trajectory.feasible is None else verdict),
        "frames": _FRAMES + (_FIXED_FRAME if trajectory.displaced else ""),
    }
