"""Install freefloat for several versions of Python, and with the oldest dependencies, and use it.

    python scripts/lab/verify_installations.py python3.11 python3.12 python3.13

Each version gets a virtual environment with the newest dependencies, the first one another with the
oldest that ``pyproject.toml`` permits, chosen by uv. In each of them commands plan, check, export,
draw and run a study. The exit code is 1 where one fails.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = (
    "plan planar_2dof/line -o plane.h5",
    "check plane.h5",
    "plan spatial_6dof/line -o space.h5 --html space.html --plots plots",
    "check space.h5",
    "export space.h5",
    "plan spatial_6dof/around",
    "plan servicing/inspect_client",
    "map planar_3dof/parabola",
    "batch spatial_6dof/montecarlo -o study",
    "info example-robot-data:panda --end-effector panda_hand_tcp",
)


def fails(folder: Path) -> int:
    """Number of commands that fail in the environment of a folder."""
    count = 0
    for command in COMMANDS:
        program = [str(folder / "bin" / "freefloat"), *command.split(), "--quiet"]
        done = subprocess.run(program, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            print(f"  {command}: exit code {done.returncode}: {done.stderr.strip()}")
            count += 1
    return count


def main(interpreters: list[str]) -> int:
    """Verify all installations; return the exit code."""
    count = 0
    with tempfile.TemporaryDirectory() as name:
        tools = Path(name) / "tools"
        venv.create(tools, with_pip=True)
        subprocess.run([tools / "bin" / "pip", "install", "--quiet", "uv"], check=True)
        kinds = [(python, "highest") for python in interpreters]
        for python, resolution in [*kinds, (interpreters[0], "lowest-direct")]:
            folder = Path(name) / f"{len(list(Path(name).iterdir()))}"
            uv = [tools / "bin" / "uv", "--quiet"]
            subprocess.run([*uv, "venv", "--python", python, folder], check=True)
            where = ["--python", folder / "bin" / "python", "--resolution", resolution]
            subprocess.run([*uv, "pip", "install", *where, ROOT], check=True)
            print(f"{python}, {resolution} versions:", flush=True)
            failed = fails(folder)
            print(f"  {len(COMMANDS) - failed} of {len(COMMANDS)} commands succeed", flush=True)
            count += failed
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or [sys.executable]))
