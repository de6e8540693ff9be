"""Bodies of a model of MuJoCo: their names, their joints, and the one that is the spacecraft."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any

import numpy as np

from freefloat.errors import ModelError, did_you_mean
from freefloat.so3 import Array

FREE, BALL, SLIDE, HINGE = range(4)
"""Types of joints in MuJoCo."""
WORLD = 0
"""Number of MuJoCo's world body."""
_KINDS = ("free", "ball", "slide", "hinge")
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
_ORTHOGONAL = 1e-6
"""Largest difference of the determinant of three orthogonal axes from one."""


def root_body(model: Any, root: str | None, source: str) -> int:
    """Number of the body that is the spacecraft.

    That is the body of a name, else the only body in the world, else the only one with a free joint
    and bodies that move on it, else, where no body has these, the only one with bodies that move on
    it.

    Raises:
        ModelError: If there is none of that name, several could be it, or joints connect it with
            the world that do not leave it free, or a constraint ties it to the world.
    """
    found = _chosen(model, root, source)
    joints = [joint for body in line(model, found) for joint in joints_of(model, body)]
    moves = _is_free(model, joints) or is_on_table(model, found) or moves_in_plane(model, found)
    if joints and not moves:
        problem = (
            f"the root body {body_name(model, found)} moves in the world with "
            f"{_joint_texts(model, joints)}; a base is free in all six directions, or moves in its "
            "x-y plane"
        )
        accepted = (
            "a root body with a <freejoint/>, or without joints, which stands for free; on a table "
            "two slides along x and y and a hinge about z, without ranges"
        )
        raise ModelError("root", problem, accepted, source)
    if (tie := _tie(model, found)) is not None:
        problem = f"{tie} ties the robot of {body_name(model, found)}"
        accepted = "a robot that no equality, tendon or flex ties to what is fixed"
        raise ModelError("root", f"{problem} to the world", accepted, source)
    return found


def _chosen(model: Any, root: str | None, source: str) -> int:
    names = body_names(model, range(1, model.nbody))
    if root is not None:
        if root not in names:
            problem = f"the model has no body {root!r}{did_you_mean(root, names)}"
            raise ModelError("root", problem, f"one of {', '.join(names)}", source)
        return names.index(root) + 1
    in_world = bodies_in_world(model)
    carriers = {line(model, body)[-1] for body in range(1, model.nbody)
                if model.body_parentid[body] != WORLD and model.body_jntnum[body]}  # fmt: skip
    arms = [body for body in in_world if body in carriers]
    free = [body for body in arms if _is_free(model, joints_of(model, body))]
    candidates = in_world if len(in_world) == 1 else free or arms
    if len(candidates) == 1:
        return candidates[0]
    known = ", ".join(body_names(model, candidates or in_world))
    problem = f"{len(candidates)} of its {len(in_world)} bodies in the world could be the root"
    accepted = f"--root BODY (robot.root in a scenario), one of {known or 'its bodies'}"
    raise ModelError("root", problem, accepted, source)


def _is_free(model: Any, joints: Iterable[int]) -> bool:
    """Whether joints of a root are one free joint, or several that are as good as one.

    Those are three slides, then a ball or three hinges, along and about orthogonal axes, without
    ranges.
    """
    numbers = list(joints)
    kinds = [int(model.jnt_type[joint]) for joint in numbers]
    turning = kinds[3:] in ([BALL], [HINGE] * 3)
    if kinds[:3] != [SLIDE] * 3 or not turning or len(set(model.jnt_bodyid[numbers])) != 1:
        return kinds == [FREE]
    triads = np.split(model.jnt_axis[numbers], [3])
    orthogonal = all(
        abs(abs(np.linalg.det(axes)) - 1.0) < _ORTHOGONAL for axes in triads if len(axes) == 3
    )
    return bool(orthogonal) and not model.jnt_limited[numbers].any()


def is_on_table(model: Any, root: int) -> bool:
    """Whether two slides and a hinge, without ranges, move a root in its x-y plane."""
    joints = list(joints_of(model, root))
    if not _slides_and_turns(model, joints) or line(model, root)[1:]:
        return False
    axes, kinds = model.jnt_axis[joints], model.jnt_type[joints]
    upright = np.abs(axes[kinds == HINGE][0, :2]).max() + np.abs(axes[kinds == SLIDE][:, 2]).max()
    return bool(abs(np.linalg.det(axes)) > _ORTHOGONAL and upright < _ORTHOGONAL)


def _slides_and_turns(model: Any, joints: list[int]) -> bool:
    """Whether joints are two slides and a hinge without ranges."""
    kinds = sorted(int(model.jnt_type[joint]) for joint in joints)
    return kinds == [SLIDE, SLIDE, HINGE] and not model.jnt_limited[joints].any()


def moves_in_plane(model: Any, root: int) -> bool:
    """Whether a root moves in a plane, by two slides and a hinge, in which its robot stays.

    All joints turn about the normal of the plane or slide along it, all centres of mass lie in one
    plane, and the normal is a principal axis of all bodies: with a free base the robot would move
    alike.
    """
    import mujoco

    joints = list(joints_of(model, root))
    if not _slides_and_turns(model, joints) or line(model, root)[1:]:
        return False
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    bodies = [body for body in range(1, model.nbody) if root in line(model, body)]
    every = [joint for body in bodies for joint in joints_of(model, body)]
    turning = model.jnt_type[every] == HINGE
    normal = data.xaxis[next(joint for joint in joints if model.jnt_type[joint] == HINGE)]
    across = np.abs(data.xaxis[every] @ normal)
    axes = data.ximat[bodies].reshape(-1, 3, 3)
    moments = np.einsum("bij,bj,bkj->bik", axes, model.body_inertia[bodies], axes) @ normal
    products = moments - np.outer(moments @ normal, normal)
    heights = data.xipos[bodies] @ normal
    return bool(
        abs(abs(np.linalg.det(data.xaxis[joints])) - 1.0) < _ORTHOGONAL
        and np.abs(across - turning).max() < _ORTHOGONAL
        and np.abs(products).max() < _ORTHOGONAL * np.abs(moments).max()
        and np.ptp(heights) < _ORTHOGONAL * float(np.abs(data.xipos).max() + 1.0)
    )


def _tie(model: Any, root: int) -> str | None:
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


def moving_joint(model: Any, body: int, source: str) -> int | None:
    """Number of the joint that moves a body in its parent; None where there is none.

    Raises:
        ModelError: If the body has several joints, or one that is no hinge or slide.
    """
    joints = joints_of(model, body)
    if not joints:
        return None
    if len(joints) > 1 or int(model.jnt_type[joints[0]]) not in (SLIDE, HINGE):
        problem = f"the body {body_name(model, body)} moves with {_joint_texts(model, joints)}"
        accepted = "one hinge or slide for each body that moves on the root"
        raise ModelError("urdf", problem, accepted, source)
    return joints[0]


def bodies_in_world(model: Any) -> list[int]:
    """Numbers of the bodies in the world."""
    return [body for body in range(1, model.nbody) if model.body_parentid[body] == WORLD]


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


def _joint_texts(model: Any, joints: Iterable[int]) -> str:
    """Names and types of joints, as in ``the joints x (slide), t (hinge)``."""
    texts = [f"{joint_name(model, joint)} ({_KINDS[int(model.jnt_type[joint])]})"
             for joint in joints]  # fmt: skip
    return f"the joint{'s' * (len(texts) > 1)} {', '.join(texts)}"
