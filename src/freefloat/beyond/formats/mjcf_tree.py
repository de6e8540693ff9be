"""Bodies and joints of a model of MuJoCo: their numbers and names."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

WORLD = 0
"""Number of MuJoCo's world body."""


def line(model: Any, body: int) -> list[int]:
    """A body and those that carry it, up to the one in the world."""
    bodies = [body]
    while model.body_parentid[bodies[-1]] != WORLD:
        bodies.append(int(model.body_parentid[bodies[-1]]))
    return bodies


def joints_of(model: Any, body: int) -> range:
    """Numbers of the joints of a body."""
    first = int(model.body_jntadr[body])
    return range(first, first + int(model.body_jntnum[body]))


def bodies_in_world(model: Any) -> list[int]:
    """Numbers of the bodies in the world."""
    return [body for body in range(1, model.nbody) if model.body_parentid[body] == WORLD]


def body_name(model: Any, body: int) -> str:
    """Name of a body, or one made of its number."""
    return str(model.body(body).name) or f"body_{body}"


def body_names(model: Any, bodies: Iterable[int]) -> list[str]:
    """Names of bodies."""
    return [body_name(model, body) for body in bodies]


def joint_name(model: Any, joint: int) -> str:
    """Name of a joint, or one made of the name of its body, with a number if that has several."""
    body = int(model.jnt_bodyid[joint])
    several = joints_of(model, body)
    number = f"_{several.index(joint) + 1}" if len(several) > 1 else ""
    return str(model.joint(joint).name) or f"{body_name(model, body)}_joint{number}"
