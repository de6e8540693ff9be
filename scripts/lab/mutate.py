"""Change modules in small ways and count how many of the changes the tests notice.

``python scripts/lab/mutate.py --module motion.integration --mutants 30 --seed 1`` draws 30 mutants
of a module or package at random and runs its tests on each until one fails. It works in a copy of
the checkout; every test run is a fork of one process that has the libraries loaded. A mutant whose
tests take far longer than they should counts as killed.

Equivalent mutants survive: ``<`` for ``<=`` between computed numbers, another order of a
commutative product, an initial value that is overwritten.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import shlex
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from mutants import Mutant, mutants_of

ROOT = Path(__file__).parents[2]
RANGES = "tests/validation/test_brute_force.py::test_random_ranges_agree_with_brute_force"
KINDS = "tests/test_result_kinds.py -k 'not page and not figure'"
LOADED = "tests/missions/test_manoeuvre_command.py::test_a_loaded_motion_knows_what_moves_its_arm"
ARMS = "tests/motion/test_two_arms.py::test_plans_are_saved_loaded_and_checked"
TESTS = {
    "dynamics.momentum": "tests/dynamics/test_momentum.py tests/validation/test_planar_golden.py",
    "io.results": "tests/io/test_results.py tests/io/test_scene_section.py "
    f"tests/singularities/test_singularity_map.py {LOADED} {ARMS} {KINDS}",
    "kinds": "tests/test_result_kinds.py tests/io/test_export.py tests/studies/test_track.py "
    "tests/visualization/test_page.py tests/verification/test_check.py",
    "limits": f"tests/limits {KINDS} tests/studies/test_whole_scenarios.py",
    "motion.integration": "tests/motion/test_integration.py tests/motion/test_motion.py "
    "tests/motion/test_extrema.py",
    "motion.problem": "tests/motion/test_problem.py tests/test_misuse.py tests/scene "
    "tests/motion/test_two_arms.py tests/limits/test_clearance.py tests/missions/test_mission.py",
    "motion.law": "tests/motion/test_law.py tests/motion/test_two_arms.py "
    "tests/validation/test_mujoco.py",
    "beyond.missions.manoeuvre_planner": "tests/missions/test_phases.py "
    "tests/missions/test_manoeuvre.py tests/missions/test_phase_limits.py",
    "planning.plane.ranges": f"tests/planning/test_planar_ranges.py {RANGES}[2] {RANGES}[4]",
    "planning.touch_points": "tests/planning/test_touch_points.py -k 'not brute_force'",
    "codec": f"tests/test_records.py {KINDS}",
}
"""Arguments of pytest: the tests of a module or package, without its slowest."""
LIBRARIES = ("numba", "pinocchio", "scipy.optimize", "pydantic", "pytest", "hypothesis", "mujoco")
"""Loaded once, before the forks."""
LONGEST = 600.0
"""Of a test run [s]."""


class QuickRun:
    """A pytest plugin: quick files first, few examples of each property, none made smaller."""

    def __init__(self, durations: Path) -> None:
        """Take how long files of tests take [s] from a file, or write it where there is none."""
        self._file, self._seconds = durations, Counter[str]()
        self._known = json.loads(durations.read_text()) if durations.exists() else {}

    def pytest_runtest_logreport(self, report: Any) -> None:
        self._seconds[report.location[0]] += report.duration

    def pytest_sessionfinish(self) -> None:
        if not self._known:
            self._file.write_text(json.dumps(self._seconds))

    def pytest_collection(self) -> None:
        from hypothesis import Phase, settings

        phases = [Phase.explicit, Phase.generate]
        settings.register_profile("mutants", settings(), max_examples=15, phases=phases)
        settings.load_profile("mutants")

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        items.sort(key=lambda item: self._known.get(item.location[0], 0.0))
        items.sort(key=lambda item: item.get_closest_marker("slow") is not None)


class Experiment:
    """A copy of the checkout in which tests are run on mutants of one module or package."""

    def __init__(self, folder: Path, module: str) -> None:
        for name in ("src", "tests", "scripts", "models", "pyproject.toml", "README.md"):
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
            copy(ROOT / name, folder / name)
        self.folder, self.module = folder, module
        place = folder / "src" / "freefloat" / module.replace(".", "/")
        self.files = sorted(place.rglob("*.py")) or [place.with_suffix(".py")]
        self.seconds = LONGEST
        os.chdir(folder)
        os.environ.update(PYTHONPATH=str(folder / "src"), OPENBLAS_NUM_THREADS="1")
        sys.path[:0] = [str(folder / "src"), str(folder)]
        for library in LIBRARIES:
            import_module(library)

    def run(self, file: Path, source: str) -> tuple[str, float]:
        """What killed another source of a file, or an empty text; how long the tests took [s]."""
        for stale in (file.parent / "__pycache__").glob(f"{file.stem}.cpython*.pyc"):
            stale.unlink()
        before = file.read_text()
        file.write_text(source)
        log, begin = self.folder / "log", time.monotonic()
        child = os.fork()
        if child == 0:
            self._test(log)
        status = self._wait(child)
        file.write_text(before)
        seconds = time.monotonic() - begin
        if status is None or os.WIFSIGNALED(status):
            return "timeout or crash", seconds
        code = os.waitstatus_to_exitcode(status)
        failed = re.search(r"^(?:FAILED|ERROR) (\S+)", log.read_text(errors="replace"), re.M)
        return (failed[1] if failed else f"exit code {code}") if code else "", seconds

    def _test(self, log: Path) -> NoReturn:
        os.setpgid(0, 0)
        output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(output, 1)
        os.dup2(output, 2)
        code = 3
        try:
            arguments = ["-xq", "-p", "no:cacheprovider", "-p", "no:xdist"]
            arguments += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]
            tests, durations = shlex.split(TESTS[self.module]), self.folder / "durations.json"
            code = int(import_module("pytest").main([*arguments, *tests], [QuickRun(durations)]))
        finally:
            sys.stdout.flush()
            os._exit(code)

    def _wait(self, child: int) -> int | None:
        """Status of a test run; None for one that was killed because it takes too long."""
        try:
            end = time.monotonic() + self.seconds
            while time.monotonic() < end:
                done, status = os.waitpid(child, os.WNOHANG)
                if done:
                    return status
                time.sleep(0.05)
            return None
        finally:
            with suppress(ProcessLookupError):
                os.killpg(child, signal.SIGKILL)


def evaluate(module: str, count: int, seed: int) -> list[Mutant]:
    """Run the tests of a module on randomly drawn mutants."""
    with tempfile.TemporaryDirectory() as folder:
        experiment = Experiment(Path(folder), module)
        file = experiment.files[0]
        killed_by, seconds = experiment.run(file, ast.unparse(ast.parse(file.read_text())))
        if killed_by:
            sys.exit(f"the tests of {module} fail without a mutant: {killed_by}")
        experiment.seconds = 30.0 + 3.0 * seconds
        mutants = [
            (file, *pair) for file in experiment.files for pair in mutants_of(file.read_text())
        ]
        print(f"{module}: {len(mutants)} mutants, the tests take {seconds:.0f} s", flush=True)
        drawn = random.Random(seed).sample(mutants, min(count, len(mutants)))
        for file, mutant, source in drawn:
            mutant.killed_by, seconds = experiment.run(file, source)
            outcome = mutant.killed_by or "SURVIVED"
            print(f"  {file.stem} {mutant}: {outcome} ({seconds:.0f} s)", flush=True)
        return [mutant for _, mutant, _ in drawn]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--module", action="append", choices=list(TESTS), help="default: all")
    parser.add_argument("--mutants", type=int, default=30, help="of each module")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    results = {
        module: evaluate(module, options.mutants, options.seed)
        for module in options.module or TESTS
    }
    for module, mutants in results.items():
        survivors = [mutant for mutant in mutants if not mutant.killed_by]
        print(f"{module}: {len(mutants) - len(survivors)} of {len(mutants)} mutants killed")
        for mutant in sorted(survivors, key=lambda mutant: mutant.line):
            print(f"    {mutant}")


if __name__ == "__main__":
    main()
