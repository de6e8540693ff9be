"""Hostile input: good files of every kind, what is done with them, and what may come of it.

A kind of file is mutated at random (:mod:`tests.mutations`) and read as the commands read it.
Either it is read, or refused with one message; see :func:`outcome` for what is found out besides.
"""

from __future__ import annotations

import os
import resource
import sys
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import yaml

from freefloat.cli.info import natural_task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import FreeFloatError
from freefloat.io.results import load
from freefloat.io.scenario import load_scenario
from freefloat.io.schema import ScenarioFile
from freefloat.io.yaml import validated
from freefloat.limits.collision import collision_shapes
from freefloat.paths.path import parse_samples, samples_text
from freefloat.planning.simulation import Simulation
from freefloat.robot.meshes import read_mesh
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.names import MeshFileError
from freefloat.robot.validation import examine
from freefloat.studies.run import study_files
from freefloat.studies.study import load_study
from freefloat.verification.check import check
from freefloat.visualization.visuals import robot_visuals
from tests import hostile_samples as good
from tests.mutations import CSV, LINES, XML, YAML, Mutator, mutated
from tests.result_mutations import HDF5, mutated_result
from tests.scenarios import PARABOLA

READ, REFUSED = "read", "refused"
TRACEBACK, MEMORY, OUTSIDE, MESSAGE = "traceback", "memory", "outside", "message"
OUTCOMES = (READ, REFUSED, MESSAGE, "crash", "hang", TRACEBACK, MEMORY, OUTSIDE)
"""Read, or refused in one message; all others are failures: a refusal in a message that no terminal
should get, a process that died or did not come back, another exception, more memory than a file
may take, something done outside the folder."""
_LONGEST = 20_000
"""Characters of a message."""
_MOST = 400_000
"""Kilobytes that reading one file may take more than any before."""
SECRET = "a secret that no message may tell"


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes:
        file: Its name in the folder of the input.
        samples: Good ones.
        mutators: Ways to change them.
        use: What is done with the file.
    """

    file: str
    samples: Callable[[], tuple[bytes, ...]]
    mutators: tuple[Mutator, ...]
    use: Callable[[Path], object]

    def input(self, seed: str) -> bytes:
        """A mutated file."""
        random = Random(seed)
        content = random.choice(self.samples())
        if self.mutators is HDF5:
            return mutated_result(random, content)
        return mutated(random, content, self.mutators)


# What is done with each


def _scenario(file: Path) -> None:
    scenario = load_scenario(file)
    scenario.search()
    model = scenario.model()
    scenario.limits(model)
    margin = scenario.content.margin
    if margin.fraction is None:  # else the largest magnitude is searched for, which takes long
        problem = scenario.problem()
        problem.path.twist_rate(0.3 * problem.path.duration)
        problem.path.pose(problem.path.duration)


def _urdf(file: Path) -> None:
    [str(finding) for finding in examine(file)]
    model = FreeFloatingModel.from_urdf(file)
    model.bodies  # noqa: B018
    virtual = VirtualManipulator.of(model)
    if model.dof <= 60:
        virtual.pose(np.zeros(model.dof))
        natural_task(model)
    robot_visuals(model)
    collision_shapes(model)


def _csv(file: Path) -> None:
    curve, attitude = parse_samples(samples_text(file), file)
    for s in (0.0, 0.3, 1.0):
        curve(s, 1)
        if attitude is not None:
            attitude.rotation(s), attitude.rate(s)


def _result(file: Path) -> None:
    result = load(file)
    chosen = getattr(result, "chosen", None)
    if chosen is None:
        return
    times = chosen.motion.times
    chosen.motion.sample([0.5 * float(times[0] + times[-1])])
    if Random(len(times)).random() < 0.1:
        check(Simulation((chosen,), chosen)).to_dict()  # of a plan kernels would be compiled


def _study(file: Path) -> None:
    study = load_study(file)
    count = study.count
    for number in {0, 1 % count, count // 2, count - 1}:
        study.start(number)
        try:
            validated(ScenarioFile, study.document(number), study.base_source)
        except FreeFloatError:
            continue
    study_files(study)


def _mesh(file: Path) -> None:
    head = file.read_bytes()[:5]
    suffix = ".stl"
    for start, other in {b"ply": ".ply", b"<": ".dae", b"glTF": ".glb", b"mtlli": ".obj",
                         b"{\"sce": ".gltf"}.items():  # fmt: skip
        suffix = other if head.startswith(start) else suffix
    named = file.with_suffix(suffix)
    file.rename(named)
    try:
        read_mesh(named)
    finally:
        named.unlink()


def _yaml(*documents: Any) -> tuple[bytes, ...]:
    return tuple(one.encode() if isinstance(one, str) else yaml.safe_dump(one).encode()
                 for one in documents)  # fmt: skip


KINDS = {
    "scenario": Kind("scenario.yaml", lambda: _yaml(PARABOLA, good.RICH, good.SAMPLED),
                     YAML, _scenario),
    "urdf": Kind("robot.urdf", lambda: (*good.bundled("planar_3dof", "ets_vii"), good.meshed()),
                 XML, _urdf),
    "csv": Kind("path.csv", lambda: (good.POINTS.encode(),), CSV, _csv),
    "plan": Kind("plan.h5", good.plans, HDF5, _result),
    "map": Kind("map.h5", good.maps, HDF5, _result),
    "study": Kind("study.yaml", lambda: _yaml(good.STUDY, good.START, good.HEADINGS), YAML, _study),
    "mesh": Kind("mesh", good.meshes, LINES, _mesh),
}  # fmt: skip


# What may come of it


class Watch:
    """What this process does outside a folder: files it writes, programs, connections.

    What Python does is seen at once; what libraries in C do, in the folder beside.
    """

    def __init__(self, folder: Path) -> None:
        """Make the folders: ``in`` for the file, ``out`` for what is made of it, ``outside``."""
        self.folder, self.seen = folder, list[str]()
        self.inside, self.outside = folder / "in", folder / "outside"
        for name in ("in/folder", "out", "outside"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        (self.outside / "secret").write_text(SECRET)
        for name, target in (
            ("zero", "/dev/zero"),
            ("loop", "loop"),
            ("link", "../outside/secret"),
        ):
            (self.inside / name).symlink_to(target)
        os.mkfifo(self.inside / "fifo")
        for name in ("planar_3dof", "spatial_6dof"):
            (self.inside / f"{name}.urdf").write_bytes(good.bundled(name)[0])
        (self.inside / "points.csv").write_text(good.POINTS)
        (self.inside / "wish.yaml").write_text(PARABOLA)
        (self.inside / "good_study.yaml").write_text(yaml.safe_dump(good.HEADINGS))
        (self.inside / "part.stl").write_bytes(good.meshes()[0])
        self._before = self._state()
        self._allowed = tuple(os.path.realpath(folder / name) + os.sep for name in ("in", "out"))
        self._on = True
        sys.addaudithook(self._look)

    def close(self) -> None:
        """Look no more: hooks cannot be taken off."""
        self._on = False

    def found(self) -> list[str]:
        """What was done outside since the last call."""
        found, self.seen = self.seen, []
        now = self._state()
        if now != self._before:
            found.append(f"{self.outside} was changed")
            self._before = now
        return found

    def _state(self) -> list[tuple[str, int]]:
        return [(entry.name, entry.stat(follow_symlinks=False).st_mtime_ns)
                for place in (self.outside, self.folder) for entry in os.scandir(place)
                if entry.name not in ("in", "out")]  # fmt: skip

    def _look(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self._on or event not in _WATCHED:
            return
        if event == "open":
            path, _, flags = arguments
            if isinstance(path, int) or not flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
                return
        elif _WATCHED[event] == 0:
            self.seen.append(f"{event} {str(arguments)[:200]}")
            return
        for path in arguments[: max(_WATCHED[event], 1)]:
            place = os.path.realpath(os.fsdecode(path))
            if not f"{place}{os.sep}".startswith(self._allowed) and place != "/dev/null":
                self.seen.append(f"{event} {place}")


_WATCHED = {
    "open": 1, "os.mkdir": 1, "os.rename": 2, "os.remove": 1, "os.rmdir": 1, "os.symlink": 2,
    "os.link": 2, "os.chmod": 1, "os.truncate": 1, "os.utime": 1, "subprocess.Popen": 0,
    "os.system": 0, "os.exec": 0, "os.posix_spawn": 0, "socket.connect": 0,
    "socket.getaddrinfo": 0, "urllib.Request": 0, "pickle.find_class": 0,
}  # fmt: skip
"""Audit events, and how many of their arguments are paths of files that are written."""


def outcome(kind: Kind, content: bytes, watch: Watch) -> tuple[str, str]:
    """What comes of reading a file, and words about it.

    Warnings count as tracebacks: a user would see them.
    """
    file = watch.inside / kind.file
    file.write_bytes(content)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    result, told = READ, ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            kind.use(file)
    except MemoryError:
        result, told = MEMORY, traceback.format_exc()
    except (FreeFloatError, MeshFileError) as error:
        result, told = REFUSED, str(error)
    except BaseException:
        result, told = TRACEBACK, traceback.format_exc()
    if result == REFUSED and ("MemoryError" in told or "Unable to allocate" in told):
        result = MEMORY
    elif result == REFUSED and _is_no_message(told):
        result = MESSAGE
    if resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before > _MOST:
        result, told = MEMORY, f"{result}: {told}"
    done = watch.found()
    return (OUTSIDE, f"{done} ({told})") if done else (result, told)


def _is_no_message(told: str) -> bool:
    return not told.isprintable() or len(told) > _LONGEST or SECRET in told
