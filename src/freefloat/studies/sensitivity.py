"""Sobol indices: how much of the variance of margin and feasibility each random key explains."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from freefloat.concurrency import available_cores
from freefloat.so3 import Array
from freefloat.statistics import QUANTILE
from freefloat.studies.disturbances import group_numbers
from freefloat.studies.study import Study
from freefloat.studies.variation import Values, Variation

if TYPE_CHECKING:
    from freefloat.robot.model import FreeFloatingModel
    from freefloat.studies.groups import Group

MARGIN, FEASIBILITY = "margin", "feasible"
"""Quantities that have indices."""
_PAIRS = 2048
"""Pairs of independent draws."""
_TRIED, _MODELS = 256, 2
"""Draws tried first, and the largest number of them of whose robots models may be built."""


@dataclass(frozen=True)
class Estimate:
    """An estimate with its 95 % confidence interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        value, low, high = (round(number, 2) + 0.0 for number in vars(self).values())  # no -0.00
        return f"{value:.2f} ({low:.2f} to {high:.2f})"


@dataclass(frozen=True)
class Sensitivity:
    """Sobol indices of a varied key: fractions of the variance of a quantity.

    Attributes:
        key: The key; a list of numbers counts as one.
        quantity: ``"margin"``, the minimum margin, or ``"feasible"``, feasibility, 1 or 0.
        first_order: Fraction of the variance that the key explains alone.
        total: Fraction that is left if all other keys are known.
    """

    key: str
    quantity: str
    first_order: Estimate
    total: Estimate

    @property
    def quantity_name(self) -> str:
        """The name of the quantity for people."""
        return "minimum margin" if self.quantity == MARGIN else "feasibility"

    def to_dict(self) -> dict[str, Any]:
        """The indices as a JSON document."""
        indices = {"first_order": self.first_order, "total": self.total}
        document: dict[str, Any] = {"key": self.key, "quantity": self.quantity}
        for name, index in indices.items():
            document |= {name: index.value, f"{name}_interval": [index.low, index.high]}
        return document


@dataclass(frozen=True, eq=False)
class _Mixtures(Variation):
    """Saltelli's design: draws A and B of each key, then A with the values of one key from B."""

    def values(self, first: int, count: int) -> Values:
        """See :class:`.variation.Variation`."""
        pairs = {key: (section.draws(self.seed, key, 0, _PAIRS),
                       section.draws(self.seed, key, _PAIRS, _PAIRS))
                 for key, section in self.vary.items()}  # fmt: skip
        some = slice(first, first + count)
        return {
            key: np.concatenate([A, B, *(B if other == key else A for other in self.vary)])[some]
            for key, (A, B) in pairs.items()
        }


class _MixedStudy(Study):
    """A study whose runs are the runs of Saltelli's design."""

    @cached_property
    def variation(self) -> Variation:
        """See :class:`.study.Study`."""
        return _Mixtures(self.content.vary, False, 1, self.content.seed)


def sensitivities(study: Study) -> list[Sensitivity]:
    """Sobol indices of the keys of a study, for the minimum margin and for feasibility.

    The indices are computed from 2,048 pairs of draws and their mixtures, integrated beside the
    runs of the study. Motions so near to margin or limits that a precise motion would decide count
    as they are. Empty for studies that ensembles do not decide, that list values, or in which the
    more than 2 of the first 256 draws need the model of a robot of their own; without indices of
    feasibility where limits need precise or recorded motions, and of what does not vary.
    """
    if study.variation.listed or group_numbers(study)[0] < 0:
        return []
    from freefloat.studies.groups import grouped  # compiled kernels

    mixed = _MixedStudy(study.source, study.settled, study.base_source, study.base)
    (group, _), keys = grouped(mixed, 0), list(study.content.vary)
    if group is None:
        return []
    varied_robots = any(key.startswith("robot.") for key in keys)
    if varied_robots and (group.starts_at_best or group.problem.redundant):
        return []
    decides = not (group.others or group.recorded.names)
    group, count = replace(group, recorded=group.recorded.without), (len(keys) + 2) * _PAIRS
    if varied_robots and _models_of(group, _TRIED) > _MODELS:
        return []
    numbers, motions = group.integrate(np.arange(count), available_cores())
    known = np.zeros(count, dtype=bool)
    known[numbers] = motions.reached & ~motions.failed
    used = known.reshape(-1, _PAIRS).all(axis=0)
    quantities = {MARGIN: motions.minimum_margins}
    if decides:
        quantities[FEASIBILITY] = group.are_feasible(motions).astype(float)
    results = list[Sensitivity]()
    for quantity, found in quantities.items():
        every = np.zeros(count)
        every[numbers] = found
        values = every.reshape(-1, _PAIRS)[:, used]
        if values.size and np.ptp(values[:2]) != 0.0:
            indices = zip(keys, sobol_indices(values[0], values[1], values[2:]), strict=True)
            results += [Sensitivity(key, quantity, *pair) for key, pair in indices]
    return results


def _models_of(group: Group, count: int) -> int:
    """Number of models that are built to integrate the first runs of a group."""
    built = list[int]()

    def model_of(number: int) -> FreeFloatingModel:
        built.append(number)
        return group.robot.model_of(number)

    counted = replace(group, robot=replace(group.robot, model_of=model_of))
    counted.integrate(np.arange(count), available_cores())
    return len(built)


def sobol_indices(f_A: Array, f_B: Array, f_AB: Array) -> list[tuple[Estimate, Estimate]]:
    """First-order and total index of each variable, as ``scipy.stats.sobol_indices``.

    Saltelli et al., "Variance based sensitivity analysis of model output", 2010, table 2 (b), (f).
    Intervals come from linearizing a ratio of two means; SciPy's bootstrap takes a time
    that grows with the square of the number of samples.

    Args:
        f_A: Values of a function at N independent points A, shape (N,).
        f_B: Values at N others, B, shape (N,).
        f_AB: Values at A with variable k of B, shape (d, N).
    """
    mean = (f_A.mean() + f_B.mean()) / 2.0
    A, B, AB = f_A - mean, f_B - mean, f_AB - mean
    squares = (A**2 + B**2) / 2.0
    return [
        (_ratio(B * (mixed - A), squares), _ratio((A - mixed) ** 2 / 2.0, squares)) for mixed in AB
    ]


def _ratio(numerators: Array, denominators: Array) -> Estimate:
    """The ratio of two means over samples."""
    mean = denominators.mean()
    value = numerators.mean() / mean
    error = np.std(numerators - value * denominators) / (mean * np.sqrt(len(numerators)))
    return Estimate(*map(float, (value, value - QUANTILE * error, value + QUANTILE * error)))
