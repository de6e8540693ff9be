"""Read many mutated files of every kind and count the outcomes.

Usage: python scripts/lab/fuzz.py [--inputs N] [--seed S] [--kinds KIND...] [--keep FOLDER]

Two processes read them, one input after the other, each in at most 10 s and 1.5 GB. A file may be
read, or refused with one message; everything else is a failure, printed with the input's number
and saved in a folder. Exit code 1 when there is one.
"""

import argparse
import os
import pickle
import resource
import select
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.dont_write_bytecode = True

from fuzzing.kinds import KINDS, MEMORY, OUTCOMES, READ, REFUSED, Watch, outcome  # noqa: E402

PROCESSES = 2
FIRST, SECONDS, PATIENCE = 3, 10, 60
"""Processor seconds for one input, at first and once more, and seconds on the clock."""
MOST_MEMORY = 1_500_000_000
"""Bytes more than at the start."""
LARGEST_FILE = 200_000_000
SHOWN = 25
"""Failures that are printed in full, one of each sort."""

Job = tuple[str, int]
Report = tuple[Job, str, str]


@dataclass
class Worker:
    """A process, the inputs that it has not reported yet, and the pipe of its reports."""

    process: int
    pipe: int
    left: list[Job]
    again: bool
    buffer: bytes = b""


def content_of(job: Job, seed: int) -> bytes:
    """A mutated file; a valid one for a negative number."""
    kind, number = job
    return (
        KINDS[kind].samples()[number]
        if number < 0
        else KINDS[kind].input(f"{seed}/{kind}/{number}")
    )


def start(jobs: list[Job], seed: int, again: bool = False) -> Worker:
    """Fork a process that works on jobs and writes a report of each into a pipe."""
    reading, writing = os.pipe()
    process = os.fork()
    if process:
        os.close(writing)
        return Worker(process, reading, jobs, again)
    os.close(reading)
    status = 1
    try:
        work(jobs, seed, writing, again)
        status = 0
    finally:
        os._exit(status)


def work(jobs: list[Job], seed: int, writing: int, again: bool) -> None:
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MOST_MEMORY,) * 2)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_FILE,) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    null = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(null, stream)
    with tempfile.TemporaryDirectory(prefix="freefloat-fuzz-") as name:
        os.chdir(name)
        watch = Watch(Path(name))
        os.chdir(watch.inside)
        for job in jobs:
            content = content_of(job, seed)
            signal.setitimer(
                signal.ITIMER_PROF, SECONDS if again else FIRST
            )  # both end the process
            signal.setitimer(signal.ITIMER_REAL, PATIENCE)
            result, message = outcome(KINDS[job[0]], content, watch)
            signal.setitimer(signal.ITIMER_PROF, 0)
            signal.setitimer(signal.ITIMER_REAL, 0)
            if result in (READ, REFUSED):
                message = ""
            report = pickle.dumps((job, result, message[-6000:]))
            os.write(writing, len(report).to_bytes(4, "little") + report)
        watch.close()


def reports(workers: list[Worker]) -> Iterator[tuple[Worker, Report | None]]:
    """Reports as they arrive; None for a process that has ended."""
    while workers:
        ready, _, _ = select.select([worker.pipe for worker in workers], [], [])
        for worker in [entry for entry in workers if entry.pipe in ready]:
            data = os.read(worker.pipe, 1 << 16)
            worker.buffer += data
            while len(worker.buffer) >= 4:
                size = 4 + int.from_bytes(worker.buffer[:4], "little")
                if len(worker.buffer) < size:
                    break
                report, worker.buffer = pickle.loads(worker.buffer[4:size]), worker.buffer[size:]
                worker.left.pop(0)
                yield worker, report
            if not data:
                yield worker, None


