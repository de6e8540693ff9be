"""What is beyond the paper, found by name: the planner imports nothing of it."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

READERS = {"xacro": "freefloat.beyond.formats.xacro", "mjcf": "freefloat.beyond.formats.mjcf"}
"""Modules whose function ``read`` returns the URDF of a file."""


def beyond(module: str, name: str) -> Any:
    """An object of a module of ``freefloat.beyond``, which is imported now."""
    return getattr(import_module(f"freefloat.beyond.{module}"), name)


def later(module: str, name: str) -> Callable[..., Any]:
    """A function of a module of ``freefloat.beyond``, which is imported at the first call."""

    def function(*arguments: Any) -> Any:
        return beyond(module, name)(*arguments)

    return function
