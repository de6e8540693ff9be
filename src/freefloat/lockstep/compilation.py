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
from numba.core.compiler import Compiler

from freefloat.errors import InputError
from freefloat.lockstep.cache_files import CheckedCacheFile, is_private

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
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
    return cast(_Function, njit(**_OPTIONS, pipeline_class=_InnerCompiler)(function))


def inlined(function: _Function) -> _Function:
    """Compile a small function into the functions that call it."""
    options = _OPTIONS | {"forceinline": True}
    return cast(_Function, njit(**options, pipeline_class=_InnerCompiler)(function))


class _InnerCompiler(Compiler):
    """The compiler of fragments, or Numba's own where this Numba has not what that extends."""

    def define_pipelines(self) -> list[Any]:
        """The steps of the compiler."""
        pipelines: list[Any] = (_fragment_pipelines() or Compiler.define_pipelines)(self)
        return pipelines


@cache
def _fragment_pipelines() -> Callable[[Any], list[Any]] | None:
    """Gives the steps of the compiler of fragments; None where it cannot compile a small kernel."""
    try:
        from freefloat.lockstep.fragments import FragmentCompiler

        part = njit(pipeline_class=FragmentCompiler)(lambda x: x + 1.0)
        njit(lambda x: part(x) * x)(1.0)
    except (ImportError, AttributeError, TypeError):
        return None
    return FragmentCompiler.define_pipelines


@cache
def _digest(folder: Path) -> str:
    """Digest of the sources below a folder that contain kernels."""
    texts = [path.read_bytes() for path in sorted(folder.rglob("*.py"))]
    kernels = [text for text in texts if b"compilation import" in text or b"numba" in text]
    return sha256(b"".join(kernels)).hexdigest()
