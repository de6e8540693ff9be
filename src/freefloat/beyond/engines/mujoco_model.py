"""MuJoCo as a second engine: its URDF reader, kinematics and dynamics.

Poses and axes of joints come from MuJoCo's own URDF reader. Inertias come from the model's rigid
bodies, because the reader refuses links of some robots: links that violate the triangle inequality,
and tiny ones, even if they are fixed to large ones.
MuJoCo's free joint has its linear velocity in inertial axes, its angular velocity in body axes, and
its quaternion in the order w, x, y, z. On a table two slides and a hinge take its place.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from freefloat.dynamics.system import System
from freefloat.errors import InputError, require_extra
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.rigid_bodies import held_value
from freefloat.robot.urdf_xml import text_of
from freefloat.rotations import Rotation
from freefloat.so3 import Array, heading_quaternion

_TABLE = {"along x": [1, 0, 0], "along y": [0, 1, 0], "about z": [0, 0, 1]}
"""Joints of a base on a table, two slides and a hinge, with their axes."""
_ON_TABLE = [0, 1, 5]
"""Components of its velocity."""
_LIGHTEST = 1e-9
"""Mass and inertia of links in the reader [kg, kg m²], until theirs are set."""


class MuJoCoModel:
    """A robot in MuJoCo: free or planar base, no contacts, no joint limits.

    Wheels with a momentum h_w exert the torque -omega x h_w on the spacecraft.

    Raises:
        InputError: If MuJoCo is not installed, or refuses the robot.
    """

    def __init__(self, system: System) -> None:
        require_extra("mujoco", "mujoco")
        import mujoco

        mujoco.set_mju_user_warning(lambda _: None)  # it would write a log in the working folder
        model, self.system, self._mujoco = system.model, system, mujoco
        try:
            spec = mujoco.MjSpec.from_string(kinematic_urdf(model))
            spec.compiler.fusestatic = False
            spec.compiler.boundmass = spec.compiler.boundinertia = _LIGHTEST
            root = spec.worldbody.first_body()
            if model.on_table:
                slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
                for (name, axis), kind in zip(_TABLE.items(), (slide, slide, hinge), strict=True):
                    root.add_joint(name=f"{root.name} {name}", axis=axis, type=kind)
            else:
                root.add_freejoint()
            self.model = spec.compile()
        except (ValueError, RuntimeError) as error:
            problem = str(error).splitlines()[0] if str(error) else type(error).__name__
            accepted = "a robot that mujoco accepts, or another engine"
            raise InputError("engine", f"mujoco rejects the robot ({problem})", accepted) from None
        self.model.opt.gravity[:] = 0.0, 0.0, -model.gravity
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        self.data = mujoco.MjData(self.model)
        self.velocity_stage = int(mujoco.mjtStage.mjSTAGE_VEL)  # poses, mass matrix, bias forces
        self.root = self.model.body(root.name).id
        joints = (self.model.joint(name) for name in model.joint_names)
        self._moving = [self.root, *(int(joint.bodyid[0]) for joint in joints)]
        self._set_inertias(model)
        self.tools = [self.model.body(link).id for link in model.end_effector_links]

    def _set_inertias(self, model: FreeFloatingModel) -> None:
        """Set the inertias of the moving bodies and rotors, and zero for all others."""
        target, moving = self.model, self._moving
        target.body_sameframe[:], target.body_simple[:] = 0, 0  # frames are shifted below
        target.body_mass[:], target.body_inertia[:] = 0.0, 0.0
        for index, body in zip(moving, model.bodies, strict=True):
            moments, axes = np.linalg.eigh(body.inertia)
            axes[:, 0] *= np.linalg.det(axes)
            target.body_mass[index] = body.mass
            target.body_inertia[index] = moments
            target.body_ipos[index] = body.centre
            target.body_iquat[index] = wxyz(Rotation.from_matrix(axes).as_quat())
        target.dof_armature[self.base_rates :] = [body.armature for body in model.bodies[1:]]
        self._mujoco.mj_setConst(target, self.data)

    @property
    def base_rates(self) -> int:
        """Number of velocities of the base, the first of all."""
        return len(_ON_TABLE) if self.system.model.on_table else 6

    def place(self, value: Array, rate: Array, acceleration: Array) -> None:
        """Set [position, quaternion x y z w, joints] and its first two time derivatives."""
        a, data = value[3:7], self.data
        self.set_positions(value[:3], a, value[7:])
        for place, row in ((data.qvel, rate), (data.qacc, acceleration)):
            self.set_rates(place, np.concatenate([row[:3], _angular(a, row[3:7])]), row[7:])

    def set_positions(self, position: Array, attitude: Array, joints: Array) -> None:
        """Set position and attitude, a quaternion x, y, z, w, of the base, and the joints."""
        base = [*position, *wxyz(attitude)]
        if self.system.model.on_table:
            base = [*position[:2], 2.0 * np.arctan2(attitude[2], attitude[3])]
        self.data.qpos[:] = [*base, *joints]

    def set_rates(self, place: Array, base: Array, joints: Array) -> None:
        """Write the velocity of the base, shape (6,), or its derivative, and joint rates."""
        place[:] = [*(base[_ON_TABLE] if self.system.model.on_table else base), *joints]

    @property
    def base_position(self) -> Array:
        """Position of the base [m], shape (3,)."""
        height = 0.0 if self.system.model.on_table else self.data.qpos[2]
        return np.array([*self.data.qpos[:2], height])

    @property
    def attitude(self) -> Array:
        """Attitude of the base, unit quaternion x, y, z, w."""
        if self.system.model.on_table:
            return heading_quaternion(self.data.qpos[2])
        return np.roll(self.data.qpos[3:7], -1)

    def inverse(self, value: Array, rate: Array, acceleration: Array) -> tuple[Array, Array]:
        """Inverse dynamics at a state, see :meth:`place`: base wrench (6,), joint torques (n,)."""
        self.place(value, rate, acceleration)
        with self._wheels():
            self._mujoco.mj_inverse(self.model, self.data)
        base, torques = np.split(self.data.qfrc_inverse, [self.base_rates])
        wrench = np.zeros(6)
        wrench[_ON_TABLE if self.system.model.on_table else slice(6)] = base
        return wrench, torques.copy()

    def angular_momentum(self) -> Array:
        """Angular momentum about the centre of mass at the present state [N m s].

        On a table only the component about z, which is conserved.
        """
        self._mujoco.mj_forward(self.model, self.data)
        self._mujoco.mj_subtreeVel(self.model, self.data)
        axes = self.data.xmat[self.root].reshape(3, 3)
        momentum = np.asarray(self.data.subtree_angmom[self.root] + axes @ self.system.wheels)
        return momentum * [0.0, 0.0, 1.0] if self.system.model.on_table else momentum

    def end_effector_positions(self) -> Array:
        """Positions of all end-effectors that follow paths, inertial frame [m], shape (E, 3)."""
        self._mujoco.mj_kinematics(self.model, self.data)
        return np.array(self.data.xpos[self.tools])

    def inertia(self) -> tuple[Array, Array]:
        """Mass matrix (b + n, b + n) and bias forces (b + n,) of base and joints, b base rates.

        The bias includes the torque of wheels.
        """
        with self._wheels():
            self._mujoco.mj_forward(self.model, self.data)
        M = np.zeros((self.model.nv, self.model.nv))
        for row, unit in zip(M, np.eye(len(M)), strict=True):  # its name differs between versions
            self._mujoco.mj_mulM(self.model, self.data, row, unit)
        return M, self.data.qfrc_bias - self.data.qfrc_passive

    def step(self, torques: Array) -> None:
        """Integrate one time step with constant joint torques (n,) and a free base."""
        self.data.qfrc_applied[:] = [*np.zeros(self.base_rates), *torques]
        with self._wheels():
            self._mujoco.mj_step(self.model, self.data)

    def set_friction(self, friction: float) -> None:
        """Set the dry friction of every joint [N m or N], which :meth:`step` considers."""
        bits = self._mujoco.mjtDisableBit
        self.model.dof_frictionloss[6:] = friction
        if friction:  # MuJoCo's constraints of friction, but not of contacts and ranges
            self.model.opt.disableflags &= ~int(bits.mjDSBL_CONSTRAINT)
            self.model.opt.disableflags |= int(bits.mjDSBL_CONTACT) | int(bits.mjDSBL_LIMIT)

    def batch(self, factors: Array) -> Any:
        """Robots with other masses, simulated side by side, without torques of wheels.

        Factors (K, 1 + n) are on mass and inertia of every moving body.
        """
        require_extra("mujoco", "mujoco.batch")  # which earlier versions lack
        from mujoco.batch import Batch

        batch = Batch(self.model, len(factors), 1)
        batch.expand("body_mass")[:, self._moving] *= factors
        batch.expand("body_inertia")[:, self._moving] *= factors[..., None]
        batch.set_const()
        return batch

    def friction_law(self, batch: Any) -> tuple[Array, float]:
        """MuJoCo's regularization of dry friction.

        Below its limit, the friction of a joint is minus an inertia times the sum of the
        acceleration and a constant times the rate. Returned are these inertias of the robots of a
        :meth:`batch`, shape (K, n), and the constant [1/s].
        """
        impedance, width = self.model.dof_solimp[6, :2]
        time, _ = self.model.dof_solref[6]
        inertia = impedance / (1.0 - impedance) / batch.expand("dof_invweight0")[:, 6:]
        return inertia, 2.0 / (width * time)

    @contextmanager
    def _wheels(self) -> Iterator[None]:
        """Context in which MuJoCo adds the torque of wheels to its passive forces."""
        if self.system.model.on_table or not self.system.wheels.any():  # which turn about z
            yield
            return

        def torque(_: Any, data: Any) -> None:
            data.qfrc_passive[3:6] -= np.cross(data.qvel[3:6], self.system.wheels)

        self._mujoco.set_mjcb_passive(torque)
        try:
            yield
        finally:
            self._mujoco.set_mjcb_passive(None)

    def rest(self, seconds: float) -> None:
        """Prepare steps of a length [s] with the Runge-Kutta integrator, from time 0."""
        self.data.time = 0.0
        self.model.opt.timestep = seconds
        self.model.opt.integrator = int(self._mujoco.mjtIntegrator.mjINT_RK4)


def wxyz(quaternion: Array) -> Array:
    """A quaternion x, y, z, w in MuJoCo's order."""
    return np.asarray(np.roll(quaternion, 1))


