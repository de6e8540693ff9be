"""A process of its own for readers of files that are programs: xacro, and models of MuJoCo.

The process ends after a time. On Linux it cannot use more than an amount of memory, and ends with
its parent. Of freefloat it imports only errors, records of what is not read, this module, the
reader and what the reader imports.
"""

from __future__ import annotations

import ctypes
import json
import os
import resource
import signal
import subprocess
import sys
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from freefloat.errors import ModelError
from freefloat.robot.not_read import NotRead

SECONDS: float = 30
"""Time that a reader may take [s]."""
MEMORY = 2_000_000_000
"""Address space that a reader may use [bytes]."""
_LARGEST = 20_000_000
"""Largest number of characters of a URDF."""
_MAIN = "from freefloat.robot.reader_process import main; main()"
_END_WITH_PARENT = 1
"""PR_SET_PDEATHSIG of Linux."""


@dataclass(frozen=True)
class Argument:
    """An argument of a xacro file: its value, and whether that is its default."""

    name: str
    value: str
    default: bool


@dataclass(frozen=True)
class UrdfText:
    """What a reader returns.

    Attributes:
        text: The URDF.
        warnings: Problems with their remedies.
        files: Further files that were read: included ones, meshes, parameters.
        not_read: What the file says and the URDF does not.
        converted: Whether it was made of another format, so that its lines are not the file's.
        frames: Links that are mere frames, such as sites: none of them is meant as the last link.
        arguments: Arguments of a xacro file.
    """

    text: str
    warnings: tuple[tuple[str, str], ...] = ()
    files: tuple[str, ...] = ()
    not_read: tuple[NotRead, ...] = ()
    converted: bool = False
    frames: tuple[str, ...] = ()
    arguments: tuple[Argument, ...] = ()


def run_reader(module: str, file: Path, **arguments: Any) -> UrdfText:
    """What the function ``read`` of a module returns in a process of its own.

    Args:
        module: The module; its function takes the file and the arguments.
        file: The file; the process works in its folder.
        arguments: Arguments that JSON can represent.

    Raises:
        ModelError: As raised by the reader, or if it takes too much time or memory.
    """
    path = os.path.abspath(file)
    request = {"module": module, "parent": os.getpid(), "arguments": {"file": path, **arguments}}
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(os.path.abspath(entry) for entry in sys.path if entry),
        "OPENBLAS_NUM_THREADS": "1",  # each thread takes address space
        "OMP_NUM_THREADS": "1",
    }
    try:
        process = subprocess.run(
            [sys.executable, "-P", "-c", _MAIN], input=json.dumps(request).encode(),
            capture_output=True, timeout=SECONDS, cwd=os.path.dirname(path), env=environment,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        problem = f"it takes more than {SECONDS} s to read"
        raise ModelError("urdf", problem, "a smaller model", str(file)) from None
    if process.returncode != 0:
        reason = process.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        problem = f"its reader ended with code {process.returncode} ({reason or 'no message'})"
        raise ModelError("urdf", problem, "a smaller or a valid model", str(file))
    answer = json.loads(process.stdout)
    if "error" in answer:
        key, problem, accepted, source, line = answer["error"]
        own = source is None or source == path
        raise ModelError(key, problem, accepted, str(file) if own else source, line)
    warnings = tuple((first, second) for first, second in answer["warnings"])
    not_read = tuple(NotRead(**entry) for entry in answer["not_read"])
    return UrdfText(
        answer["text"], warnings, tuple(answer["files"]), not_read, converted=True,
        frames=tuple(answer["frames"]),
        arguments=tuple(Argument(**argument) for argument in answer["arguments"]),
    )  # fmt: skip


def main() -> None:
    """Answer the request on the standard input; messages of libraries are dropped."""
    request = json.loads(sys.stdin.buffer.read())
    answers, errors = os.fdopen(os.dup(1), "w"), os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    if sys.platform == "linux":  # other systems know neither
        ctypes.CDLL(None).prctl(_END_WITH_PARENT, signal.SIGKILL)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    if os.getppid() != request["parent"]:
        return
    try:
        json.dump(_answer(request["module"], request["arguments"]), answers)
    finally:
        os.dup2(errors, 2)
    answers.close()


def _answer(module: str, arguments: dict[str, Any]) -> dict[str, Any]:
    accepted = "a smaller model"
    try:
        urdf: UrdfText = import_module(module).read(**arguments)
        if len(urdf.text) > _LARGEST:
            problem = f"its URDF has more than {_LARGEST:,} characters"
            raise ModelError("urdf", problem, accepted)
    except ModelError as error:
        return {"error": [error.key, error.problem, error.accepted, error.source, error.line]}
    except MemoryError:
        problem = f"it takes more than {MEMORY / 1e9:g} GB of memory to read"
        return {"error": ["urdf", problem, accepted, None, None]}
    return asdict(urdf)
