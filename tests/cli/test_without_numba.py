"""Commands where Numba is missing, or refuses the NumPy that is installed."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.commands import document, without_progress

REASONS = {
    "ModuleNotFoundError": "No module named 'numba'",
    "ImportError": "Numba needs NumPy 2.4 or less. Got NumPy 9.0",
}
NEED_KERNELS = (
    "plan spatial_6dof/line",
    "map spatial_6dof/line --samples 64",
    "batch spatial_6dof/montecarlo --output study",
    "simulate servicing/two_arms_both --attitude 0 0 0 1",
)


def run(
    folder: Path, words: str, refusal: str = "ModuleNotFoundError"
) -> subprocess.CompletedProcess[str]:
    """A command in a folder with a module ``numba`` that cannot be imported."""
    (folder / "numba.py").write_text(f"raise {refusal}({REASONS[refusal]!r})")
    return subprocess.run(
        [sys.executable, "-m", "freefloat", *words.split()],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(folder)}, capture_output=True, text=True,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "refusal"),
    [
        *((words, "ModuleNotFoundError") for words in NEED_KERNELS[1:]),
        (NEED_KERNELS[0], "ImportError"),
    ],
)
def test_what_needs_kernels_ends_with_one_sentence(tmp_path, words, refusal):
    done = run(tmp_path, f"{words} --json", refusal)
    assert done.returncode == 2, done.stderr
    (line,) = without_progress(done.stderr).splitlines()
    error = json.loads(done.stdout)["error"]
    assert line == f"freefloat: {error['message']}"
    assert error["key"] == "numba"
    assert REASONS[refusal] in line
    assert not (tmp_path / "study").exists()


@pytest.mark.slow
def test_motions_are_simulated_and_checked(tmp_path: Path) -> None:
    assert run(tmp_path, "info planar_2dof/line").returncode == 0
    written = run(tmp_path, "simulate planar_2dof/line --heading 30 --output motion.h5")
    assert (written.returncode, without_progress(written.stderr)) == (0, "")
    assert run(tmp_path, "check motion.h5").returncode == 0


@pytest.mark.slow
def test_a_planar_plan_is_that_of_the_kernels(tmp_path: Path) -> None:
    done = run(tmp_path, "plan planar_2dof/arc --json")
    assert done.returncode == 0
    (line,) = without_progress(done.stderr).splitlines()  # that it takes longer, and why
    assert REASONS["ModuleNotFoundError"] in line
    found, expected = json.loads(done.stdout), document("plan", "planar_2dof/arc")
    for plan in (found, expected):
        ranges = [part for entry in plan["attitude_ranges_deg"] for part in entry["ranges"]]
        plan["edges"] = [edge for part in ranges for edge in part]
        plan["margin"] = plan["min_margin"]["value"]
    for key in ("heading_deg", "margin", "edges"):
        assert found[key] == pytest.approx(expected[key], rel=1e-6, abs=1e-6)
