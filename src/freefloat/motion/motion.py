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

from freefloat.brief import brief
from freefloat.dynamics.momentum import momentum_map
from freefloat.errors import InputError
from freefloat.motion.problem import Problem
from freefloat.so3 import Array, IntArray, cross, frozen, rotation_matrix, rotation_vector_between

DEGREE = 8
"""Of the polynomials inside a panel; one above the integrator's dense output."""
NODES = frozen(chebyshev.chebpts2(DEGREE + 1))
"""Where a panel is sampled, in [-1, 1], ends included."""

_TO_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(NODES, DEGREE))
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

    __repr__ = brief

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

    __repr__ = brief

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
    def coefficients(self) -> Array:
        """Chebyshev coefficients of (time, attitude, joints), shape (panels, 9, 5 + n).

        Of a panel's own parameter, which runs from -1 to 1.
        """
        return np.asarray(_TO_COEFFICIENTS @ self._values)

    @property
    def _values(self) -> Array:
        """(time, attitude, joints) at the nodes of every panel, shape (panels, 9, 5 + n)."""
        values = np.column_stack([self.times, self.attitudes, self.joints])
        nodes = DEGREE * np.arange(self.panels)[:, None] + np.arange(DEGREE + 1)
        return np.asarray(values[nodes])

    @cached_property
    def node_parameters(self) -> Array:
        """Panel coordinates of the nodes, see :meth:`evaluate`, shape (N,)."""
        inner = np.arange(self.panels)[:, None] + (NODES[:-1] + 1.0) / 2.0
        return frozen(np.append(inner.ravel(), self.panels))

    def evaluate(self, place: npt.ArrayLike) -> tuple[Array, Array, Array]:
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
        panel, x = self._inside(places)
        basis = chebyshev.chebvander(x, DEGREE)
        values = np.einsum("ij,ijc->ic", basis, self.coefficients[panel])
        attitudes = values[:, 1:5] / np.linalg.norm(values[:, 1:5], axis=1, keepdims=True)
        return values[:, 0], attitudes, values[:, 5:]

    def _inside(self, place: npt.ArrayLike) -> tuple[IntArray, Array]:
        """Panels and where in them, -1 to 1."""
        places = np.atleast_1d(np.asarray(place, dtype=float))
        panel = np.clip(places.astype(np.int64), 0, self.panels - 1)
        return panel, np.asarray(2.0 * (places - panel) - 1.0)

    def parameter_at(self, times: npt.ArrayLike) -> Array:
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
            early = sign * self.evaluate(middle)[0] < sign * wanted
            low, high = np.where(early, middle, low), np.where(early, high, middle)
        found = np.where(wanted == self.times[0], 0.0, (low + high) / 2.0)
        # where time turns, at a singularity, its place is known to half the digits only
        return np.where(wanted == self.times[-1], float(self.panels), found)

    def sample(self, times: npt.ArrayLike) -> tuple[State, ...]:
        """The system at given times [s], shape (K,).

        Raises:
            InputError: If a time lies outside the motion.
        """
        wanted = np.atleast_1d(np.asarray(times, dtype=float))
        _, attitudes, joints = self.evaluate(self.parameter_at(wanted))
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
        t, a, q = self.evaluate(whole + (place - whole) * (nodes + 1.0) / 2.0)
        return Motion(
            self.problem,
            ending,
            np.concatenate([self.times[kept], t]),
            np.vstack([self.attitudes[kept], a]),
            np.vstack([self.joints[kept], q]),
        )

    def residuals(self) -> Residuals:
        """How well the recorded configurations follow the path and keep the momentum."""
        position, attitude = np.max(self.end_effector_errors, axis=0)
        panel = np.repeat(np.arange(self.panels), DEGREE + 1)
        momentum = self._momentum_errors(panel, np.tile(NODES, self.panels))
        return Residuals(
            end_effector_position=float(position),
            end_effector_attitude=float(attitude) if self.problem.task.turns else None,
            momentum=float(np.max(momentum, initial=0.0, where=np.isfinite(momentum))),
        )

    @cached_property
    def end_effector_errors(self) -> Array:
        """Distance from the path [m] and angle from its attitude [rad] at the nodes, (N, 2).

        Only what the task prescribes counts.
        """
        task, model, path = self.problem.task, self.problem.model, self.problem.path
        nodes = zip(self.attitudes, self.joints, strict=True)
        found = [model.end_effector_pose(attitude, joints) for attitude, joints in nodes]
        wanted = [path.pose(float(t)) for t in self.times]
        off = np.array([a.position - b.position for a, b in zip(found, wanted, strict=True)])
        turn = rotation_vector_between(
            [one.rotation for one in found], [one.rotation for one in wanted]
        )
        errors = [off[:, [row for row in task.rows if row < 3]],
                  turn[:, [row - 3 for row in task.rows if row > 2]]]  # fmt: skip
        return frozen(np.column_stack([np.linalg.norm(error, axis=1) for error in errors]))

    def momentum_errors(self, place: npt.ArrayLike) -> Array:
        """Deviation of the angular momentum from the one given, recomputed from what is recorded.

        Args:
            place: Panel coordinates, shape (K,).

        Returns:
            Magnitudes [N m s], shape (K,); nan where next to nothing changes or time nearly stands
            still, so that there are no rates by time worth the name.
        """
        if not self.panels:
            return np.full(np.shape(np.atleast_1d(place)), np.nan)
        return self._momentum_errors(*self._inside(place))

    def _momentum_errors(self, panel: IntArray, x: Array) -> Array:
        """By derivatives of everything recorded, time included, by the panels' parameter."""
        errors = np.full(len(x), np.nan)
        scale = np.ones(self.joints.shape[1] + 5)
        scale[0] = self.problem.path.duration
        all_values = self._values
        for k in np.unique(panel):
            values = all_values[k]
            if (np.ptp(values, axis=0) / scale).max() < _UNRESOLVED:
                continue
            nodes = slice(DEGREE * k, DEGREE * k + DEGREE + 1)
            c = _TO_COEFFICIENTS @ np.column_stack([values, self.base_positions[nodes]])
            slope = chebyshev.chebder(c)
            still = _NEARLY_STILL * np.abs(chebyshev.chebval(NODES, slope[:, 0])).max()
            mine = np.flatnonzero(panel == k)
            known, rates = (chebyshev.chebval(x[mine], series).T for series in (c, slope))
            for i, value, rate in zip(mine, known, rates, strict=True):
                if abs(rate[0]) > still:
                    errors[i] = self._momentum_error(value, rate)
        return errors

    def _momentum_error(self, values: Array, rates: Array) -> float:
        """From (time, attitude, joints, base position) and their derivatives."""
        size = np.linalg.norm(values[1:5])
        attitude, joints, by_time = values[1:5] / size, values[5:-3], rates[1:] / rates[0]
        base = rotation_matrix(attitude).T @ by_time[-3:]
        turning = _angular_velocity(attitude, by_time[:4] / size)
        v = np.concatenate([base, turning, by_time[4:-3]])
        found = momentum_map(self.problem.model, joints, attitude) @ v
        return float(np.linalg.norm(found[3:] - self.problem.momentum))


def _angular_velocity(attitude: Array, rate: Array) -> Array:
    """Spacecraft-frame angular velocity from a unit quaternion's derivative: (8c) inverted."""
    x, w = attitude[:3], attitude[3]
    return np.asarray(2.0 * (w * rate[:3] - rate[3] * x - cross(x, rate[:3])))
