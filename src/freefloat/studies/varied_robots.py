"""Robots of many runs: factors on links, spacecraft, payload and mount as they vary in studies."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from freefloat.dynamics.denavit_hartenberg import inertial_row
from freefloat.ensemble.robots import Robots
from freefloat.errors import LARGEST_NUMBER
from freefloat.io.scenario.robot_section import RobotSection
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import Rotation
from freefloat.so3 import Array, BoolArray, IntArray, Pose
from freefloat.studies.columns import Column, as_numbers

SCALE_MASS = "robot.scale_mass"
MASS_FACTORS = 1e-2, 1e2
"""Factors beyond which a robot is built and checked."""
_FIELD = re.compile(
    r"(robot\.(?:spacecraft|payload))\.(mass|inertia|com|mount\.xyz|mount\.rpy)"
    r"(?:(?<!mass)(?<!inertia)\.([012]))?"
)
"""Keys of parts that may differ between the robots of an ensemble; of vectors entries, too."""
INERTIA = "inertia"
"""Last word of the keys of inertias."""
_TRIANGLE = 1e-9


def is_robot_key(key: str) -> bool:
    """Whether runs that differ in a key have robots with the same joints."""
    link = key.removeprefix(f"{SCALE_MASS}.")
    return (link != key and "." not in link) or _field_of(key) is not None


def vary_robots(keys: Iterable[str], listed: Mapping[str, Sequence[Any]]) -> bool:
    """Whether runs have robots that no factor on all links makes equal."""
    maps = any(isinstance(value, dict) for value in listed.get(SCALE_MASS, ()))
    return maps or any(is_robot_key(key) for key in keys)


def _field_of(key: str) -> tuple[str, str, int | None] | None:
    """Part, field and index of the entry, None for all, that a key names."""
    if (match := _FIELD.fullmatch(key)) is None:
        return None
    part, field, entry = match.groups()
    return part, field, None if entry is None else int(entry)


def uniform_factors(column: Column) -> Column:
    """Values of the factor on all links; 1 where a map has one for each."""
    if isinstance(column, np.ndarray):
        return column
    return [1.0 if isinstance(value, dict) else value for value in column]


def nominal_values(parameters: Mapping[str, Any], base: Mapping[str, Any]) -> dict[str, Any]:
    """Values of the varied keys for the robot of which the robots of the runs are variations.

    Factors are 1. A part has the values of the base scenario; a part that this scenario lacks has
    the values of the parameters of a run.
    """
    values: dict[str, Any] = {}
    for key, value in parameters.items():
        field = _field_of(key)
        if key == SCALE_MASS or (is_robot_key(key) and field is None):
            values[key] = 1.0
        elif field is not None and field[0].removeprefix("robot.") not in base.get("robot", {}):
            values[key] = value
    return values


@dataclass(frozen=True, eq=False)
class VariedRobot:
    """The robot of runs that differ in masses, inertias and mounts.

    Attributes:
        model: The robot with nominal values.
        section: Section of the robot in the scenario.
        model_of: Builds the model of a run.
        present: Attitude and joints in whose spacecraft frame the path is stated; None for a path
            that does not depend on the robot.
    """

    model: FreeFloatingModel
    section: RobotSection
    model_of: Callable[[int], FreeFloatingModel]
    present: tuple[Array, Array] | None

    def accepts(self, values: Mapping[str, Column], count: int) -> BoolArray:
        """Which of ``count`` runs have values of a robot that an ensemble can represent."""
        factors, fields = _link_factors(values, count), self._fields(values, count)
        accepted = np.full(count, self.model.link_places.keys() >= factors.keys())
        if self.section.attached and any(".mount." in key for key in fields):
            accepted[:] = False
        for factor in factors.values():
            accepted &= _within(factor, *MASS_FACTORS)
        for key, array in fields.items():
            accepted &= _is_accepted(key, array)
        return accepted

    def robots(self, values: Mapping[str, Column], numbers: IntArray) -> Robots | None:
        """The robots of runs; None where all are the nominal one.

        Args:
            values: Values of the runs by key, which are accepted.
            numbers: Numbers of the runs, shape (K,).
        """
        count = len(numbers)
        factors, fields = _link_factors(values, count), self._fields(values, count)
        if not factors and not fields:
            return None
        description, scale = self.model.description, self.section.scale_mass
        spacecraft, payload = description.roots[0], description.links[-1].name
        links = {"robot.spacecraft": spacecraft, "robot.payload": payload}
        factor = scale.get if isinstance(scale, dict) else lambda link, _: scale
        rows = {
            link: self._row(part, fields, count) * factor(link, 1.0)
            for part, link in links.items()
            if any(f"{part}.{name}" in fields for name in ("mass", "inertia", "com"))
        }
        robots = Robots.of(
            self.model, numbers, self.model_of, factors=factors, rows=rows,
            mounts=self._mounts(fields, count),
        )  # fmt: skip
        return robots if self.present is None else robots.with_paths_from(*self.present)

    def _fields(self, values: Mapping[str, Column], count: int) -> dict[str, Array]:
        """Values of the varied fields of parts, (K, ...), NaN where they are no such numbers."""
        fields: dict[str, Array] = {}
        for key, column in values.items():
            parts = _field_of(key)
            if parts is None:
                continue
            part, name, index = parts
            field = f"{part}.{name}"
            nominal = self._nominal(field)
            if name == INERTIA:
                shape = (6,) if len(column) and np.shape(column[0]) == (6,) else (3,)
                fields[field] = _matrices(as_numbers(column, shape))
            elif index is None:
                fields[field] = as_numbers(column, nominal.shape)
            else:
                fields.setdefault(field, np.tile(nominal, (count, 1)))
                fields[field][:, index] = as_numbers(column, ())
        return fields

    def _nominal(self, key: str) -> Array:
        """The value of a field in the section, an inertia as a matrix."""
        value = np.array(attrgetter(key.removeprefix("robot."))(self.section), dtype=float)
        return _matrices(value) if key.endswith("inertia") else value

    def _row(self, part: str, fields: Mapping[str, Array], count: int) -> Array:
        """Mass, first moment and inertia of a part in its link's frame, shape (K, 10)."""
        mass, com, inertia = (
            fields.get(f"{part}.{name}", self._nominal(f"{part}.{name}"))
            for name in ("mass", "com", "inertia")
        )
        return inertial_row(np.broadcast_to(mass, count), np.broadcast_to(com, (count, 3)), inertia)

    def _mounts(self, fields: Mapping[str, Array], count: int) -> tuple[Pose, Array, Array] | None:
        """The mount of the section, and positions and rotations of the mounts of the runs."""
        keys = [f"robot.spacecraft.mount.{name}" for name in ("xyz", "rpy")]
        craft = self.section.spacecraft
        if craft is None or not any(key in fields for key in keys):
            return None
        values = [fields.get(key, self._nominal(key)) for key in keys]
        xyz, rpy = (np.broadcast_to(value, (count, 3)) for value in values)
        return craft.mount.to_mount().pose, xyz, Rotation.from_rpy(rpy).as_matrix()


