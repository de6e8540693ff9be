"""Parts of an assembly: a spacecraft, further URDFs, a payload."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from freefloat.errors import InputError, finite_number, finite_vector, number_array, require_type
from freefloat.robot.named_files import is_file
from freefloat.robot.plausibility import breaks_triangle
from freefloat.robot.source import RobotSource
from freefloat.rotations import Rotation
from freefloat.so3 import Array, Pose, frozen, zeros

INERTIA = (
    "three principal moments or a symmetric 3x3 matrix, or its six moments ixx ixy ixz iyy iyz izz "
    "[kg m²]"
)
"""Accepted forms of an inertia."""
_MOUNT = "Mount(xyz, rpy), in m and rad, such as Mount([0, 0, 1])"


@dataclass(frozen=True, eq=False)
class Mount:
    """Pose of a root link in the frame of the link that carries it.

    Attributes:
        xyz: Position [m], shape (3,).
        rpy: Roll, pitch, yaw about the carrier's x, y, z axes in this order [rad], shape (3,).

    Example:
        >>> Mount([0.0, 0.0, 1.0]).pose.position
        array([0., 0., 1.])
    """

    xyz: Array = field(default_factory=zeros)
    rpy: Array = field(default_factory=zeros)

    def __post_init__(self) -> None:
        for name in ("xyz", "rpy"):
            values = finite_vector(f"mount.{name}", getattr(self, name), 3)
            object.__setattr__(self, name, frozen(values))

    @classmethod
    def of(cls, key: str, value: Any) -> Mount:
        """A mount as it is given, or the mount of a pose."""
        if isinstance(value, cls):
            return value
        pose = Pose.of(key, value, _MOUNT)
        return cls(pose.position, pin.rpy.matrixToRpy(pose.rotation))

    @property
    def pose(self) -> Pose:
        """The root link's frame in the carrier's frame."""
        return Pose(self.xyz, Rotation.from_rpy(self.rpy).as_matrix())


@dataclass(frozen=True, eq=False)
class Spacecraft:
    """A rigid spacecraft that carries the arm.

    Attributes:
        mass: Without the arm [kg].
        inertia: Inertia about its centre of mass, axes of its frame [kg m²]: principal moments,
            shape (3,), the six moments ixx, ixy, ixz, iyy, iyz, izz, or a matrix; kept as a matrix,
            (3, 3).
        mount: Pose of the arm's root link; also as a ``pin.SE3``.
        size: Edges of a box centred on its frame's origin [m], shape (3,).
        mesh: A mesh file in metres, in its frame. With neither size nor mesh it has no shape.
        com: Centre of mass in its frame [m], shape (3,).

    Raises:
        InputError: If no rigid body has these values, or the mesh file does not exist.

    Example:
        >>> spacecraft = ff.Spacecraft(mass=200.0, inertia=np.diag([35.0, 35.0, 35.0]))
        >>> ur5 = "example-robot-data:ur5"
        >>> model = ff.FreeFloatingModel.from_urdf(ur5, "tool0", spacecraft=spacecraft)
        >>> round(model.total_mass, 2)
        220.99
    """

    mass: float
    inertia: Array
    mount: Mount = field(default_factory=Mount)
    size: Array | None = None
    mesh: Path | None = None
    com: Array = field(default_factory=zeros)

    def __post_init__(self) -> None:
        object.__setattr__(self, "mount", Mount.of("spacecraft.mount", self.mount))
        _check_body("spacecraft", self)


@dataclass(frozen=True, eq=False)
class Payload:
    """A rigid body fixed to the end-effector.

    Attributes:
        mass: Mass [kg].
        inertia: Inertia about its centre of mass, axes of the end-effector's frame [kg m²]; in the
            forms of :class:`Spacecraft`.
        com: Centre of mass in the end-effector's frame [m], shape (3,).
        size: Edges of a box centred on its centre of mass [m], shape (3,).
        mesh: A mesh file in metres, in the end-effector's frame.
        name: Name of its link, with a number where the robot has one of this name.

    Raises:
        InputError: If no rigid body has these values, or the mesh file does not exist.

    Example:
        >>> payload = ff.Payload(mass=20.0, inertia=np.diag([0.5, 0.5, 0.5]))
        >>> model = ff.FreeFloatingModel.from_urdf("planar_3dof", "end_effector", payload=payload)
        >>> model.total_mass
        491.0
    """

    mass: float
    inertia: Array
    com: Array = field(default_factory=zeros)
    size: Array | None = None
    mesh: Path | None = None
    name: str = "payload"

    def __post_init__(self) -> None:
        require_type("payload.name", self.name, str, "a name")
        _check_body("payload", self)


@dataclass(frozen=True, eq=False)
class Attachment:
    """Another URDF, fixed to a link: a tool, a second arm, an antenna.

    Attributes:
        urdf: A file, XML text, a source, or the name of a robot.
        link: The link, or the joint that moves it, that carries its root link; None for the
            spacecraft.
        mount: Pose of its root link; also as a ``pin.SE3``.
        prefix: Put before the names of its links and joints.
    """

    urdf: str | Path | RobotSource
    link: str | None = None
    mount: Mount = field(default_factory=Mount)
    prefix: str = ""

    def __post_init__(self) -> None:
        RobotSource.of(self.urdf)
        object.__setattr__(self, "mount", Mount.of("attachment.mount", self.mount))


def _check_body(name: str, body: Spacecraft | Payload) -> None:
    """Check the values of a rigid body and replace them by read-only arrays."""
    smallest = float(np.finfo(float).tiny)
    mass = finite_number(f"{name}.mass", body.mass, "a positive mass [kg]", smallest)
    values: dict[str, Any] = {
        "mass": mass,
        "inertia": inertia_matrix(f"{name}.inertia", body.inertia),
        "com": frozen(finite_vector(f"{name}.com", body.com, 3)),
    }
    if body.size is not None:
        edges = finite_vector(f"{name}.size", body.size, 3)
        if edges.min() <= 0.0:
            problem = f"{edges.tolist()} was given"
            raise InputError(f"{name}.size", problem, "three positive lengths [m]")
        values["size"] = frozen(edges)
    if body.mesh is not None:
        if body.size is not None:
            raise InputError(f"{name}.mesh", "size is given, too", "one of mesh and size")
        values["mesh"] = Path(body.mesh).absolute()
        if not is_file(values["mesh"]):
            raise InputError(f"{name}.mesh", f"{values['mesh']}: no such file", "a mesh file")
    for key, value in values.items():
        object.__setattr__(body, key, value)


def inertia_matrix(key: str, values: npt.ArrayLike) -> Array:
    """The inertia matrix (3, 3), read-only, from three principal moments, six moments or a matrix.

    Raises:
        InputError: Naming ``key``, if no rigid body has that inertia.
    """
    matrix = number_array(key, values, INERTIA)
    if matrix.shape == (3,):
        matrix = np.diag(matrix)
    elif matrix.shape == (6,):
        matrix = matrix[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    elif matrix.shape == (9,):
        matrix = matrix.reshape(3, 3)
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        raise InputError(key, f"{matrix.tolist()} was given", INERTIA)
    if np.abs(matrix - matrix.T).max() > 1e-9 * np.abs(matrix).max():
        raise InputError(key, f"{matrix.tolist()} is not symmetric", INERTIA)
    moments = np.linalg.eigvalsh(matrix)
    shown = "principal moments " + ", ".join(f"{moment:.6g}" for moment in moments)
    if moments[0] <= 0.0:
        problem = f"{matrix.tolist()} has {shown}"
        raise InputError(key, problem, f"a positive definite inertia; {INERTIA}")
    if breaks_triangle(moments):
        accepted = "moments of which the smaller two sum to the largest or more"
        raise InputError(key, f"{shown} violate the triangle inequality", accepted)
    return frozen(matrix)
