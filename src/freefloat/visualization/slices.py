"""Planar slices through the ball of rotation vectors, with the margin of every attitude.

The direction of a rotation vector is the axis of the rotation and its length the angle. All
attitudes form a ball of radius pi; at its centre the spacecraft's axes are the inertial ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from freefloat.concurrency import Progress
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.rotations import Rotation
from freefloat.so3 import Array, frozen

_ACROSS = ((1, 2), (0, 2), (0, 1))
"""Horizontal and vertical component of planes normal to x, y, z."""


@dataclass(frozen=True, eq=False)
class Mark:
    """A marked attitude.

    Attributes:
        name: One of best, robust, nearest, infeasible, now.
        attitude: Quaternion x, y, z, w, shape (4,).
        branch: Number of the arm branch; None for the best of a redundant arm, or for none.
    """

    name: str
    attitude: Array
    branch: int | None = None


@dataclass(frozen=True, eq=False)
class Slice:
    """A plane through the ball of rotation vectors.

    Attributes:
        mark: The marked attitude in the plane; None for the centre of the ball.
        normal: Component that is constant on the plane: 0, 1, 2.
        offset: Value of that component [rad].
        ticks: Values of the other two components [rad], shape (P,).
        margins: Largest minimum margin of the feasible arm branches, zero where none is feasible,
            NaN more than one step outside the ball; one row per value of the vertical component,
            shape (P, P).
        reached: Whether an arm branch reaches the start of the path, shape (P, P).
    """

    mark: Mark | None
    normal: int
    offset: float
    ticks: Array = field(repr=False)
    margins: Array = field(repr=False)
    reached: npt.NDArray[np.bool_] = field(repr=False)

    @property
    def across(self) -> tuple[int, int]:
        """The horizontal and the vertical component."""
        return _ACROSS[self.normal]

    @property
    def inside(self) -> npt.NDArray[np.bool_]:
        """Whether an attitude is in the ball, shape (P, P)."""
        squares = self.ticks**2
        return np.asarray(squares + squares[:, None] + self.offset**2 <= np.pi**2)


def map_marks(attitude_map: AttitudeMap) -> list[Mark]:
    """The best, the most robust and the nearest attitude of a map, those it has."""
    candidates = {name: getattr(attitude_map, name) for name in ("best", "robust", "nearest")}
    return [Mark(name, c.attitude, c.branch) for name, c in candidates.items() if c is not None]


def rotation_vectors(attitudes: npt.ArrayLike) -> Array:
    """Rotation vectors [rad], at most pi long, of attitudes (..., 4); shape (..., 3)."""
    return np.asarray(Rotation.from_quat(attitudes).as_rotvec())


def map_slices(
    evaluator: FeasibilityEvaluator,
    marks: Sequence[Mark],
    progress: Progress | None = None,
    *,
    side: int = 51,
) -> tuple[Slice, ...]:
    """The three planes through each mark, normal to x, y and z, with the minimum margins on them.

    Args:
        evaluator: Evaluator of a spatial problem.
        marks: Attitudes in the planes; without any, the planes pass through the ball's centre.
        progress: Called with the fraction done, in [0, 1].
        side: Attitudes along a diameter of the ball; fewer where arm branches have no closed form.
    """
    side = round(side / np.sqrt(evaluator.sample_reduction)) // 2 * 2 + 1
    centres: list[tuple[Mark | None, Array]]
    centres = [(mark, rotation_vectors(mark.attitude)) for mark in marks]
    centres = centres or [(None, np.zeros(3))]
    slices = []
    for mark, centre in centres:
        for normal in range(3):
            slices.append(_slice(evaluator, mark, normal, float(centre[normal]), side))
            if progress is not None:
                progress(len(slices) / (3 * len(centres)))
    return tuple(slices)


def _slice(
    evaluator: FeasibilityEvaluator, mark: Mark | None, normal: int, offset: float, side: int
) -> Slice:
    """One plane, evaluated inside the ball."""
    ticks = np.linspace(-np.pi, np.pi, side)
    vectors = np.full((side, side, 3), offset)
    horizontal, vertical = _ACROSS[normal]
    vectors[..., horizontal], vectors[..., vertical] = np.meshgrid(ticks, ticks)
    inside = np.linalg.norm(vectors, axis=2) <= np.pi + ticks[1] - ticks[0]
    attitudes = Rotation.from_rotvec(vectors[inside]).as_quat()
    result = evaluator.evaluate(attitudes, stop_at_margin=True)
    feasible = evaluator.problem.margin.keeps(result.margins)
    margins = np.full(inside.shape, np.nan)
    reached = np.zeros(inside.shape, dtype=bool)
    margins[inside] = np.where(feasible, result.margins, 0.0).max(axis=1, initial=0.0)
    reached[inside] = result.exist.any(axis=1)
    reached.setflags(write=False)
    return Slice(mark, normal, offset, frozen(ticks), frozen(margins), reached)
