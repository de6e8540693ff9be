"""What an arm that balances the spacecraft is asked for."""

from __future__ import annotations

from dataclasses import dataclass

from freefloat.errors import InputError, require_type, seed_number, whole_number

AXES = {"xyz": [0, 1, 2], "xy": [0, 1], "yz": [1, 2], "zx": [2, 0]}
"""Components of the angular velocity that are balanced, spacecraft axes."""


@dataclass(frozen=True)
class BalanceSettings:
    """What a balancing arm does.

    Attributes:
        arm: Name of the arm.
        axes: Spacecraft axes about which it keeps the attitude: ``"xyz"``, or two of them, about
            whose third the spacecraft may turn.
        starts: Number of initial configurations of the arm that are tried: the one with which its
            joint curve begins, and others in its ranges.
        seed: Seed of these.

    Example:
        >>> ff.BalanceSettings("left", "xy").starts
        8
    """

    arm: str
    axes: str = "xyz"
    starts: int = 8
    seed: int = 0

    def __post_init__(self) -> None:
        require_type("balance.arm", self.arm, str, "the name of an arm")
        require_type("balance.axes", self.axes, str, ", ".join(AXES))
        if self.axes not in AXES:
            raise InputError("balance.axes", f"{self.axes!r} was given", ", ".join(AXES))
        whole_number("balance.starts", self.starts, 1)
        seed_number("balance.seed", self.seed)
