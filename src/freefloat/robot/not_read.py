"""What a robot file says and freefloat does not use."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NotRead:
    """An element or attribute of a robot file that carries physics, geometry or a limit, unused.

    Attributes:
        element: The element and the link, joint or body that it belongs to, as in
            ``"dynamics of joint elbow"``.
        attribute: The attribute, as in ``"damping"``; empty where the whole element is meant.
        line: Line of the element, counted from 1; None where the file is no URDF.
        meaning: What it means and what freefloat does instead, a phrase.
    """

    element: str
    attribute: str
    line: int | None
    meaning: str
