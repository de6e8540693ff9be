"""The tutorial scripts: how they are run, and the number in which each ends."""

import re
import runpy
import subprocess
import sys
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from tests.commands import without_progress

SCRIPTS = sorted((Path(__file__).parents[1] / "scripts").glob("[0-9][0-9]_*.py"))
(MISSION,) = (script for script in SCRIPTS if script.stem == "09_inspect_a_client")
ENDS = {
    "01_load_a_urdf": ("total mass: {} kg", 220.9939, 1e-4),
    "02_generalized_jacobian": ("dynamically singular at an elbow of {} deg", 11.2981, 1e-4),
    "03_follow_a_path": ("branch 2 becomes singular at {} s", 54.6620, 1e-3),
    "04_planar_ranges": ("heading: {} deg", 246.9150, 0.02),
    "05_so3_map": ("feasible: {}% of 512 attitudes", 96.2, 2.0),
    "06_plan_with_limits": ("duration: {} s instead of 30 s", 225.327, 0.5),
    "07_playback": ("apart: {} deg", 88.4002, 1e-3),
    "08_study": ("feasible: {} %", 50.0, 1e-9),
    "09_inspect_a_client": ("moved by the cones: {} deg", 15.1, 3.0),
    "10_capture_a_client": ("with locked joints: {} deg/s", 0.367, 0.01),
    "11_two_arms": ("moving: the spacecraft turns by up to {} deg", 1.52, 0.01),
    "12_from_the_table_to_orbit": (
        "smallest |det S*|: 0.0650 on the table, {} in orbit",
        0.0475,
        0.0005,
    ),
}
"""The last line of each, the number in it, and how far it may be off: where a search decides, as
far as its samples are apart."""
WRITTEN = {
    "03_follow_a_path": ["motion.png"],
    "04_planar_ranges": ["joint_space.png"],
    "05_so3_map": ["so3_map.png"],
    "06_plan_with_limits": ["snapshots.png"],
    "07_playback": ["playback.html"],
    "08_study": ["study/study.sqlite", "study/cases.csv", "study/summary.png"],
    "09_inspect_a_client": ["inspect_client.html", "angles.png", "plan.h5", "plan.csv"],
    "10_capture_a_client": ["capture_client.html", "manoeuvre.png", "manoeuvre.h5"],
    "11_two_arms": ["two_arms.html", "moved.h5"],
    "12_from_the_table_to_orbit": ["table_and_orbit.png"],
}


PROCESSES = ("01_load_a_urdf", "08_study")
"""Scripts that are run as a user runs them; the others save the start of a process."""


def completed(script: Path, folder: Path) -> dict[str, Any]:
    """Run a script in a folder, and check how it ends; return its names, none of a process."""
    names: dict[str, Any] = {}
    if script.stem in PROCESSES:
        command = [sys.executable, str(script)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert (done.returncode, without_progress(done.stderr)) == (0, "")
        printed = done.stdout
    else:
        with chdir(folder), redirect_stdout(StringIO()) as output:
            names = runpy.run_path(str(script), run_name="__main__")
        printed = output.getvalue()
    words, number, off = ENDS[script.stem]
    pattern = re.escape(words).replace(r"\{\}", r"(-?[\d.]+)")
    found = re.fullmatch(pattern, printed.splitlines()[-1])
    assert found, printed
    assert float(found[1]) == pytest.approx(number, abs=off)
    for name in WRITTEN.get(script.stem, []):
        assert (folder / name).stat().st_size > 100
    assert "verified: False" not in printed
    return names
