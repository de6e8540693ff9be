"""A motion: what spacecraft and arm do, as a record that can be evaluated and proves itself.

The record holds configurations at the nodes of consecutive panels. Inside a panel time, attitude
and joints are polynomials of a parameter that need not be time; so a motion that ends in a
singularity, where rates by time have no bound, is recorded as exactly as any other.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev

from freefloat.dynamics import momentum_map
from freefloat.errors import InputError
from freefloat.problem import Problem
from freefloat.spatial import Array, frozen, rotation_matrix, turn_between

DEGREE = 8
"""Of the polynomials inside a panel; one above the integrator's dense output."""
NODES = frozen(chebyshev.chebpts2(DEGREE + 1))
"""Where a panel is sampled, in [-1, 1], ends included."""

_TO_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(NODES, DEGREE))
_DERIVATIVE = chebyshev.chebval(NODES, chebyshev.chebder(_TO_COEFFICIENTS)).T
_BISECTIONS = 60
_UNRESOLVED = 1e-7
"""Changes smaller than this leave derivatives to rounding [rad, m, share of the duration]."""
_NEARLY_STILL = 1e-2
"""Where time passes slower than this share of its pace in the panel, no rates are formed."""


class Ending(Enum):
    """How a motion ended; the value is the sentence shown to people."""

    COMPLETED = "The whole path was followed."
    SINGULAR = "The arm became dynamically singular."
    MARGIN = "The margin to a dynamic singularity was used up."


@dataclass(frozen=True, eq=False)
class State:
    """The system at an instant.

    Attributes:
        time: [s].
        attitude: Of the spacecraft, unit quaternion x, y, z, w, shape (4,).
        joints: Joint values, shape (n,).
        base_position: Of the spacecraft's root link from the centre of mass [m], shape (3,).
    """

    time: float
    attitude: Array
    joints: Array
    base_position: Array


@dataclass(frozen=True)
class Residuals:
    """How well a motion does what it should; zero is perfect.

    Attributes:
        end_effector_position: Largest distance from the path [m].
        end_effector_attitude: Largest angle from the path's attitude [rad]; None where the task
            leaves the attitude free.
        momentum: Largest deviation of the angular momentum from the one given [N m s], recomputed
            from the recorded configurations alone by differentiating their polynomials.
    """

    end_effector_position: float
    end_effector_attitude: float | None
    momentum: float


