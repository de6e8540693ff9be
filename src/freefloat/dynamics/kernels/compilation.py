"""How kernels are compiled: to machine code, kept on disk, and run beside other threads."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from types import CellType, FunctionType
from typing import Any, TypeVar, cast

from numba import njit
from numba.extending import intrinsic

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
_PACKAGE = Path(__file__).parents[2]
_Function = TypeVar("_Function", bound=Callable[..., Any])


def compiled(function: _Function) -> _Function:
    """Compile a function at its first call; later processes find it on disk.

    It runs without Python's lock, and divides by zero as numpy does. Where no folder can be written
    to, it is compiled anew in every process.
    """
    stamped = _stamped(cast(FunctionType, function))
    try:
        return cast(_Function, njit(cache=True, **_OPTIONS)(stamped))
    except RuntimeError:  # numba found no folder for its cache
        return cast(_Function, njit(**_OPTIONS)(stamped))


def _stamped(function: FunctionType) -> FunctionType:
    """The same function with a closure that holds a digest of all kernels.

    Numba compiles a kernel anew when its file or its closure changes, but would go on using old
    machine code of the kernels it calls from other files.
    """
    code = function.__code__.replace(co_freevars=("kernels",))
    closure = (CellType(_digest(_PACKAGE)),)
    stamped = FunctionType(code, function.__globals__, function.__name__, None, closure)
    stamped.__doc__, stamped.__module__ = function.__doc__, function.__module__
    stamped.__qualname__ = function.__qualname__
    return stamped


@cache
def _digest(folder: Path) -> str:
    """Digest of the sources below a folder that contain kernels."""
    texts = [path.read_bytes() for path in sorted(folder.rglob("*.py"))]
    return sha256(b"".join(text for text in texts if b"@compiled" in text)).hexdigest()


def _borrow(_: Any, array: Any) -> Any:
    """Code for the same array without an owner."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = context.make_array(signature.return_type)(context, builder, arguments[0])
        view.meminfo = view.meminfo.type(None)
        return view._getvalue()

    return array(array), generate


borrowed: Any = intrinsic(_borrow)
"""In a kernel: the same array without an owner, for which no references are counted. Counting costs
more than the arithmetic of a small kernel. Whoever calls the kernel must hold on to the array."""
