"""Bounds of limits, and the fraction of the margin, as they vary between runs."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from freefloat.motion.pointing import Keep, PointingLimit
from freefloat.so3 import Array, BoolArray
from freefloat.studies.columns import Column, as_numbers

FRACTION = "margin.fraction"
_BOUND = re.compile(
    r"limits\.(base_rate|base_turn_deg|joint_(rate|torque)(\..+)?|pointing\.\d+\.angle_deg)"
)
"""Scenario keys of bounds of limits that may differ in an ensemble."""
_LARGEST = 1e9


def is_bound(key: str) -> bool:
    """Whether a key is that of a bound, of a limit or of the margin, that may differ."""
    return key == FRACTION or _BOUND.fullmatch(key) is not None


def bound_ratios(
    values: Mapping[str, Column], nominal: Mapping[str, float], count: int
) -> tuple[dict[str, Array], BoolArray]:
    """Nominal bounds over those of runs by key, and whether all of a run are accepted.

    Args:
        values: Values by key.
        nominal: Nominal values of the keys of bounds that vary.
        count: Number of runs.
    """
    ratios, fits = dict[str, Array](), np.ones(count, dtype=bool)
    for key, value in nominal.items():
        bounds = as_numbers(values[key], ())
        most = 180.0 if key.endswith("_deg") else 1.0 if key == FRACTION else _LARGEST
        with np.errstate(invalid="ignore"):
            accepted = (bounds > 0.0) & (bounds < most) & (value > 0.0)
        fits &= accepted
        ratios[key] = np.where(accepted, value, 1.0) / np.where(accepted, bounds, 1.0)
    return ratios, fits


def limit_scales(
    ratios: Mapping[str, Array],
    limits: Mapping[str, tuple[str, ...]],
    pointing: Sequence[PointingLimit],
) -> Array | None:
    """Factors on the ratios of Q quantities of limits, shape (K, Q); None where none varies.

    Args:
        ratios: Nominal bounds over those of K runs by key.
        limits: Joints, or other names, of the quantities of each limit.
        pointing: The limits of axes.
    """
    if not ratios:
        return None
    quantities = [
        (limit, str(number), place)
        for limit, places in limits.items()
        for number, place in enumerate(places)
    ]
    scales = np.ones((len(next(iter(ratios.values()))), len(quantities)))
    for key, ratio in ratios.items():
        _, name, *others = key.split(".", 2)
        entry = "".join(others).removesuffix(".angle_deg")
        for column, (limit, *names) in zip(scales.T, quantities, strict=True):
            if limit == name.removesuffix("_deg") and (not entry or entry in names):
                outside = limit == "pointing" and pointing[int(names[0])].keep is Keep.OUTSIDE
                column *= 1.0 / ratio if outside else ratio
    return scales
