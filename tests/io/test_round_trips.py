"""Results of every kind return from files with all of their fields, exactly as they were saved."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import freefloat as ff
from freefloat.attitude_grids import attitude_grid
from freefloat.io.scenario.scenario import Scenario
from freefloat.motion.problem import Problem
from freefloat.planning.candidates import Ball, BoundaryPoint, NearAttitude, Peak, Region
from freefloat.planning.plan import Plan
from freefloat.planning.space.attitude_map import AttitudeMap
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import heading_quaternion
from tests.maps import branch_results
from tests.plans import planar_plan, smaller_searches
from tests.robots import random_robot

pytestmark = pytest.mark.usefixtures("kernels")

IDENTITY = [0.0, 0.0, 0.0, 1.0]
PHASES = """
robot: {urdf: planar_2dof, end_effector: end_effector}
task: planar-position
path: {line: {from: [1.9, 0.2, 0], to: [0.5, 1.2, 0]}}
timing: {duration: 30}
margin: {measure: system, fraction: 0.1}
limits: {joint_rate: 0.25}
search: {from_attitude: [0, 0, 0, 1], joints: [0.5, 0.5], reorient: true}
scene: {bodies: [{name: client, sphere: 0.1, position: [0.5, 1.2, 0]}]}
phases:
  - capture: {body: client, mass: 3, inertia: [0.1, 0.1, 0.1]}
  - joints: [0.4, 1.2]
    duration: 30
