"""Values of the varied keys in many runs as arrays, where ensembles can represent them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from freefloat.errors import LARGEST_NUMBER
from freefloat.io.scenario.path_schema import FrameName
from freefloat.io.scenario.scenario import Scenario
from freefloat.motion.pointing import Keep, PointingLimit
from freefloat.motion.problem import Problem
from freefloat.paths.timing import SHORTEST
from freefloat.rotations import rotation_matrix
from freefloat.so3 import NORM_ERROR, Array, BoolArray, IntArray
from freefloat.studies.columns import NUMBER, Columns, as_numbers
from freefloat.studies.study import Study
from freefloat.studies.study_file import START_KEYS, Command
from freefloat.studies.variation import Values
from freefloat.studies.varied_robots import MASS_FACTORS, SCALE_MASS, is_robot_key, uniform_factors

NO_ROWS: Columns = {NUMBER: ()}
"""Results of no run."""
FRACTION = "margin.fraction"
_BOUND = re.compile(
    r"limits\.(base_rate|base_turn_deg|joint_(rate|torque)(\..+)?|pointing\.\d+\.angle_deg)"
)
"""Scenario keys of bounds of limits that may differ in an ensemble."""
VECTORS = {"momentum": "momenta", "wheels.momentum": "wheels", "drift": "drifts"}
"""Scenario keys of vectors, and what they are in ensembles; entries vary, too, as momentum.2."""
ENDS = ("path.line.from", "path.line.to")
"""Scenario keys of the ends of a line, likewise."""
NUMBERS = {"timing.duration": "durations", "margin.value": "thresholds"}
"""Scenario keys of numbers, and what they are in ensembles."""
FEWEST = 16
"""Fewer runs are not worth an ensemble."""
_LEVEL = 1e-9
"""Components x, y of the quaternions of planar attitudes."""


@dataclass(frozen=True, eq=False)
class Chunk:
    """Runs that are integrated together, numbers ascending, and the first run of their group."""

    first: int
    numbers: IntArray


def is_bound(key: str) -> bool:
    """Whether a key names a bound, of a limit or of the margin, that may differ."""
    return key == FRACTION or _BOUND.fullmatch(key) is not None


def fits_ensembles(key: str, listed: Mapping[str, Sequence[Any]]) -> bool:
    """Whether runs that differ in a key are motions of one ensemble.

    Args:
        key: The key.
        listed: Listed values by key; bounds of limits are numbers, not words or maps.
    """
    if is_bound(key):
        return bool(np.isfinite(as_numbers(listed.get(key, []), ())).all())
    vector, _, entry = key.rpartition(".")
    component = vector in (*VECTORS, *ENDS) and entry in ("0", "1", "2")
    named = (*VECTORS, *ENDS, *NUMBERS, *START_KEYS, SCALE_MASS)
    return key in named or component or is_robot_key(key)


def why_alone(study: Study) -> list[str]:
    """Why all runs of a study are executed one by one, whatever its scenario."""
    if study.content.command is not Command.SIMULATE:
        return [f"the command is {study.content.command}"]
    random = [key for key in study.content.vary if key not in study.variation.listed]
    reasons = [
        f"{key} varies at random, not from a list" for key in random if not fits_ensembles(key, {})
    ]
    return reasons + ["the files of all runs are kept"] * (study.kept_files >= study.count)


def group_numbers(study: Study) -> IntArray:
    """Number of the group of each run, integrated as one ensemble; -1 of runs on their own.

    Runs on their own are runs of other commands than simulate, of small groups, with random values
    of keys that no ensemble represents, and of studies that keep the file of every run.
    """
    alone = np.full(study.count, -1)
    if why_alone(study):
        return alone
    listed, places = study.variation.listed, study.variation.places(0, study.count)
    groups = np.zeros(study.count, dtype=np.int64)
    for key in study.content.vary:
        if not fits_ensembles(key, listed):
            groups = groups * len(listed[key]) + places[key]
    _, groups, sizes = np.unique(groups, return_inverse=True, return_counts=True)
    return np.asarray(np.where(sizes[groups] >= FEWEST, groups, alone))


def selected(values: Values, places: IntArray) -> Values:
    """Select the values of some runs from values by key."""
    return {
        key: column[places] if isinstance(column, np.ndarray) else [column[k] for k in places]
        for key, column in values.items()
    }


def arrays_of(values: Values, problem: Problem, count: int) -> tuple[dict[str, Array], BoolArray]:
    """The values of ``count`` runs, and which runs' values an ensemble can represent.

    What holds where a key does not vary is the problem's.

    Returns:
        Arrays by argument of :func:`~freefloat.ensemble.simulate_many.simulate_many`, shape (K,) or
        (K, 3), and ``attitudes`` (K, 4) where the start varies; and whether a run fits, shape (K,).
    """
    nominal = {
        "momenta": problem.momentum,
        "wheels": problem.wheel_momentum,
        "drifts": problem.path.drift,
    }
    arrays: dict[str, Array] = {}
    for key, column in values.items():
        vector, _, entry = key.rpartition(".")
        if key in START_KEYS:
            arrays["attitudes"] = _attitudes(key, column, problem)
        elif key == SCALE_MASS:
            arrays["scale_mass"] = as_numbers(uniform_factors(column), ())
        elif key in NUMBERS:
            arrays[NUMBERS[key]] = as_numbers(column, ())
        elif key in VECTORS:
            arrays[VECTORS[key]] = as_numbers(column, (3,))
        elif vector in VECTORS:
            name = VECTORS[vector]
            arrays.setdefault(name, np.tile(nominal[name], (count, 1)))
            arrays[name][:, int(entry)] = as_numbers(column, ())
    fits = np.ones(count, dtype=bool)
    for name, array in arrays.items():
        fits &= _accepted(name, array, problem)
    return arrays, fits


@dataclass(frozen=True, eq=False)
class Line:
    """A path along a line whose ends vary."""

    ends: Array  # ends of the line in the frame of the path [m], (2, 3)
    axes: Array  # rotation from this frame to the inertial one, (3, 3)

    def offsets(self, values: Values, count: int) -> Array:
        """Offsets from its ends to the ends of ``count`` runs with values by key, (K, 2, 3)."""
        ends = np.tile(self.ends, (count, 1, 1))
        for key, column in values.items():
            whole, _, entry = key.rpartition(".")
            if key in ENDS:
                ends[:, ENDS.index(key)] = as_numbers(column, (3,))
            elif whole in ENDS:
                ends[:, ENDS.index(whole), int(entry)] = as_numbers(column, ())
        return (ends - self.ends) @ self.axes.T


def lines_vary(keys: Iterable[str]) -> bool:
    """Whether ends of a line are among varied keys."""
    return any(key.startswith(ENDS) for key in keys)


def line_of(scenario: Scenario, keys: Iterable[str]) -> Line | None:
    """The path of a scenario if its ends vary: a line in the inertial or the spacecraft's frame."""
    path, attitude = scenario.content.path, scenario.search().from_attitude
    if path.line is None or not lines_vary(keys):
        return None
    axes = np.eye(3)
    if path.frame is FrameName.SPACECRAFT and attitude is not None:
        axes = rotation_matrix(attitude)
    return Line(np.array([path.line.start, path.line.end]), axes)


