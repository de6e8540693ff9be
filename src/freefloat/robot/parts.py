"""What an arm is put together with: a spacecraft, further URDFs, something to hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from freefloat.brief import brief
from freefloat.errors import InputError, require_type
from freefloat.robot.names import is_file
from freefloat.robot.urdf_text import refuse_no_urdf
from freefloat.so3 import Array, Pose, breaks_triangle, finite_vector, frozen

INERTIA = (
    "three principal moments or a symmetric 3x3 matrix, or its six moments ixx ixy ixz iyy iyz izz "
    "[kg m²]"
)
"""How an inertia may be written."""

_MOUNT = "Mount(xyz, rpy), in m and rad, such as Mount([0, 0, 1])"


@dataclass(frozen=True, eq=False)
class Mount:
    """Where a root link stands on what carries it.

    Attributes:
        xyz: Its origin in the carrier's frame [m], shape (3,).
        rpy: Roll, pitch, yaw about the carrier's x, y, z axes in this order [rad], shape (3,).
    """

    __repr__ = brief

    xyz: Array = field(default_factory=lambda: np.zeros(3))
    rpy: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        for name in ("xyz", "rpy"):
            values = finite_vector(f"spacecraft.mount.{name}", getattr(self, name), 3)
            object.__setattr__(self, name, frozen(values))

    @classmethod
    def of(cls, pose: Pose) -> Mount:
        """The mount of a pose in the carrier's frame."""
        return cls(pose.position, roll_pitch_yaw(pose.rotation))

    @property
    def pose(self) -> Pose:
        """The root link's frame in the carrier's."""
        (cr, cp, cy), (sr, sp, sy) = np.cos(self.rpy), np.sin(self.rpy)
        roll = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
        pitch = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        yaw = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        return Pose(self.xyz, yaw @ pitch @ roll)


@dataclass(frozen=True, eq=False)
class Spacecraft:
    """What carries the arm.

    Attributes:
        mass: Without the arm [kg].
        inertia: About its centre of mass, axes of its frame [kg m²]: principal moments, shape (3,),
            the six moments ixx, ixy, ixz, iyy, iyz, izz, or a matrix; kept as a matrix, (3, 3).
        mount: Where the arm's root link stands.
        size: Edges of the box that stands for it, centred on its frame's origin [m], shape (3,).
        mesh: File of the mesh that stands for it, in metres and its frame. With neither there is
            no shape.
        com: Its centre of mass in its frame [m], shape (3,).
    """

    __repr__ = brief

    mass: float
    inertia: Array
    mount: Mount = field(default_factory=Mount)
    size: Array | None = None
    mesh: Path | None = None
    com: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        require_type("spacecraft.mount", self.mount, Mount, _MOUNT)
        _check_body("spacecraft", self)


@dataclass(frozen=True, eq=False)
class Payload:
    """What the hand holds rigidly.

    Attributes:
        mass: [kg].
        inertia: About its centre of mass, axes of the end-effector's frame [kg m²]; written and
            kept as the spacecraft's.
        com: Its centre of mass in the end-effector's frame [m], shape (3,).
        size: Edges of the box that stands for it, centred on its centre of mass [m], shape (3,).
        mesh: File of the mesh that stands for it, in metres and the end-effector's frame.
    """

    __repr__ = brief

    mass: float
    inertia: Array
    com: Array = field(default_factory=lambda: np.zeros(3))
    size: Array | None = None
    mesh: Path | None = None

    def __post_init__(self) -> None:
        _check_body("payload", self)


@dataclass(frozen=True, eq=False)
class Attachment:
    """Another URDF, fixed to a link: a tool, a second arm, an antenna.

    Attributes:
        urdf: A file or XML text.
        link: The link, or the joint that moves it, that carries its root link; the spacecraft when
            left out.
        mount: Where its root link stands on that link.
        prefix: Put before the names of its links, joints and materials.
    """

    __repr__ = brief

    urdf: str | Path
    link: str | None = None
    mount: Mount = field(default_factory=Mount)
    prefix: str = ""

    def __post_init__(self) -> None:
        refuse_no_urdf(self.urdf)
        require_type("attachment.mount", self.mount, Mount, _MOUNT)


