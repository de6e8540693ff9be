"""The work of ``simulate``: from which state, and every branch that was followed as one page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from freefloat.errors import InputError
from freefloat.motion.problem import Problem
from freefloat.motion.simulation import Simulation
from freefloat.so3 import heading_quaternion


def start_attitude(
    problem: Problem, attitude: Sequence[float] | None, heading: float | None
) -> Sequence[float]:
    """The initial attitude, given as a quaternion or, for planar tasks, as a heading [degrees].

    Raises:
        InputError: If not exactly one is given, or a heading does not fit the task.
    """
    if (attitude is None) == (heading is None):
        raise InputError(
            "attitude",
            ("neither" if attitude is None else "both") + " of --attitude and --heading given",
            "--heading DEG" if problem.task.planar else "--attitude X Y Z W",
        )  # fmt: skip
    if attitude is not None:
        return attitude
    if heading is None or not math.isfinite(heading):
        raise InputError("heading", f"{heading} was given", "a finite number of degrees")
    if not problem.task.planar:
        raise InputError("heading", f"task {problem.task} is not planar", "--attitude X Y Z W")
    return list(heading_quaternion(math.radians(heading)))


def joint_values(text: str | None) -> list[float] | None:
    """Joint values from numbers with commas between."""
    if text is None:
        return None
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        raise InputError("joints", f"{text!r} was given", "numbers with commas between") from None


def save_page(file: Path, simulation: Simulation, title: str) -> None:
    """Write a page on which every branch that was followed can be played, the chosen one first.

    Raises:
        InputError: If the file cannot be written.
    """
    from freefloat.visualization.playback import (
        playback,
    )  # MeshCat takes a third of a second to import

    playback(simulation, title).save(file)
