"""Studies from process start to exit, many disturbed motions, many closed loops."""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from shutil import rmtree
from typing import Any, NamedTuple

import numpy as np
import yaml

import freefloat as ff
from benchmarks.costs import PROGRAM, run
from benchmarks.motions import ATTITUDE
from benchmarks.plain import PlainMotion
from benchmarks.result import Result, processor_time, race
from freefloat.beyond.engines.mujoco import start
from freefloat.beyond.engines.mujoco_model import MuJoCoModel
from freefloat.beyond.engines.tracking import track_many
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.robots import Robots
from freefloat.ensemble.systems import Systems
from freefloat.limits.pairs import CollisionPairs
from freefloat.robot.named_files import find_scenario, find_study
from freefloat.studies.database import DATABASE
from freefloat.studies.rows import StudyRows

STUDY = "spatial_6dof/montecarlo"
AGAINST = "the plain loop at 1e-6, time of {} of the motions, multiplied"
BUNDLED = {"planar_3dof/grid": 5.0, STUDY: 5.0, "spatial_6dof/track": 8.0}
"""Bundled studies, and the largest permitted durations [s]."""
_FEW, _MANY = 10_000, 100_000
"""Runs of studies that are timed three times and twice; more are timed once."""
_TO_COMPILE = 100
"""Runs after which the kernels are on disk."""
WHOLE: dict[str, Any] = {
    "robot": {
        "urdf": "example-robot-data:ur5", "end_effector": "tool0",
        "spacecraft": {"mass": 200, "inertia": [35, 35, 35], "mount": {"xyz": [0, 0, 0.5]}},
    },
    "path": {
        "frame": "spacecraft", "line": {"from": [0.6, 0.1, 0.9], "to": [0.35, 0.35, 1.0]},
        "attitude": {"fixed": {"rpy": [0, 1.5707963268, 0]}},
    },
    "timing": {"duration": 20},
    "margin": {"measure": "gjm", "fraction": 0.2},
    "search": {"joints": [0.3, -1.2, 1.4, -0.2, 1.3, 0.2]},
    "limits": {
        "joint_rate": 0.1, "base_rate": 0.0165, "base_turn_deg": 15,
        "pointing": [{"body": "spacecraft", "axis": [0, 0, 1], "angle_deg": 20, "keep": "outside",
                      "target": {"direction": [0.63, 0.28, 0.73]}}],
    },
}  # fmt: skip
"""A base scenario with a fraction, a path in the spacecraft's frame and limits."""


def limited(**limits: float) -> dict[str, Any]:
    """The same with further limits."""
    return WHOLE | {"limits": WHOLE["limits"] | limits}


SLOWER = 1.0 / 1.08
"""Ratio of a motion with the problem's robot and one with a robot of its own."""


class Case(NamedTuple):
    """A study."""

    name: str
    document: dict[str, Any]
    links: tuple[str, ...]  # with mass factors of their own
    base: dict[str, Any]  # changes to the base scenario
    runs: int
    limit: float | None = None  # of the duration [s]
    wanted: float | None = None  # ratio of the plain loop's processor time


def cases() -> list[Case]:
    """The bundled Monte Carlo, without and with a robot for each run, and studies of other arms."""
    bundled = yaml.safe_load(find_study(STUDY).read_text("utf-8"))
    by_link = bundled | {"vary": {key: values for key, values in bundled["vary"].items()
                                  if key != "robot.scale_mass"}}  # fmt: skip
    links = ("spacecraft", *(f"link_{k}" for k in range(1, 7)))
    momentum = {"momentum": {"ball": {"center": [0, 0, 0], "radius": 0.2}}}
    ur5 = {"base": "ur5_servicer/arc", "command": "simulate", "attitude": [0, 0, 0, 1], "seed": 7,
           "vary": momentum}  # fmt: skip
    panda = ur5 | {"base": "panda_servicer/line", "attitude": [0, 0, 0.2, 0.98]}
    margin = {"margin": {"measure": "gjm", "value": 0.01}, "limits": {}}
    arm = ("upper_arm_link", "forearm_link", "wrist_1_link", "wrist_2_link", "wrist_3_link")
    panda_links = tuple(f"panda_link{k}" for k in range(1, 8))
    factors = " and a mass factor for each link"
    scenario = ("a UR5 with a fraction, a path from the spacecraft and limits of joint rates, base "
                "rate, turn and pointing")  # fmt: skip
    whole = ur5 | {"vary": {"robot.spacecraft.mass": {"uniform": [150, 250]},
                            "timing.duration": {"uniform": [15, 30]}, **momentum}}  # fmt: skip
    return [
        Case(STUDY, bundled, (), {}, 10_000, 3.0),
        Case(STUDY, bundled, (), {}, 100_000, 9.0, 200.0),
        Case(STUDY, bundled, (), {}, 1_000_000, 90.0, 200.0),
        Case(STUDY + factors, by_link, links, {}, 10_000, 4.0),
        Case(STUDY + factors, by_link, links, {}, 100_000, 15.0, 200.0),
        Case(STUDY + factors, by_link, links, {}, 1_000_000, 150.0, 200.0),
        Case("a study of a UR5" + factors, ur5, arm, margin, 100_000, None, 100.0),
        Case("a study of seven joints" + factors, panda, panda_links, margin, 100_000, None, 100.0),
        Case(scenario, whole, (), WHOLE, 5_000, None, 100.0),
        Case(f"{scenario}, and torques", whole, (), limited(joint_torque=0.012), 5_000, None, 15.0),
        Case(f"{scenario}, and a clearance", whole, (), limited(clearance=0.013), 5_000, None, 3.0),
    ]  # fmt: skip


