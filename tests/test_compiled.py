"""Compiling kernels: kept on disk, compiled anew when any of them changes, or not kept at all."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from freefloat.kernels.compiled import compiled

HELPER = """
from freefloat.kernels.compiled import compiled

@compiled
def factor() -> float:
    return {value}
"""
KERNEL = """
from freefloat.kernels.compiled import compiled
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
