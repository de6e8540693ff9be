"""What ties a robot of a model of MuJoCo to the world."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from freefloat.beyond.formats.mjcf_tree import WORLD, joints_of, line
from freefloat.so3 import Array

_TIES = (0, 1)
"""Types of equality constraints between bodies or sites: connect and weld."""
_COUPLING = 2
"""Type of equality constraints of joints."""
_LENGTH = 3
"""The same of tendons."""
_HOLDS = "stiffness", "damping", "frictionloss", "armature", "limited"
"""Properties of tendons that act without a drive."""
_SITE, _WRAPPED_SITE = 6, 3
"""Type of object of MuJoCo's sites, also where a tendon passes them."""


def tie_to_world(model: Any, root: int) -> str | None:
    """What ties a body of a root's robot to the world: an active constraint, a tendon, or a flex.

    Bodies without joints in the world, and those that are moved from outside, are as the world. One
    that couples a joint of the root ties it, too.
    """
    robot = [body for body in range(1, model.nbody) if root in line(model, body)]
    joints = {joint for body in line(model, root) for joint in joints_of(model, body)}
    constraint = "an active equality constraint"
    for number in np.flatnonzero(model.eq_active0):
        ends = [int(model.eq_obj1id[number]), int(model.eq_obj2id[number])]
        if int(model.eq_type[number]) == _COUPLING and joints & set(ends):
            return constraint
        if int(model.eq_type[number]) not in _TIES:
            continue
        if int(model.eq_objtype[number]) == _SITE:
            ends = [int(model.site_bodyid[site]) for site in ends]
        if _joins(model, ends, robot):
            return constraint
    held = _held_tendons(model)
    for tendon in range(model.ntendon):
        first = int(model.tendon_adr[tendon])
        wraps = slice(first, first + int(model.tendon_num[tendon]))
        sites = model.wrap_objid[wraps][model.wrap_type[wraps] == _WRAPPED_SITE]
        if held[tendon] and _joins(model, model.site_bodyid[sites].tolist(), robot):
            return f"the tendon {model.tendon(tendon).name or tendon}"
    for flex in range(model.nflex):
        first = int(model.flex_vertadr[flex])
        vertices = slice(first, first + int(model.flex_vertnum[flex]))
        if _joins(model, model.flex_vertbodyid[vertices].tolist(), robot):
            import mujoco

            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex)
            return f"the flex {name or flex}"
    return None


def _held_tendons(model: Any) -> Array:
    """Which tendons act on their ends without a drive, shape (T,)."""
    held = np.zeros(model.ntendon, dtype=bool)
    for name in _HOLDS:
        held |= getattr(model, f"tendon_{name}") != 0
    of_length = model.eq_active0.astype(bool) & (model.eq_type == _LENGTH)
    for ends in (model.eq_obj1id, model.eq_obj2id):
        held[ends[of_length & (ends >= 0)]] = True
    return held


def _joins(model: Any, bodies: Sequence[int], robot: Collection[int]) -> bool:
    """Whether bodies are of a robot and of what is fixed, or is moved from outside."""
    others = [body for body in bodies if body not in robot]
    return len(others) < len(bodies) and any(
        model.body_weldid[body] == WORLD or model.body_mocapid[body] >= 0 for body in others
    )
