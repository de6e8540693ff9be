"""Which lines of ``src`` the tests run, kernels included.

``python scripts/lab/measure_coverage.py``.

Coverage does not see compiled code; the tests of the kernels run them as plain Python, too.
Processes that tests start are measured. Needs ``pip install 'coverage>=7.10'``, an installed
freefloat and twenty-five minutes. Two tests fail while coverage measures: an interruption, which
coverage handles itself, and files of limited memory. In one process, as coverage lost the data of
workers.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
SETTINGS = """\
[run]
source = {root}/src
data_file = {folder}/data
parallel = true
concurrency = thread, multiprocessing
patch = subprocess, fork, _exit
sigterm = true
"""
"""Every process that a test starts writes a file of its own."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minimum", type=float, default=95.0, help="percentage; less is an error")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "settings").write_text(SETTINGS.format(root=ROOT, folder=folder))

        def coverage(*words: str) -> int:
            command = [sys.executable, "-m", "coverage", words[0], f"--rcfile={folder}/settings"]
            return subprocess.run([*command, *words[1:]], cwd=ROOT, check=False).returncode

        coverage("run", "-m", "pytest", "-q")
        coverage("combine", "-q")
        return coverage(
            "report", "--skip-covered", "--show-missing", f"--fail-under={options.minimum}"
        )


if __name__ == "__main__":
    sys.exit(main())
