"""Warnings about a URDF: what loads, but is probably not what was meant."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from freefloat.robot.description import IDENTITY, Joint, Link, RigidGroup, RobotDescription
from freefloat.robot.flat_links import flat_links
from freefloat.robot.shapes import MeshFile, corners
from freefloat.robot.source import MeshFileError, find_mesh
from freefloat.robot.urdf_xml import ROUNDED
from freefloat.so3 import Array

LONG = 0.2
"""Links are long from this fraction of the arm's length: links of stock arms with a motor on their
joint have up to 0.14 (UR3's shoulder), booms of space arms 0.25 and more."""
ON_JOINT = 0.02
"""Fraction of a link's length within which a centre of mass counts as on the joint."""
GYRATION = 3.0
"""Largest gyration radius over the known extent of a link, its joints and shapes: sound links reach
2.1 (Panda's last), links with inertias a hundredfold too large 4.5 and more."""
COMPACT = 0.1
"""Smallest gyration radius over the extent of the shapes of a link: stock robots have 0.13."""
DENSITIES = (0.01, 7850.0)
"""Mean densities of balls with the mass and the inertia of a link [kg/m³]: the Space Station has 3,
the densest links of stock robots 4,000; 7,850 is steel."""
PLACEHOLDER = 1.0
"""Mass up to which stock robots have links with any inertia [kg]."""
_TINY = 1e-15
"""Moments of inertia that are zero but for rounding [kg m²]: a milligram at 0.03 mm."""


class Fault(NamedTuple):
    """An error or a warning before its severity is known."""

    element: Link | Joint | RobotDescription  # the link, joint or robot concerned
    where: str | int  # tag of an element in it, or a line
    problem: str  # what is wrong, with its numbers
    remedy: str  # what to write instead

    @property
    def line(self) -> int:
        """Line in the URDF; the line of the link or joint where the element is missing."""
        if isinstance(self.where, int):
            return self.where
        lines = self.element.lines
        return lines.get(self.where, lines[self.element.tag])


Faults = Iterator[Fault]


def _inertias(robot: RobotDescription) -> Faults:
    flat = flat_links(robot)
    for link in robot.links:
        moments = _principal_moments(link)
        if moments is None:
            continue
        shown = ", ".join(f"{moment:.6g}" for moment in moments)
        if link.name in flat:
            problem = "of its inertia only izz is positive"
            remedy = "ixx and iyy; izz / 2 is used, as of a flat body: all joints are planar"
            yield Fault(link, "inertia", problem, remedy)
        elif moments[0] < 0.0 or (moments[0] == 0.0 and link.mass > 0.0):
            problem = f"its inertia is not positive definite (principal moments {shown})"
            remedy = "moments about the centre of mass; signs of the products as in the matrix"
            yield Fault(link, "inertia", problem, remedy)
        elif breaks_triangle(moments):
            problem = f"its principal moments {shown} violate the triangle inequality"
            remedy = f"at most {moments[0] + moments[1]:.6g} for the largest"
            yield Fault(link, "inertia", problem, remedy)


def breaks_triangle(moments: npt.ArrayLike) -> bool:
    """Whether no rigid body has these principal moments of inertia, ascending, shape (3,)."""
    smallest, middle, largest = np.asarray(moments, dtype=float).tolist()
    return bool(smallest + middle < largest * (1.0 - 1e-9))


def _principal_moments(link: Link) -> Array | None:
    """Principal moments of inertia, ascending, without rounding errors [kg m²]; None without."""
    inertial = link.inertial
    if inertial is None or not np.isfinite(inertial.inertia).all() or "inertia" not in link.lines:
        return None
    moments = np.linalg.eigvalsh(inertial.inertia)
    return np.where(np.abs(moments) < max(_TINY, 1e-12 * moments[-1]), 0.0, moments)


def _joint_values(robot: RobotDescription) -> Faults:
    for joint in robot.joints:
        limited = joint.type == "revolute" and "limit" in joint.lines
        if limited and joint.lower >= joint.upper:  # prismatic joints are refused where they move
            problem = f"its range is {joint.lower:g} to {joint.upper:g}"
            remedy = "a lower end below the upper, or a fixed joint; the range is ignored"
            yield Fault(joint, "limit", problem, remedy)
        length = float(np.linalg.norm(joint.axis))
        if joint.moving and length > 0.0 and abs(length - 1.0) > ROUNDED:
            unit = " ".join(f"{value:.9g}" for value in joint.axis / length + 0.0)
            problem = f"its <axis> has length {length:.6g}; only the direction is used"
            yield Fault(joint, "axis", problem, f'<axis xyz="{unit}"/>')


def root_masses(robot: RobotDescription, mounted: bool) -> Faults:
    """A spacecraft where there should be an arm, or the other way round.

    Without a spacecraft that carries it, a root link without mass or lighter than what moves is the
    foot of an arm; with one, a heavier root link is a spacecraft already.
    """
    masses = {first: _mass(robot, group) for first, group in robot.rigid_groups.items()}
    moving = sum(mass for first, mass in masses.items() if first not in robot.roots)
    for root in robot.roots if robot.joints else ():
        mass = masses[root]
        if mass == 0.0 and not mounted:
            problem = "the root link and what is fixed to it have no mass"
            remedy = "robot.spacecraft in a scenario, or an <inertial> in this link"
        elif mass > moving if mounted else mass < moving:
            problem = f"the root link has {mass:.4g} kg, what it carries {moving:.4g} kg"
            remedy = "robot.spacecraft in a scenario, if this is the foot of an arm"
            if mounted:
                remedy = "no robot.spacecraft, which is added, if this is a spacecraft already"
        else:
            continue
        yield Fault(robot.links_by_name[root], "link", problem, remedy)


def _mass(robot: RobotDescription, group: RigidGroup) -> float:
    return sum(robot.links_by_name[name].mass for name in group.links)


def _moving_links(robot: RobotDescription) -> Faults:
    """Links without mass, or with their centre of mass where it cannot be."""
    arm_length = max((_reach(robot, root) for root in robot.roots), default=0.0)
    for first, group in robot.rigid_groups.items():
        if first in robot.roots:
            continue
        mass = _mass(robot, group)
        if mass == 0.0 and first not in robot.frames:
            remedy = "its <inertial> if it has mass; without mass, joint torques may be undefined"
            yield Fault(robot.links_by_name[first], "link", "it moves but has no mass", remedy)
        elif mass > 0.0:
            yield from _centre_of_mass(robot, group, mass, arm_length)


def _centre_of_mass(
    robot: RobotDescription, group: RigidGroup, mass: float, arm_length: float
) -> Faults:
    """A long link with its centre of mass on one of its joints."""
    span = _span(group)
    length = float(np.linalg.norm(span))
    if length < max(LONG * arm_length, 1e-9):
        return
    centre = sum(
        (robot.links_by_name[name].mass * (pose @ inertial.origin).position
         for name, pose in group.links.items()
         if (inertial := robot.links_by_name[name].inertial) is not None), np.zeros(3),
    ) / mass  # fmt: skip
    near = ON_JOINT * length
    end = next((end for end in (0.0, 1.0) if np.linalg.norm(centre - end * span) < near), None)
    prismatic = [child for child in group.joints if robot.parent_joints[child].type == "prismatic"]
    carriage = any(np.array_equal(group.joints[child], span) for child in prismatic)
    if end is None or (end and carriage):  # a mast or rail with its carriage in the middle
        return
    heaviest = max(group.links, key=lambda name: robot.links_by_name[name].mass)
    link, pose = robot.links_by_name[heaviest], group.links[heaviest]
    middle = np.round(pose.rotation.T @ (span / 2.0 - pose.position), 9) + 0.0
    problem = (
        f"the centre of mass of {link.mass:.6g} kg is on {'the next' if end else 'its'} joint, "
        f"although the link is {length:.4g} m long"
    )
    remedy = f'in the middle: <origin xyz="{" ".join(f"{value:.6g}" for value in middle)}"/>'
    yield Fault(link, "origin" if "origin" in link.lines else "inertial", problem, remedy)


def inertia_sizes(robot: RobotDescription, names: Collection[str] | None = None) -> Faults:
    """Links, all or some, whose inertia does not fit their mass or their extent."""
    for first, group in robot.rigid_groups.items():
        for name in group.links:
            link = robot.links_by_name[name]
            moments = _principal_moments(link)
            meant = names is None or name in names
            if meant and moments is not None and min(link.mass, moments[2]) > 0.0:
                yield from _inertia_size(robot, link, float(moments[2]), first in robot.roots)


def _inertia_size(robot: RobotDescription, link: Link, moment: float, root: bool) -> Faults:
    """A largest moment that neither mass nor extent explain: shapes, of moving links joints too."""
    radius = float(np.sqrt(moment / link.mass))
    heavy = link.mass > PLACEHOLDER
    density = link.mass / (4.0 / 3.0 * np.pi * (np.sqrt(2.5) * radius) ** 3)
    if heavy and not DENSITIES[0] <= density <= DENSITIES[1]:
        problem = (
            f"its largest moment {moment:.6g} kg m² is that of a ball of {link.mass:.6g} kg with "
            f"a density of {density:.2g} kg/m³"
        )
        bounds = (0.4 * link.mass * (link.mass / (4.0 / 3.0 * np.pi * bound)) ** (2.0 / 3.0)
                  for bound in reversed(DENSITIES))  # fmt: skip
        least, most = bounds
        yield Fault(link, "inertia", problem, f"{least:.3g} to {most:.3g} kg m²; mass in kg")
        return
    shapes: list[Array] = []
    for shape in link.shapes:
        if shape.geometry is not None and not isinstance(shape.geometry, MeshFile):
            at = shape.origin
            shapes += list(at.position + corners(shape.geometry) @ at.rotation.T)
    points = list(shapes)
    if not root:
        points += [joint.origin.position for joint in robot.children.get(link.name, ())]
        if not np.any(points):
            origin = robot.parent_joints[link.name].origin
            points = [-origin.rotation.T @ origin.position]
    centre = IDENTITY.position if link.inertial is None else link.inertial.origin.position
    farthest = max(float(np.linalg.norm(point - centre)) for point in (*points, np.zeros(3)))
    small = heavy and bool(shapes) and radius < COMPACT * farthest
    large = (heavy or not root) and radius > GYRATION * farthest
    reach, away = np.linalg.norm([np.zeros(3), *points], axis=1).max(), np.linalg.norm(centre)
    if small and away > GYRATION * reach:
        problem = f"its centre of mass is {away:.4g} m from its frame, but it reaches {reach:.3g} m"
        yield Fault(link, "origin", problem, "the <origin> of its <inertial> in m")
    elif np.any(points) and (small or large):
        problem = (
            f"its gyration radius is {radius:.3g} m (largest moment {moment:.6g} kg m² of "
            f"{link.mass:.6g} kg), but it reaches {farthest:.3g} m from its centre of mass"
        )
        rod = link.mass * (2.0 * farthest) ** 2 / 12.0
        yield Fault(link, "inertia", problem, f"moments in kg m²; a rod of this mass has {rod:.3g}")


def _span(group: RigidGroup) -> Array:
    """Vector from the first joint to the farthest next joint, else to the farthest frame [m]."""
    points = list(group.joints.values()) or [pose.position for pose in group.links.values()]
    return max(points, key=lambda point: float(np.linalg.norm(point)))


def _reach(robot: RobotDescription, root: str) -> float:
    """Sum of the distances between the joints of the longest arm, to its last frame [m]."""
    longest = 0.0
    seen = {root}
    arms = [(link, 0.0) for link in robot.rigid_groups[root].joints]
    for link, length in arms:
        group = robot.rigid_groups.get(link)
        if group is None or link in seen:
            continue
        seen.add(link)
        last = 0.0 if group.joints else float(np.linalg.norm(_span(group)))
        longest = max(longest, length + last)
        arms += [(child, length + float(np.linalg.norm(p))) for child, p in group.joints.items()]
    return longest


def unusable_meshes(robot: RobotDescription) -> Faults:
    """Mesh files that are not there, and unusable mesh files of collision shapes, each once."""
    seen = set[object]()
    for link in robot.links:
        for shape in link.shapes:
            mesh, compared = shape.geometry, shape.kind == "collision"
            if not isinstance(mesh, MeshFile) or (mesh, compared) in seen:
                continue
            seen.add((mesh, compared))
            try:
                file = find_mesh(mesh.filename, robot.file)
                if compared:
                    from freefloat.robot.meshes import read_mesh  # trimesh imports slowly

                    read_mesh(file, mesh.scale)
            except MeshFileError as error:
                problem = f"mesh {mesh.filename or 'without a name'}: {error.reason}"
                if problem not in seen:
                    seen.add(problem)
                    remedy = error.remedy or "a readable mesh, relative to the URDF, or a <box>"
                    yield Fault(link, shape.line, problem, remedy)


WARNINGS = (_inertias, _joint_values, _moving_links, inertia_sizes)
"""Rules for every robot."""
