"""Just-in-time compilation of kernels, cached on disk, that release Python's global lock."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import config, njit

from freefloat.errors import InputError
from freefloat.lockstep.cache_files import CheckedCacheFile, is_private
from freefloat.lockstep.fragments import FragmentCompiler

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
_INNER: dict[str, Any] = {
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": FragmentCompiler,
}
_PACKAGE = Path(__file__).parents[1]
_Function = TypeVar("_Function", bound=Callable[..., Any])


def compiled(function: _Function) -> _Function:
    """Compile a function at its first call and cache the machine code on disk.

    The compiled function releases the global lock and divides by zero as NumPy does. Without a
    writable cache folder that is the user's own, every process compiles it again.

    Raises:
        InputError: If Numba's compiler is switched off; kernels compute with its vectors.
    """
    try:
        with _caches_of_the_environment():
            kernel = njit(cache=True, **_OPTIONS)(function)
    except RuntimeError:  # Numba has no folder for its cache
        return cast(_Function, njit(**_OPTIONS)(function))
    if kernel is function:
        raise InputError("NUMBA_DISABLE_JIT", "it is set", "no such variable in the environment")
    if not is_private(Path(kernel._cache.cache_path), _PACKAGE):
        return cast(_Function, njit(**_OPTIONS)(function))
    # Numba compares the stamp of the kernel's own file only and would keep machine code of kernels
    # that it calls from other files: the stamp is extended by a digest of all kernels
    kernel._cache._cache_file = CheckedCacheFile.of(kernel._cache, _digest(_PACKAGE))
    return cast(_Function, kernel)


@contextmanager
def _caches_of_the_environment() -> Iterator[None]:
    """Let no file of the current folder, such as .numba_config.yaml, name the folder of caches.

    Whoever sent that folder would have machine code run that lies in it.
    """
    settings = vars(config)
    stated = settings["CACHE_DIR"]
    settings["CACHE_DIR"] = os.environ.get("NUMBA_CACHE_DIR", "")
    try:
        yield
    finally:
        settings["CACHE_DIR"] = stated


def inner(function: _Function) -> _Function:
    """Compile a function that compiled functions alone call, as part of these."""
    return cast(_Function, njit(**_OPTIONS, **_INNER)(function))


def inlined(function: _Function) -> _Function:
    """Compile a small function into the functions that call it."""
    return cast(_Function, njit(**_OPTIONS, **_INNER, forceinline=True)(function))


@cache
def _digest(folder: Path) -> str:
    """Digest of the sources below a folder that contain kernels."""
    texts = [path.read_bytes() for path in sorted(folder.rglob("*.py"))]
    kernels = [text for text in texts if b"compilation import" in text or b"numba" in text]
    return sha256(b"".join(kernels)).hexdigest()
