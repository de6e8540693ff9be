"""Compilation of kernels and their cache on disk."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.kernels.compilation import compiled
from freefloat.io.scenario import load_scenario
from freefloat.motion.margin import Margin
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.paths.timing import TimedPath, Timing
from freefloat.planning.simulation import simulate

HELPER = """
from freefloat.ensemble.kernels.compilation import compiled

@compiled
def factor() -> float:
    return {value}
"""
KERNEL = """
from freefloat.ensemble.kernels.compilation import compiled
from helper import factor

@compiled
def scaled(x):
    '''Scale.'''
    return factor() * x
"""
RUN = """
from pathlib import Path
from freefloat.ensemble.kernels import compilation
compilation._PACKAGE = Path.cwd()
import kernel
print(kernel.scaled(3.0), sum(kernel.scaled.stats.cache_hits.values()), kernel.scaled.__doc__)
"""


def run(folder: Path) -> list[str]:
    """Result of the kernel in a new process, and the number of cache hits."""
    command = [sys.executable, "-c", RUN]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.slow
def test_cached_kernels_are_compiled_again_when_a_called_kernel_changes(tmp_path: Path) -> None:
    """Also when the called kernel is in another file, which Numba does not check."""
    (tmp_path / "kernel.py").write_text(KERNEL)
    (tmp_path / "helper.py").write_text(HELPER.format(value=2.0))
    assert run(tmp_path) == ["6.0", "0", "Scale."]
    assert run(tmp_path) == ["6.0", "1", "Scale."]
    (tmp_path / "helper.py").write_text(HELPER.format(value=5.0))
    assert run(tmp_path) == ["15.0", "0", "Scale."]


def test_kernels_run_without_a_cache_folder() -> None:
    """A function without a file has no folder for its cache."""
    scope = {"compiled": compiled}
    exec(compile("@compiled\ndef twice(x):\n    return 2.0 * x\n", "<nowhere>", "exec"), scope)
    assert scope["twice"](4.0) == 8.0
    assert not scope["twice"].stats.cache_path


def signatures() -> dict[str, int]:
    """Number of compiled signatures of each kernel."""
    return {
        f"{name}.{kernel}": len(thing.signatures)
        for name in sys.modules if name.startswith("freefloat.")
        for kernel, thing in vars(sys.modules[name]).items() if isinstance(thing, Dispatcher)
    }  # fmt: skip


def test_integers_and_read_only_arrays_need_no_further_compilation() -> None:
    """Compiling the kernels again would take a quarter of a minute."""
    problem = load_scenario("spatial_6dof/line").problem()
    used(problem)
    before = signatures()
    path = TimedPath(problem.path.path, Timing(round(problem.path.duration)))
    margin = Margin(problem.margin.measure, round(problem.margin.threshold))
    whole = Problem(problem.model, path, problem.task, (0, 0, 1), margin)
    used(whole)
    assert before["freefloat.ensemble.kernels.integration.integrate_many"] > 0
    assert signatures() == before


def used(problem: Problem) -> Motion:
    """The chosen motion, after all kernels have been called."""
    attitude = np.array([0.0, 0.0, 0.0, 1.0])
    results = FeasibilityEvaluator(problem, 1).evaluate(attitude[None], stop_at_margin=True)
    assert (results.motions.endings >= 0).any()
    return simulate(problem, attitude).chosen.motion