def are_lines(offsets: Array, problem: Problem) -> BoolArray:
    """Which offsets of the ends, shape (K, 2, 3), lead to lines that a problem may have, (K,)."""
    path = problem.path.path.curve
    chords = path(1.0) - path(0.0) + offsets[:, 1] - offsets[:, 0]
    with np.errstate(invalid="ignore"):
        lines = (np.abs(offsets) <= LARGEST_NUMBER).all(axis=(1, 2)) & chords.any(axis=1)
        if problem.task.planar:
            lines &= (problem.plane.seen(np.nan_to_num(offsets))[..., 2] == 0.0).all(axis=1)
    return np.asarray(lines)


def _attitudes(key: str, column: Array | Sequence[Any], problem: Problem) -> Array:
    """Unit quaternions of attitudes or headings in degrees."""
    if key == "heading_deg":
        return problem.plane.attitudes(np.radians(as_numbers(column, ())))
    quaternions = as_numbers(column, (4,))
    norms = np.linalg.norm(quaternions, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(np.abs(norms - 1.0) <= NORM_ERROR, quaternions / norms, np.nan))


def _accepted(name: str, array: Array, problem: Problem) -> BoolArray:
    """Which runs have values of an argument that an ensemble accepts."""
    rows = array.reshape(len(array), -1)
    with np.errstate(invalid="ignore"):
        accepted = (np.abs(rows) <= LARGEST_NUMBER).all(axis=1)
        if name == "durations":
            accepted &= rows[:, 0] >= SHORTEST
        elif name == "scale_mass":
            accepted &= (rows[:, 0] >= MASS_FACTORS[0]) & (rows[:, 0] <= MASS_FACTORS[1])
        elif name == "thresholds":
            accepted &= rows[:, 0] >= 0.0
        elif problem.has_headings:
            seen = np.nan_to_num(problem.plane.seen(rows[:, :3]))
            tilt = seen[:, 2:] if name == "drifts" else seen[:, :2]
            accepted &= (np.abs(tilt) <= (_LEVEL if name == "attitudes" else 0.0)).all(axis=1)
    return np.asarray(accepted)


def bound_ratios(
    values: Values, nominal: Mapping[str, float], count: int
) -> tuple[dict[str, Array], BoolArray]:
    """Nominal bounds over the bounds of runs by key, and whether all bounds of a run are accepted.

    Args:
        values: Values by key.
        nominal: Nominal values of the keys of bounds that vary.
        count: Number of runs.
    """
    ratios, fits = dict[str, Array](), np.ones(count, dtype=bool)
    for key, value in nominal.items():
        bounds = as_numbers(values[key], ())
        most = 180.0 if key.endswith("_deg") else 1.0 if key == FRACTION else LARGEST_NUMBER
        with np.errstate(invalid="ignore", divide="ignore"):
            fits &= (bounds > 0.0) & (bounds < most) & (value > 0.0)
            ratios[key] = value / bounds
    return ratios, fits


def limit_scales(
    ratios: Mapping[str, Array],
    limits: Mapping[str, tuple[str, ...]],
    pointing: Sequence[PointingLimit],
) -> Array | None:
    """Factors on the ratios of Q quantities of limits, shape (K, Q); None where none varies.

    Args:
        ratios: Nominal bounds over the bounds of K runs by key.
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
