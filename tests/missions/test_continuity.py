"""Phases join: each begins with the state at which the one before ends, in every manoeuvre."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.beyond.missions.manoeuvre import Manoeuvre
from freefloat.certificate.certificate import certify
from freefloat.errors import UnreachableError
from freefloat.io.scenario.scenario import Scenario
from freefloat.planning.plan import Plan
from freefloat.so3 import Array, Pose, angle_between
from tests.robots import random_robot

ARMS = {
    0: ("RRR", "position"), 1: ("RCP", "position"), 2: ("RRCR", "position"), 3: ("RRRRRR", "pose"),
    5: ("CRPR", "position"),
}  # fmt: skip
"""Structures of arms by seed, some of them redundant, and their tasks."""
REORIENTED = 0
"""The manoeuvre that begins with a reorientation."""
SAME = 1e-9
SAMPLES = "on.csv"


def rates(phase: Any, end: int) -> Array:
    """Joint rates at the first or last node, by differences of the motion itself."""
    motion, step = phase.motion, 1e-4
    nearby = motion.times[end] + (step if end == 0 else -step) * np.arange(4)
    _, _, q = motion.evaluate(motion.coordinates_at(nearby))
    slope = (-11.0 * q[0] + 18.0 * q[1] - 9.0 * q[2] + 2.0 * q[3]) / (6.0 * step)
    return slope if end == 0 else -slope


def base(phase: Any, end: int) -> Array:
    """Position of the root link in the frame of the manoeuvre [m]."""
    motion, state = phase.motion, (phase.motion.initial, phase.motion.final)[end]
    return phase.centre + state.time * motion.setting.drift + state.base_position


def joins(manoeuvre: Manoeuvre) -> int:
    """The number of joins between motions, all of which are continuous."""
    impulse = {}
    moving = [phase for phase in manoeuvre.phases if phase.motion is not None]
    for before, phase in pairwise(manoeuvre.phases):
        if before.kind == "capture":
            impulse[phase.name] = before.result.joint_rates
    for before, after in pairwise(moving):
        last, first = before.motion.final, after.motion.initial
        assert angle_between(last.attitude, first.attitude) < SAME
        np.testing.assert_allclose(first.joints, last.joints, rtol=0.0, atol=1e-14)
        np.testing.assert_allclose(base(after, 0), base(before, -1), atol=SAME)
        ending = impulse.get(after.name, rates(before, -1))
        if after.feasible:
            np.testing.assert_allclose(rates(after, 0), ending, atol=1e-6)
    return len(moving) - 1


def checked(found: Manoeuvre, folder: Path) -> Manoeuvre:
    """A manoeuvre as it is after saving and loading; where it is feasible, ``check`` passes."""
    file = folder / "manoeuvre.h5"
    ff.save(found, file)
    (folder / SAMPLES).unlink()  # the file holds them
    ff.save(ff.load(file), file)
    loaded = ff.load(file)
    assert loaded.to_dict()["reason"] == found.reason
    if found.feasible:
        # the stand-ins for plans lack maps, and state nothing that is false
        missing = {entry.name: entry.stated for entry in ff.check(loaded).discrepancies}
        assert set(missing.values()) == {None}
        assert {name.rpartition(".")[2] for name in missing} == {"map"}
    return loaded


def as_document(task: str, first: Array, last: Array, axes: Array) -> dict[str, Any]:
    """A line in the frame of the client, with a fixed orientation."""
    path: dict[str, Any] = {"line": {"from": first.tolist(), "to": last.tolist()}}
    if task == "pose":
        path["attitude"] = {"fixed": {"quaternion": quaternion(axes)}}
    return path | {"frame": "client"}


def quaternion(axes: Array) -> list[float]:
    return Rotation.from_matrix(axes).as_quat().tolist()


def random_scenario(seed: int, folder: Path) -> Scenario:
    """An arm that approaches a tumbling client, captures it or not, and moves on, at random."""
    rng = np.random.default_rng(seed)
    chain, task = ARMS[seed]
    robot = random_robot(rng, chain)
    (folder / "robot.urdf").write_text(robot.text)
    model = ff.FreeFloatingModel.from_urdf(str(folder / "robot.urdf"), robot.end_effector)
    measure = ff.singularity_measure(model, task, "gjm")
    drawn = rng.uniform(-2.5, 2.5, (64, model.dof))
    joints = drawn[np.argmax([abs(measure(q)) for q in drawn])]
    attitude = Rotation.random(rng=rng)
    there = model.end_effector_pose(attitude.as_quat(), joints)
    client = Pose(there.position + rng.uniform(-1.0, 1.0, 3), Rotation.random(rng=rng).as_matrix())
    grasp = client.inverse() @ there
    points = grasp.position + 0.01 * np.arange(3)[:, None] * rng.normal(size=3)
    paths = [as_document(task, *ends, grasp.rotation) for ends in pairwise(points)]
    np.savetxt(folder / SAMPLES, points[1:], delimiter=",", header="x,y,z", comments="")
    paths[1]["samples"] = str(folder / SAMPLES)
    del paths[1]["line"]
    capture = {"capture": {"body": "client", "mass": float(rng.uniform(5.0, 50.0))}}
    beyond = {"joints": rng.uniform(-3.9, 3.9, model.dof).tolist(), "duration": 90.0}
    turned = joints + rng.uniform(-0.2, 0.2, model.dof) + 2.0 * np.pi * (np.array([*chain]) == "C")
    near = {"joints": turned.tolist(), "duration": 60.0}
    step = {"position": rng.uniform(-0.01, 0.01, 3).tolist(), "frame": "end_effector"}
    stop = {"to": step, "duration": 15.0}
    redundant = model.dof > (6 if task == "pose" else 3)  # whose rates another robot would change
    captured = [capture] if seed % 2 else []
    rest = [beyond, near, stop] if redundant or seed % 3 else [stop, beyond]
    present = attitude * Rotation.from_rotvec(rng.uniform(-0.01, 0.01, 3))
    return ff.load_scenario({
        "robot": {"urdf": str(folder / "robot.urdf"), "end_effector": robot.end_effector},
        "task": task, "path": paths[0],
        "timing": {"duration": 15.0, "law": "quintic" if "frame" in paths[0] else "optimal"},
        "margin": {"measure": "gjm", "value": 0.0},
        "momentum": rng.uniform(-0.1, 0.1, 3).tolist(),
        "wheels": {"momentum": rng.uniform(-0.1, 0.1, 3).tolist()},
        "drift": rng.uniform(-1e-3, 1e-3, 3).tolist(),
        "search": {"objective": "nearest", "from_attitude": present.as_quat().tolist(),
                   "joints": joints.tolist(), "reorient": seed == REORIENTED},
        "scene": {"bodies": [{
            "name": "client", "sphere": 0.1, "position": client.position.tolist(),
            "orientation": {"quaternion": quaternion(client.rotation)},
            "tumbling": {"inertia": [0.3, 0.4, 0.5], "rate": rng.uniform(-2e-3, 2e-3, 3).tolist()},
        }]},
        "phases": [{"path": paths[1], "timing": {"duration": 12.0}}, *captured, *rest],
    })  # fmt: skip


def first_reached(problem: ff.Problem, search: ff.Search, limits: ff.Limits, **_: Any) -> Plan:
    """In place of a search: the motion from an attitude near the present one."""
    problem = search.applied_to(problem).stretched(0.99)  # a timing that is found
    rng = np.random.default_rng(0)
    for _ in range(32):
        turn = Rotation.from_rotvec(rng.uniform(-0.01, 0.01, 3))
        attitude = (Rotation.from_quat(search.from_attitude) * turn).as_quat()
        try:
            chosen = ff.simulate(problem, attitude).chosen
        except UnreachableError:
            continue
        if chosen.feasible:
            return Plan(problem, search, True, "", chosen=chosen, limits=limits,
                        limit_results=tuple(ff.check_limits(chosen.motion, limits)),
                        certificate=certify(chosen.motion))  # fmt: skip
    raise AssertionError("no attitude near the present one serves")


@pytest.mark.slow
@pytest.mark.parametrize("seed", ARMS)
def test_phases_of_random_manoeuvres_join(seed: int, tmp_path: Path, monkeypatch) -> None:
    """With momentum, wheels and drift, joints beyond pi, captures, redundant and prismatic arms."""
    monkeypatch.setattr("freefloat.beyond.missions.manoeuvre_planner.plan", first_reached)
    scenario = random_scenario(seed, tmp_path)
    found = ff.plan_manoeuvre(
        scenario.problem(), scenario.phases(), scenario.search(), scenario.limits(),
        reorient=scenario.content.search.reorient,
    )  # fmt: skip
    assert found.feasible, found.reason
    assert joins(found) == joins(checked(found, tmp_path)) > 1