def _link_factors(values: Mapping[str, Column], count: int) -> dict[str, Array]:
    """Factors on links by name, shape (K,), NaN where one is not a number."""
    factors: dict[str, Array] = {}
    for key, column in values.items():
        if key.startswith(f"{SCALE_MASS}."):
            factors[key.removeprefix(f"{SCALE_MASS}.")] = as_numbers(column, ())
        elif key == SCALE_MASS and not isinstance(column, np.ndarray):
            maps = [value if isinstance(value, dict) else {} for value in column]
            for link in {name: None for entry in maps for name in entry}:
                factors[link] = as_numbers([entry.get(link, 1.0) for entry in maps], ())
    return factors


def _matrices(inertia: Array) -> Array:
    """Inertias as matrices (..., 3, 3), from three or six moments or matrices."""
    if inertia.shape[-2:] == (3, 3):
        return inertia
    if inertia.shape[-1] == 6:
        return inertia[..., [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    return np.asarray(inertia[..., None] * np.eye(3))


def _within(array: Array, low: float, high: float) -> BoolArray:
    """Whether all numbers of each row are within bounds."""
    rows = array.reshape(len(array), -1)
    with np.errstate(invalid="ignore"):
        return np.asarray(((rows >= low) & (rows <= high)).all(axis=1))


def _is_accepted(key: str, array: Array) -> BoolArray:
    """Which values of a field scenarios accept, shape (K,)."""
    name = key.rpartition(".")[2]
    if name == "mass":
        return _within(array, float(np.finfo(float).tiny), LARGEST_NUMBER)
    if name == "rpy":
        return _within(array, -2.0 * np.pi, 2.0 * np.pi)
    accepted = _within(array, -LARGEST_NUMBER, LARGEST_NUMBER)
    if name == INERTIA:
        accepted &= are_inertias(np.where(accepted[:, None, None], array, np.eye(3)))
    return accepted


def are_inertias(values: Array) -> BoolArray:
    """Which values are inertias of rigid bodies, shape (K,).

    Args:
        values: Finite principal moments (K, 3), six moments (K, 6), or matrices (K, 3, 3).
    """
    matrices = _matrices(values)
    least, middle, largest = np.linalg.eigvalsh(matrices).T
    symmetric = (matrices == matrices.swapaxes(1, 2)).all(axis=(1, 2))
    return np.asarray(symmetric & (least > 0.0) & (least + middle >= largest * (1.0 - _TRIANGLE)))
