"""Studies from process start to exit, and many disturbed motions, against the plain loop."""

from __future__ import annotations

import resource
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from shutil import rmtree

import numpy as np

import freefloat as ff
from benchmarks.costs import PROGRAM, run
from benchmarks.motions import ATTITUDE
from benchmarks.plain import PlainMotion
from benchmarks.result import Result, race
from freefloat.robot.names import find_study

STUDY = "spatial_6dof/montecarlo"
AGAINST = "the plain loop at 1e-6, time of {} of the motions, multiplied"


def studies(quick: bool) -> list[Result]:
    """The bundled Monte Carlo with more runs; the plain loop integrates some of its motions."""
    picks = 2 if quick else 24
    problem = ff.load_scenario("spatial_6dof/line").problem()
    joints = ff.simulate(problem, ATTITUDE).chosen.branch.joints
    momenta = [run["momentum"] for run in map(ff.load_study(STUDY).parameters, range(picks))]

    def loop() -> None:
        for momentum in momenta:
            disturbed = replace(problem, momentum=np.array(momentum))
            PlainMotion(disturbed).minimum(ATTITUDE, joints)

    cases = ((10_000, 3.0, 3), (100_000, 9.0, 3), (1_000_000, 90.0, 1))
    return [
        result
        for runs, limit, rounds in (((200, 3.0, 1),) if quick else cases)
        for result in _study(runs, limit, rounds, loop, picks)
    ]


def _study(
    runs: int, limit: float, rounds: int, loop: Callable[[], None], picks: int
) -> list[Result]:
    """Duration of a study and its processor time, alternating with the plain loop."""
    times = []
    with tempfile.TemporaryDirectory() as place:
        file, out = Path(place) / "study.yaml", Path(place) / "out"
        text = find_study(STUDY).read_text("utf-8").replace("cases: 200", f"cases: {runs}")
        file.write_text(text, "utf-8")
        command = run(PROGRAM, "batch", str(file), "-o", str(out), "--quiet")
        command()
        for _ in range(rounds):
            rmtree(out)
            begin, before, alone = time.perf_counter(), _children(), time.process_time()
            command()
            wall, after = time.perf_counter() - begin, _children()
            loop()
            times.append((wall, after - before, time.process_time() - alone))
    wall, processor, plain = np.min(times, axis=0).tolist()
    name = f"`freefloat batch {STUDY}` with {runs:,} runs"
    wanted = 200.0 if runs >= 100_000 else None
    return [
        Result(name, wall, limit=limit, remark="from start to exit"),
        Result(name, processor, AGAINST.format(picks), plain / picks * runs, wanted,
               remark="processor time"),
    ]  # fmt: skip


def _children() -> float:
    """Processor time of the processes that ended [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def many_motions(quick: bool) -> list[Result]:
    """Attitude, momentum, duration and masses disturbed."""
    scenarios = (("spatial_6dof/line", "Example 2", 400.0), ("ur5_servicer/arc", "a UR5", 100.0))
    return [_many_motions(*entry, quick) for entry in scenarios]


def _many_motions(scenario: str, name: str, wanted: float, quick: bool) -> Result:
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


def batch_results(quick: bool) -> list[Result]:
    return [*studies(quick), *many_motions(quick)]
