"""Compiling kernels: kept on disk, compiled anew when any of them changes, or not kept at all."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from freefloat.dynamics.kernels.compilation import compiled
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.io.scenario import load_scenario
from freefloat.motion.arc_length import arc_flow
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Margin, Problem
from freefloat.paths.timing import TimedPath, Timing
from freefloat.planning.simulation import simulate

HELPER = """
from freefloat.dynamics.kernels.compilation import compiled

@compiled
def factor() -> float:
    return {value}
"""
KERNEL = """
from freefloat.dynamics.kernels.compilation import compiled
from helper import factor

@compiled
def scaled(x):
    '''Scale.'''
    return factor() * x
"""
RUN = """
import kernel
print(kernel.scaled(3.0), sum(kernel.scaled.stats.cache_hits.values()), kernel.scaled.__doc__)
"""


def run(folder: Path) -> list[str]:
    """What the kernel gives in a fresh process, and how often it was found on disk."""
    command = [sys.executable, "-c", RUN]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.slow
def test_kernels_are_found_on_disk_until_one_that_they_call_changes(tmp_path: Path) -> None:
    """Also when that one stands in another file, which numba by itself does not look at."""
    (tmp_path / "kernel.py").write_text(KERNEL)
    (tmp_path / "helper.py").write_text(HELPER.format(value=2.0))
    assert run(tmp_path) == ["6.0", "0", "Scale."]
    assert run(tmp_path) == ["6.0", "1", "Scale."]
    (tmp_path / "helper.py").write_text(HELPER.format(value=5.0))
    assert run(tmp_path) == ["15.0", "0", "Scale."]


def test_where_nothing_can_be_kept_kernels_still_run() -> None:
    """A function without a file has no folder beside it."""
    scope = {"compiled": compiled}
    exec(compile("@compiled\ndef twice(x):\n    return 2.0 * x\n", "<nowhere>", "exec"), scope)
    assert scope["twice"](4.0) == 8.0
    assert not scope["twice"].stats.cache_path


def test_division_by_zero_is_numpys() -> None:
    """Infinite, not an exception."""

    @compiled
    def inverse(x: float) -> float:
        return 1.0 / x

    assert inverse(0.0) == np.inf


def machine_code() -> dict[str, int]:
    """For how many kinds of arguments each kernel is compiled."""
    return {
        f"{name}.{kernel}": len(thing.signatures)
        for name in sys.modules if name.startswith("freefloat.kernels.")
        for kernel, thing in vars(sys.modules[name]).items() if isinstance(thing, Dispatcher)
    }  # fmt: skip


@pytest.mark.parametrize("name", ["planar_3dof/parabola_nonstop", "spatial_6dof/line"])
def test_whole_numbers_and_those_that_nobody_may_change_take_the_same_machine_code(
    name: str,
) -> None:
    """Compiling it again would be a quarter of a minute in which nothing seems to happen."""
    problem = load_scenario(name).problem()
    motion = used(problem)
    before = machine_code()
    path = TimedPath(problem.path.path, Timing(round(problem.path.duration)))
    margin = Margin(problem.margin.measure, round(problem.margin.threshold))
    whole = Problem(problem.model, path, problem.task, (0, 0, 1), margin)
    used(whole)
    determinant = arc_flow(whole).determinant
    assert determinant is not None
    assert determinant(motion.joints[0]) != 0.0
    assert before["freefloat.ensemble.kernels.integration.integrate_many"] > 0
    assert machine_code() == before


def used(problem: Problem) -> Motion:
    """Its first motion, after many branches were found and followed."""
    attitude = np.array([0.0, 0.0, 0.0, 1.0])
    found = FeasibilityEvaluator(problem, 1).evaluate(attitude[None], stop_at_margin=True)
    assert (found.endings >= 0).any()
    return simulate(problem, attitude).chosen.motion
