"""Problems made in Python, restated as scenarios; and whether a scenario poses a problem."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from freefloat.dynamics.redundancy import Redundancy, Toward
from freefloat.errors import InputError
from freefloat.io.scenario import Scenario, parse_scenario
from freefloat.motion.problem import Problem
from freefloat.paths.curves import ArcCurve, Curve, PolynomialCurve, SplineCurve
from freefloat.paths.orientation import (
    DirectedOrientation,
    FixedOrientation,
    FreeOrientation,
    OrientationLaw,
    SlerpOrientation,
)
from freefloat.planning.options import Search
from freefloat.so3 import Array

_SOURCE = Path("made in Python")
_LOOKS = np.linspace(0.0, 1.0, 21)
"""Where two paths are compared."""
_SHARE = 1e-9
"""By how much numbers may differ that say the same: rounding."""
_ACCEPTED = "the Scenario that it came from"


def restated(problem: Problem, search: Search) -> Scenario:
    """A scenario that poses a problem, where one can.

    Args:
        problem: To be said.
        search: What was looked for.

    Raises:
        InputError: If scenario files have no words for it: a curve or an attitude law of one's own,
            a path of samples, an end-effector that points at a target.
    """
    model, timing = problem.model, problem.path.timing
    content: dict[str, Any] = {
        "robot": {
            "urdf": model.description.source,
            "end_effector": model.end_effector,
            "held": {name: float(value) for name, value in model.held.items()},
        },
        "task": str(problem.task),
        "momentum": problem.momentum.tolist(),
        "path": _curve(problem.path.path.curve) | _attitude(problem.path.path.orientation),
        "timing": {
            "duration": float(timing.duration),
            "law": str(timing.law),
            "stops": [{"s": float(stop.s), "t": float(stop.t)} for stop in timing.stops],
        },
        "margin": {
            "measure": problem.margin.measure.name,
            "value": float(problem.margin.threshold),
        },
        "search": _search(search),
    }
    if problem.redundancy is not None:
        content["redundancy"] = _redundancy(problem.redundancy)
    try:
        scenario = parse_scenario(yaml.safe_dump(content, sort_keys=False), _SOURCE)
        _refuse_another(scenario, problem, search)
    except InputError as error:
        raise _unsaid("problem", f"it ({error.key}: {error.problem})") from None
    return scenario


def _curve(curve: Curve) -> dict[str, Any]:
    if isinstance(curve, PolynomialCurve):
        columns = curve.coefficients.T.tolist()
        return {"polynomial": dict(zip("xyz", columns, strict=True))}
    if isinstance(curve, ArcCurve):
        arc = {"center": curve.centre, "normal": curve.normal, "from": curve.start}
        told: dict[str, Any] = {name: value.tolist() for name, value in arc.items()}
        return {"arc": told | {"angle_deg": float(np.degrees(curve.angle))}}
    if isinstance(curve, SplineCurve):
        return {"waypoints": curve.points.tolist()}
    raise _unsaid("path", f"a {type(curve).__name__}")


def _attitude(law: OrientationLaw) -> dict[str, Any]:
    if isinstance(law, FreeOrientation):
        return {}
    if isinstance(law, FixedOrientation):
        return {"attitude": {"fixed": _quaternion(law.axes)}}
    if isinstance(law, SlerpOrientation):
        ends = {"from": _quaternion(law.start), "to": _quaternion(law.end)}
        return {"attitude": {"slerp": ends}}
    if isinstance(law, DirectedOrientation):  # toward a target it turns otherwise, which is noticed
        return {"attitude": {"follow": {"axis": law.axis, "normal": law.reference.tolist()}}}
    raise _unsaid("path.attitude", f"a {type(law).__name__}")


def _quaternion(axes: Array) -> list[float]:
    found: list[float] = Rotation.from_matrix(axes).as_quat().tolist()
    return found


def _redundancy(redundancy: Redundancy) -> dict[str, Any]:
    told: dict[str, Any] = {
        "metric": dict(redundancy.weights) or str(redundancy.metric),
        "toward": str(redundancy.toward),
    }
    if redundancy.toward is not Toward.NONE:
        told |= {"gain": float(redundancy.gain), "bound": float(redundancy.bound)}
    return told


def _search(search: Search) -> dict[str, Any]:
    told: dict[str, Any] = {"objective": str(search.objective), "seed": int(search.seed)}
    if search.from_attitude is not None:
        told["from_attitude"] = np.asarray(search.from_attitude, dtype=float).tolist()
    if search.samples is not None:
        told["samples"] = int(search.samples)
    return told


def _unsaid(key: str, what: str) -> InputError:
    return InputError(key, f"a scenario file has no words for {what}", _ACCEPTED)


def refuse_another(scenario: Scenario, problem: Problem, search: Search) -> None:
    """Raise an InputError where a scenario does not pose a problem.

    Args:
        scenario: What is to stand for it.
        problem: What was asked.
        search: What was looked for.
    """
    if scenario.model().description.text != problem.model.description.text:
        raise _another("robot")
    _refuse_another(scenario, problem, search)


def _refuse_another(scenario: Scenario, problem: Problem, search: Search) -> None:
    """The same, but for the robot, whose text may have come from no file."""
    robot, model = scenario.content.robot, problem.model
    if robot.end_effector != model.end_effector or dict(robot.held) != dict(model.held):
        raise _another("end-effector or joints held")
    for what in _differences(scenario.problem(model), problem):
        raise _another(what)
    own = scenario.search()
    if own.objective != search.objective or not _alike(own.from_attitude, search.from_attitude):
        raise _another("search")


def _another(what: str) -> InputError:
    return InputError("scenario", f"its {what} is not that of the problem", _ACCEPTED)


def _differences(one: Problem, other: Problem) -> Iterator[str]:
    """What two problems of a robot do not have in common, in words."""
    if one.task is not other.task:
        yield "task"
    if not _alike(one.momentum, other.momentum):
        yield "momentum"
    if one.margin.measure.name != other.margin.measure.name:
        yield "measure"
    if not _alike(one.margin.threshold, other.margin.threshold):
        yield "margin"
    if not _alike(_poses(one), _poses(other)):
        yield "path"
    if _times(one) != _times(other):
        yield "timing"
    if _chosen(one) != _chosen(other):
        yield "redundancy"


def _poses(problem: Problem) -> Array:
    """Of the end-effector, as far as the task prescribes them, shape (21, 3) or (21, 12)."""
    poses = [problem.path.path.pose(float(s)) for s in _LOOKS]
    places = np.array([pose.position for pose in poses])
    if not problem.task.turns:
        return places
    return np.hstack([places, [pose.rotation.ravel() for pose in poses]])


def _times(problem: Problem) -> list[Any]:
    timing = problem.path.timing
    return [timing.duration, timing.law, *((stop.s, stop.t) for stop in timing.stops)]


def _chosen(problem: Problem) -> dict[str, Any] | None:
    """What is done with joints to spare, where there are any."""
    if not problem.redundant:
        return None
    return _redundancy(problem.redundancy or Redundancy())


def _alike(one: Any, other: Any) -> bool:
    if one is None or other is None:
        return one is other
    return np.shape(one) == np.shape(other) and np.allclose(one, other, rtol=_SHARE, atol=_SHARE)