def write_study(case: Case, runs: int, folder: Path) -> Path:
    """Write a study, and its base scenario if that is changed."""
    document = case.document | {"cases": runs, "files": "none"}
    document["vary"] = document["vary"] | {
        f"robot.scale_mass.{link}": {"uniform": [0.95, 1.05]} for link in case.links
    }
    if case.base:
        base = yaml.safe_load(find_scenario(document["base"]).read_text("utf-8")) | case.base
        (folder / "base.yaml").write_text(yaml.safe_dump(base), "utf-8")
        document["base"] = "base.yaml"
    file = folder / "study.yaml"
    file.write_text(yaml.safe_dump(document), "utf-8")
    return file


def vector(row: dict[str, Any], name: str) -> np.ndarray:
    """A vector of a row, whose entries are columns."""
    return np.array([value for key, value in row.items() if key.startswith(f"{name}.")])


_WITH_PEAK = """
import os, resource, sys
child = os.posix_spawn(sys.argv[2], sys.argv[2:], os.environ)
code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
with open(sys.argv[1], "w") as file:
    file.write(str(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss))
sys.exit(code)
"""
"""Notes the memory of a command: a process begins with the peak of the one that starts it."""


def study(case: Case, quick: bool) -> list[Result]:
    """A study and the plain loop on some of its runs, alternately."""
    picks, runs = (2, 100) if quick else (24, case.runs)
    with tempfile.TemporaryDirectory() as place:
        file, out = write_study(case, _TO_COMPILE, Path(place)), Path(place) / "out"
        peak, batch = Path(place, "peak"), (PROGRAM, "batch", str(file), "-o", str(out), "--quiet")
        command = run(sys.executable, "-S", "-c", _WITH_PEAK, str(peak), *batch)
        command()
        write_study(case, runs, Path(place))
        loaded = ff.load_study(file)
        rows = StudyRows(out / DATABASE, list(loaded.variation.columns(0, 1)))
        starts = [(vector(rows[k], "attitude"), vector(rows[k], "joints")) for k in range(picks)]
        problems = [loaded.scenario(k).problem() for k in range(picks)]
        motions, limits = (
            [PlainMotion(problem) for problem in problems],
            case.base.get("limits", {}),
        )
        checked: dict[str, Any] = {"torques": "joint_torque" in limits}
        if "clearance" in limits:
            checked["pairs"] = CollisionPairs(problems[0].model, limits["clearance"])

        def loop() -> None:
            for motion, start in zip(motions, starts, strict=True):
                motion.worst(*start, 6, **checked) if limits else motion.minimum(*start)

        best = np.full(3, np.inf)
        for _ in range(1 if quick else 1 + (runs <= _MANY) + (runs <= _FEW)):
            rmtree(out)
            best = np.minimum(best, [*processor_time(command), processor_time(loop)[1]])
        memory = float(peak.read_text("utf-8")) / 1024.0
    seconds, ours, sample = best.tolist()
    name = f"`freefloat batch` of {case.name}, {runs:,} runs"
    return [
        Result(name, seconds, limit=case.limit,
               remark=f"from start to exit, at most {memory:.0f} MiB of memory"),
        Result(name, ours, AGAINST.format(picks), sample / picks * runs, case.wanted,
               remark="processor time"),
    ]  # fmt: skip


