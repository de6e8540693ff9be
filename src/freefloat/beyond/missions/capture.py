"""Capture of a client spacecraft: momentum, impulse and rates when it becomes a payload.

At contact the grapple of the client coincides with the end-effector, to which it is fixed from then
on. The impact is plastic; its impulse on both bodies is the one that makes their velocities there
equal. The linear momentum of both and their angular momentum about the common centre of mass do not
change.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.momentum import (
    CARRIED,
    conserved_inertias,
    end_effector_jacobian,
    mass_matrix,
)
from freefloat.dynamics.system import System
from freefloat.errors import InputError, finite_vector, require_type
from freefloat.robot.base import HORIZONTAL
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.parts import Mount, Payload
from freefloat.rotations import rotation_matrix
from freefloat.so3 import Array, frozen, zeros


@dataclass(frozen=True, eq=False)
class Client:
    """A rigid spacecraft that is captured.

    Attributes:
        mass: Mass of the body [kg].
        inertia: Inertia about its centre of mass, axes of its frame [kg m²]; in the forms of
            :class:`~freefloat.robot.parts.Spacecraft`.
        grapple: Pose of the end-effector's frame in the client's frame at contact.
        angular_velocity: Before contact, axes of its frame [rad/s], shape (3,).
        velocity: Velocity of its centre of mass before contact, inertial axes [m/s], shape (3,).
        com: Centre of mass in its frame [m], shape (3,).
        name: Name of its link as a payload, with a number where the robot has one of this name.

    Example:
        >>> grapple = ff.so3.Pose([0.5, 0.0, 0.0], np.eye(3))
        >>> ff.Client(mass=100.0, inertia=[20.0, 20.0, 10.0], grapple=grapple).payload.mass
        100.0
    """

    mass: float
    inertia: Array
    grapple: Mount = field(default_factory=Mount)
    angular_velocity: Array = field(default_factory=zeros)
    velocity: Array = field(default_factory=zeros)
    com: Array = field(default_factory=zeros)
    name: str = "payload"

    def __post_init__(self) -> None:
        object.__setattr__(self, "grapple", Mount.of("client.grapple", self.grapple))
        for name in ("angular_velocity", "velocity", "com"):
            values = frozen(finite_vector(f"client.{name}", getattr(self, name), 3))
            object.__setattr__(self, name, values)
        try:
            body = Payload(self.mass, self.inertia, self.com, name=self.name)  # which checks them
        except InputError as error:
            raise error.with_key(error.key.replace("payload", "client", 1)) from None
        object.__setattr__(self, "inertia", body.inertia)

    @property
    def payload(self) -> Payload:
        """The client as a payload of the end-effector."""
        grapple = self.grapple.pose
        R = grapple.rotation
        inertia, com = R.T @ self.inertia @ R, R.T @ (self.com - grapple.position)
        return Payload(self.mass, inertia, com, name=self.name)


@dataclass(frozen=True, eq=False)
class Capture:
    """The system just after a capture. All vectors are in inertial axes.

    Attributes:
        model: The robot with the client as payload.
        mismatch: End-effector twist minus the grapple's twist before contact [m/s; rad/s], (6,).
        impulse: Impulse on the end-effector, at the origin of its frame, with joints that move
            freely [N s; N m s], shape (6,); zero where the velocities match.
        joint_rates: Just after contact, joints moving freely [rad/s or m/s], shape (n,).
        base_rate: The spacecraft's angular velocity then, inertial axes [rad/s], shape (3,).
        momentum: Angular momentum about the common centre of mass, wheels included [N m s],
            shape (3,).
        velocity: Velocity of the common centre of mass [m/s], shape (3,).
        centre_of_mass: Common centre of mass, from the robot's own before [m], shape (3,).
        locked_rate: Angular velocity of the whole system once its joints are locked [rad/s], (3,).
        smallest_rate: No rotation of the locked system with this momentum is slower [rad/s].
        largest_rate: None is faster [rad/s]. Without wheels the rotations about the axes of largest
            and smallest inertia have these rates.
        wheel_momentum: Stored in wheels, spacecraft frame [N m s], shape (3,).
    """

    model: FreeFloatingModel = field(repr=False)
    mismatch: Annotated[Array, "m/s, rad/s"]
    impulse: Annotated[Array, "N s, N m s"]
    joint_rates: Annotated[Array, "rad/s or m/s"]
    base_rate: Annotated[Array, "rad/s"]
    momentum: Annotated[Array, "N m s"]
    velocity: Annotated[Array, "m/s"]
    centre_of_mass: Annotated[Array, "m"]
    locked_rate: Annotated[Array, "rad/s"]
    smallest_rate: float
    largest_rate: float
    wheel_momentum: Annotated[Array, "N m s"]

    @property
    def system(self) -> System:
        """The robot with the client, its momenta and its drift."""
        return System(self.model, self.momentum, self.wheel_momentum, self.velocity)

    def to_dict(self) -> dict[str, Any]:
        """The capture as a JSON document."""
        values = {entry.name: getattr(self, entry.name) for entry in fields(self)[1:]}
        document = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()}
        return {"mass": self.model.total_mass, **document}


def capture(
    system: System,
    client: Client,
    attitude: npt.ArrayLike,
    joints: npt.ArrayLike,
    joint_rates: npt.ArrayLike,
) -> Capture:
    """Fix a client to the end-effector.

    Args:
        system: Robot with its momenta and drift before contact.
        client: Client, its grapple at the end-effector.
        attitude: Attitude of the spacecraft, unit quaternion x, y, z, w.
        joints: Joint values, shape (n,).
        joint_rates: Before contact, shape (n,).

    Raises:
        InputError: If a vector has another shape or is not finite, the attitude on a table is no
            turn about z, or no rigid body has the client's inertia.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_2dof")
        >>> client = ff.Client(50.0, [4.0, 4.0, 4.0], angular_velocity=[0.0, 0.0, 0.1])
        >>> system = ff.System(model)
        >>> after = ff.capture(system, client, [0.0, 0.0, 0.0, 1.0], [0.3, 0.7], [0.0, 0.0])
        >>> after.momentum.round(6)
        array([0. , 0. , 0.4])
    """
    require_type("system", system, System, "System(model, momentum)")
    require_type("client", client, Client, "Client(mass, inertia, grapple)")
    system.model.require_supported("captures")
    model, h, v = system.model, system.momentum, system.drift
    a = system.attitude(attitude)
    q, rates = model.joint_vector(joints), model.joint_vector(joint_rates, "joint_rates")
    R = rotation_matrix(a)
    before = np.concatenate([system.base_twist(a, q, rates), rates])

    pose = model.end_effector_pose(a, q)
    body, axes = client.payload, pose.rotation @ client.grapple.pose.rotation.T
    omega = axes @ client.angular_velocity
    arm = pose.rotation @ body.com  # from the end-effector to the client's centre of mass
    J = end_effector_jacobian(model, q, a)
    mismatch = J @ before - np.concatenate([client.velocity - np.cross(omega, arm), omega])
    M, free = mass_matrix(model, q), np.ones(6 + model.dof, dtype=bool)
    free[CARRIED] = not model.on_table
    moving = np.ix_(free, free)
    M_inverse = np.zeros_like(M)
    M_inverse[moving] = np.linalg.inv(M[moving])
    impulse = -np.linalg.solve(
        J @ M_inverse @ J.T + _mobility(client.mass, axes @ client.inertia @ axes.T, arm), mismatch
    )
    after = before + M_inverse @ J.T @ impulse

    total = model.total_mass + client.mass
    place = pose.position + arm
    centre, common = client.mass * place / total, model.total_mass * v
    common = (common + client.mass * client.velocity) / total
    H = (
        h + model.total_mass * np.cross(-centre, v - common)
        + axes @ client.inertia @ client.angular_velocity
        + client.mass * np.cross(place - centre, client.velocity - common)
    )  # fmt: skip
    new = FreeFloatingModel.from_urdf(
        model.description.text, model.end_effector, fixed_joints=model.fixed_joints,
        payload=body, base=model.base, gravity=model.gravity,
    )  # fmt: skip
    new = replace(new, description=replace(new.description, source=model.description.source))
    D = R @ conserved_inertias(new, q)[0] @ R.T
    moments = np.linalg.eigvalsh(D)
    if model.on_table:  # which carries the rest
        H, centre, common = H * [0.0, 0.0, 1.0], centre * HORIZONTAL, common * HORIZONTAL
        moments = D[2:, 2]
    size, wheels = float(np.linalg.norm(H)), float(np.linalg.norm(system.wheels))
    locked = np.linalg.solve(D, H - R @ system.wheels)
    return Capture(
        new, frozen(mismatch), frozen(impulse), frozen(after[6:]), frozen(R @ after[3:6]),
        frozen(H), frozen(common), frozen(centre), frozen(locked),
        abs(size - wheels) / float(moments[-1]), (size + wheels) / float(moments[0]),
        system.wheels,
    )  # fmt: skip


def _mobility(mass: float, inertia: Array, arm: Array) -> Array:
    """Change of a rigid body's twist at a point per impulse there, shape (6, 6).

    Args:
        mass: Mass of the body [kg].
        inertia: Inertia about the centre of mass [kg m²], shape (3, 3).
        arm: Vector from the point to the centre of mass [m], shape (3,).
    """
    to_centre = np.eye(6)  # twist at the centre of mass from that at the point
    to_centre[:3, 3:] = -np.cross(np.eye(3), arm)
    at_centre = np.zeros((6, 6))
    at_centre[:3, :3], at_centre[3:, 3:] = mass * np.eye(3), inertia
    return np.asarray(np.linalg.inv(to_centre.T @ at_centre @ to_centre))