"""


def differing(value: Any, other: Any, place: str = "") -> Iterator[str]:
    """Places at which two records differ, down to the last digit and the types of all values."""
    if type(value) is not type(other) and not isinstance(value, Mapping):
        yield f"{place}: {type(value).__name__} {type(other).__name__}"
    elif isinstance(value, ff.Search):
        yield from differing(value.to_dict(), other.to_dict(), place)
    elif isinstance(value, Problem):
        for key in ("momentum", "wheel_momentum", "start_joints", "task", "path.timing"):
            yield from differing(deep(value, key), deep(other, key), f"{place}.{key}")
        yield from differing(value.margin.threshold, other.margin.threshold, f"{place}.margin")
    elif isinstance(value, FreeFloatingModel):
        yield from differing(value.total_mass, other.total_mass, f"{place}.total_mass")
    elif is_dataclass(value):
        for entry in fields(value):
            name = entry.name
            yield from differing(getattr(value, name), getattr(other, name), f"{place}.{name}")
    elif isinstance(value, np.ndarray):
        same = value.dtype == other.dtype and np.array_equal(value, other, equal_nan=True)
        if not same:
            yield place
    elif isinstance(value, Mapping):
        value, other = dict(value), dict(other)
        if list(value) != list(other):
            yield f"{place}: {list(value)} {list(other)}"
        for key in value:
            yield from differing(value[key], other[key], f"{place}[{key!r}]")
    elif isinstance(value, tuple):
        if len(value) != len(other):
            yield f"{place}: {len(value)} {len(other)}"
        for number, pair in enumerate(zip(value, other, strict=False)):
            yield from differing(*pair, f"{place}[{number}]")
    elif value != other:
        yield f"{place}: {value} {other}"


def deep(value: Any, key: str) -> Any:
    for name in key.split("."):
        value = getattr(value, name)
    return value


def arrays(path: Path) -> dict[str, Any]:
    """All arrays and attributes of the result in a file."""
    found = {}

    def visit(name: str, item: Any) -> None:
        found[name] = dict(item.attrs)
        if isinstance(item, h5py.Dataset):
            found[name]["values"] = item[()]

    with h5py.File(path) as file:
        file["result"].visititems(visit)
    return found


def bundled(name: str) -> Scenario:
    return ff.load_scenario(name)


def stretched_plan() -> Plan:
    """One whose motion is too fast for its limits, without a feasible motion."""
    limits = ff.Limits(joint_rate=np.full(3, 0.01), clearance=0.0)
    problem = bundled("planar_3dof/parabola").problem()
    return ff.plan(problem, ff.Search("nearest", IDENTITY), limits)


def spatial_plan() -> Plan:
    """One with a map, limits, a certificate and tolerances."""
    limits = ff.Limits(joint_rate=np.full(6, 0.3), base_rate=0.3, base_turn=2.0)
    with smaller_searches():
        problem = bundled("spatial_6dof/line").problem()
        return ff.plan(problem, ff.Search(samples=64), limits)


def infeasible_plan() -> Plan:
    problem = bundled("planar_3dof/parabola").problem()
    return Plan(problem, ff.Search(), False, "no attitude is feasible")


def singular_simulation() -> ff.Simulation:
    """One of its motions ends in a singularity."""
    scenario = bundled("planar_3dof/parabola_nonstop")
    attitude = heading_quaternion(np.radians(140.0))
    return ff.simulate(scenario.problem(), attitude, limits=ff.Limits(base_rate=0.01))


def attitude_map() -> AttitudeMap:
    """One with everything that a map may have."""
    attitudes = attitude_grid(8)
    random = np.random.default_rng(5)
    margins, joints = random.random((8, 8)), random.random((8, 8, 6))
    return AttitudeMap(
        bundled("spatial_6dof/line").problem(),
        replace(branch_results(attitudes, margins, determinant_ratios=margins / 2), joints=joints),
        regions=(Region(1, 0.5, 0.1, attitudes[0], 0.3), Region(None, 0.1, 0.1, attitudes[1], 0.1)),
        best=Peak(attitudes[1], 2, 7.0),
        robust=Ball(attitudes[2], None, 0.2),
        nearest_to=attitudes[3],
        nearest=NearAttitude(attitudes[4], 0, 0.1, 0.05),
        boundary=(BoundaryPoint(attitudes[5], 3, None), BoundaryPoint(attitudes[5], None, 0.1)),
        tangency=(),
        search=ff.Search(seed=5),
        seconds=1.5,
    )  # fmt: skip


def singularity_map() -> ff.SingularityMap:
    robot = random_robot(np.random.default_rng(9), "RPRRPR")
    model = FreeFloatingModel.from_urdf(robot.text, robot.end_effector)
    fixed = {model.joint_names[0]: 0.3, model.joint_names[3]: -1.0}
    return ff.singularity_map(model, resolution=np.radians(20.0), fixed=fixed)


def reorientation() -> ff.Reorientation:
    problem = bundled("planar_2dof/line").problem()
    return ff.reorient(problem, IDENTITY, heading_quaternion(0.3), ff.Limits(base_rate=0.02))


def failed_reorientation() -> ff.Reorientation:
    problem = bundled("planar_2dof/line").problem()
    limits = ff.Limits(base_rate=0.02)
    return ff.reorient(problem, IDENTITY, heading_quaternion(0.3), limits, duration=1.0)


RESULTS: dict[str, Callable[[], Any]] = {
    "planar plan": planar_plan,
    "plan without a motion": infeasible_plan,
    "plan that violates limits": stretched_plan,
    "spatial plan": spatial_plan,
    "simulation": singular_simulation,
    "heading map": lambda: ff.attitude_map(bundled("planar_3dof/parabola").problem(), 12),
    "attitude map": attitude_map,
    "singularity map": singularity_map,
    "reorientation": reorientation,
    "reorientation that fails": failed_reorientation,
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", RESULTS)
def test_a_result_returns_with_all_of_its_fields(kind: str, tmp_path: Path) -> None:
    first, second = tmp_path / "first.h5", tmp_path / "second.h5"
    result = RESULTS[kind]()
    ff.save(result, first)
    loaded = ff.load(first)
    assert list(differing(result, loaded)) == []
    ff.save(loaded, second)
    np.testing.assert_equal(arrays(second), arrays(first))


@pytest.mark.slow
def test_a_manoeuvre_returns_with_all_of_its_phases(tmp_path: Path) -> None:
    file = tmp_path / "phases.yaml"
    file.write_text(PHASES)
    scenario = ff.load_scenario(file)
    limits, search = scenario.limits(), scenario.search()
    manoeuvre = ff.plan_manoeuvre(
        scenario.problem(), scenario.phases(), search, limits, reorient=True
    )
    assert {phase.kind for phase in manoeuvre.phases} == KINDS_OF_PHASES
    ff.save(manoeuvre, tmp_path / "first.h5", scenario)
    loaded = ff.load(tmp_path / "first.h5")
    assert list(differing(manoeuvre, loaded)) == []
    ff.save(loaded, tmp_path / "second.h5", scenario)
    np.testing.assert_equal(arrays(tmp_path / "second.h5"), arrays(tmp_path / "first.h5"))


KINDS_OF_PHASES = {"reorientation", "joints", "path", "capture"}


def test_a_record_in_two_places_is_one_record(tmp_path: Path) -> None:
    ff.save(singular_simulation(), tmp_path / "motion.h5")
    loaded = ff.load(tmp_path / "motion.h5")
    assert loaded.chosen in loaded.branches


def test_arrays_of_loaded_records_are_read_only(tmp_path: Path) -> None:
    ff.save(attitude_map(), tmp_path / "map.h5")
    loaded = ff.load(tmp_path / "map.h5")
    with pytest.raises(ValueError, match="read-only"):
        loaded.results.motions.minimum[0, 0] = 1.0
