"""Robots as URDF text: random ones of every structure, planar ones from tables.

A structure is a word, one letter a joint from the spacecraft outwards: ``R`` revolute,
``C`` continuous, ``P`` prismatic, ``F`` fixed with a massive link behind it.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.named_files import example_robot

KINDS = {"R": "revolute", "C": "continuous", "P": "prismatic", "F": "fixed"}
STROKE = 4.0
"""Range of random prismatic joints, both ways [m]."""
AWKWARD = (0.0, 1e-9, -1e-6, 1e-3, np.pi / 2, -np.pi / 2, np.pi, -np.pi)
"""Where formulas break: zero, nearly zero, right angles, folded back."""


@dataclass(frozen=True)
class Robot:
    """URDF text and the names of its links and joints.

    Attributes:
        text: The URDF. Its root link is ``bus``.
        end_effector: Last link of the arm.
        joints: Moving joints from the spacecraft to the end-effector.
        others: Moving joints of the second arm.
    """

    text: str
    end_effector: str
    joints: tuple[str, ...]
    others: tuple[str, ...]

    def model(self, **options: Any) -> FreeFloatingModel:
        """The robot as freefloat reads it."""
        return FreeFloatingModel.from_urdf(self.text, self.end_effector, **options)

    def with_frame(self, name: str, xyz: str, rpy: str = "0 0 0") -> Robot:
        """The same robot with one more massless frame fixed to the end-effector."""
        frame = f'<link name="{name}"/>' + joint_text(
            f"{name}_joint", "F", self.end_effector, name, xyz, rpy
        )
        return replace(
            self, text=self.text.replace("</robot>", frame + "</robot>"), end_effector=name
        )


def numbers(values: Sequence[float] | np.ndarray) -> str:
    """Numbers as attributes of a URDF, no digit lost."""
    return " ".join(repr(float(value)) for value in values)


def inertial_text(mass: float, inertia: np.ndarray, xyz: str = "0 0 0", rpy: str = "0 0 0") -> str:
    """An ``<inertial>`` with its frame at ``xyz``, ``rpy``."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = np.asarray(inertia).tolist()
    return (
        f'<inertial><origin xyz="{xyz}" rpy="{rpy}"/><mass value="{mass!r}"/>'
        f'<inertia ixx="{xx!r}" ixy="{xy!r}" ixz="{xz!r}" iyy="{yy!r}" iyz="{yz!r}" izz="{zz!r}"/>'
        "</inertial>"
    )


def link_text(name: str, inertial: str = "") -> str:
    """A ``<link>``."""
    return f'<link name="{name}">{inertial}</link>\n'


def joint_text(
    name: str,
    kind: str,
    parent: str,
    child: str,
    xyz: str = "0 0 0",
    rpy: str = "0 0 0",
    axis: str = "0 0 1",
    limits: tuple[float, float] = (-STROKE, STROKE),
) -> str:
    """A ``<joint>``."""
    text = (
        f'<joint name="{name}" type="{KINDS[kind]}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{xyz}" rpy="{rpy}"/>'
    )
    if kind != "F":
        text += f'<axis xyz="{axis}"/>'
    if kind in "RP":
        text += f'<limit lower="{limits[0]}" upper="{limits[1]}" effort="100" velocity="10"/>'
    return text + "</joint>\n"


def random_inertia(rng: np.random.Generator, scale: float) -> np.ndarray:
    """A full inertia matrix that a rigid body can have: second moments are positive."""
    a, b, c = scale * rng.uniform(0.1, 1.0, 3)
    R = Rotation.random(rng=rng).as_matrix()
    return R @ np.diag([b + c, a + c, a + b]) @ R.T


