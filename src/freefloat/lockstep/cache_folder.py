"""The folder of the kernels' machine code, which the user alone can write to."""

from __future__ import annotations

import logging
import os
import re
import stat
import sys
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path

_KERNELS = b"\nfrom numba", b"\nfrom freefloat.lockstep.compilation "
_CONSTANTS = re.compile(rb"^from freefloat\.(\S+) import (?:\(\s*)?[A-Z][A-Z_]", re.MULTILINE)
"""Beginnings of lines of modules with kernels; lines of these modules that import constants."""
_logger = logging.getLogger("freefloat")


@cache
def cache_folder(package: Path) -> Path | None:
    """The folder of the machine code of a package's kernels as they are; None where there is none.

    Numba compares a kernel's own file only and would keep machine code of kernels that it calls
    from other files: other sources have another folder. No file of the current folder, such as
    .numba_config.yaml, names it: whoever sent that would have machine code run that lies there.
    """
    stated, caches = (os.environ.get(name) for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"))
    try:
        root = stated or Path(caches or Path.home() / ".cache") / "freefloat"
        folder = Path(root) / f"kernels-{_digest(package)[:16]}"
        for place in (*reversed(folder.parents), folder):  # the mode holds for the last one alone
            if not place.is_dir():
                place.mkdir(mode=0o700 if place == folder else 0o755, exist_ok=True)
    except (OSError, RuntimeError):  # the second: there is no home
        return None
    return folder if _is_private(folder, package) else None


def _digest(folder: Path) -> str:
    """Digest of the sources below a folder with kernels, and with constants that these import."""
    texts = {path: path.read_bytes() for path in sorted(folder.rglob("*.py"))}
    kernels = {path for path, text in texts.items() if any(line in text for line in _KERNELS)}
    names = {name.decode() for path in kernels for name in _CONSTANTS.findall(texts[path])}
    used = kernels | {folder / f"{name.replace('.', '/')}.py" for name in names}
    return sha256(b"".join(text for path, text in texts.items() if path in used)).hexdigest()


def _is_private(folder: Path, package: Path) -> bool:
    """Whether the user, root and the owner of a package alone can write to a cache folder.

    Cache files are unpickled, so whoever writes one runs code. Folders above it count, too, unless
    they hold the package: who can replace it there can replace the package.

    Args:
        folder: The folder; a warning names it if others can write to it.
        package: Folder of the package.
    """
    if sys.platform == "win32":
        return True
    place = folder.resolve()
    above = (parent for parent in place.parents if not package.is_relative_to(parent))
    private = is_closed(place.stat()) and all(
        is_closed(parent.stat()) or parent.stat().st_mode & stat.S_ISVTX for parent in above
    )
    if not private:
        problem = "others may write to the kernel cache %s: it is not used, kernels are compiled"
        _logger.warning(f"{problem} in each process; NUMBA_CACHE_DIR names another folder", folder)
    return private


def is_closed(entry: os.stat_result) -> bool:
    """Whether the user, root and the owner of the package alone own and may write to a file.

    Its group may write where that is the owner's own, which has no other user and the same name:
    where users have such groups, files are often made so that the group may write to them.
    """
    import grp
    import pwd

    trusted = {os.geteuid(), 0, os.stat(__file__).st_uid}
    if entry.st_uid not in trusted or entry.st_mode & stat.S_IWOTH:
        return False
    if not entry.st_mode & stat.S_IWGRP:
        return True
    with suppress(KeyError):
        user, group = pwd.getpwuid(entry.st_uid), grp.getgrgid(entry.st_gid)
        members = {other.pw_name for other in pwd.getpwall() if other.pw_gid == group.gr_gid}
        return group.gr_name == user.pw_name and members.union(group.gr_mem) <= {user.pw_name}
    return False
