"""Change the code in small ways and see whether the tests notice: the share of mutants killed.

``python scripts/mutate.py --room motion --mutants 40 --seed 1`` takes 40 of all the mutants of a
room by chance, and runs for each the tests that concern the room, until one fails. It works in a
copy of the tree; every test run is a fork of a process that has the libraries loaded. A mutant
whose tests take far longer than they should counts as killed.

Operators, comparisons, signs, numbers, conditions, branches, arguments, statements and answers are
changed; texts, types and the wording of errors are not. ``rollout_kernels`` runs as plain Python
upon the compiled kernels below it, which spares the half a minute in which a mutant would compile.

Known survivors change nothing that is told: ``<`` for ``<=`` between computed numbers that are
equal once in a lifetime, half a turn less instead of more before whole turns are taken away, the
other order of a product of two vectors, work space and base positions that begin at one, not zero.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import resource
import shlex
import shutil
import signal
import sys
import tempfile
import time
import traceback
from contextlib import suppress
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import NoReturn

from mutants import Mutant, mutants_of

ROOT = Path(__file__).parents[1]
RANGES = "tests/validation/test_brute_force.py::test_random_ranges_agree_with_brute_force"
TESTS = {  # what pytest is told: the tests that concern a room, but for the slowest
    "dynamics": "tests/validation/test_planar_golden.py tests/test_dynamics.py "
    "tests/test_null_space.py",
    "motion": "tests/test_motion.py tests/test_closeness.py tests/test_time_series.py",
    "planar_ranges": f"tests/test_planar_ranges.py {RANGES}[0] {RANGES}[2] {RANGES}[4]",
    "tangency_points": "tests/test_touch_points.py -k 'not brute_force and not gjm and not wrist'",
    "rollout": "tests/test_rollout.py tests/test_redundancy_kernels.py -k 'not random_arms'",
    "rollout_kernels": "tests/test_rollout.py -k 'not random_arms and not threads'",
}
LIBRARIES = [
    "numpy", "numba", "pinocchio", "scipy.interpolate", "scipy.linalg.lapack", "scipy.optimize",
    "scipy.spatial.transform", "pydantic", "yaml", "pytest", "hypothesis", "mujoco", "pyarrow",
    "playwright.sync_api",
]  # fmt: skip


class Hasty:
    """A pytest plugin: few examples of each property, and none made smaller."""

    def pytest_collection(self) -> None:
        from hypothesis import Phase, settings

        few = [Phase.explicit, Phase.generate]
        settings.register_profile("hasty", settings(), max_examples=15, phases=few)
        settings.load_profile("hasty")


class Laboratory:
    """A copy of the tree in which tests are run on mutants of one room."""

    def __init__(self, folder: Path, room: str) -> None:
        for name in ("src", "tests", "scripts", "models", "pyproject.toml", "README.md"):
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
            copy(ROOT / name, folder / name)
        self.folder, self.room = folder, room
        house = folder / "src" / "freefloat"
        self.file = next(house.rglob(f"{room}.py"))
        self.source = self.file.read_text()
        os.chdir(folder)
        for module in [name for name in sys.modules if name.startswith("freefloat")]:
            del sys.modules[module]
        os.environ.update(PYTHONPATH=str(folder / "src"), OPENBLAS_NUM_THREADS="1")
        sys.path[:0] = [str(folder / "src"), str(folder)]
        for library in LIBRARIES:
            with suppress(ImportError):
                import_module(library)
        # remembered, so that kernels on disk are found although the room differs
        import_module("freefloat.dynamics.kernels.compilation")._digest(house)
        self.seconds = 600.0

    def try_out(self, source: str) -> tuple[str, str, float]:
        """What becomes of a source of the room, by which test, and in how many seconds."""
        if "kernels" in self.file.parts:
            python = "unowned = compiled = lambda thing: thing"
            source = re.sub(
                r"from freefloat.dynamics.kernels.compilation import .*", python, source
            )
        for stale in (self.file.parent / "__pycache__").glob(f"{self.room}.cpython*.pyc"):
            stale.unlink()
        self.file.write_text(source)
        log, begun = self.folder / "log", time.monotonic()
        child = os.fork()
        if child == 0:
            self.run_tests(log)
        try:
            status = self.waited(child)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(child, signal.SIGKILL)
        used = time.monotonic() - begun
        if status is None or os.WIFSIGNALED(status):
            return "killed", "time" if status in (None, signal.SIGXCPU) else "crash", used
        code = os.waitstatus_to_exitcode(status)
        if code == 0:
            return "survived", "", used
        failed = re.search(r"^(?:FAILED|ERROR) (\S+)", log.read_text(errors="replace"), re.M)
        return "killed", failed[1] if failed else f"exit {code}", used

    def run_tests(self, log: Path) -> NoReturn:
        os.setpgid(0, 0)
        if self.seconds < 600.0:
            resource.setrlimit(resource.RLIMIT_CPU, (int(self.seconds), int(self.seconds) + 5))
        out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(out, 1)
        os.dup2(out, 2)
        quiet = ["-xq", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning"]
        code = 3
        try:
            code = int(
                import_module("pytest").main([*quiet, *shlex.split(TESTS[self.room])], [Hasty()])
            )
        except BaseException:
            traceback.print_exc()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)

    def waited(self, child: int) -> int | None:
        """How a test run ended; None for one that hangs without computing."""
        for _ in range(int(200.0 * self.seconds)):
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                return status
            time.sleep(0.05)
        os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)
        return None


def sample(some: list[tuple[Mutant, str]], count: int, seed: int) -> list[tuple[Mutant, str]]:
    """Mutants by chance, one kind after the other as long as there are any of it."""
    drawn = random.Random(seed).sample(some, len(some))
    turns: dict[str, int] = {}
    ranks = []
    for mutant, _ in drawn:
        turns[mutant.kind] = turns.get(mutant.kind, 0) + 1
        ranks.append(turns[mutant.kind])
    order = sorted(range(len(drawn)), key=ranks.__getitem__)
    return [drawn[i] for i in order[:count]]


def cpu_seconds() -> float:
    """Of all test runs so far."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def examine(room: str, count: int, seed: int, lines: list[int]) -> list[Mutant]:
    """Try mutants of a room out; only those of some lines, if any are given."""
    with tempfile.TemporaryDirectory() as place:
        laboratory = Laboratory(Path(place), room)
        everything = mutants_of(laboratory.source)
        some = [one for one in everything if not lines or one[0].line in lines]
        chosen = sample(some, count, seed)
        before = cpu_seconds()
        outcome, by, used = laboratory.try_out(ast.unparse(ast.parse(laboratory.source)))
        if outcome == "killed":
            sys.exit(
                f"the tests fail on {room} as it is: {by}\n{(Path(place) / 'log').read_text()}"
            )
        laboratory.seconds = 30.0 + 3.0 * (cpu_seconds() - before)
        print(f"{room}: {len(everything)} mutants, the tests take {used:.0f} s", flush=True)
        for mutant, source in chosen:
            mutant.outcome, mutant.by, mutant.seconds = laboratory.try_out(source)
            print(f"  {mutant.outcome} ({mutant.seconds:.0f} s) {mutant}  {mutant.by}", flush=True)
        return [mutant for mutant, _ in chosen]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--room", action="append", choices=list(TESTS), help="all when left out")
    parser.add_argument("--mutants", type=int, default=40, help="of each room")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--line", type=int, action="append", default=[], help="only these lines")
    parser.add_argument("--json", type=Path, help="where to write every mutant")
    given = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("interrupted"))
    table = {}
    for room in given.room or TESTS:
        table[room] = examine(room, given.mutants, given.seed, given.line)
    print(f"\n{'room':16} mutants killed survived share")
    for room, mutants in table.items():
        alive = [mutant for mutant in mutants if mutant.outcome == "survived"]
        killed = len(mutants) - len(alive)
        share = killed / max(1, len(mutants))
        print(f"{room:16} {len(mutants):7} {killed:6} {len(alive):8} {share:5.0%}")
        for mutant in sorted(alive, key=lambda one: one.line):
            print(f"    {room}.py:{mutant}")
    if given.json:
        told = {room: [asdict(mutant) for mutant in mutants] for room, mutants in table.items()}
        given.json.write_text(json.dumps(told, indent=1) + "\n")


if __name__ == "__main__":
    main()
