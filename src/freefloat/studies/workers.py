"""Workers of studies: what those on other machines are sent, and processes of this machine.

Processes of this machine end with this one; nothing listens.
"""

from __future__ import annotations

import logging
import os
import shutil
import tempfile
import weakref
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any, TypeVar

from freefloat.concurrency import interrupts_deferred, isolated_starts
from freefloat.errors import InputError
from freefloat.robot.named_files import is_file
from freefloat.robot.shapes import MeshFile
from freefloat.robot.source import MeshFileError, RobotSource, find_mesh
from freefloat.robot.urdf import parse_urdf
from freefloat.studies.study import Study

Files = tuple[tuple[str, bytes], ...]
"""Absolute paths of files and their contents."""
FEW = 32
"""Largest number of tasks that this process executes, too: others take seconds to start."""
_ENDED = 2
"""Number of workers that end as they start, one after the other, after which no other is tried."""
_KILLED = "a worker process was killed; its run is begun again"
Task = TypeVar("Task")
Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class PortableStudy:
    """A study with the files that its scenarios name.

    Attributes:
        study: The study.
        files: The files; empty where they are read at their own places.
    """

    study: Study
    files: Files = field(default=(), repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """What is sent: the arm branch that is found once, not the place where the files are."""
        study, source = self.study, self.study.base_source.absolute()  # from any working folder
        here = replace(study, content=study.settled, base_source=source)
        return {"study": here, "files": self.files}

    @cached_property
    def _folder(self) -> str:
        """A folder with copies of the files, each at its own path below it."""
        folder = tempfile.mkdtemp(prefix="freefloat-")
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        for path, content in self.files:
            copy = _below(folder, Path(path))
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(content)
        return folder

    @cached_property
    def here(self) -> Study:
        """The study on this machine."""
        if not self.files:
            return self.study
        source = _below(self._folder, self.study.base_source)
        for place in (source.parent, *_packages(self.study, source.parent).values()):
            place.mkdir(parents=True, exist_ok=True)  # for names that begin with ..
        return replace(self.study, base_source=source)

    def original(self, message: str) -> str:
        """A message that names the original files, not their copies."""
        return message.replace(self._folder, "") if self.files else message


def _below(folder: str, path: Path) -> Path:
    return folder / path.relative_to(path.anchor)


def study_files(study: Study, *, absolute: bool = False) -> Files:
    """Read the files that the scenarios of a study name by relative paths, or by absolute ones.

    Of robots also the files that they include, and their meshes. Results depend on them, and
    workers on other machines need them. Bundled robots and robots of example-robot-data are on
    every machine; absolute names must lead to a file there.

    Raises:
        InputError: If a file cannot be read.
    """
    folder = study.base_source.absolute().parent
    robot = _robot_section(study)
    names = list(_file_names(study.base, robot))
    for key, section in study.content.vary.items():
        names += _file_names(section.values, robot, key.rpartition(".")[2])
    packages = _packages(study, folder)
    files = set[Path]()
    for key, name, beside in names:
        path = Path(os.path.normpath(folder / name))
        if is_file(path) and os.path.isabs(name) == absolute:
            files.add(path)
            if key == "urdf":
                with suppress(InputError):  # which is an error of the runs
                    source = RobotSource(
                        path, beside.get("root"), packages, beside.get("arguments", {})
                    )
                    files |= set(_robot_files(source))
    return tuple(sorted((str(file), _read(file)) for file in files))


def _robot_section(study: Study) -> dict[str, Any]:
    section = study.base.get("robot")  # runs may have another one
    return section if isinstance(section, dict) else {}


def _packages(study: Study, folder: Path) -> dict[str, Path]:
    """Folders of the packages that the base scenario names."""
    packages = _robot_section(study).get("packages", {})
    return {name: Path(os.path.normpath(folder / place)) for name, place in packages.items()}


def _robot_files(source: RobotSource) -> Iterator[Path]:
    """Yield the declarations of packages above a robot, its included files and its meshes."""
    declarations = (folder / "package.xml" for folder in Path(source.name).parents)
    yield from filter(is_file, declarations)
    robot = parse_urdf(source)
    yield from map(Path, robot.files)
    for shape in (shape for link in robot.links for shape in link.shapes):
        if isinstance(shape.geometry, MeshFile):
            with suppress(MeshFileError):
                yield Path(os.path.abspath(find_mesh(shape.geometry.filename, robot.source)))


def _file_names(
    node: Any, section: dict[str, Any], key: str = ""
) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield keys and names of files in a scenario's data, with the section that has each.

    The data may be values of one of its keys, then the section is the unvaried scenario's.
    """
    if isinstance(node, dict):
        for inner, value in node.items():
            yield from _file_names(value, node, inner)
    elif isinstance(node, list):
        for value in node:
            yield from _file_names(value, section, key)
    elif isinstance(node, str) and key in ("urdf", "srdf", "mesh", "samples"):
        yield key, node, section


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError("file", str(error.strerror), "a readable file", str(path)) from None


_studies: list[PortableStudy] = []
"""In a worker, the study that it was started with."""


def completed_in_pool(
    work: Callable[[PortableStudy, Task], Result],
    study: PortableStudy,
    tasks: Sequence[Task],
    workers: int,
) -> Generator[tuple[Task, Result | None]]:
    """Yield tasks of a study and their results as they are completed.

    Where a worker dies, another one repeats its task; if that dies, too, the result is None.

    Args:
        work: What is done with the study and a task.
        study: The study, which workers receive once.
        tasks: The tasks.
        workers: Number of processes; of few tasks this one is among them.

    Raises:
        InputError: If workers end before they have started.
    """
    waiting, missing, few = deque(tasks), len(tasks), len(tasks) <= FEW
    completed = SimpleQueue[tuple[Task | None, Result | BaseException]]()

    def remaining() -> Iterator[Task]:
        """Tasks that no process has begun, each for the one that takes it."""
        with suppress(IndexError):
            while True:
                yield waiting.popleft()

    def feed(worker: ProcessPoolExecutor, start: Future[None]) -> None:
        """Give a worker one task after another, in a thread."""
        task = None
        try:
            start.result()  # a worker that starts slowly takes no task from others
            for task in remaining():
                completed.put((task, worker.submit(_execute, work, task).result()))
        except BaseException as error:  # which the main thread raises
            completed.put((task, error))

    with ExitStack() as stack:

        def begin() -> None:
            worker = stack.enter_context(_worker(study))
            Thread(target=feed, args=worker, daemon=True).start()

        for _ in range(min(workers, missing) - few):
            begin()
        for task in remaining() if few else ():
            yield task, work(study, task)
            missing -= 1
        repeated, ended = list[Task](), 0
        while missing:
            begun, outcome = completed.get()
            if isinstance(outcome, BrokenExecutor):
                ended = ended + 1 if begun is None else 0
                if ended == _ENDED:
                    accepted = 'a script that calls it below `if __name__ == "__main__":`'
                    raise InputError("workers", "worker processes end as they start", accepted)
                logging.getLogger("freefloat").warning(_KILLED)
                if begun is not None and begun not in repeated:
                    repeated.append(begun)
                    waiting.appendleft(begun)
                elif begun is not None:
                    yield begun, None
                    missing -= 1
                begin()
            elif isinstance(outcome, BaseException):
                raise outcome
            elif begun is not None:
                yield begun, outcome
                missing -= 1


@contextmanager
def _worker(study: PortableStudy) -> Iterator[tuple[ProcessPoolExecutor, Future[None]]]:
    """A worker and its first task; it ends with the block or this process, not by Ctrl-C."""
    context = get_context("spawn")
    lifeline, held = context.Pipe(duplex=False)
    with isolated_starts():
        worker = ProcessPoolExecutor(1, context, initializer=_begin, initargs=(lifeline, study))
    try:
        with isolated_starts(), interrupts_deferred():
            start = worker.submit(_start)
        yield worker, start
    finally:
        with interrupts_deferred():
            held.close()
            worker.shutdown(cancel_futures=True)
            lifeline.close()


def _begin(lifeline: Connection, study: PortableStudy) -> None:
    """Begin a worker: one thread computes, another ends it with the process that started it."""
    Thread(target=_end_with, args=(lifeline,), daemon=True).start()
    _studies.append(study)


def _end_with(lifeline: Connection) -> None:
    with suppress(EOFError, OSError):
        lifeline.recv()
    os._exit(1)


def _start() -> None:
    """The first task of each worker."""


def _execute(work: Callable[[PortableStudy, Task], Result], task: Task) -> Result:
    """Execute a task in a worker."""
    return work(_studies[0], task)
