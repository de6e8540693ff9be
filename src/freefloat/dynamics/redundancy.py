"""Settings of redundant arms: metric of the joint rates and objective of the null-space motion."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from freefloat.dynamics.tasks import Task, prescribed_rows
from freefloat.errors import InputError, did_you_mean, finite_number, member, require_type
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array

SINGULAR_SPEED = 2e4
"""Joint speed times duration above which integrators take a redundant arm for singular, and of
which ``simulate`` warns [rad, m]."""
SPINNING_SPEED = 3e2
"""Joint speed times duration for the task ``pointing``: an arm that rolls about its last axis spins
that joint as a reaction wheel of tiny effect where it would otherwise become singular."""
_LARGEST_WEIGHT = 1e6
LARGEST_GAIN = 1e6
"""Largest gain and bound of the null-space motion."""


def singular_speed(task: Task) -> float:
    """Joint speed times duration from which a redundant arm counts as singular [rad, m]."""
    return SPINNING_SPEED if task is Task.POINTING else SINGULAR_SPEED


class Metric(StrEnum):
    """What the joint rates minimize.

    ``JOINTS``: their Euclidean norm [rad/s, m/s]. ``ENERGY``: the kinetic energy of the
    free-floating system, apart from the momentum's constant contribution.
    """

    JOINTS = "joints"
    ENERGY = "energy"


class Toward(StrEnum):
    """Objective of the null-space motion.

    ``MANIPULABILITY``: the product of the singular values of S*, which scenarios call ``sigma``, as
    they do the measure that is the smallest one alone. ``MIDDLE``: the centres of the joint ranges.
    """

    NONE = "none"
    MANIPULABILITY = "sigma"
    MIDDLE = "middle"


@dataclass(frozen=True, eq=False)
class Redundancy:
    """Null-space motion of a redundant arm, see :mod:`freefloat.dynamics.resolved_rates`.

    Attributes:
        metric: What the joint rates minimize; a map from joint to weight for the sum of weight
            times rate squared, in which the other joints have weight 1.
        toward: Objective of the null-space motion.
        gain: Gain of the attraction over the path, dimensionless.
        bound: Smooth upper bound of the length, over the path, of the motion due to the attraction;
            motion due to ``metric`` is not bounded [rad, m].

    Example:
        >>> ff.Redundancy(metric="energy", toward="middle").gain
        1.0
    """

    metric: Metric | Mapping[str, float] = Metric.JOINTS
    toward: Toward = Toward.NONE
    gain: float = 1.0
    bound: float = 3.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "metric", _checked_metric(self.metric))
        object.__setattr__(self, "toward", member("redundancy.toward", Toward, self.toward))
        accepted = "0 to 1e+06, per path"
        finite_number("redundancy.gain", self.gain, accepted, 0.0, LARGEST_GAIN)
        accepted = "above 0, up to 1e+06"
        finite_number("redundancy.bound", self.bound, accepted, sys.float_info.min, LARGEST_GAIN)

    @property
    def minimum_norm(self) -> bool:
        """Whether the joint rates have minimum Euclidean norm."""
        return self.metric is Metric.JOINTS and self.toward is Toward.NONE

    @property
    def weights(self) -> Mapping[str, float]:
        """Weights by joint, apart from weights of 1."""
        return {} if isinstance(self.metric, Metric) else self.metric

    def to_dict(self) -> dict[str, Any]:
        """The settings as a JSON document."""
        metric = dict(self.weights) or str(self.metric)
        gains = {"gain": float(self.gain), "bound": float(self.bound)}
        return {"metric": metric, "toward": str(self.toward), **gains}

    def require_applicable(self, model: FreeFloatingModel, task: Task) -> None:
        """Raise an InputError if the settings do not apply to an arm and a task."""
        arm = model.joint_names[: model.arm_dof]
        rows = prescribed_rows(model, task)
        if len(arm) <= len(rows):
            raise InputError(
                "redundancy",
                f"the task prescribes {len(rows)} rates and the arm has {len(arm)} joints: "
                "not redundant",
                "no such key, or a task that prescribes less",
            )
        for joint in self.weights:
            if joint not in arm:
                raise InputError(
                    f"redundancy.metric.{joint}",
                    f"there is no such moving joint{did_you_mean(joint, arm)}",
                    ", ".join(arm),
                )
        if model.arms and self.metric is Metric.ENERGY:
            problem = "energy, but another arm moves along a joint curve"
            raise InputError("redundancy.metric", problem, "joints or weights of joints")
        if model.on_table and model.path_arms and self.metric is Metric.ENERGY:
            problem = "energy, but several arms follow paths on a table"
            raise InputError("redundancy.metric", problem, "joints or weights of joints")
        massless = not any(body.mass for body in model.bodies[1 : 1 + len(arm)])
        if self.metric is Metric.ENERGY and massless:
            accepted = "joints, or an arm with mass"
            raise InputError("redundancy.metric", "energy, but the arm has no mass", accepted)
        if self.toward is Toward.MIDDLE and not np.isfinite(range_centres(model)[: len(arm)]).any():
            raise InputError(
                "redundancy.toward", "middle, but no joint of this arm has a range", "none or sigma"
            )


def _checked_metric(metric: Any) -> Metric | Mapping[str, float]:
    if isinstance(metric, str) and metric in tuple(Metric):
        return Metric(metric)
    accepted = "joints, energy, or a map from joint to weight"
    require_type("redundancy.metric", metric, Mapping, accepted)
    weights, accepted = {}, "from 1e-06 to 1e+06"
    for joint, value in metric.items():
        key = f"redundancy.metric.{joint}"
        smallest = 1.0 / _LARGEST_WEIGHT
        weights[str(joint)] = finite_number(key, value, accepted, smallest, _LARGEST_WEIGHT)
    return weights


def range_centres(model: FreeFloatingModel) -> Array:
    """Centres of the joint ranges [rad, m], NaN for joints without two limits, shape (n,)."""
    lower, upper = model.joint_ranges
    with np.errstate(invalid="ignore"):
        centres = (lower + upper) / 2.0
    return np.where(np.isfinite(centres), centres, np.nan)


def joint_weights(model: FreeFloatingModel, redundancy: Redundancy) -> Array:
    """Weights of the squared joint rates, divided by the mean of the arm's, shape (n,)."""
    weights = np.array([redundancy.weights.get(joint, 1.0) for joint in model.joint_names])
    return np.asarray(weights / weights[: model.arm_dof].mean())
