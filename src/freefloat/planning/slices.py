"""Cuts through the ball of rotation vectors: planes of attitudes, each followed.

A rotation vector points along the axis of a turn and is as long as its angle: all attitudes fill a
ball of radius pi, in whose centre the spacecraft's axes are the inertial ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from freefloat.ensemble.ensemble import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.attitude_map import AttitudeMap
from freefloat.so3 import Array, frozen

_TOLD = ("best", "robust", "nearest")
"""Keys of the document of a map whose attitudes are marked."""
_ACROSS = ((1, 2), (0, 2), (0, 1))
"""Of planes at right angles to x, y, z: the components drawn to the right and upwards."""


@dataclass(frozen=True, eq=False)
class Mark:
    """An attitude worth showing.

    Attributes:
        name: What it is: best, robust, nearest, chosen.
        attitude: Quaternion x, y, z, w, shape (4,).
        branch: Number of the arm branch; None for the best of a redundant arm, or for none.
    """

    name: str
    attitude: Array
    branch: int | None = None


@dataclass(frozen=True, eq=False)
class Slice:
    """A plane cut through the ball of rotation vectors.

    Attributes:
        mark: What lies in the plane; None for the centre of the ball.
        normal: Component that is the same all over the plane: 0, 1, 2.
        offset: That component [rad].
        ticks: Values of the other two components [rad], shape (P,).
        least: Largest S_min of the arm branches where one keeps the margin, zero where none does,
            nan farther than a step beyond the ball; a row for each value of the second component,
            shape (P, P).
        reached: Where an arm branch reaches the start of the path, shape (P, P).
    """

    mark: Mark | None
    normal: int
    offset: float
    ticks: Array
    least: Array
    reached: npt.NDArray[np.bool_]

    @property
    def across(self) -> tuple[int, int]:
        """The components that vary: from left to right, and upwards."""
        return _ACROSS[self.normal]


def told_marks(document: Mapping[str, Any]) -> list[Mark]:
    """The best, the most robust and the nearest attitude, as far as a map's document has them."""
    places = [(name, document[name]) for name in _TOLD if document.get(name) is not None]
    return [Mark(name, frozen(place["attitude"]), place["branch"]) for name, place in places]


def map_marks(found: AttitudeMap) -> list[Mark]:
    """The best, the most robust and the nearest attitude of a map, as far as it has them."""
    marks = {name: getattr(found, name) for name in _TOLD}
    return [Mark(name, at.attitude, at.branch) for name, at in marks.items() if at is not None]


def rotation_vectors(attitudes: npt.ArrayLike) -> Array:
    """Rotation vectors [rad], at most pi long, of attitudes (K, 4); shape (K, 3)."""
    return np.asarray(Rotation.from_quat(attitudes).as_rotvec())


def map_slices(
    outlook: FeasibilityEvaluator,
    marks: Sequence[Mark],
    progress: Progress | None = None,
    *,
    side: int = 51,
) -> tuple[Slice, ...]:
    """The three planes through each mark, at right angles to x, y and z, with S_min all over them.

    Args:
        outlook: Of a spatial problem.
        marks: Attitudes through which to cut; through the centre of the ball where there are none.
        progress: Called with the share done, in [0, 1].
        side: Attitudes along a diameter of the ball; fewer where arm branches have no closed form.
    """
    side = round(side / np.sqrt(outlook.sample_reduction)) // 2 * 2 + 1
    planes = [*_planes(marks)]
    slices = []
    for number, (mark, normal, offset) in enumerate(planes):
        slices.append(_cut(outlook, mark, normal, offset, side))
        if progress is not None:
            progress((number + 1) / len(planes))
    return tuple(slices)


def _planes(marks: Sequence[Mark]) -> Iterator[tuple[Mark | None, int, float]]:
    for mark in marks or (None,):
        centre = np.zeros(3) if mark is None else rotation_vectors(mark.attitude[None])[0]
        for normal in range(3):
            yield mark, normal, float(centre[normal])


def _cut(
    outlook: FeasibilityEvaluator, mark: Mark | None, normal: int, offset: float, side: int
) -> Slice:
    """One plane, followed wherever it lies in the ball."""
    ticks = np.linspace(-np.pi, np.pi, side)
    vectors = np.full((side, side, 3), offset)
    right, up = _ACROSS[normal]
    vectors[..., right], vectors[..., up] = np.meshgrid(ticks, ticks)
    inside = np.linalg.norm(vectors, axis=2) <= np.pi + ticks[1] - ticks[0]
    attitudes = Rotation.from_rotvec(vectors[inside]).as_quat()
    found = outlook.evaluate(attitudes, stop_at_margin=True)
    keeps = outlook.problem.margin.is_kept(found.margins)
    least, reached = np.full(inside.shape, np.nan), np.zeros(inside.shape, dtype=bool)
    least[inside] = np.where(keeps, found.margins, 0.0).max(axis=1, initial=0.0)
    reached[inside] = found.exist.any(axis=1)
    reached.setflags(write=False)
    return Slice(mark, normal, offset, frozen(ticks), frozen(least), reached)
