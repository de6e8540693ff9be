"""Bodies and joints of a model of MuJoCo: their numbers, names, and which bodies may touch."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import combinations
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


def contact_bits(model: Any, geom: int) -> tuple[int, int]:
    """What a geom is, and what it touches, as MuJoCo's bits ``contype`` and ``conaffinity``."""
    return int(model.geom_contype[geom]), int(model.geom_conaffinity[geom])


def pairs_apart(model: Any, bodies: Iterable[int]) -> Iterator[tuple[str, str]]:
    """Names of bodies with geoms that touch others, but not each other, by bits or an exclusion."""
    bits: dict[int, list[tuple[int, int]]] = {}
    for body in bodies:
        first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
        geoms = (contact_bits(model, geom) for geom in range(first, first + count))
        bits[body] = [entry for entry in geoms if any(entry)]
    excluded = {frozenset(divmod(int(pair), 1 << 16)) for pair in model.exclude_signature}
    for one, other in combinations((body for body, entries in bits.items() if entries), 2):
        touch = any(a & d or c & b for a, b in bits[one] for c, d in bits[other])
        if not touch or frozenset((one, other)) in excluded:
            yield body_name(model, one), body_name(model, other)
