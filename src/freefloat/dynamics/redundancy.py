"""Which of its many motions an arm with joints to spare takes.

Such an arm can follow a path with infinitely many joint rates. They differ by motions in the null
space of the generalized Jacobian S*, which move neither the end-effector nor the momentum. Among
them the rates ``u`` are taken that make

    u^T W u / 2 - gain ds/dt (u . g)

smallest: W is the metric, in units of its mean diagonal element, and g the gradient of what the
arm is drawn toward. Without that these are the rates of least norm. With it the arm adds
a null-space motion, projected in the same metric, that never leads down from g.

The pull is in proportion to the speed ds/dt along the path. So it rests where the path rests, at
both ends and at stops between; and where there is no momentum, joints and attitude are functions of
the place on the path alone: a motion over a longer time takes the same way. For the same reason the
gain is counted per path, not per second: it is dimensionless, one over the share of the path in
which a pull of its own size is followed. A motion integrated backwards retraces, with or without
momentum, because ds/dt changes its sign with the end-effector's velocity. The path described the
other way round is another path, on which the arm is drawn up the gradient again.

Toward ``sigma`` g is the gradient of ln sqrt(det(S* S*^T)), the logarithm of the manipulability: it
grows with the smallest singular value but is smooth where that value is shared and has a kink, and
it does not depend on the unit of length. Toward ``middle`` g is what is missing to the middle of
the joint ranges; joints without a range do not count.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from freefloat.brief import brief
from freefloat.errors import InputError

_LARGEST_WEIGHT = 1e6


class Metric(StrEnum):
    """What joint rates are measured by.

    ``JOINTS``: their Euclidean norm [rad/s, m/s]. ``ENERGY``: the kinetic energy of the drifting
    system, to which the momentum adds what no joint rate changes.
    """

    JOINTS = "joints"
    ENERGY = "energy"


class Toward(StrEnum):
    """What the null-space motion is drawn toward."""

    NONE = "none"
    SIGMA = "sigma"
    MIDDLE = "middle"


@dataclass(frozen=True, eq=False)
class Redundancy:
    """What a redundant arm does with its freedom.

    Attributes:
        metric: What of the rates is least; a map from joint to weight for the norm of weighted
            rates, weight times rate squared, in which joints not named weigh 1.
        toward: What the arm is drawn toward.
        gain: How strongly, per path; the pull toward g is ``gain`` times g where W is 1.
        bound: The null-space motion that this adds stays shorter than this, per path [rad, m]; it
            does so smoothly.
    """

    __repr__ = brief

    metric: Metric | Mapping[str, float] = Metric.JOINTS
    toward: Toward = Toward.NONE
    gain: float = 1.0
    bound: float = 3.0

    def __post_init__(self) -> None:
        if not isinstance(self.metric, Metric):
            object.__setattr__(self, "metric", self._checked_metric(self.metric))
        if self.toward not in tuple(Toward):
            raise InputError("redundancy.toward", f"{self.toward!r} was given", ", ".join(Toward))
        object.__setattr__(self, "toward", Toward(self.toward))
        if not (np.isfinite(self.gain) and self.gain >= 0.0):
            raise InputError("redundancy.gain", f"{self.gain} was given", "0 or more, per path")
        if not (np.isfinite(self.bound) and self.bound > 0.0):
            raise InputError("redundancy.bound", f"{self.bound} was given", "more than 0, per path")

    def __reduce__(self) -> tuple[type[Redundancy], tuple[Any, ...]]:
        return Redundancy, (self.metric, self.toward, self.gain, self.bound)

    @property
    def plain(self) -> bool:
        """Whether the rates are those of least Euclidean norm."""
        return self.metric is Metric.JOINTS and self.toward is Toward.NONE

    @property
    def weights(self) -> Mapping[str, float]:
        """Of joints that do not weigh 1."""
        return {} if isinstance(self.metric, Metric) else self.metric

    @staticmethod
    def _checked_metric(given: Any) -> Metric | Mapping[str, float]:
        if isinstance(given, str):
            if given in tuple(Metric):
                return Metric(given)
            raise InputError("redundancy.metric", f"{given!r} was given", _METRICS)
        weights = {str(joint): float(weight) for joint, weight in dict(given).items()}
        for joint, weight in weights.items():
            if not 1.0 / _LARGEST_WEIGHT <= weight <= _LARGEST_WEIGHT:
                raise InputError(
                    f"redundancy.metric.{joint}", f"{weight} was given", "from 1e-06 to 1e+06"
                )
        return weights


_METRICS = "joints, energy, or a map from joint to weight"