@dataclass(frozen=True, eq=False)
class Motion:
    """What the spacecraft and the arm do while the end-effector follows its path.

    Panel k holds the nodes 8 k to 8 k + 8; neighbours share a node.

    Attributes:
        problem: What was asked.
        ending: How it ended.
        times: At the nodes [s], shape (N,); falling for a motion integrated in reverse.
        attitudes: Of the spacecraft, unit quaternions x, y, z, w, shape (N, 4).
        joints: Joint values, shape (N, n).
    """

    problem: Problem
    ending: Ending
    times: Array
    attitudes: Array
    joints: Array

    def __post_init__(self) -> None:
        for name in ("times", "attitudes", "joints"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __reduce__(self) -> tuple[type[Motion], tuple[Any, ...]]:
        """Made anew on unpickling, so that its arrays are read-only there, too."""
        return Motion, (self.problem, self.ending, self.times, self.attitudes, self.joints)

    @property
    def panels(self) -> int:
        """Number of panels; zero for a motion that ends where it begins."""
        return (len(self.times) - 1) // DEGREE

    @property
    def completed(self) -> bool:
        """Whether the whole path was followed."""
        return self.ending is Ending.COMPLETED

    @cached_property
    def base_positions(self) -> Array:
        """Of the spacecraft's root link from the centre of mass at the nodes [m], shape (N, 3)."""
        base_position = self.problem.model.base_position
        nodes = zip(self.attitudes, self.joints, strict=True)
        return frozen([base_position(attitude, joints) for attitude, joints in nodes])

    @property
    def initial(self) -> State:
        """The first state."""
        return self._node(0)

    @property
    def final(self) -> State:
        """The last state."""
        return self._node(-1)

    def _node(self, index: int) -> State:
        return State(float(self.times[index]), self.attitudes[index], self.joints[index],
                     self.base_positions[index])  # fmt: skip

    @cached_property
    def _coefficients(self) -> Array:
        """Chebyshev coefficients of (time, attitude, joints), shape (panels, 9, 5 + n)."""
        return np.asarray(_TO_COEFFICIENTS @ self._values)

    @property
    def _values(self) -> Array:
        """(time, attitude, joints) at the nodes of every panel, shape (panels, 9, 5 + n)."""
        values = np.column_stack([self.times, self.attitudes, self.joints])
        nodes = DEGREE * np.arange(self.panels)[:, None] + np.arange(DEGREE + 1)
        return np.asarray(values[nodes])

    @cached_property
    def node_places(self) -> Array:
        """Panel coordinates of the nodes, see :meth:`at_place`, shape (N,)."""
        inner = np.arange(self.panels)[:, None] + (NODES[:-1] + 1.0) / 2.0
        return frozen(np.append(inner.ravel(), self.panels))

    def at_place(self, place: npt.ArrayLike) -> tuple[Array, Array, Array]:
        """Evaluate the motion by panel coordinate.

        Args:
            place: k to k + 1 in panel k, shape (K,).

        Returns:
            Times (K,), attitudes (K, 4) and joints (K, n).
        """
        places = np.atleast_1d(np.asarray(place, dtype=float))
        if not self.panels:
            alone = np.zeros(len(places), dtype=int)
            return self.times[alone], self.attitudes[alone], self.joints[alone]
        panel = np.clip(places.astype(int), 0, self.panels - 1)
        basis = chebyshev.chebvander(2.0 * (places - panel) - 1.0, DEGREE)
        values = np.einsum("ij,ijc->ic", basis, self._coefficients[panel])
        attitudes = values[:, 1:5] / np.linalg.norm(values[:, 1:5], axis=1, keepdims=True)
        return values[:, 0], attitudes, values[:, 5:]

    def place_of(self, times: npt.ArrayLike) -> Array:
        """Panel coordinates at which the motion is at given times, by bisection, shape (K,)."""
        wanted = np.atleast_1d(np.asarray(times, dtype=float))
        first, last = sorted((float(self.times[0]), float(self.times[-1])))
        if ((wanted < first) | (wanted > last)).any() or np.isnan(wanted).any():
            raise InputError(
                "times", f"{wanted.min():g} to {wanted.max():g} s asked for",
                f"{first:g} to {last:g} s, where the motion is known",
            )  # fmt: skip
        sign = 1.0 if self.times[-1] >= self.times[0] else -1.0
        low = np.searchsorted(sign * self.times[DEGREE:-1:DEGREE], sign * wanted).astype(float)
        high = low + 1.0
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2.0
            early = sign * self.at_place(middle)[0] < sign * wanted
            low, high = np.where(early, middle, low), np.where(early, high, middle)
        return np.asarray((low + high) / 2.0)

    def sample(self, times: npt.ArrayLike) -> tuple[State, ...]:
        """The system at given times [s], shape (K,).

        Raises:
            InputError: If a time lies outside the motion.
        """
        wanted = np.atleast_1d(np.asarray(times, dtype=float))
        _, attitudes, joints = self.at_place(self.place_of(wanted))
        model = self.problem.model
        return tuple(
            State(float(t), frozen(a), frozen(q), frozen(model.base_position(a, q)))
            for t, a, q in zip(wanted, attitudes, joints, strict=True)
        )

    def cut(self, place: float, ending: Ending) -> Motion:
        """The motion up to a panel coordinate, ending there."""
        whole = min(int(place), max(self.panels - 1, 0))
        kept = slice(0, DEGREE * whole + 1)
        nodes = NODES[1:] if place > whole else NODES[:0]
        t, a, q = self.at_place(whole + (place - whole) * (nodes + 1.0) / 2.0)
        return Motion(
            self.problem,
            ending,
            np.concatenate([self.times[kept], t]),
            np.vstack([self.attitudes[kept], a]),
            np.vstack([self.joints[kept], q]),
        )

    def residuals(self) -> Residuals:
        """How well the recorded configurations follow the path and keep the momentum."""
        errors = np.array([
            self._pose_error(t, a, q)
            for t, a, q in zip(self.times, self.attitudes, self.joints, strict=True)
        ])  # fmt: skip
        worst = np.max(errors, axis=0)
        return Residuals(
            end_effector_position=float(worst[0]),
            end_effector_attitude=float(worst[1]) if self.problem.task.turns else None,
            momentum=self._momentum_residual(),
        )

    def _pose_error(self, t: float, attitude: Array, joints: Array) -> tuple[float, float]:
        task, wanted = self.problem.task, self.problem.path.pose(t)
        is_ = self.problem.model.end_effector_pose(attitude, joints)
        off = (is_.position - wanted.position)[[row for row in task.rows if row < 3]]
        turn = turn_between(is_.rotation, wanted.rotation)[
            [row - 3 for row in task.rows if row > 2]
        ]
        return float(np.linalg.norm(off)), float(np.linalg.norm(turn))

    def _momentum_residual(self) -> float:
        """By panel: derivatives by the parameter of everything recorded, time included.

        A panel across which next to nothing changes has no derivatives worth the name.
        """
        worst, model, h = 0.0, self.problem.model, self.problem.momentum
        scale = np.ones(self.joints.shape[1] + 5)
        scale[0] = self.problem.path.duration
        for panel, values in enumerate(self._values):
            if (np.ptp(values, axis=0) / scale).max() < _UNRESOLVED:
                continue
            nodes = slice(DEGREE * panel, DEGREE * panel + DEGREE + 1)
            rates = _DERIVATIVE @ np.column_stack([values, self.base_positions[nodes]])
            pace = np.abs(rates[:, 0])
            for k in np.flatnonzero(pace > _NEARLY_STILL * pace.max()):
                attitude, joints = values[k, 1:5], values[k, 5:]
                by_time = rates[k, 1:] / rates[k, 0]
                base = rotation_matrix(attitude).T @ by_time[-3:]
                turning = _angular_velocity(attitude, by_time[:4])
                v = np.concatenate([base, turning, by_time[4:-3]])
                found = momentum_map(model, joints, attitude) @ v
                worst = max(worst, float(np.linalg.norm(found[3:] - h)))
        return worst


def _angular_velocity(attitude: Array, rate: Array) -> Array:
    """Spacecraft-frame angular velocity from a unit quaternion's derivative: (8c) inverted."""
    x, w = attitude[:3], attitude[3]
    return np.asarray(2.0 * (w * rate[:3] - rate[3] * x - np.cross(x, rate[:3])))