def random_robot(
    rng: np.random.Generator, chain: str = "RRRRRR", branch: str = "", on_bus: bool = False
) -> Robot:
    """A robot with random masses, inertias, offsets and frames; names in no order.

    Args:
        rng: Source of randomness.
        chain: Structure of the arm to the end-effector.
        branch: Structure of a second arm, mounted on a random body.
        on_bus: Mount it on the root link.
    """
    names = iter(rng.permutation(100))

    def direction() -> np.ndarray:
        vector = rng.normal(size=3)
        return vector / np.linalg.norm(vector)

    def place(size: float) -> tuple[str, str]:
        return numbers(rng.uniform(-size, size, 3)), numbers(rng.uniform(-3.0, 3.0, 3))

    def arm(structure: str, parents: list[str], parent: str) -> list[str]:
        moving = []
        for kind in structure:
            number = next(names)
            joint, child = f"joint_{number:02d}", f"link_{number:02d}"
            axis = direction()
            parts.append(joint_text(joint, kind, parent, child, *place(0.8), numbers(axis)))
            mass, centre = float(np.exp(rng.uniform(0.0, 4.0))), place(0.3)
            inertial = inertial_text(mass, random_inertia(rng, 0.1 * mass), *centre)
            parts.append(link_text(child, inertial))
            if kind != "F":
                moving.append(joint)
            parents.append(child)
            parent = child
        return moving

    mass = float(rng.uniform(50.0, 500.0))
    bus = inertial_text(mass, random_inertia(rng, 0.2 * mass), *place(0.4))
    parts, bodies = [link_text("bus", bus)], ["bus"]
    joints = arm(chain, bodies, "bus")
    end_effector = bodies[-1]
    others = arm(branch, bodies, bodies[0 if on_bus else rng.integers(len(chain) + 1)])
    text = '<?xml version="1.0"?>\n<robot name="random">\n' + "".join(parts) + "</robot>"
    return Robot(text, end_effector, tuple(joints), tuple(others))


def planar_robot(
    m: Sequence[float],
    inertia: Sequence[float],
    before: Sequence[float],
    after: Sequence[float],
    axis: str = "0 0 1",
) -> str:
    """A planar arm, straight along x at zero, as in the paper's Table I.

    Args:
        m: Masses of spacecraft and links [kg].
        inertia: Moments about z [kg m²].
        before: ``l_i``: from joint i to the CM of link i, the spacecraft's left out [m].
        after: ``r_i``: from the CM of body i to joint i + 1, at last to the end-effector [m].
        axis: Of the joints.
    """
    text = link_text("bus", inertial_text(float(m[0]), float(inertia[0]) * np.eye(3)))
    at, parent = float(after[0]), "bus"
    for i in range(1, len(m)):
        link, to_centre = f"link_{i}", float(before[i - 1])
        text += joint_text(f"q{i}", "C", parent, link, f"{at!r} 0 0", axis=axis)
        text += link_text(
            link, inertial_text(float(m[i]), float(inertia[i]) * np.eye(3), f"{to_centre!r} 0 0")
        )
        at, parent = to_centre + float(after[i]), link
    text += joint_text("tool", "F", parent, "end_effector", f"{at!r} 0 0")
    return f'<robot name="planar">{text}<link name="end_effector"/></robot>'


def in_units(text: str, metres: float = 1.0, kilograms: float = 1.0) -> str:
    """The same robot in other units: a length of 1 m becomes ``metres``, and so on."""
    robot = ET.fromstring(text)
    for element in robot.iter():
        for key, value in element.attrib.items():
            factor = {
                ("origin", "xyz"): metres,
                ("mass", "value"): kilograms,
                ("limit", "lower"): metres,
                ("limit", "upper"): metres,
            }.get((element.tag, key), kilograms * metres**2 if element.tag == "inertia" else None)
            if factor is not None:
                element.set(key, numbers([factor * float(word) for word in value.split()]))
    return ET.tostring(robot, encoding="unicode")


structures = st.text("RCPF", min_size=1, max_size=7).filter(lambda word: set(word) != {"F"})
"""Any arm of up to seven joints, at least one of them moving."""


@st.composite
def robots(
    draw: st.DrawFn,
    chain: st.SearchStrategy[str] = structures,
    branch: st.SearchStrategy[str] = st.text("RCPF", max_size=3),  # noqa: B008
) -> Robot:
    """Random robots of a structure; by default any."""
    seed = draw(st.integers(0, 2**32 - 1))
    return random_robot(np.random.default_rng(seed), draw(chain), draw(branch))


