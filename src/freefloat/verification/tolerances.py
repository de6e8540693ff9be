"""Comparison of what a record states with what was recomputed of it, value by value.

Both are trees of :mod:`freefloat.codec`, so that a new field of a record is compared, or named as
not verified, without a line here. A value is named by its place in the file, its parts joined by
dots: ``chosen.closest_approach.value``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from freefloat.codec import Codec
from freefloat.kinds import kind_of, named
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.motion.setting import JointSetting
from freefloat.planning.settings import Search
from freefloat.records import Known, Origin, Quantity, Tree
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array, BoolArray
from freefloat.verification.comparisons import Check

CODEC = Codec((Problem, JointSetting, Search, Limits, FreeFloatingModel))
"""Codec of results: files store scenario and robot as texts."""


class _Rule(NamedTuple):
    """How near a stated number must be to the recomputed one.

    Attributes:
        relative: Deviation as a fraction of the recomputed number: rounding.
        absolute: Deviation in its unit, but where all numbers of an array are below 1, as a
            fraction of the largest: numbers of a small robot have as many true digits. A deviation
            between the two is no discrepancy, but not verified either.
        scaled: Whether absolute and slack are fractions of the largest number in every case.
        factor: Between such numbers that are as far apart as other machines may compute them: no
            discrepancy, but not verified either.
        slack: Absolute deviation that is likewise no discrepancy.
        free: Whether no value is a discrepancy, because rounding decides.
        unbounded: Whether none is where the recomputed number is infinite.
    """

    relative: float = 1e-6
    absolute: float = 1e-9
    scaled: bool = False
    factor: float = 1.0
    slack: float = 0.0
    free: bool = False
    unbounded: bool = False


_EXACT = _Rule()
_ANY = _Rule(free=True)
_ERROR = _Rule(absolute=0.0, factor=10.0, slack=1e-7)
_SEARCHED = _Rule(factor=1.5)
_STATE = _Rule(1e-4, 1e-6, slack=1e-3)
_END = _STATE._replace(slack=1e-2)
"""Where a motion ends singular, its state changes with the root of the time that is left."""
_STEP_COUNTS = _Rule(1e-3, 1e-6, factor=2.0, slack=1e-3)
_ERRORS = """
end_effector_position.value end_effector_orientation.value momentum.value rates.value
integration.attitude integration.joints limit_results.base_wrench
"""
"""Errors are rounding: their order of magnitude is compared."""
_FREE = """
end_effector_position.time end_effector_orientation.time momentum.time rates.time
integration.attitude_time integration.joints_time integration.joint contact.time contact.s
boundary boundary.attitude boundary.branch touch touch.attitude touch.branch touch.gap touch.kind
motions.minimum_at
"""
"""When and where errors, distances and alike minima are largest or smallest; points of a boundary,
of which it is not known how many were asked for."""
_RULES: dict[str, _Rule] = {
    **dict.fromkeys(_ERRORS.split(), _ERROR),
    **dict.fromkeys(_FREE.split(), _ANY),
    # a proof stops at nine tenths of the minimum or above
    "minima.bound": _Rule(absolute=0.0, factor=10.0 / 9.0, slack=1e-9),
    "minima.value": _Rule(absolute=0.0, slack=1e-9),  # each in the unit of its measure
    "certificate.intervals": _SEARCHED,
    # distances are found up to a tenth of a millimetre, where they hardly change at any time
    "contact.depth": _Rule(slack=2e-4),
    # searches of attitudes that end elsewhere where a machine rounds otherwise
    "tolerance.momentum": _SEARCHED,
    "tolerance.shortest": _SEARCHED,
    "tolerance.longest": _SEARCHED,
    "ranges.low": _Rule(absolute=1e-6, slack=5e-4),
    "ranges.high": _Rule(absolute=1e-6, slack=5e-4),
    "polynomial.coefficients": _Rule(scaled=True),
    # compiled motions: in float32, at the steps of the integrator, or near a singularity
    "results.joints": _Rule(absolute=1e-6),
    "motions.ended_at": _STATE,
    "motions.minimum": _STATE._replace(scaled=True),
    "motions.attitudes": _END,
    "motions.joints": _END,
    "motions.lower": _END,
    "motions.upper": _END,
    "motions.slacks": _STATE,
    "motions.rates": _STEP_COUNTS._replace(unbounded=True),
    "motions.base_rate": _STEP_COUNTS._replace(unbounded=True),
    "motions.determinant_ratios": _STEP_COUNTS,
    "motions.evaluations": _SEARCHED._replace(unbounded=True),
}
"""Rules by the last two parts of a name, without numbers, or the last one alone."""


def compare(stated: Any, known: Known) -> tuple[list[Check], list[str], list[str]]:
    """Compare a record with what is known of it.

    Returns:
        Checks of the values that were recomputed, names of the values that were not, or not
        to all digits, and names of the values that are part of the question.
    """
    checks, unverified, given = list[Check](), list[str](), list[str]()
    codec = named(kind_of(stated, saved=True).codec)
    for name, entry, found in _leaves("", codec.encode(stated), codec.encode(known)):
        if found is _MISSING:
            unverified.append(name)
        elif found is Origin.GIVEN:
            given.append(name)
        elif found is not Origin.TESTED:
            check, exact = _compared(name, entry, found)
            checks.append(check)
            if check.passed and not exact:
                unverified.append(name)
    return checks, unverified, given


_MISSING = object()
_UNIT = 1e-9
"""Deviation of the norm of a quaternion from 1."""


def _leaves(name: str, stated: Any, found: Any) -> Iterator[tuple[str, Any, Any]]:
    """Names, stated and recomputed values; of what was not recomputed ``_MISSING``."""
    keys = stated.keys() - {"class"} if isinstance(stated, dict) else ()
    if keys and (found is _MISSING or isinstance(found, Origin)):
        found = dict.fromkeys(keys, found)
    elif not (isinstance(stated, dict) and isinstance(found, dict)):
        yield name, _summary(stated), _summary(found)
        return
    elif "class" in stated:
        yield f"{name}.class".lstrip("."), stated["class"], found.get("class")
    elif bool(stated) is not bool(found) or not (
        _is_table(stated) or stated.keys() == found.keys()
    ):
        yield name, _summary(stated), _summary(found)
    for key in (key for key in stated if key != "class"):
        place = f"{name}.{key}" if name else key
        yield from _leaves(place, stated[key], found.get(key, _MISSING))


def _is_table(tree: Tree) -> bool:
    """Whether entries are columns, of which some may not be known."""
    return all(isinstance(entry, Quantity) for entry in tree.values())


def _summary(entry: Any) -> Any:
    """A value; of a record its class, of several values their keys."""
    if not isinstance(entry, dict):
        return entry
    return entry.get("class") or ", ".join(entry) or "none"


def _compared(name: str, stated: Any, found: Any) -> tuple[Check, bool]:
    """The check of a value, and whether it is the recomputed one up to rounding."""
    parts = [part for part in name.split(".") if not part.isdecimal()]
    rule = _RULES.get(".".join(parts[-2:]), _RULES.get(parts[-1], _EXACT))
    unit = getattr(stated, "unit", "")
    one, other = (np.asarray(getattr(entry, "values", entry)) for entry in (stated, found))
    if one.shape != other.shape:
        words = f"shape {one.shape} is stated, but it is {other.shape}"
        return Check(name, rule.free, words, unit=unit, relation="="), False
    unsound = np.zeros(one.shape, bool)
    if unit.startswith("1, quaternion") and one.dtype == float:
        other = np.where((one * other).sum(axis=-1, keepdims=True) < 0.0, -other, other)
        unsound |= np.abs(np.linalg.norm(one, axis=-1, keepdims=True) - 1.0) > _UNIT
    same, near = _agreement(one, other, rule)
    wrong = ~near | unsound
    place = tuple(np.argwhere(wrong)[0].tolist()) if wrong.any() else ()
    detail = ""
    if wrong.any():
        where = f"{list(place)}: " if place else ""
        detail = f"{where}{one[place]} is stated, but it is {other[place]}"
    pair = [values[place] if values.ndim == len(place) else None for values in (one, other)]
    a, b = (value.item() if isinstance(value, np.generic) else value for value in pair)
    return Check(name, not detail, detail, a, b, unit=unit, relation="="), bool(same.all())


def _agreement(stated: Array, found: Array, rule: _Rule) -> tuple[BoolArray, BoolArray]:
    """Where values are the same up to rounding, and where they are no discrepancy."""
    kinds = stated.dtype.kind + found.dtype.kind
    if not {*kinds} <= {*"iuf"}:
        same = np.asarray(stated == found) & (len({*kinds}) == 1)
        return same, same | rule.free
    a, b = stated.astype(float), found.astype(float)
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    size, finite = np.abs(b), np.isfinite(a) & np.isfinite(b)
    largest = float(size.max(initial=0.0, where=finite))
    rounding = rule.absolute * (largest if rule.scaled else min(largest, 1.0))
    error = np.abs(np.subtract(a, b, where=finite, out=np.full(a.shape, np.inf)))
    if "f" in kinds:
        same |= finite & (error <= rule.relative * size + rounding)
    smaller = np.where(finite, np.minimum(np.abs(a), size), 0.0)
    slack = max(rule.slack, rule.absolute) * (largest if rule.scaled else 1.0)
    apart = finite & (error <= (rule.factor - 1.0) * smaller + slack)
    apart |= rule.unbounded & np.isposinf(b) & (a > 0.0)
    return same, same | apart | rule.free


def differences(
    stated: Any, recomputed: Any, key: str = "", errors: bool = False
) -> Iterator[tuple[str, Any, Any]]:
    """Numbers, truth values and lengths in which a document differs from its record's document.

    Texts are not compared, nor keys that only one of the two has.

    Args:
        stated: The document in a file.
        recomputed: The document of the record.
        key: Key path of both.
        errors: Whether they are errors, of which only the order of magnitude is compared.

    Yields:
        Key path, stated and recomputed value.
    """
    if isinstance(stated, dict) and isinstance(recomputed, dict):
        for name in (name for name in stated if name in recomputed):
            inner = f"{key}.{name}" if key else name
            residuals = name == "residuals"
            yield from differences(stated[name], recomputed[name], inner, errors or residuals)
    elif isinstance(stated, list) and isinstance(recomputed, list):
        if len(stated) != len(recomputed):
            yield key, stated, recomputed
            return
        if key.endswith("attitude") and np.dot(stated, recomputed) < 0.0:  # of opposite sign
            recomputed = [-value for value in recomputed]
        for index, pair in enumerate(zip(stated, recomputed, strict=True)):
            yield from differences(*pair, f"{key}[{index}]", errors)
    elif not _agree(stated, recomputed, errors):
        yield key, stated, recomputed


def _agree(stated: Any, recomputed: Any, errors: bool) -> bool:
    if isinstance(stated, str) and isinstance(recomputed, str):
        return True
    if not {type(stated), type(recomputed)} <= {int, float}:
        return type(stated) is type(recomputed) and bool(stated == recomputed)
    rule = _ERROR if errors else _EXACT
    return bool(_agreement(np.asarray(stated), np.asarray(recomputed), rule)[1])