def refuse_other_parts(spacecraft: object, payload: object, attached: Any) -> None:
    """Raise an InputError where what is to be put to an arm is no such part."""
    if spacecraft is not None:
        accepted = "Spacecraft(mass, inertia, mount), in kg and kg m²"
        require_type("spacecraft", spacecraft, Spacecraft, accepted)
    if payload is not None:
        accepted = "Payload(mass, inertia, com), in kg, kg m² and m"
        require_type("payload", payload, Payload, accepted)
    accepted = "a list of parts, such as [Attachment(urdf, link)]"
    require_type("attached", attached, Sequence, accepted)
    for index, one in enumerate(attached):
        require_type(f"attached.{index}", one, Attachment, accepted)


def inertia_matrix(key: str, given: npt.ArrayLike) -> Array:
    """An inertia as a matrix that a rigid body can have, shape (3, 3).

    Args:
        key: Named in errors.
        given: Principal moments, shape (3,), the six moments in a URDF's order, shape (6,), or a
            matrix, shape (3, 3) or its rows one after the other, (9,).

    Raises:
        InputError: If it is none of them, or no rigid body has it.
    """
    try:
        values = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise InputError(key, f"{given!r} was given", INERTIA) from None
    matrix = _as_matrix(values)
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        raise InputError(key, f"{values.tolist()} was given", INERTIA)
    if np.abs(matrix - matrix.T).max() > 1e-9 * np.abs(matrix).max():
        raise InputError(key, f"{matrix.tolist()} is not symmetric", INERTIA)
    moments = np.linalg.eigvalsh(matrix)
    shown = "principal moments " + ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] <= 0.0:
        raise InputError(key, f"{shown} are not all positive", "a positive definite inertia")
    if breaks_triangle(moments):
        raise InputError(
            key,
            f"{shown} break the triangle inequality, no rigid body has them",
            "moments of which the smaller two sum to the largest or more",
        )
    return frozen(matrix)


def roll_pitch_yaw(R: Array) -> Array:
    """Roll, pitch, yaw of a rotation (3, 3), about the fixed x, y, z axes in this order [rad].

    Also where roll and yaw are about the same axis: what noise there is in the yaw, the roll makes
    up for.
    """
    yaw = np.arctan2(R[1, 0], R[0, 0])
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    _, cosine, sine = np.cos(yaw) * R[1] - np.sin(yaw) * R[0]
    return np.array([np.arctan2(-sine, cosine), pitch, yaw])


def _check_body(name: str, body: Spacecraft | Payload) -> None:
    """Check what a rigid body says of itself, and keep it as read-only arrays."""
    mass = float(finite_vector(f"{name}.mass", [body.mass], 1)[0])
    if mass <= 0.0:
        raise InputError(f"{name}.mass", f"{mass:g} kg was given", "a positive mass [kg]")
    object.__setattr__(body, "mass", mass)
    object.__setattr__(body, "inertia", inertia_matrix(f"{name}.inertia", body.inertia))
    object.__setattr__(body, "com", frozen(finite_vector(f"{name}.com", body.com, 3)))
    if body.size is not None:
        edges = finite_vector(f"{name}.size", body.size, 3)
        if edges.min() <= 0.0:
            given = f"{edges.tolist()} was given"
            raise InputError(f"{name}.size", given, "three positive lengths [m]")
        object.__setattr__(body, "size", frozen(edges))
    if body.mesh is not None:
        if body.size is not None:
            raise InputError(f"{name}.mesh", "size is given, too", "one of mesh and size")
        mesh = Path(body.mesh).absolute()
        if not is_file(mesh):
            raise InputError(f"{name}.mesh", f"{mesh}: no such file", "a mesh file")
        object.__setattr__(body, "mesh", mesh)


def _as_matrix(values: Array) -> Array:
    if values.shape == (3,):
        return np.diag(values)
    if values.shape == (6,):
        xx, xy, xz, yy, yz, zz = values
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return values.reshape(3, 3) if values.shape == (9,) else values
