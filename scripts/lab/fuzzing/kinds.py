"""Hostile input: valid files of every kind, what is done with them, and the possible outcomes.

A kind of file is mutated at random (:mod:`fuzzing.mutations`) and read as the commands read it.
Either it is read, or refused with one message; see :func:`outcome` for all other outcomes.
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

from freefloat.dynamics.summary import natural_task
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.errors import FreeFloatError
from freefloat.io.results import load
from freefloat.io.scenario.loading import load_scenario
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.io.scenario.yaml import validated
from freefloat.limits.pairs import CollisionPairs
from freefloat.paths.samples import parse_samples, samples_text
from freefloat.planning.simulation import Simulation
from freefloat.robot.meshes import read_mesh
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.source import MeshFileError
from freefloat.robot.validation import examine
from freefloat.studies.loading import load_study
from freefloat.studies.workers import study_files
from freefloat.verification.check import check
from freefloat.visualization.scenes.visuals import robot_visuals
from fuzzing import samples
from fuzzing.mutations import CSV, LINES, XML, YAML, Mutator, mutated
from fuzzing.result_mutations import HDF5, mutated_result
from tests import samples as good
from tests.scenarios import PARABOLA

READ, REFUSED = "read", "refused"
TRACEBACK, MEMORY, OUTSIDE, MESSAGE = "traceback", "memory", "outside", "message"
OUTCOMES = (READ, REFUSED, MESSAGE, "crash", "hang", TRACEBACK, MEMORY, OUTSIDE)
"""Read, or refused in one message; all others are failures: an unprintable or long message, a
process that died or did not end, another exception, too much memory, an action outside the
folder."""
_MAX_LENGTH = 20_000
"""Characters of a message."""
_MAX_MEMORY = 400_000
"""Kilobytes that reading one file may take more than any before."""
SECRET = "a secret that no message may contain"


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
    scenario.limits()
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
    CollisionPairs(model, 0.0)


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
    texts = (entry if isinstance(entry, str) else yaml.safe_dump(entry) for entry in documents)
    return tuple(text.encode() for text in texts)


KINDS = {
    "scenario": Kind("scenario.yaml", lambda: _yaml(PARABOLA, samples.RICH, samples.SAMPLED),
                     YAML, _scenario),
    "urdf": Kind("robot.urdf", lambda: (*good.bundled("planar_3dof", "ets_vii"), samples.meshed()),
                 XML, _urdf),
    "csv": Kind("path.csv", lambda: (samples.POINTS.encode(),), CSV, _csv),
    "plan": Kind("plan.h5", good.plans, HDF5, _result),
    "map": Kind("map.h5", samples.maps, HDF5, _result),
    "study": Kind("study.yaml", lambda: _yaml(samples.STUDY, samples.START, samples.HEADINGS),
                  YAML, _study),
    "mesh": Kind("mesh", good.meshes, LINES, _mesh),
}  # fmt: skip


# Outcomes

_WATCHED = {
    "open": 1, "os.mkdir": 1, "os.rename": 2, "os.remove": 1, "os.rmdir": 1, "os.symlink": 2,
    "os.link": 2, "os.chmod": 1, "os.truncate": 1, "os.utime": 1, "subprocess.Popen": 0,
    "os.system": 0, "os.exec": 0, "os.posix_spawn": 0, "socket.connect": 0,
    "socket.getaddrinfo": 0, "urllib.Request": 0, "pickle.find_class": 0,
}  # fmt: skip
"""Audit events, and how many of their arguments are paths of files that are written."""


class Watch:
    """Actions of this process outside a folder: files it writes, programs, connections.

    Those of Python are seen by an audit hook; those of C libraries, by changes of folders.
    """

    def __init__(self, folder: Path) -> None:
        """Make the folders: ``in`` for the file, ``out`` for output, ``outside``."""
        self.folder, self.seen = folder, list[str]()
        self.inside, self.outside = folder / "in", folder / "outside"
        for name in ("in/folder", "out", "outside"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        (self.outside / "secret").write_text(SECRET)
        links = {"zero": "/dev/zero", "loop": "loop", "link": "../outside/secret"}
        for name, target in links.items():
            (self.inside / name).symlink_to(target)
        os.mkfifo(self.inside / "fifo")
        for name in ("planar_3dof", "spatial_6dof"):
            (self.inside / f"{name}.urdf").write_bytes(good.bundled(name)[0])
        (self.inside / "points.csv").write_text(samples.POINTS)
        (self.inside / "base.yaml").write_text(PARABOLA)
        (self.inside / "good_study.yaml").write_text(yaml.safe_dump(samples.HEADINGS))
        (self.inside / "part.stl").write_bytes(good.meshes()[0])
        self._before = self._state()
        self._allowed = tuple(os.path.realpath(folder / name) + os.sep for name in ("in", "out"))
        self._on = True
        sys.addaudithook(self._look)

    def close(self) -> None:
        """Ignore further events: hooks cannot be removed."""
        self._on = False

    def actions(self) -> list[str]:
        """Actions outside the folder since the last call."""
        actions, self.seen = self.seen, []
        now = self._state()
        if now != self._before:
            actions.append(f"{self.outside} was changed")
            self._before = now
        return actions

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
        for path in arguments[: _WATCHED[event]]:
            place = os.path.realpath(os.fsdecode(path))
            if not f"{place}{os.sep}".startswith(self._allowed) and place != "/dev/null":
                self.seen.append(f"{event} {place}")


def outcome(kind: Kind, content: bytes, watch: Watch) -> tuple[str, str]:
    """Outcome of reading a file, and its message.

    Warnings count as tracebacks: a user would see them.
    """
    file = watch.inside / kind.file
    file.write_bytes(content)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    result, message = READ, ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            kind.use(file)
    except MemoryError:
        result, message = MEMORY, traceback.format_exc()
    except (FreeFloatError, MeshFileError) as error:
        result, message = REFUSED, str(error)
        if "MemoryError" in message or "Unable to allocate" in message:
            result = MEMORY
        elif not message.isprintable() or len(message) > _MAX_LENGTH or SECRET in message:
            result = MESSAGE
    except BaseException:
        result, message = TRACEBACK, traceback.format_exc()
    if resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before > _MAX_MEMORY:
        result, message = MEMORY, f"{result}: {message}"
    actions = watch.actions()
    return (OUTSIDE, f"{actions} ({message})") if actions else (result, message)
