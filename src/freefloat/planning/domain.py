"""The attitudes that a search considers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from freefloat.attitude_grids import attitude_grid, attitudes_within, ball_fraction, grid_spacing
from freefloat.dynamics.plane import Plane
from freefloat.errors import InputError
from freefloat.motion.problem import Problem
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray, angle_between, frozen

_LARGEST_ANGLE = 4.0 * np.pi
"""Largest present joint angle [rad]: larger ones are degrees."""
_HEADINGS = 2880
"""Headings between which the arm branch closest to the present joints changes once at most."""
_EXACT = 1e-10
"""Accuracy of the headings at which it changes [rad]."""
_ANGLE_ERROR = 1e-9
"""Rounding error of angles [rad]."""


@dataclass(frozen=True, eq=False)
class SearchDomain:
    """All attitudes, or those within an angle of one of them.

    Attributes:
        centre: Quaternion x, y, z, w.
        radius: Largest angle from the centre [rad]; pi for all attitudes.
    """

    centre: Array = field(default_factory=lambda: frozen([0.0, 0.0, 0.0, 1.0]))
    radius: float = np.pi

    @property
    def whole(self) -> bool:
        """Whether it has all attitudes."""
        return self.radius >= np.pi

    @property
    def fraction(self) -> float:
        """Its fraction of all attitudes in space."""
        return ball_fraction(self.radius)

    def contains(self, attitudes: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Which attitudes (..., 4) belong to it, shape (...)."""
        return np.asarray(angle_between(attitudes, self.centre) <= self.radius + _ANGLE_ERROR)

    def attitudes(self, count: int, seed: int = 0) -> Array:
        """Evenly distributed attitudes, shape (count, 4)."""
        if self.whole:
            return attitude_grid(count, seed)
        return attitudes_within(self.centre, self.radius, count, seed)

    def spacing(self, count: int) -> float:
        """Side [rad] of a cube with the volume that each of ``count`` attitudes represents."""
        return grid_spacing(count, self.radius)

    def headings(self, count: int, plane: Plane) -> Array:
        """Evenly spread headings [rad], rising, shape (count,); of all, from zero."""
        if self.whole:
            return frozen(np.arange(count) * (2.0 * np.pi / count))
        low, _ = self.heading_limits(plane)
        return frozen(low + (np.arange(count) + 0.5) * (2.0 * self.radius / count))

    def heading_limits(self, plane: Plane) -> tuple[float, float]:
        """First heading [rad], in [0, 2 pi), and last heading of planar attitudes."""
        low = (plane.heading(self.centre) - self.radius) % (2.0 * np.pi)
        return low, low + 2.0 * self.radius


def require_radians(model: FreeFloatingModel, joints: Array) -> None:
    """Raise an InputError where present joints (n,) are so large that they must be degrees."""
    largest = np.where(model.prismatic[: len(joints)], 0.0, np.abs(joints)).max()
    if largest > _LARGEST_ANGLE:
        accepted = "radians of at most two full rotations; 90 degrees are 1.5708"
        raise InputError("search.joints", f"{largest:g} rad was given", accepted)


def branch_changes(problem: Problem, known: Sequence[float] = ()) -> list[float]:
    """Headings [rad] at which another arm branch becomes the closest to the present joints.

    Also those next to headings that are known, however near each other.
    """

    def closest(headings: npt.NDArray[np.floating]) -> IntArray:
        exist = problem.many_branches(problem.plane.attitudes(headings)).exist
        return np.where(exist.any(axis=1), np.argmax(exist, axis=1), -1)

    even = np.arange(_HEADINGS) * (2.0 * np.pi / _HEADINGS)
    low = np.unique(np.concatenate([even, np.mod(known, 2.0 * np.pi)]))
    width = np.diff(low, append=2.0 * np.pi)
    before = closest(low)
    changed = before != np.roll(before, -1)
    low, before, width = low[changed], before[changed], width[changed]
    while width.max(initial=0.0) > _EXACT:
        width = width / 2.0
        low = low + np.where(closest(low + width) == before, width, 0.0)
    changes: list[float] = (low % (2.0 * np.pi)).tolist()
    return changes
