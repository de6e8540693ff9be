"""The body of a MuJoCo model that is the spacecraft, how it moves, and the bodies of the robot."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any

import numpy as np

from freefloat.beyond.formats.mjcf_tree import (
    WORLD,
    bodies_in_world,
    body_name,
    body_names,
    joint_name,
    joints_of,
    line,
)
from freefloat.errors import ModelError, did_you_mean
from freefloat.robot.free_base import NEGLIGIBLE, needed_widths
from freefloat.so3 import Array

FREE, BALL, SLIDE, HINGE = range(4)
"""Types of joints in MuJoCo."""
_KINDS = ("free", "ball", "slide", "hinge")
_ORTHOGONAL = 1e-6
"""Largest difference of the determinant of three orthogonal axes from one."""
_TIES = (0, 1)
"""Types of equality constraints between bodies or sites: connect and weld."""
_COUPLING = 2
"""Type of equality constraints of joints."""
_LENGTH = 3
"""Type of equality constraints of tendons."""
_HOLDS = "stiffness", "damping", "frictionloss", "armature", "limited"
"""Properties of tendons that act without a drive."""
_SITE, _WRAPPED_SITE = 6, 3
"""Type of object of MuJoCo's sites, also where a tendon passes them."""


def root_body(model: Any, root: str | None, source: str) -> int:
    """Number of the body that is the spacecraft.

    That is the body of a name, also the world's, else the only body in the world, else the only one
    with a free joint and bodies that move on it, else, where no body has these, the only one with
    bodies that move on it. Bodies of negligible mass that slide or turn in the world, one on the
    other, carry it.

    Raises:
        ModelError: If there is none of that name, several could be it, or joints connect it with
            the world that do not leave it free, or a constraint ties it to the world.
    """
    found = _chosen(model, root, source)
    if root is None and _is_base(model, carried := _carried(model, found)):
        found = carried
    joints = base_joints(model, found)
    if joints and not _is_base(model, found):
        problem = (
            f"the root body {body_name(model, found)} moves in the world with "
            f"{_joint_texts(model, joints)}; a base is free in all six directions, or moves in its "
            "x-y plane"
        )
        accepted = (
            "--root world (robot.root in a scenario) for an arm that stands in the world; a root "
            "body with a <freejoint/>, or without joints, which stands for free; on a table two "
            "slides along x and y and a hinge about z; with ranges of at least 2 m and a full "
            "turn, if any, and nothing of more than a ten thousandth of its mass on them beside it"
        )
        raise ModelError("root", problem, accepted, source)
    if found != WORLD and (tie := tie_to_world(model, found)) is not None:
        problem = f"{tie} ties the robot of {body_name(model, found)}"
        accepted = "a robot that no equality, tendon or flex ties to what is fixed"
        raise ModelError("root", f"{problem} to the world", accepted, source)
    return found


def _chosen(model: Any, root: str | None, source: str) -> int:
    names = body_names(model, range(model.nbody))
    if root is not None:
        if root not in names:
            problem = f"the model has no body {root!r}{did_you_mean(root, names)}"
            raise ModelError("root", problem, f"one of {', '.join(names)}", source)
        return names.index(root)
    in_world = bodies_in_world(model)
    if not in_world:
        raise ModelError("root", "the model has no body", "a file with a robot", source)
    carriers = {line(model, body)[-1] for body in range(1, model.nbody)
                if model.body_parentid[body] != WORLD and model.body_jntnum[body]}  # fmt: skip
    arms = [body for body in in_world if body in carriers]
    free = [body for body in arms if _is_free(model, body)]
    candidates = in_world if len(in_world) == 1 else free or arms
    if len(candidates) == 1:
        return candidates[0]
    known = ", ".join(body_names(model, candidates or in_world))
    problem = f"{len(candidates)} of its {len(in_world)} bodies in the world could be the root"
    accepted = (
        f"--root BODY (robot.root in a scenario), one of {known or 'its bodies'}; --root world for "
        "all that stands in the world"
    )
    raise ModelError("root", problem, accepted, source)


def _carried(model: Any, body: int) -> int:
    """A body, or the first one with mass of the bodies that it carries, one on the other."""
    while model.body_mass[body] <= NEGLIGIBLE * model.body_subtreemass[body]:
        children = np.flatnonzero(model.body_parentid == body)
        if len(children) != 1:
            break
        body = int(children[0])
    return body


def base_joints(model: Any, root: int) -> list[int]:
    """Numbers of the joints that move a root in the world, from the world to it."""
    return [joint for body in reversed(line(model, root)) for joint in joints_of(model, body)]


def _is_base(model: Any, root: int) -> bool:
    """Whether joints that move a root leave it free, or on a table, with nothing else to move."""
    alone = float(model.body_subtreemass[root])
    other_mass = float(model.body_subtreemass[line(model, root)[-1]]) - alone
    if other_mass > NEGLIGIBLE * alone or not _are_wide(model, base_joints(model, root)):
        return False
    return _is_free(model, root) or is_on_table(model, root) or moves_in_plane(model, root)


