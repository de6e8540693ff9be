"""Just-in-time compilation of kernels, cached on disk, that release Python's global lock."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import config, njit, types
from numba.core.compiler import CompilerBase, DefaultPassBuilder

from freefloat.errors import InputError
from freefloat.lockstep.cache_folder import cache_folder

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
    kernel = _cached(function) or njit(**_OPTIONS)(function)
    if kernel is function:
        raise InputError("NUMBA_DISABLE_JIT", "it is set", "no such variable in the environment")
    return cast(_Function, kernel)


def _cached(function: Callable[..., Any]) -> Any:
    """The compiled function with its machine code in the cache folder; None where it has none."""
    folder, settings = cache_folder(_PACKAGE), vars(config)
    if folder is None:
        return None
    stated, settings["CACHE_DIR"] = settings["CACHE_DIR"], str(folder)
    try:
        kernel = njit(cache=True, **_OPTIONS)(function)
    except RuntimeError:  # Numba cannot write there, or the function has no file
        return None
    finally:
        settings["CACHE_DIR"] = stated
    with suppress(ImportError, AttributeError, TypeError):  # another Numba keeps its own files
        from freefloat.lockstep.cache_files import CheckedCacheFile

        kernel._cache._cache_file = CheckedCacheFile.of(kernel._cache, folder, function.__module__)
    return kernel


def inner(function: _Function) -> _Function:
    """Compile a function that compiled functions alone call, as part of its callers."""
    return cast(_Function, _part(function, **_OPTIONS))


def inlined(function: _Function) -> _Function:
    """Compile a small function into the functions that call it."""
    return cast(_Function, _part(function, **_OPTIONS, forceinline=True))


def _part(function: Callable[..., Any], **options: Any) -> Any:
    """The compiled function; Numba compiles others again for each constant argument."""
    part = njit(**options, pipeline_class=_InnerCompiler)(function)
    if part is not function:  # the compiler is not switched off, see compiled
        compile_for = part.compile
        part.compile = lambda kinds: compile_for(tuple(map(types.unliteral, kinds)))
    return part


class _InnerCompiler(CompilerBase):
    """The compiler of fragments, or Numba's own where this Numba has not what that extends."""

    def define_pipelines(self) -> list[Any]:
        """The steps of the compiler."""
        if (pipelines := _fragment_pipelines()) is not None:
            return pipelines(self)
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]


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
