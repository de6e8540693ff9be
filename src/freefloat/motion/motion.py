"""A motion: configurations of spacecraft and arm, which can be evaluated at any time.

Between its nodes a motion is a polynomial of a parameter that need not be time, see
:mod:`freefloat.motion.panels`; so a motion that ends in a singularity, where rates by time have no
bound, is recorded as exactly as any other.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev

from freefloat.dynamics.inverse_dynamics import Forces
from freefloat.errors import InputError, number_array
from freefloat.motion.law import JointLaw, PathLaw
from freefloat.motion.panels import DEGREE, NODES, TO_COEFFICIENTS, parameters_at, require_nodes
from freefloat.motion.problem import Problem
from freefloat.motion.residuals import Residuals, momentum_errors, path_errors
from freefloat.motion.setting import Setting
from freefloat.records import Joints, Quaternions, Times, derived
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, IntArray, Pose, frozen


class Ending(Enum):
    """How a motion along a path ended; the value is the sentence shown in tables."""

    COMPLETED = "The whole path was followed."
    PART = "The part of the path that was asked for was followed."
    SINGULAR = "The arm became singular."
    MARGIN = "The margin to a dynamic singularity was used up."


@dataclass(frozen=True, eq=False)
class State:
    """The system at an instant.

    Attributes:
        time: Time [s].
        attitude: Attitude of the spacecraft, unit quaternion x, y, z, w, shape (4,).
        joints: Joint values [rad or m], shape (n,).
        base_position: Position of the root link from the centre of mass [m], shape (3,).
    """

    time: float
    attitude: Array
    joints: Array
    base_position: Array

    def to_dict(self) -> dict[str, Any]:
        """The state as a JSON document."""
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in vars(self).items()}


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of spacecraft and arm along the end-effector's path, or with prescribed joints.

    Panel k holds the nodes 8 k to 8 k + 8; neighbours share a node.

    Attributes:
        law: What moves the arm: the path of a problem, or prescribed joints.
        ending: How it ended.
        times: Times of the nodes [s], shape (N,); falling for a motion integrated backward.
        attitudes: Attitudes of the spacecraft, unit quaternions x, y, z, w, shape (N, 4).
        joints: Joint values [rad or m], shape (N, n).

    Raises:
        InputError: If these are not the nodes of whole panels, with finite numbers, unit
            quaternions of which neighbours are near, and times that rise or fall.
    """

    law: PathLaw | JointLaw = field(repr=False)
    ending: Ending
    times: Times = field(repr=False)
    attitudes: Quaternions = field(repr=False)
    joints: Joints = field(repr=False)

    def __post_init__(self) -> None:
        for name in ("times", "attitudes", "joints"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        require_nodes(self.times, self.attitudes, self.joints, self.model.dof)

    @property
    def setting(self) -> Setting:
        """Robot, momentum and scene."""
        return self.law.setting

    @property
    def problem(self) -> Problem:
        """The problem whose path is followed; an InputError where joints are prescribed."""
        return self.law.problem

    @property
    def model(self) -> FreeFloatingModel:
        """The robot."""
        return self.law.setting.model

    @property
    def panels(self) -> int:
        """Number of panels; zero for a motion that ends where it begins."""
        return (len(self.times) - 1) // DEGREE

    @property
    def panel_nodes(self) -> IntArray:
        """Indices of the nodes of every panel, shape (panels, 9)."""
        nodes = DEGREE * np.arange(self.panels)[:, None] + np.arange(DEGREE + 1)
        nodes.setflags(write=False)
        return nodes

    @property
    def completed(self) -> bool:
        """Whether the path, or the joint curve, was followed as far as was asked for."""
        return self.ending in (Ending.COMPLETED, Ending.PART)

    @property
    def outcome(self) -> str:
        """How the motion ended, in a sentence."""
        return self.law.followed if self.ending is Ending.COMPLETED else self.ending.value

    @derived
    def base_positions(self) -> Annotated[Array, "m"]:
        """Root link relative to the centre of mass, at the nodes [m], shape (N, 3)."""
        return frozen(self.model.base_position(self.attitudes, self.joints))

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
        """Chebyshev coefficients of (time, attitude, joints), shape (panels, 9, 5 + n)."""
        values = np.column_stack([self.times, self.attitudes, self.joints])
        return frozen(TO_COEFFICIENTS @ values[self.panel_nodes])

    @cached_property
    def node_coordinates(self) -> Array:
        """Panel coordinates of the nodes, see :meth:`evaluate`, shape (N,)."""
        inner = np.arange(self.panels)[:, None] + (NODES[:-1] + 1.0) / 2.0
        return frozen(np.append(inner.ravel(), self.panels))

    @cached_property
    def node_rates(self) -> Array:
        """Rates of spacecraft and joints at the nodes of every panel, shape (panels, 9, 3 + n)."""
        rates = np.concatenate(self.law.rates(*self._panel_arguments), axis=1)
        return frozen(rates.reshape(-1, DEGREE + 1, rates.shape[1]))

    @cached_property
    def node_effort(self) -> Forces:
        """Rates, accelerations and forces at the nodes, arrays of shape (panels, 9, ...)."""
        values = vars(self.law.effort(*self._panel_arguments)).values()
        return Forces(*(frozen(rows.reshape(-1, DEGREE + 1, rows.shape[-1])) for rows in values))

    @property
    def _panel_arguments(self) -> tuple[Array, Array, Array, IntArray]:
        """What laws take of the states at the nodes of every panel."""
        which, panels = self.panel_nodes.ravel(), np.repeat(np.arange(self.panels), DEGREE + 1)
        segments = self.timing_segment(panels)
        return self.times[which], self.attitudes[which], self.joints[which], segments

    def at(self, panel: IntArray, x: Array) -> tuple[Array, Array, Array]:
        """Times (K,), attitudes (K, 4) and joints (K, n) in panels, at parameters from -1 to 1."""
        basis = chebyshev.chebvander(x, DEGREE)
        values = np.einsum("ij,ijc->ic", basis, self.coefficients[panel])
        attitudes = values[:, 1:5] / np.linalg.norm(values[:, 1:5], axis=1, keepdims=True)
        return values[:, 0], attitudes, values[:, 5:]

    def _located(self, u: npt.ArrayLike) -> tuple[IntArray, Array]:
        """Panels and their parameters, shape (K,) each, of panel coordinates (K,)."""
        u = np.atleast_1d(np.asarray(u, dtype=float))
        panel = np.clip(u.astype(np.int64), 0, self.panels - 1)
        return panel, np.asarray(2.0 * (u - panel) - 1.0)

    def timing_segment(self, panel: IntArray) -> IntArray:
        """Numbers of the segments of the time law that hold in panels."""
        first, last = self.times[DEGREE * panel], self.times[DEGREE * (panel + 1)]
        return np.asarray(self.law.timing.segment_at((first + last) / 2.0))

    def evaluate(self, u: npt.ArrayLike) -> tuple[Array, Array, Array]:
        """Times (K,), attitudes (K, 4) and joints (K, n) at panel coordinates (K,).

        Panel coordinates are k to k + 1 in panel k.
        """
        if not self.panels:
            node = np.zeros(np.size(u), dtype=int)
            return self.times[node], self.attitudes[node], self.joints[node]
        return self.at(*self._located(u))

    def time_at(self, u: float) -> float:
        """The time at a panel coordinate, within the motion [s]; exact at the ends of panels."""
        if float(u).is_integer():
            return float(self.times[DEGREE * int(u)])
        return float(np.clip(self.evaluate(u)[0][0], self.times.min(), self.times.max()))

    def coordinates_at(self, times: npt.ArrayLike) -> Array:
        """Panel coordinates at which the motion is at given times [s], shape (K,).

        Raises:
            InputError: If a time lies outside the motion.
        """
        times = np.atleast_1d(number_array("times", times, "times [s]"))
        if times.ndim != 1:
            raise InputError("times", f"shape {times.shape} was given", "shape (K,)")
        first, last = sorted((float(self.times[0]), float(self.times[-1])))
        if ((times < first) | (times > last)).any() or np.isnan(times).any():
            given = f"{times.min():g} to {times.max():g} s was given"
            raise InputError("times", given, f"{first:g} to {last:g} s, where the motion is known")
        sign = 1.0 if self.times[-1] >= self.times[0] else -1.0
        if not self.panels:
            return np.zeros(len(times))
        panel = np.searchsorted(sign * self.times[DEGREE:-1:DEGREE], sign * times)
        x = parameters_at(sign * self.coefficients[panel, :, 0], sign * times)
        u = np.where(times == self.times[0], 0.0, panel + (x + 1.0) / 2.0)
        # at a singularity, where time reverses, u is known to half the digits only
        return np.where(times == self.times[-1], float(self.panels), u)

    def sample(self, times: npt.ArrayLike) -> tuple[State, ...]:
        """The states at given times [s], shape (K,).

        Raises:
            InputError: If a time lies outside the motion.
        """
        _, attitudes, joints = self.evaluate(self.coordinates_at(times))
        times = np.atleast_1d(np.asarray(times, dtype=float))
        positions = self.model.base_position(attitudes, joints)
        states = zip(times.tolist(), attitudes, joints, positions, strict=True)
        return tuple(State(t, *map(frozen, vectors)) for t, *vectors in states)

    def ways(self, count: int) -> dict[str, Pose]:
        """Some poses along the path of each end-effector, or along its way without a path.

        They are by the name of the arm, which is empty for the first one.
        """
        _, attitudes, joints = self.evaluate(np.linspace(0.0, self.panels, count))
        return self.law.ways(self.model.end_effector_pose(attitudes, joints))

    def cut(self, u: float, ending: Ending) -> Motion:
        """The motion up to a panel coordinate, ending there."""
        whole = min(int(u), max(self.panels - 1, 0))
        before = slice(0, DEGREE * whole + 1)
        last = NODES[1:] if u > whole else NODES[:0]
        t, a, q = self.evaluate(whole + (u - whole) * (last + 1.0) / 2.0)
        nodes = (self.times, t), (self.attitudes, a), (self.joints, q)
        times, attitudes, joints = (np.concatenate([x[before], y]) for x, y in nodes)
        return Motion(self.law, ending, times, attitudes, joints)

    def residuals(self) -> Residuals:
        """Largest distance from the path and deviation of the momentum."""
        position, orientation = np.max(self.end_effector_errors, axis=0)
        panel = np.repeat(np.arange(self.panels), DEGREE + 1)
        momentum = self._momentum_errors(panel, np.tile(NODES, self.panels))
        largest = float(np.max(momentum, initial=0.0, where=np.isfinite(momentum)))
        oriented = self.problem.task.prescribes_orientation
        return Residuals(float(position), float(orientation) if oriented else None, largest)

    @cached_property
    def end_effector_errors(self) -> Array:
        """Errors of the end-effector at the nodes, see :func:`path_errors`, shape (N, 2)."""
        return frozen(path_errors(self.problem, self.times, self.attitudes, self.joints))

    @cached_property
    def _panel_states(self) -> Array:
        """Time, attitude, joints and base position at the nodes, shape (panels, 9, 8 + n)."""
        states = [self.times, self.attitudes, self.joints, self.base_positions]
        return frozen(np.column_stack(states)[self.panel_nodes])

    def momentum_errors(self, u: npt.ArrayLike) -> Array:
        """Deviations (K,) from the prescribed angular momentum at panel coordinates (K,) [N m s].

        They are recomputed from the recorded configurations alone, by the derivatives of the
        panels' polynomials, time included; nan in panels without motion and where time nearly
        stands still.
        """
        if not self.panels:
            return np.full(np.size(u), np.nan)
        return self._momentum_errors(*self._located(u))

    def _momentum_errors(self, panel: IntArray, x: Array) -> Array:
        system, duration = self.setting.system, self.law.timing.duration
        return momentum_errors(system, duration, self._panel_states, panel, x)