def _angular(a: Array, change: Array) -> Array:
    """Vector part of 2 conj(a) a' or 2 conj(a) a'': body-frame angular rate or acceleration."""
    vector = a[3] * change[:3] - change[3] * a[:3] - np.cross(a[:3], change[:3])
    return np.asarray(2.0 * vector)


def kinematic_urdf(model: FreeFloatingModel) -> str:
    """The URDF without inertias, shapes, friction, mimics; joints that do not move are fixed.

    MuJoCo takes a link called world for the ground.
    """
    robot = ET.fromstring(model.description.text)
    for element in robot.iter():
        for key in ("name", "link"):
            if element.get(key) == "world":
                element.set(key, "not_the_ground")
    for link in robot.findall("link"):
        for content in list(link):
            link.remove(content)
    for joint in robot.findall("joint"):
        for content in (*joint.findall("dynamics"), *joint.findall("mimic")):
            joint.remove(content)
        if joint.get("name") not in model.joint_names:
            _fix(joint, held_value(model.description, joint.get("name", ""), model.fixed_joints))
    _order(robot, model)
    return ET.tostring(robot, encoding="unicode")


def _order(robot: ET.Element, model: FreeFloatingModel) -> None:
    """Put the joints into the order of the moving joints to which they lead.

    MuJoCo numbers joints depth first; so the joints of one arm follow the joints of another.
    """
    first: dict[str, int] = {}
    for number, joint in reversed([*enumerate(model.moving_joints)]):
        link = joint.child
        while link in model.description.parent_joints:
            carrier = model.description.parent_joints[link]
            first[carrier.name], link = number, carrier.parent
    elements = robot.findall("joint")
    for element in elements:
        robot.remove(element)
    robot.extend(sorted(elements, key=lambda entry: first.get(entry.get("name", ""), model.dof)))


def _fix(joint: ET.Element, value: float) -> None:
    """Fix a joint at a value [rad or m]."""
    prismatic = joint.get("type") == "prismatic"
    joint.set("type", "fixed")
    if value == 0.0:
        return
    element, origin = joint.find("axis"), joint.find("origin")
    text = "1 0 0" if element is None else element.get("xyz", "1 0 0")
    axis = np.array(text.split(), dtype=float)
    axis *= value / np.linalg.norm(axis)
    if origin is None:
        origin = ET.SubElement(joint, "origin")
    xyz = np.array(origin.get("xyz", "0 0 0").split(), dtype=float)
    rotation = Rotation.from_rpy(list(map(float, origin.get("rpy", "0 0 0").split())))
    if prismatic:
        xyz += rotation.apply(axis)
    else:
        rotation *= Rotation.from_rotvec(axis)
    origin.set("xyz", text_of(xyz))
    origin.set("rpy", text_of(rotation.as_rpy()))
