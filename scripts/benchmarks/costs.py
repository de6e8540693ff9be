"""What it costs to start, and the memory of a map."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from benchmarks.result import Result, race

_MAP = """
import resource, time
import freefloat as ff
problem = ff.load_scenario("spatial_6dof/line").problem()
ff.attitude_map(problem, 64)
before, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.perf_counter()
result = ff.attitude_map(problem, {samples})
seconds = time.perf_counter() - start
after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(seconds, before / 1024, after / 1024, result.motions)
"""


def large_map(quick: bool) -> list[Result]:
    """The default map of the command, in a process of its own that has done nothing else."""
    samples = 64 if quick else 36_864
    output = subprocess.run(
        [sys.executable, "-c", _MAP.format(samples=samples)],
        check=True, capture_output=True, text=True,
    ).stdout.split()  # fmt: skip
    seconds, before, after, motions = map(float, output)
    remark = f"{motions:,.0f} motions; {after - before:.0f} MiB of memory beside {before:.0f}"
    return [Result(f"map of Example 2, {samples:,} attitudes", seconds, limit=40.0, remark=remark)]


def start_up(quick: bool) -> list[Result]:
    def run(*command: str) -> Callable[[], object]:
        return lambda: subprocess.run(command, check=True, capture_output=True)

    program = str(Path(sys.executable).with_name("freefloat"))
    simulation = (program, "simulate", "spatial_6dof/line", "--attitude", "0.46", "0.0935")
    helped, imported, simulated = race(
        run(program, "--help"),
        run(sys.executable, "-c", "import freefloat"),
        run(*simulation, "0.7352", "-0.489"),
        rounds=1 if quick else 5,
    )
    return [
        Result("`freefloat --help`", helped, limit=0.4),
        Result("`import freefloat`", imported, limit=0.5),
        Result("`freefloat simulate spatial_6dof/line`", simulated, remark="all eight branches"),
    ]


def cost_results(quick: bool) -> list[Result]:
    return [*large_map(quick), *start_up(quick)]
