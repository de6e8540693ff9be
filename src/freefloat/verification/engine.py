"""Other engines that repeat motions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

from freefloat.errors import InputError, require_extra
from freefloat.kinds import ENGINES, named
from freefloat.motion.motion import Motion
from freefloat.verification.comparisons import Check

PINOCCHIO = "pinocchio"
"""Name of freefloat's own dynamics."""


@dataclass(frozen=True)
class EngineRuns:
    """What another engine computed along a motion along a path.

    Attributes:
        inverse: Record of its inverse dynamics; None without another engine.
        forward: Record of its own integration; None without another engine.
        checks: Comparisons of both with the motion.
    """

    inverse: Any = None
    forward: Any = None
    checks: tuple[Check, ...] = ()


class Engine(Protocol):
    """Another engine that repeats motions."""

    def repeated(self, motion: Motion) -> EngineRuns:
        """Inverse dynamics of a motion along a path, and its integration.

        Raises:
            InputError: If the engine has no model of the robot.
        """

    def simulated(self, motion: Motion, steps: int, allowed: float) -> Iterator[Check]:
        """Integrate a motion of prescribed joints; check its final attitude.

        Args:
            motion: The recorded motion.
            steps: Number of steps.
            allowed: Deviation of the final attitude [rad].
        """


def other_engine(name: str) -> Engine | None:
    """The engine of a name; None for freefloat's own dynamics.

    Raises:
        InputError: If the engine is unknown or not installed.
    """
    if name == PINOCCHIO:
        return None
    if name not in ENGINES:
        raise InputError("engine", f"{name!r} was given", ", ".join([PINOCCHIO, *ENGINES]))
    require_extra(name, name)
    engine: Engine = named(ENGINES[name])()
    return engine
