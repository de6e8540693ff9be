"""What a URDF may say but hardly means, and what should be known of how it is read."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator

import numpy as np

from freefloat.robot.diagnostics import UrdfDiagnostic
from freefloat.robot.geometry import RigidGroup, RobotGeometry, placed
from freefloat.robot.urdf_text import UrdfText, plain_number, plain_numbers
from freefloat.robot.validation_errors import MOVING, mass_of
from freefloat.so3 import Array, breaks_triangle

LONG = 0.2
"""Share of its arm from which a link is long. Links of stock arms whose mass is a motor on their
joint have up to 0.14 (UR3's shoulder), booms of space arms 0.25 and more."""
ON_JOINT = 0.02
"""Share of a link's length: what a centre of mass on its joint may be off by rounding."""
BEYOND = 3.0
"""No body's gyration radius exceeds the distance of its farthest point. What is known of a link,
its joints and plain shapes, may be less than all of it: sound links reach 2.1 (Panda's last), links
with inertias a hundredfold too large 4.5 and more."""
ROUNDED = 1e-3
"""Error of a unit axis written with three digits."""


def doubts(urdf: UrdfText, carried: bool) -> Iterator[UrdfDiagnostic]:
    """Every doubt and note that can be told, also of a URDF with defects.

    Args:
        urdf: The robot.
        carried: Whether it is mounted on a spacecraft that the file does not tell of.
    """
    anatomy = RobotGeometry(urdf)
    for link in urdf.links:
        yield from _inertia_doubts(urdf, link)
        yield from _turn_doubts(urdf, link)
    for joint in urdf.joints:
        yield from _turn_doubts(urdf, joint)
        yield from _joint_doubts(urdf, joint)
    for first, body in anatomy.fixtures.items():
        if first in anatomy.roots:
            yield from _root_notes(urdf, anatomy, body, carried)
            continue
        if anatomy.mass(body) == 0.0:
            remedy = "motions stay exact; where joint torques matter give it a small <inertial>"
            link = anatomy.links[first]
            yield urdf.doubt(link, link, "it moves but has no mass", remedy)
        else:
            yield from _centre_doubts(urdf, anatomy, body)
        for name in body.places:
            yield from _gyration_doubts(urdf, anatomy, name)


def _turn_doubts(urdf: UrdfText, owner: ET.Element) -> Iterator[UrdfDiagnostic]:
    """Angles that were hardly meant in radians."""
    for origin in owner.iter("origin"):
        angles = plain_numbers(origin, "rpy", "0 0 0")
        if np.abs(np.nan_to_num(angles)).max() > 2.0 * np.pi:
            radians = " ".join(f"{angle:.9g}" for angle in np.radians(angles) + 0.0)
            problem = f'<origin rpy="{origin.get("rpy")}"> turns by more than a turn'
            remedy = f'angles are in radians; if these are degrees, write rpy="{radians}"'
            yield urdf.doubt(origin, owner, problem, remedy)


def _moments(link: ET.Element) -> Array:
    """Principal moments of a link's inertia, ascending [kg m²]; empty where there are none."""
    element = link.find("inertial/inertia")
    xx, xy, xz, yy, yz, zz = (
        plain_number(element, key) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if element is None or not np.isfinite(matrix).all():
        return np.zeros(0)
    return np.asarray(np.linalg.eigvalsh(matrix))


def _inertia_doubts(urdf: UrdfText, link: ET.Element) -> Iterator[UrdfDiagnostic]:
    element, moments = link.find("inertial/inertia"), _moments(link)
    if element is None or not moments.size:
        return
    printed = ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] < 0.0 or (moments[0] == 0.0 and mass_of(link) > 0.0):
        problem = f"its inertia is not positive definite (principal moments {printed})"
        remedy = "check the signs of its <inertia>, and that it is about the centre of mass: "
        remedy += "ixx, iyy, izz are positive, products at most half as large as any of them"
        yield urdf.doubt(element, link, problem, remedy)
    elif breaks_triangle(moments):
        problem = f"its principal moments {printed} break the triangle inequality"
        remedy = "no rigid body has them: the smaller two must sum to the largest or more, "
        remedy += f"here write at most {moments[0] + moments[1]:.6g} for the largest"
        yield urdf.doubt(element, link, problem, remedy)


def _gyration_doubts(urdf: UrdfText, anatomy: RobotGeometry, name: str) -> Iterator[UrdfDiagnostic]:
    link = anatomy.links[name]
    element, moments, mass = link.find("inertial/inertia"), _moments(link), mass_of(link)
    if element is None or not moments.size or not mass > 0.0 or not moments[2] > 0.0:
        return
    centre, radius = (
        placed(link.find("inertial")).position,
        float(np.sqrt(moments[2]) / np.sqrt(mass)),
    )
    points = anatomy.known_points(name)
    farthest = max(float(np.linalg.norm(point - centre)) for point in points)
    if np.any(points) and radius > BEYOND * farthest:
        rod = mass * (2.0 * farthest) ** 2 / 12.0
        problem = (
            f"its gyration radius is {radius:.3g} m (largest moment {moments[2]:.6g} kg m² of "
            f"{mass:.6g} kg), but it reaches {farthest:.3g} m from its centre of mass"
        )
        remedy = (
            "check the unit of its <inertia> [kg m²] and what it is about; a rod of this mass and "
            f"length has {rod:.3g}"
        )
        yield urdf.doubt(element, link, problem, remedy)


def _centre_doubts(
    urdf: UrdfText, anatomy: RobotGeometry, body: RigidGroup
) -> Iterator[UrdfDiagnostic]:
    span, length = body.span, float(np.linalg.norm(body.span))
    if not anatomy.mass(body) > 0.0 or length < max(LONG * anatomy.longest_arm, 1e-9):
        return
    along = float(anatomy.centre(body) @ span) / length**2
    at = next((end for end in (0.0, 1.0) if abs(along - end) < ON_JOINT), None)
    if at is None:
        return
    heaviest = max(body.places, key=lambda link: mass_of(anatomy.links[link]))
    link, place = anatomy.links[heaviest], body.places[heaviest]
    middle = place.rotation.T @ (span / 2.0 - place.position)
    inertial = link.find("inertial")
    origin = None if inertial is None else inertial.find("origin")
    element = next(one for one in (origin, inertial, link) if one is not None)
    whose = "the next joint" if at else "its joint"
    problem = (
        f"the centre of mass of {mass_of(link):.6g} kg stands on {whose}, although the link is "
        f"{length:.4g} m long"
    )
    middle_text = " ".join(f"{value + 0.0:.6g}" for value in np.round(middle, 9))
    remedy = (
        f'write where it is, in the middle <origin xyz="{middle_text}"/> in the <inertial>, '
        "and the moments about it"
    )
    yield urdf.doubt(element, link, problem, remedy)


def _joint_doubts(urdf: UrdfText, joint: ET.Element) -> Iterator[UrdfDiagnostic]:
    limit, mimic, kind = joint.find("limit"), joint.find("mimic"), joint.get("type")
    if kind in ("revolute", "prismatic") and limit is not None:
        lower, upper = plain_number(limit, "lower"), plain_number(limit, "upper")
        if lower >= upper:
            problem = f"its range is {lower:g} to {upper:g}"
            remedy = f'write <limit lower="{upper:g}" upper="{lower:g}" .../> in order'
            if lower == upper:
                remedy = 'write <limit lower=".." upper=".." .../>, or make it fixed'
            yield urdf.doubt(limit, joint, problem, remedy)
    if kind in MOVING:
        yield from _axis_doubts(urdf, joint)
    if mimic is not None:
        problem = f"it mimics {mimic.get('joint')}, which is ignored: it moves by itself or is held"
        remedy = 'hold it still, or write type="fixed" and leave out <mimic>'
        yield urdf.doubt(mimic, joint, problem, remedy)
    if kind == "continuous":
        remedy = 'nothing to be done; type="revolute" with a <limit> would give it a range'
        problem = "continuous: it is read as a plain angle without a range"
        yield urdf.note(joint, joint, problem, remedy)


def _axis_doubts(urdf: UrdfText, joint: ET.Element) -> Iterator[UrdfDiagnostic]:
    element = joint.find("axis")
    axis = plain_numbers(element, "xyz", "1 0 0")
    length = float(np.linalg.norm(axis))
    if element is not None and length > 0.0 and abs(length - 1.0) > ROUNDED:
        unit = " ".join(f"{value:.9g}" for value in axis / length + 0.0)
        problem = (
            f'<axis xyz="{element.get("xyz")}"> has length {length:.6g}; only its direction counts'
        )
        yield urdf.doubt(element, joint, problem, f'write <axis xyz="{unit}"/>, of length 1')


def _root_notes(
    urdf: UrdfText, anatomy: RobotGeometry, body: RigidGroup, carried: bool
) -> Iterator[UrdfDiagnostic]:
    """What becomes of a root link without mass, such as ``world``."""
    link, mass = anatomy.links[body.first], anatomy.mass(body)
    if mass_of(link) != 0.0 or not urdf.joints:
        return
    if carried:
        problem = "root link without mass: a mere frame, where the arm stands on the spacecraft"
        yield urdf.note(link, link, problem, "nothing to be done")
    elif mass > 0.0:
        heavy = [name for name in body.places if mass_of(anatomy.links[name]) > 0.0]
        problem = (
            f"root link without mass: what is fixed to it is the spacecraft, "
            f"{', '.join(heavy)} of {mass:.6g} kg"
        )
        remedy = "nothing to be done, or robot.spacecraft in a scenario to carry the arm"
        yield urdf.note(link, link, problem, remedy)
    elif mass == 0.0:
        problem = "the root link, and all that is fixed to it, has no mass: a spacecraft of 0 kg"
        remedy = "write robot.spacecraft in a scenario, or an <inertial> in this link"
        yield urdf.doubt(link, link, problem, remedy)
