"""What commands cost, the first time and later, and the memory of a map."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import yaml

from benchmarks.result import Result, race

MODELS = Path(__file__).resolve().parents[2] / "models"
PROGRAM = str(Path(sys.executable).with_name("freefloat"))
NOW = [0.1, -0.5, 0.2, 0.8367]
SIMULATE = ("simulate", "spatial_6dof/line", "--attitude", "0.46", "0.0935", "0.7352", "-0.489")
SIMULATE_PLANAR = ("simulate", "planar_3dof/parabola", "--heading", "120")
PLAN, PLAN_PLANAR = ("plan", "spatial_6dof/line"), ("plan", "planar_3dof/parabola")
MISSIONS = ("servicing/inspect_client", "servicing/capture_client")
OBJECTIVES = ("nearest", "robust", "still", {"margin": 1, "turn": 0.5})
VARIANTS = (
    *((PLAN[1], f"objective {each}", {"search": {"objective": each, "from_attitude": NOW}})
      for each in OBJECTIVES),
    ("servicing/inspect_client", "law optimal", {"timing": {"law": "optimal", "duration": 45}}),
)  # fmt: skip
"""Scenarios, what differs, and the sections in place of theirs."""

_MAP = """
import pathlib, re, time
import freefloat as ff
def peak():
    return int(re.search(r"VmHWM:\\s*(\\d+)", pathlib.Path("/proc/self/status").read_text())[1])
problem = ff.load_scenario("spatial_6dof/line").problem()
ff.attitude_map(problem, 64)
before, start = peak(), time.perf_counter()
result = ff.attitude_map(problem, {samples}, refine={refine})
seconds = time.perf_counter() - start
print(seconds, before / 1024, peak() / 1024, result.motions)
"""


def whole_maps(quick: bool) -> list[Result]:
    """Maps from Python, each in a process of its own that has done nothing else."""
    cases = [(512, False, "", 0.1), (64 if quick else 36_864, False, "", 4.0),
             (64 if quick else 36_864, True, " and the searches between them", None)]  # fmt: skip
    return [_whole_map(*case) for case in cases]


def _whole_map(samples: int, refine: bool, searches: str, limit: float | None) -> Result:
    output = subprocess.run(
        [sys.executable, "-c", _MAP.format(samples=samples, refine=refine)],
        check=True, capture_output=True, text=True,
    ).stdout.split()  # fmt: skip
    seconds, before, after, motions = map(float, output)
    return Result(
        f"map of Example 2, {samples:,} attitudes{searches}", seconds, limit=limit,
        remark=f"{motions:,.0f} motions; {after - before:.0f} MiB of memory beside {before:.0f}",
    )  # fmt: skip


def run(*command: str, **environment: str) -> Callable[[], object]:
    """A command in a process of its own; an infeasible result is one, too.

    It keeps compiled bytecode, as that of an installed package is kept.
    """
    environment = {"PYTHONDONTWRITEBYTECODE": "", **environment}

    def call() -> None:
        done = subprocess.run(command, capture_output=True, env={**os.environ, **environment})
        if done.returncode not in (0, 1):
            raise RuntimeError(done.stderr.decode())

    return call


def start_up(quick: bool) -> list[Result]:
    helped, imported, simulated = race(
        run(PROGRAM, "--help"),
        run(sys.executable, "-c", "import freefloat"),
        run(PROGRAM, *SIMULATE),
        rounds=1 if quick else 5,
    )
    return [
        Result("`freefloat --help`", helped, limit=0.4),
        Result("`import freefloat`", imported, limit=0.5),
        Result("`freefloat simulate spatial_6dof/line`", simulated, remark="all eight branches"),
    ]


def commands(quick: bool) -> list[Result]:
    """From process start to exit, kernels compiled."""
    cases = [("plan spatial_6dof/line", PLAN, 2.5), ("plan planar_3dof/parabola", PLAN_PLANAR, 2.0),
             ("map spatial_6dof/line", ("map", PLAN[1], "--samples", "4096"), 4.0),
             *((f"plan {name}", ("plan", name), None) for name in MISSIONS)]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        for name, difference, change in VARIANTS:
            file = Path(folder) / f"{len(cases)}.yaml"
            document = yaml.safe_load((MODELS / f"{name}.yaml").read_text("utf-8"))
            limit = None
            if name == PLAN[1]:
                limit, document["robot"]["urdf"] = 4.0, "spatial_6dof"
            file.write_text(yaml.safe_dump(document | change), "utf-8")
            cases.append((f"plan {name}, {difference}", ("plan", str(file)), limit))
        calls = [run(PROGRAM, *command) for _, command, _ in cases]
        seconds = race(*calls, rounds=1 if quick else 3)
    return [
        Result(f"`freefloat {what}`", taken, limit=limit)
        for (what, _, limit), taken in zip(cases, seconds, strict=True)
    ]


def first_use() -> list[Result]:
    """The same on a computer on which nothing is compiled yet."""
    results = []
    for command, limit in ((SIMULATE, 4.0), (SIMULATE_PLANAR, 4.0), (PLAN, 15.0),
                           (PLAN_PLANAR, 15.0)):  # fmt: skip
        with tempfile.TemporaryDirectory() as folder:
            (seconds,) = race(run(PROGRAM, *command, NUMBA_CACHE_DIR=folder), rounds=1)
        name = f"`freefloat {command[0]} {command[1]}`, first use"
        results.append(Result(name, seconds, limit=limit))
    return results


def cost_results(quick: bool) -> list[Result]:
    return [*whole_maps(quick), *start_up(quick), *commands(quick), *([] if quick else first_use())]
