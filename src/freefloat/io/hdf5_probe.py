"""Whether an HDF5 file can be opened at all: some never come back, or end the process."""

from __future__ import annotations

import faulthandler
import os
import resource
import signal
import warnings
from pathlib import Path
from typing import Any

import h5py

_SECONDS = 10
"""For looking at every part of a file; a plan takes a hundredth of one."""
_MEMORY = 1_500_000_000
"""Bytes that looking may take; the arrays of freefloat's files are not read for it."""
_GROWTH = 300_000
"""Kilobytes that texts and packed arrays may take, which are small in freefloat's files."""
_TOO_MUCH = 3
_ROOM, _DENSEST = 50_000_000, 20
"""Bytes that any array may have in memory, and how many times the bytes that it has on disk."""


def refuse_deadly(path: str | Path) -> None:
    """Look at every part of a file in a process of its own.

    Raises:
        ValueError: If that process does not come back. What is wrong otherwise is not told: it can
            be found out here then.
    """
    if not hasattr(os, "fork"):
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of other threads: none is needed
        child = os.fork()
    if child == 0:
        status = 0
        try:
            _limit_this_process()
            with h5py.File(path, "r") as file:
                before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
                _look(file)
            grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
            status = _TOO_MUCH if grown > _GROWTH else 0
        except MemoryError:
            status = _TOO_MUCH
        except BaseException:  # whoever opens it next will see it, too
            status = 0
        finally:
            os._exit(status)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        late = os.WTERMSIG(status) in (signal.SIGALRM, signal.SIGXCPU)
        raise ValueError("reading it never ends" if late else "the HDF5 library dies of it")
    if status:
        raise ValueError("reading it takes all memory")


def claims_too_much(dataset: Any) -> bool:
    """Whether an array would be far larger than what there is of it on disk."""
    if dataset.size is None:
        return False
    return bool(dataset.nbytes > max(_ROOM, _DENSEST * dataset.id.get_storage_size()))


def _limit_this_process() -> None:
    for number in (signal.SIGALRM, signal.SIGPROF, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL)
    faulthandler.disable()  # the parent tells in one line
    signal.alarm(_SECONDS)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    table = Path("/proc/self/statm")
    if not table.exists():  # not Linux
        return
    used = int(table.read_text().split()[0]) * resource.getpagesize()
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    if hard == resource.RLIM_INFINITY or hard > used + _MEMORY:
        resource.setrlimit(resource.RLIMIT_AS, (used + _MEMORY, hard))


def _look(file: Any) -> None:
    """Read attributes, texts and what is packed; plain arrays of numbers can do no harm."""
    seen: set[Any] = set()

    def visit(item: Any) -> None:
        place = h5py.h5o.get_info(item.id).addr
        if place in seen:
            return
        seen.add(place)
        try:
            dict(item.attrs)
        except (OSError, RuntimeError, TypeError, ValueError, KeyError):
            return
        if isinstance(item, h5py.Group):
            for name in item:
                if isinstance(item.get(name, getlink=True), h5py.HardLink):
                    try:
                        visit(item[name])
                    except (OSError, RuntimeError, TypeError, ValueError, KeyError):
                        continue
        elif (
            isinstance(item, h5py.Dataset)
            and (item.dtype == object or item.chunks is not None)
            and not (item.is_virtual or item.external or claims_too_much(item))
        ):
            item[()]

    visit(file)
