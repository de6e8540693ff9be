"""Warnings about a URDF: what loads, but is probably not what was meant."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from freefloat.robot.diagnostics import UrdfDiagnostic
from freefloat.robot.names import MeshFileError, find_mesh
from freefloat.robot.shapes import Box, Cylinder, MeshFile, Sphere, breaks_triangle
from freefloat.robot.urdf import Joint, Link, LinkShape, RigidGroup, RobotDescription
from freefloat.so3 import Array

LONG = 0.2
"""Links are long from this fraction of the arm's length. Links of stock arms whose mass is a motor
on their joint have up to 0.14 (UR3's shoulder), booms of space arms 0.25 and more."""
ON_JOINT = 0.02
"""Fraction of a link's length within which a centre of mass counts as on the joint."""
GYRATION = 3.0
"""No body's gyration radius exceeds the distance of its farthest point. The known extent of a link,
its joints and shapes, may be less than the real one: sound links reach 2.1 (Panda's last), links
with inertias a hundredfold too large 4.5 and more."""
ROUNDED = 1e-3
"""Error of a unit axis written with three digits."""


def warnings_about(robot: RobotDescription, mounted: bool) -> Iterator[UrdfDiagnostic]:
    """Warnings in no particular order, also about a URDF with errors.

    Args:
        robot: The robot.
        mounted: Whether it is an arm that will be mounted on a spacecraft.
    """
    for link in robot.links:
        yield from _inertia(robot, link)
    for joint in robot.joints:
        yield from _joint(robot, joint)
    arm_length = max((_reach(robot, root) for root in robot.roots), default=0.0)
    for first, body in robot.rigid_groups.items():
        mass, link = sum(robot.link[name].mass for name in body.links), robot.link[first]
        if first in robot.roots:
            if mass == 0.0 and robot.joints and not mounted:
                problem = "the root link and what is fixed to it have no mass"
                remedy = "robot.spacecraft in a scenario, or an <inertial> in this link"
                yield robot.warning(link, "link", problem, remedy)
            continue
        if mass == 0.0:
            remedy = "a small <inertial> where joint torques matter; motions are exact without"
            yield robot.warning(link, "link", "it moves but has no mass", remedy)
        elif mass > 0.0:
            yield from _centre_of_mass(robot, body, mass, arm_length)
        for name in body.links:
            yield from _gyration(robot, robot.link[name])


def missing_meshes(robot: RobotDescription) -> Iterator[UrdfDiagnostic]:
    """Warnings about mesh files that are not there."""
    for link in robot.links:
        for shape in link.shapes:
            if isinstance(shape.geometry, MeshFile):
                name = shape.geometry.filename
                try:
                    find_mesh(name, robot.source)
                except MeshFileError as error:
                    problem = (
                        f"the mesh {name or 'without a filename'} of its <{shape.kind}>: {error}"
                    )
                    remedy = "a file name relative to the URDF, or a shape such as <box>"
                    at = Link(link.name, None, (), {"link": shape.line})
                    yield robot.warning(at, "link", problem, remedy)


def _inertia(robot: RobotDescription, link: Link) -> Iterator[UrdfDiagnostic]:
    moments = _principal_moments(link)
    if not moments.size:
        return
    shown = ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] < 0.0 or (moments[0] == 0.0 and link.mass > 0.0):
        problem = f"its inertia is not positive definite (principal moments {shown})"
        remedy = "moments about the centre of mass; signs of the products as in the matrix"
        yield robot.warning(link, "inertia", problem, remedy)
    elif breaks_triangle(moments):
        problem = f"its principal moments {shown} break the triangle inequality"
        remedy = f"at most {moments[0] + moments[1]:.6g} for the largest"
        yield robot.warning(link, "inertia", problem, remedy)


def _principal_moments(link: Link) -> Array:
    """Principal moments of inertia, ascending [kg m²]; empty where there are none."""
    if link.inertial is None or not np.isfinite(link.inertial.inertia).all():
        return np.zeros(0)
    if "inertia" not in link.lines:
        return np.zeros(0)
    return np.asarray(np.linalg.eigvalsh(link.inertial.inertia))


def _joint(robot: RobotDescription, joint: Joint) -> Iterator[UrdfDiagnostic]:
    if joint.moving and "limit" in joint.lines and joint.lower >= joint.upper:
        problem = f"its range is {joint.lower:g} to {joint.upper:g}"
        remedy = "a lower end below the upper, or a fixed joint; the range is ignored"
        yield robot.warning(joint, "limit", problem, remedy)
    length = float(np.linalg.norm(joint.axis))
    if joint.moving and length > 0.0 and abs(length - 1.0) > ROUNDED:
        unit = " ".join(f"{value:.9g}" for value in joint.axis / length + 0.0)
        problem = f"its <axis> has length {length:.6g}; only the direction is used"
        yield robot.warning(joint, "axis", problem, f'<axis xyz="{unit}"/>')
    if joint.mimic is not None:
        problem = f"it mimics {joint.mimic}, which is ignored: the joint moves by itself or is held"
        yield robot.warning(joint, "mimic", problem, 'a value in held, or type="fixed"')


