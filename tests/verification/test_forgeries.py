"""Every number of every kind of result is compared with a recomputed one, or named as not verified.

The values of a record are found by its classes alone, so that a new field takes part.
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
import yaml

import freefloat as ff
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.errors import FreeFloatError
from freefloat.motion.problem import Problem
from freefloat.motion.setting import JointSetting
from freefloat.robot.model import FreeFloatingModel
from freefloat.verification.check import CheckReport, recomputed
from tests.commands import document
from tests.test_result_kinds import IDENTITY
from tests.test_result_kinds import result as usual_result

INPUTS = Problem, JointSetting, ff.Search, ff.Limits, FreeFloatingModel
SMALLEST = 1e-7
"""Numbers of an array below this fraction of its largest are rounding, not compared."""

Place = tuple[Any, ...]


def leaves(value: Any, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """All values of a record but its question, and all tuples; each with its place."""
    if isinstance(value, INPUTS) or place[-1:] == ("following",):
        return
    if isinstance(value, tuple | Mapping) or is_dataclass(value):
        if type(value) is tuple and value:
            yield place, value
        for key, entry in parts(value).items():
            yield from leaves(entry, (*place, key))
    else:
        yield place, value


def parts(value: Any) -> dict[Any, Any]:
    if is_dataclass(value):
        return {entry.name: getattr(value, entry.name) for entry in fields(value)}
    if hasattr(value, "_asdict"):
        return dict(value._asdict())
    return dict(value if isinstance(value, Mapping) else enumerate(value))


def altered(value: Any, place: Place, new: Any) -> Any:
    if not place:
        return new
    key, *rest = place
    changed = altered(parts(value)[key], tuple(rest), new)
    if is_dataclass(value):
        return replace(value, **{key: changed})  # type: ignore[type-var]
    if hasattr(value, "_replace"):
        return value._replace(**{key: changed})
    entries = parts(value) | {key: changed}
    return entries if isinstance(value, Mapping) else tuple(entries.values())


def forgeries(value: Any) -> list[Any]:
    """Other values in place of one."""
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, Enum):
        return [member for member in type(value) if member is not value][:1]
    if isinstance(value, str):
        return [value + "x"]
    if isinstance(value, int):
        return [value + 1, 10 * value + 3, -value - 1]
    if isinstance(value, float):
        return numbers(value)
    if isinstance(value, np.ndarray):
        size = np.where(np.isfinite(value), np.abs(value), 0.0)
        chosen = np.flatnonzero(size > SMALLEST * size.max(initial=0.0))
        if value.dtype.kind not in "iuf" or not len(chosen):
            return []
        n = int(chosen[len(chosen) // 2])
        number = value.flat[n].item()
        others = numbers(number) if value.dtype.kind == "f" else [number - 1]
        return [with_number(value, n, new) for new in others]
    return [value[:-1]] if isinstance(value, tuple) else []


def numbers(value: float) -> list[float]:
    if not math.isfinite(value):
        return []
    return [1.01 * value, 10.0 * value, -value] if value else [0.5]


def with_number(values: Any, n: int, new: float) -> Any:
    """An array with another number; of unit quaternions 1, whose sign does not matter, keeps it."""
    changed = values.copy()
    changed.flat[n] = 2.0 if new == -1.0 else new
    return changed


def names(place: Place) -> str:
    """The name of a place in reports, without numbers."""
    return ".".join(str(part) for part in place if not str(part).isdecimal())


def named(report: Any) -> set[str]:
    listed = (*report.not_verified, *report.given)
    return {names(tuple(name.split("."))) for name in listed}


def is_named(place: Place, report: Any) -> bool:
    name = names(place)
    return any(name == entry or entry.startswith(f"{name}.") for entry in named(report))


SMALL = "small plan", "small map"
KINDS = "plan", "motion", "goal", "manoeuvre", "map", "attitude map", "singularity map", *SMALL
MOTIONS = "motion", "goal"


@cache
def result(kind: str) -> Any:
    """A result of a kind; a small one is that of a robot of centimetres and grams."""
    if kind not in SMALL:
        return usual_result(kind)
    content = yaml.safe_load(ff.load_scenario("planar_2dof/line").text)
    content["path"] = {"line": {"from": [0.057, 0.006, 0], "to": [0.015, 0.036, 0]}}
    content["limits"] = {"joint_torque": 0.1, "joint_rate": 1.0}
    content["search"] = {"from_attitude": IDENTITY}
    with TemporaryDirectory() as folder:
        content["robot"]["urdf"] = str(small_robot(Path(folder)))
        scenario = ff.load_scenario(content)
        if kind == "small map":
            return ff.attitude_map(scenario.problem(), 36)
        return ff.plan(scenario.problem(), scenario.search(), scenario.limits())


def small_robot(folder: Path, k: float = 0.03) -> Path:
    """The planar robot, with all lengths times k, at the same density."""
    text = Path("models/planar_2dof/planar_2dof.urdf").read_text(encoding="utf-8")
    lengths, inertias = r"xyz|size|radius|length", r"i[xyz]{2}"
    for names, factor in ((lengths, k), ("value", k**3), (inertias, k**5)):
        text = re.sub(rf'(?<!axis )\b({names})="([^"]*)"', partial(scaled, factor), text)
    file = folder / "small.urdf"
    file.write_text(text, encoding="utf-8")
    return file


def scaled(factor: float, attribute: re.Match[str]) -> str:
    numbers = " ".join(str(factor * float(number)) for number in attribute[2].split())
    return f'{attribute[1]}="{numbers}"'


@cache
def recomputed_of(kind: str) -> Any:
    return recomputed(result(kind))[1]


def is_found(kind: str, place: Place, new: Any, judge: Callable[[Any], CheckReport]) -> bool:
    """Whether a forged value is denied, named as not verified or given, or refused."""
    try:
        forged = altered(result(kind), place, new)
    except FreeFloatError:
        return True
    report = judge(forged)
    return not report.passed or is_named(place, report)


def compared(kind: str) -> Callable[[Any], CheckReport]:
    """The comparison with what is recomputed of the true result; it takes milliseconds."""
    return lambda forged: CheckReport(kind, ()).comparing(forged, recomputed_of(kind))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_forged_value_is_denied_or_named(kind: str) -> None:
    """The numbers of a motion are tested together, see below."""
    judge = compared(kind)
    assert judge(result(kind)).passed
    places = [pair for pair in leaves(result(kind)) if pair[0][-2:-1] != ("motion",)]
    most = 1 if kind in ("manoeuvre", "small plan") else 3  # which have the parts of other kinds
    tried = [
        (place, new)
        for place, value in places
        if "law" not in place
        for new in forgeries(value)[:most]
    ]
    assert len(tried) > 10
    missed = [(names(place), new) for place, new in tried if not is_found(kind, place, new, judge)]
    assert missed == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", MOTIONS)
def test_every_forged_value_of_a_motion_is_denied(kind: str) -> None:
    places = [pair for pair in leaves(result(kind)) if "motion" in pair[0][-3:-1]]
    assert {"times", "attitudes", "joints", "ending"} <= {place[-1] for place, _ in places}
    for place, value in places:
        for new in forgeries(value)[:1]:
            assert is_found(kind, place, new, ff.check), names(place)


@pytest.mark.slow
def test_instants_and_joints_of_extreme_values_are_denied() -> None:
    """A check accepts others where the value is the same there; here none are."""
    for place, value in leaves(result("motion")):
        if place[0] == "limit_results" and place[-1] in ("time", "where", "worst", "ratio"):
            report = ff.check(altered(result("motion"), place, forgeries(value)[0]))
            assert ".".join(map(str, place)) in {check.name for check in report.discrepancies}


def test_a_value_that_is_not_recomputed_is_named() -> None:
    """As that of a new field would be."""
    known = recomputed_of("motion")
    values = {name: value for name, value in known.values.items() if name != "contact"}
    report = CheckReport("motion", ()).comparing(result("motion"), known._replace(values=values))
    assert report.passed
    assert "contact" in report.not_verified


@pytest.mark.slow
def test_an_extreme_value_that_lasts_is_true_at_any_of_its_instants() -> None:
    """The system turns like a rigid body, with the rate h / D, and every joint rests."""
    problem, joints, rate = ff.load_scenario("planar_2dof/line").problem(), [0.3, 0.9], 0.02
    start = problem.model.end_effector_pose(IDENTITY, joints).position
    D, _ = inertia_matrices(problem.model, joints)
    arc = ff.paths.ArcCurve(np.zeros(3), start, np.array([0.0, 0.0, 1.0]), rate * 20.0)
    path = ff.EndEffectorPath(arc, ff.paths.FixedOrientation(np.eye(3)))
    timed = ff.TimedPath(path, ff.paths.Timing(20.0, ff.paths.TimeLaw.UNIFORM))
    problem = problem.replace(path=timed, momentum=D @ [0.0, 0.0, rate])
    turning = ff.simulate(problem, IDENTITY, joints=joints, limits=ff.Limits(base_rate=1.0))
    (stated,) = (entry for entry in turning.limit_results if entry.limit == "base_rate")
    assert stated.worst == pytest.approx(rate)
    for time in (0.0, 7.4, 20.0):
        at = replace(stated, time=time)
        results = tuple(at if entry is stated else entry for entry in turning.limit_results)
        approach = replace(turning.chosen.closest_approach, time=20.0 - time)
        chosen = replace(turning.chosen, closest_approach=approach)
        other = replace(turning, limit_results=results, chosen=chosen, branches=(chosen,))
        assert ff.check(other).discrepancies == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "place"),
    [
        ("plan", ("limit_results", 0, "allowed")),
        ("goal", ("feasible",)),
        ("map", ("results", "motions", "minimum")),
        ("manoeuvre", ("path", "robust_radius")),
    ],
)
def test_the_command_denies_a_forged_file(kind: str, place: Place, tmp_path: Path) -> None:
    """Saved by the library, with a digest that is right."""
    value = dict(leaves(result(kind)))[place]
    ff.save(altered(result(kind), place, forgeries(value)[0]), tmp_path / "forged.h5")
    report = document("check", tmp_path / "forged.h5", code=1)
    assert any(place[-1] in reason for reason in report["reasons"])
    ff.save(result(kind), tmp_path / "true.h5")
    report = document("check", tmp_path / "true.h5")
    assert {"software_freefloat", "document"} <= {*report["not_verified"]}


@pytest.mark.slow
def test_arm_branches_that_are_left_out_or_stated_twice_are_denied() -> None:
    """How many follow the path is a statement; a requested branch may be alone."""
    simulation = ff.simulate(ff.load_scenario("spatial_6dof/line").problem(), IDENTITY)
    branches = simulation.branches
    others = [branch for branch in branches if branch is not simulation.chosen]
    fewer = [branch for branch in branches if branch is not others[0]]
    for forged in (fewer, [*branches, others[0]]):
        assert not ff.check(replace(simulation, branches=tuple(forged))).passed
    assert ff.check(replace(simulation, branches=(simulation.chosen,))).passed


@pytest.mark.slow
def test_phases_that_are_left_out_are_denied() -> None:
    """How many succeed is a statement."""
    manoeuvre = result("manoeuvre")
    assert len(manoeuvre.phases) > 1
    report = ff.check(replace(manoeuvre, phases=manoeuvre.phases[:-1]))
    assert "phases" in {check.name for check in report.discrepancies}