def bundled_study(name: str, limit: float, quick: bool) -> Result:
    """A bundled study from start to exit, with its files."""
    with tempfile.TemporaryDirectory() as place:
        out = Path(place) / "out"
        command = run(PROGRAM, "batch", name, "-o", str(out), "--quiet")
        seconds = []
        for _ in range(1 if quick else 3):
            rmtree(out, ignore_errors=True)
            seconds.append(processor_time(command)[0])
    what = f"`freefloat batch {name}`"
    return Result(what, min(seconds), limit=limit, remark="from start to exit")


def own_robots(scenario: str, name: str, quick: bool) -> Result:
    """A motion with a robot of its own against one with the robot of the problem."""
    count, rng = 64 if quick else 4096, np.random.default_rng(2)
    problem = ff.load_scenario(scenario).problem()
    attitudes = rng.normal(size=(count, 4))
    attitudes /= np.linalg.norm(attitudes, axis=1, keepdims=True)
    branches = problem.many_branches(attitudes)
    attitudes = attitudes[np.nonzero(branches.exist)[0]][:count]
    joints, integrator = branches.joints[branches.exist][:count], EnsembleIntegrator(problem, 1)
    numbers = np.arange(len(joints))
    robots = Robots.of(problem.model, numbers, lambda number: problem.model, factors={})
    systems = replace(Systems.of(problem), robots=robots)
    alike, own = (lambda: integrator.integrate(attitudes, joints),
                  lambda: integrator.integrate(attitudes, joints, systems))  # fmt: skip
    alike(), own()
    seconds, baseline = race(own, alike, rounds=1 if quick else 8)
    return Result(
        f"one motion of an ensemble with a robot of its own, {name}", seconds / len(joints),
        "with the problem's robot", baseline / len(joints), SLOWER,
    )  # fmt: skip


def many_motions(scenario: str, name: str, wanted: float, quick: bool) -> Result:
    """Attitude, momentum, duration and masses disturbed."""
    count, picks = (200, 2) if quick else (20_000, 24)
    problem, rng = ff.load_scenario(scenario).problem(), np.random.default_rng(1)
    attitudes = rng.normal(size=(200, 4))
    attitudes /= np.linalg.norm(attitudes, axis=1, keepdims=True)
    motions = ff.simulate_many(problem, attitudes)
    best = int(np.argmax(motions.minimum_margins))
    attitude, joints = attitudes[best], motions.joints[best]
    momenta = problem.momentum + rng.uniform(-0.3, 0.3, (count, 3))
    disturbances = {
        "durations": problem.path.duration * rng.uniform(0.5, 2.0, count),
        "scale_mass": rng.uniform(0.9, 1.1, count),
    }

    def loop() -> None:
        for momentum in momenta[:picks]:
            PlainMotion(replace(problem, momentum=momentum)).minimum(attitude, joints)

    seconds, sample = race(
        lambda: ff.simulate_many(problem, attitude, joints=joints, momenta=momenta, **disturbances),
        loop, rounds=1 if quick else 3,
    )  # fmt: skip
    return Result(
        f"{count:,} disturbed motions of {name}, `simulate_many`", seconds, AGAINST.format(picks),
        sample / picks * count, wanted,
    )  # fmt: skip


def closed_loops(quick: bool) -> Result:
    """Plans followed with feedback; MuJoCo's own integrator, without controllers."""
    problem, count = ff.load_scenario("spatial_6dof/line").problem(), 16 if quick else 160
    simulation = ff.simulate(problem, ATTITUDE)
    motion, engine = simulation.chosen.motion, MuJoCoModel(problem.system)
    start(motion, engine, 0.0, np.zeros(problem.model.dof))
    engine.rest(0.01)
    engine.set_friction(0.1)
    steps, torques = round(problem.path.duration / 0.01), np.zeros(problem.model.dof)

    def loop() -> None:
        for _ in range(steps):
            engine.step(torques)

    seconds, sample = race(
        lambda: track_many(
            simulation, mass_error=0.2, noise=0.01, friction=0.1, seed=range(count)
        ),
        loop, rounds=1 if quick else 3,
    )  # fmt: skip
    return Result(
        f"{count} closed loops of Example 2, `track_many`", seconds,
        "MuJoCo's Runge-Kutta steps of 0.01 s for one of them, multiplied", sample * count, 2.0,
    )  # fmt: skip


def batch_results(quick: bool) -> list[Result]:
    results = [bundled_study(name, limit, quick) for name, limit in BUNDLED.items()]
    results += [result for case in cases() for result in study(case, quick)]
    for scenario, name, wanted in (
        ("spatial_6dof/line", "Example 2", 400.0), ("ur5_servicer/arc", "a UR5", 100.0),
    ):  # fmt: skip
        results.append(own_robots(scenario, name, quick))
        results.append(many_motions(scenario, name, wanted, quick))
    return [*results, closed_loops(quick)]