def joint_values(count: int) -> st.SearchStrategy[np.ndarray]:
    """Joint vectors, with a liking for awkward values."""
    value = st.one_of(st.sampled_from(AWKWARD), st.floats(-3.0, 3.0))
    return st.lists(value, min_size=count, max_size=count).map(np.array)


attitudes = st.one_of(
    st.sampled_from([[0.0, 0.0, 0.0, 1.0], [1e-9, 0.0, 0.0, 1.0], [0.6, 0.0, 0.8, 0.0]]),
    st.integers(0, 2**32 - 1).map(
        lambda seed: Rotation.random(rng=np.random.default_rng(seed)).as_quat().tolist()
    ),
).map(np.array)
"""Unit quaternions: none, almost none, half turns, anything."""


def ur5_on_spacecraft() -> str:
    """A stock UR5 on a cube of 200 kg and 1 m, mounted half a metre above its centre."""
    robot = ET.parse(example_robot("ur5")).getroot()
    spacecraft = link_text("spacecraft", inertial_text(200.0, 35.0 * np.eye(3)))
    mount = joint_text("mount", "F", "spacecraft", "world", "0 0 0.5")
    robot.extend([ET.fromstring(spacecraft), ET.fromstring(mount)])
    return ET.tostring(robot, encoding="unicode")


def pin_configuration(model: pin.Model, joints: Mapping[str, float]) -> np.ndarray:
    """Pinocchio's own configuration, in which continuous joints have a cosine and a sine."""
    q = pin.neutral(model)
    for name, value in joints.items():
        joint = model.joints[model.getJointId(name)]
        angle = [np.cos(value), np.sin(value)] if joint.nq == 2 else [value]
        q[joint.idx_q : joint.idx_q + joint.nq] = angle
    return q


def pinocchio_jacobian(
    model: pin.Model, frame: str, joints: Mapping[str, float], fixed: Mapping[str, float] = {}
) -> np.ndarray:
    """S* of a model on a free-flyer from Pinocchio's matrices; other joints are at neutral."""
    data, q = model.createData(), pin_configuration(model, {**joints, **fixed})
    J = pin.computeFrameJacobian(model, data, q, model.getFrameId(frame), pin.LOCAL_WORLD_ALIGNED)
    A = pin.computeCentroidalMap(model, data, q)
    columns = [model.joints[model.getJointId(name)].idx_v for name in joints]
    return J[:, columns] - J[:, :6] @ np.linalg.solve(A[:, :6], A[:, columns])


def assert_as_pinocchio_reads(
    model: FreeFloatingModel, file: Path, rng: np.random.Generator
) -> None:
    """End-effector and inertia are those of what Pinocchio itself reads from a file."""
    theirs, up = pin.buildModelFromUrdf(str(file), pin.JointModelFreeFlyer()), [0.0, 0.0, 0.0, 1.0]
    data, joints = theirs.createData(), rng.uniform(-2.0, 2.0, model.dof)
    q = pin_configuration(theirs, dict(zip(model.joint_names, joints, strict=True)))
    pin.framesForwardKinematics(theirs, data, q)
    placed = data.oMf[theirs.getFrameId(model.end_effector_link)]
    pose = model.body_poses(up, joints)[0].inverse() @ model.end_effector_pose(up, joints)
    np.testing.assert_allclose(pose.position, placed.translation, atol=1e-12)
    np.testing.assert_allclose(pose.rotation, placed.rotation, atol=1e-12)
    pin.ccrba(theirs, data, q, np.zeros(theirs.nv))
    ours, configuration = model.scratch, model.configuration(up, joints)
    pin.ccrba(model.pin_model, ours, configuration, np.zeros(model.pin_model.nv))
    np.testing.assert_allclose(ours.Ig.inertia, data.Ig.inertia, rtol=1e-11)
