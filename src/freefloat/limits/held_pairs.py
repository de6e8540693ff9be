"""Pairs of shapes of one rigid body that joints at rest separate: their distances are constant."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from freefloat.attitude_grids import low_discrepancy
from freefloat.limits.collision_shapes import CollisionShape
from freefloat.robot.description import RobotDescription
from freefloat.robot.joint_values import INERTIAL
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.rigid_bodies import body_of, build_model, se3_of
from freefloat.so3 import Array

_CONFIGURATIONS = 1024
"""Sampled configurations; pairs that are too near in all of them are left out."""
_Pairs = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class HeldPairs:
    """Pairs of shapes that joints at rest separate, by the shapes' indices.

    Attributes:
        compared: Pairs with a constant distance, the nearest first.
        always_near: Pairs that are too near wherever the joints are held that have a value by name.
        unnamed: Pairs that are too near, and no joint between them has a value by name.
    """

    compared: _Pairs
    always_near: _Pairs
    unnamed: _Pairs


def held_pairs(
    model: FreeFloatingModel, shapes: Sequence[CollisionShape], clearance: float
) -> HeldPairs:
    """The pairs of a robot that joints at rest separate; not :func:`uncompared_links`.

    Grippers and other mechanisms, whose joints rest at zero without being named, often overlap
    there: their parts are not compared with one another.

    Args:
        model: The robot.
        shapes: Shapes of the robot.
        clearance: Distance up to which pairs are too near [m].
    """
    above, adjacent = _joints_above(model.description), uncompared_links(model.description)
    placed = [se3_of(shape.placement) for shape in shapes]
    distances = dict[tuple[int, int], float]()
    for i, j in itertools.combinations(range(len(shapes)), 2):
        links = shapes[i].link, shapes[j].link
        if shapes[i].body == shapes[j].body and frozenset(links) not in adjacent:
            first, second = above[links[0]], above[links[1]]
            if first != second:
                pair = (i, j) if len(first) <= len(second) else (j, i)
                distances[pair] = _distance(shapes, placed, pair)
    named = [pair for pair in distances if _held_between(model, shapes, above, pair)]
    near = [pair for pair in named if distances[pair] <= clearance]
    always = tuple(itertools.compress(near, always_near(model, shapes, near, clearance)))
    return HeldPairs(
        tuple(sorted(set(named).difference(always), key=lambda pair: (distances[pair], pair))),
        always,
        tuple(pair for pair in distances if distances[pair] <= clearance and pair not in named),
    )


def always_near(
    model: FreeFloatingModel,
    shapes: Sequence[CollisionShape],
    pairs: Sequence[tuple[int, int]],
    clearance: float,
) -> npt.NDArray[np.bool_]:
    """Which of some pairs, too near with joints held, are so wherever these joints are held.

    Args:
        model: The robot.
        shapes: Shapes of the robot.
        pairs: Pairs that are too near wherever the moving joints are, K of them.
        clearance: Distance up to which they are too near [m].

    Returns:
        Shape (K,); true of pairs that no joint with a value by name separates.
    """
    above = _joints_above(model.description)
    near = {pair for pair in pairs if _held_between(model, shapes, above, pair)}
    others = set(pairs) - near
    names = {name for i, j in near for name in above[shapes[i].link] ^ above[shapes[j].link]}
    for distance in _sampled_distances(model, shapes, names) if near else ():
        near = {pair for pair in near if distance(pair) <= clearance}
        if not near:
            break
    always = near | others
    return np.array([pair in always for pair in pairs], dtype=bool)


def uncompared_links(robot: RobotDescription) -> set[frozenset[str]]:
    """Pairs of links that a joint that could move connects, and pairs that SRDF disables."""
    connected = {frozenset((joint.parent, joint.child)) for joint in robot.joints if joint.moving}
    return connected | robot.disabled_pairs


def sampled_configurations(lower: Array, upper: Array) -> Iterator[Array]:
    """Pinocchio's configurations that fill ranges of joints evenly; infinite ones are a full turn.

    Args:
        lower: Lower ends of the ranges [rad or m], shape (n,).
        upper: Upper ends of the ranges, likewise.
    """
    low, high = np.where(np.isfinite([lower, upper]), [lower, upper], [[-np.pi], [np.pi]])
    for fraction in low_discrepancy(_CONFIGURATIONS, len(low)):
        yield np.concatenate([INERTIAL, low + fraction * (high - low)])


def _joints_above(robot: RobotDescription) -> dict[str, frozenset[str]]:
    """The joints that could move each link relative to the root link."""
    waiting = list(robot.roots)
    above = dict.fromkeys(waiting, frozenset[str]())
    for link in waiting:
        for joint in robot.children.get(link, ()):
            above[joint.child] = above[link] | ({joint.name} if joint.moving else set())
            waiting.append(joint.child)
    return above


def _held_between(
    model: FreeFloatingModel,
    shapes: Sequence[CollisionShape],
    above: dict[str, frozenset[str]],
    pair: tuple[int, int],
) -> bool:
    """Whether a joint that is held at a value by name is between two shapes."""
    first, second = (above[shapes[number].link] for number in pair)
    return not (first ^ second).isdisjoint(model.fixed_joints)


def _sampled_distances(
    model: FreeFloatingModel, shapes: Sequence[CollisionShape], names: Collection[str]
) -> Iterator[Callable[[tuple[int, int]], float]]:
    """Distances of pairs of shapes in configurations of the joints of some names."""
    joints = {joint.name: joint for joint in model.description.joints if joint.name in names}
    pin_model, places = build_model(model.description, tuple(joints.values()), model.fixed_joints)
    data = pin_model.createData()
    names_of = enumerate(pin_model.names[2:], start=2)
    bodies = [body_of(pin_model, k, joints[name]) for k, name in names_of]
    lower, upper = np.array([(body.lower, body.upper) for body in bodies]).T
    frames = list[tuple[int, pin.SE3]]()
    for shape in shapes:
        body, link = places[shape.link]
        in_link = model.link_places[shape.link][1].inverse() @ shape.placement
        frames.append((body + 1, se3_of(link @ in_link)))
    for q in sampled_configurations(lower, upper):
        pin.forwardKinematics(pin_model, data, q)
        placed = [data.oMi[joint] * frame for joint, frame in frames]
        yield partial(_distance, shapes, placed)


def _distance(
    shapes: Sequence[CollisionShape], placed: Sequence[pin.SE3], pair: tuple[int, int]
) -> float:
    """Distance of two shapes at poses of their frames [m]; minus the depth where they overlap."""
    first, second = (
        coal.Transform3s(placed[number].rotation, placed[number].translation) for number in pair
    )
    a, b = (shapes[number].geometry for number in pair)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    return float(coal.distance(a, first, b, second, request, result))