def _centre_of_mass(
    robot: RobotDescription, body: RigidGroup, mass: float, arm_length: float
) -> Iterator[UrdfDiagnostic]:
    """A long link with its centre of mass on one of its joints."""
    span = _span(body)
    length = float(np.linalg.norm(span))
    if length < max(LONG * arm_length, 1e-9):
        return
    centre = sum(
        (robot.link[name].mass * (pose @ inertial.origin).position
         for name, pose in body.links.items()
         if (inertial := robot.link[name].inertial) is not None), np.zeros(3),
    ) / mass  # fmt: skip
    along = float(centre @ span) / length**2
    end = next((end for end in (0.0, 1.0) if abs(along - end) < ON_JOINT), None)
    if end is None:
        return
    heaviest = max(body.links, key=lambda name: robot.link[name].mass)
    link, pose = robot.link[heaviest], body.links[heaviest]
    middle = np.round(pose.rotation.T @ (span / 2.0 - pose.position), 9) + 0.0
    problem = (
        f"the centre of mass of {link.mass:.6g} kg is on {'the next' if end else 'its'} joint, "
        f"although the link is {length:.4g} m long"
    )
    remedy = f'in the middle: <origin xyz="{" ".join(f"{value:.6g}" for value in middle)}"/>'
    tag = "origin" if "origin" in link.lines else "inertial"
    yield robot.warning(link, tag, problem, remedy)


def _gyration(robot: RobotDescription, link: Link) -> Iterator[UrdfDiagnostic]:
    """A gyration radius that the size of the link does not explain."""
    moments, inertial = _principal_moments(link), link.inertial
    if inertial is None or not moments.size or not link.mass > 0.0 or not moments[2] > 0.0:
        return
    radius = float(np.sqrt(moments[2]) / np.sqrt(link.mass))
    points = _known_points(robot, link.name)
    farthest = max(float(np.linalg.norm(point - inertial.origin.position)) for point in points)
    if np.any(points) and radius > GYRATION * farthest:
        problem = (
            f"its gyration radius is {radius:.3g} m (largest moment {moments[2]:.6g} kg m² of "
            f"{link.mass:.6g} kg), but it reaches {farthest:.3g} m from its centre of mass"
        )
        rod = link.mass * (2.0 * farthest) ** 2 / 12.0
        remedy = f"moments in kg m²; a rod of this mass and length has {rod:.3g}"
        yield robot.warning(link, "inertia", problem, remedy)


def _span(body: RigidGroup) -> Array:
    """From the first joint to the farthest next joint, else to the farthest link frame [m]."""
    points = list(body.joints.values()) or [pose.position for pose in body.links.values()]
    return max(points, key=lambda point: float(np.linalg.norm(point)))


def _reach(robot: RobotDescription, root: str) -> float:
    """Sum of the distances between the joints of the longest arm, to its last frame [m]."""
    longest, stack, seen = 0.0, [(link, 0.0) for link in robot.rigid_groups[root].joints], {root}
    while stack:
        link, length = stack.pop()
        longest = max(longest, length)
        if link in seen or link not in robot.rigid_groups:
            continue
        seen.add(link)
        body = robot.rigid_groups[link]
        longest = max(
            longest, length + (0.0 if body.joints else float(np.linalg.norm(_span(body))))
        )
        stack += [
            (child, length + float(np.linalg.norm(point))) for child, point in body.joints.items()
        ]
    return longest


def _known_points(robot: RobotDescription, link: str) -> list[Array]:
    """Points of a link in its frame [m]: the next joints, corners of boxes around its shapes.

    A link without any reaches back to the joint before.
    """
    points = [joint.origin.position for joint in robot.children.get(link, ())]
    for shape in robot.link[link].shapes:
        points += _corners(shape)
    if not np.any(points) and link in robot.parent_joint:
        origin = robot.parent_joint[link].origin
        points = [-origin.rotation.T @ origin.position]
    return [np.zeros(3), *points]


def _corners(shape: LinkShape) -> Iterator[Array]:
    """Corners of the box around a primitive shape; none of a mesh."""
    match shape.geometry:
        case Box(size=size):
            half = size / 2.0
        case Cylinder(radius=radius, length=length):
            half = np.array([radius, radius, length / 2.0])
        case Sphere(radius=radius):
            half = np.full(3, radius)
        case _:
            return
    for signs in itertools.product((-1.0, 1.0), repeat=3):
        yield shape.origin.position + shape.origin.rotation @ (np.array(signs) * half)