def ended(worker: Worker) -> tuple[str, str]:
    """How a process ended before its report."""
    os.close(worker.pipe)
    _, status = os.waitpid(worker.process, 0)
    if os.WIFSIGNALED(status):
        name = signal.Signals(os.WTERMSIG(status)).name
        return ("hang" if name in ("SIGPROF", "SIGALRM") else "crash"), name
    return "crash", f"exit code {os.WEXITSTATUS(status)}"


def read_all(jobs: list[Job], seed: int) -> Iterator[Report]:
    """A report of every job; a process that dies is replaced."""
    workers = [start(jobs[number::PROCESSES], seed) for number in range(PROCESSES)]
    for worker, report in reports(workers):
        if report is not None:
            job, result, _ = report
            if result == MEMORY and not worker.again:
                workers.append(start([job], seed, again=True))
            else:
                yield report
            continue
        result, message = ended(worker)
        workers.remove(worker)
        if not worker.left:
            continue
        first, *others = worker.left
        if worker.again:
            yield first, result, message
        else:
            workers.append(start([first], seed, again=True))
        if others:
            workers.append(start(others, seed))


def sort_of(result: str, message: str) -> str:
    """Failures of one sort are printed once: the outcome, the error and its last places."""
    lines = [line.strip() for line in message.strip().splitlines()] or [""]
    places = [line.partition(", in ")[2] + " " + line.split(", ")[1] for line in lines
              if line.startswith("File ")]  # fmt: skip
    error = lines[-1].split(":")[0] if result == "traceback" else lines[-1][:60]
    return " | ".join([result, error, *places[-2:]])


def parsed() -> Any:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--inputs", type=int, default=8000, help="in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--only", type=int, help="the input of this number alone, of each kind")
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "freefloat-fuzz")
    return parser.parse_args()


def main() -> int:
    options = parsed()
    each = -(-options.inputs // len(options.kinds))
    numbers = range(each) if options.only is None else [options.only]
    jobs = [(kind, number) for number in numbers for kind in options.kinds]
    Random(options.seed).shuffle(jobs)  # slow kinds evenly spread
    samples = {kind: len(KINDS[kind].samples()) for kind in options.kinds}
    jobs[:0] = [
        (kind, -number) for kind, count in samples.items() for number in range(1, count + 1)
    ]
    table: dict[str, Counter[str]] = {kind: Counter() for kind in options.kinds}
    sorts: dict[str, list[tuple[Job, str]]] = defaultdict(list)
    begin = time.perf_counter()
    for done, (job, result, message) in enumerate(read_all(jobs, options.seed), 1):
        if job[1] < 0 and result != READ:
            sys.exit(f"a valid file of kind {job[0]} was not read: {result} {message}")
        table[job[0]][result] += 1
        if result not in (READ, REFUSED):
            sorts[f"{job[0]} | {sort_of(result, message)}"].append((job, message))
            options.keep.mkdir(parents=True, exist_ok=True)
            file = options.keep / f"{job[0]}-{options.seed}-{job[1]}-{result}"
            file.write_bytes(content_of(job, options.seed))
        if done % 2000 == 0:
            print(f"{done} inputs, {time.perf_counter() - begin:.0f} s", file=sys.stderr)
    print("kind".ljust(10) + "inputs".rjust(9) + "".join(name.rjust(11) for name in OUTCOMES))
    total: Counter[str] = Counter()
    for kind, counts in [*table.items(), ("all", total)]:
        total += counts if kind != "all" else Counter()
        numbers_ = "".join(f"{counts[name]:11,}" for name in OUTCOMES)
        print(f"{kind:10}{counts.total():9,}{numbers_}")
    print(f"seed {options.seed}, {time.perf_counter() - begin:.0f} s")
    for sort, cases in sorted(sorts.items(), key=lambda item: -len(item[1]))[:SHOWN]:
        print(f"\n{len(cases)} x {sort}; inputs {[job[1] for job, _ in cases[:8]]}")
        print("    " + "\n    ".join(cases[0][1].strip().splitlines()[-12:])[:1500])
    return int(bool(sorts))


if __name__ == "__main__":
    sys.exit(main())