def _are_wide(model: Any, joints: list[int]) -> bool:
    """Whether ranges of joints leave a base free."""
    sliding = (model.jnt_type[joints] == SLIDE).tolist()
    needed = needed_widths(["prismatic" if slides else "revolute" for slides in sliding])
    narrow = np.ptp(model.jnt_range[joints], axis=1) < needed
    return not (model.jnt_limited[joints] & narrow).any()


def _axes(model: Any, joints: list[int], root: int) -> Array:
    """Axes of joints in the frame of a root, in the model's pose, shape (J, 3)."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return np.asarray(data.xaxis[joints] @ data.xmat[root].reshape(3, 3))


def _is_free(model: Any, root: int) -> bool:
    """Whether joints of a root are one free joint, or several that are as good as one.

    Those are three slides, then a ball or three hinges, along and about orthogonal axes.
    """
    joints = base_joints(model, root)
    kinds = [int(model.jnt_type[joint]) for joint in joints]
    if kinds[:3] != [SLIDE] * 3 or kinds[3:] not in ([BALL], [HINGE] * 3):
        return kinds == [FREE]
    triads = np.split(_axes(model, joints, root), [3])
    volumes = [abs(np.linalg.det(axes)) for axes in triads if len(axes) == 3]
    return bool(np.abs(np.array(volumes) - 1.0).max() < _ORTHOGONAL)


def is_on_table(model: Any, root: int) -> bool:
    """Whether two slides and a hinge move a root in its x-y plane."""
    joints = base_joints(model, root)
    if not _slides_and_turns(model, joints):
        return False
    axes, kinds = _axes(model, joints, root), model.jnt_type[joints]
    upright = np.abs(axes[kinds == HINGE][0, :2]).max() + np.abs(axes[kinds == SLIDE][:, 2]).max()
    return bool(abs(np.linalg.det(axes)) > _ORTHOGONAL and upright < _ORTHOGONAL)


def _slides_and_turns(model: Any, joints: list[int]) -> bool:
    """Whether joints are two slides and a hinge."""
    return sorted(int(model.jnt_type[joint]) for joint in joints) == [SLIDE, SLIDE, HINGE]


def moves_in_plane(model: Any, root: int) -> bool:
    """Whether a root moves in a plane, by two slides and a hinge, in which its robot stays.

    All joints turn about the normal of the plane or slide along it, all centres of mass lie in one
    plane, and the normal is a principal axis of all bodies: with a free base the robot would move
    alike.
    """
    import mujoco

    joints = base_joints(model, root)
    if not _slides_and_turns(model, joints):
        return False
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    bodies = bodies_of(model, root)
    own = (joint for body in bodies if body != root for joint in joints_of(model, body))
    every = [*joints, *own]
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


def moving_joints(model: Any, body: int, source: str) -> list[int]:
    """Numbers of the joints that move a body in its parent, one after the other.

    Raises a ModelError if one is no hinge or slide.
    """
    joints = list(joints_of(model, body))
    if not set(model.jnt_type[joints].tolist()) <= {SLIDE, HINGE}:
        problem = f"the body {body_name(model, body)} moves with {_joint_texts(model, joints)}"
        accepted = "hinges and slides for bodies that move on the root"
        raise ModelError("urdf", problem, accepted, source)
    return joints


def bodies_of(model: Any, root: int) -> list[int]:
    """Numbers of a root and the bodies that it carries; on the world those that do not float."""
    if root != WORLD:
        return [body for body in range(1, model.nbody) if root in line(model, body)]
    inside, mocap = bodies_in_world(model), model.body_mocapid
    floating = {body for body in inside if mocap[body] >= 0 or _is_free(model, body)}
    return [body for body in range(model.nbody) if line(model, body)[-1] not in floating]


def _joint_texts(model: Any, joints: Iterable[int]) -> str:
    """Names and types of joints, as in ``the joints x (slide), t (hinge)``."""
    texts = [f"{joint_name(model, j)} ({_KINDS[int(model.jnt_type[j])]})" for j in joints]
    return f"the joint{'s' * (len(texts) > 1)} {', '.join(texts)}"


def tie_to_world(model: Any, root: int) -> str | None:
    """What ties a body of a root's robot to the world: an active constraint, a tendon, or a flex.

    Bodies without joints in the world, and those that are moved from outside, are as the world. One
    that couples a joint of the root ties it, too.
    """
    robot = bodies_of(model, root)
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
    other_bodies = [body for body in bodies if body not in robot]
    return len(other_bodies) < len(bodies) and any(
        model.body_weldid[body] == WORLD or model.body_mocapid[body] >= 0 for body in other_bodies
    )
