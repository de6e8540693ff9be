"""Which lines of ``src`` the tests run, kernels included: ``python scripts/measure_coverage.py``.

Coverage does not see compiled code. So some of the kernels' tests run a second time, with the
kernels as plain Python. Processes that tests start are measured, too. Needs ``pip install
'coverage>=7.10'`` and about twenty minutes; a few tests fail, those of computing times and those
that need compiled code.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
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
OF_KERNELS = ["tests/motion/test_arc_flow.py"]
QUICK = ("kernels", "arc_flow", "every_branch_of", "stretched", "determinant",
         "straight_wrist",
         "violations_precede")  # fmt: skip
"""Parts of the names of tests that do not take minutes without a compiler."""
PLAIN = """\
import sys
import freefloat.dynamics.kernels.compilation as compiled
compiled.compiled = compiled.unowned = lambda function: function
import pytest
sys.exit(pytest.main(sys.argv[1:]))
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minimum", type=float, default=94.0, help="percentage; less is an error")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "settings").write_text(SETTINGS.format(root=ROOT, folder=folder))
        (folder / "plain.py").write_text(PLAIN)

        def coverage(*words: str) -> int:
            command = [sys.executable, "-m", "coverage", words[0], f"--rcfile={folder}/settings"]
            return subprocess.run([*command, *words[1:]], cwd=ROOT, check=False).returncode

        coverage("run", "-m", "pytest", "-q", "--numprocesses", "auto", "--dist", "loadfile")
        quiet = ("-q", "-W", "ignore::RuntimeWarning")  # of divisions by zero
        coverage("run", str(folder / "plain.py"), *quiet, *OF_KERNELS, "-k", " or ".join(QUICK))
        coverage("combine", "-q")
        return coverage(
            "report", "--skip-covered", "--show-missing", f"--fail-under={options.minimum}"
        )


if __name__ == "__main__":
    sys.exit(main())
