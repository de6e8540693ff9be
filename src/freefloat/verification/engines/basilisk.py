"""A motion repeated with Basilisk: its MuJoCo scene, with joint servos and a free base.

Basilisk reads the robot as an MJCF model, counts time in whole nanoseconds and has attitudes as
modified Rodrigues parameters.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from freefloat.dynamics.momentum import mass_matrix
from freefloat.errors import InputError, one_line, require_extra
from freefloat.motion.motion import Motion, State
from freefloat.robot.mjcf_writer import robot_mjcf, why_refused
from freefloat.so3 import Array
from freefloat.verification.engines.forward import STIFFNESS, ForwardRun, Reference, base_velocity
from freefloat.verification.gravity import CircularOrbit

_NANO = 1e-9
"""A nanosecond [s]."""
_EVALUATIONS = 4
"""Evaluations of the dynamics in a step, which may therefore be longer than a reference's."""


def require_basilisk(motion: Motion) -> None:
    """Check that Basilisk is installed, and has a model of a motion's robot.

    Raises:
        InputError: If it is not, or the robot has wheels with momentum or an inertia that MuJoCo
            refuses.
    """
    require_extra("basilisk", "Basilisk")
    if motion.problem.wheel_momentum.any():
        accepted = "for basilisk a spacecraft whose wheels store no momentum"
        raise InputError("engine", "wheels store momentum", accepted)
    refused = why_refused(motion.problem.model)
    if refused is not None:
        accepted = "for basilisk other names, and inertias that bodies of matter have"
        raise InputError("engine", refused, accepted)


def forward_run(motion: Motion, *, steps: int | None = None) -> ForwardRun:
    """Simulate a free base with joint servos that follow the recorded joints.

    Args:
        motion: The recorded motion.
        steps: Number of steps; by default it follows from the length of the motion.
    """
    reference = Reference.of(motion, steps)
    return ForwardRun.of(motion, final_state(motion, reference), reference.steps)


def final_state(motion: Motion, reference: Reference, orbit: CircularOrbit | None = None) -> State:
    """The state at the end of such a simulation, with gravity gradient if an orbit is given.

    The servos are computed-torque controllers with Pinocchio's mass matrix.

    Raises:
        InputError: See :func:`require_basilisk`.
    """
    require_basilisk(motion)
    from Basilisk.architecture.bskLogging import BasiliskError
    from Basilisk.simulation import mujoco
    from Basilisk.utilities import SimulationBaseClass

    steps = -(-reference.steps // _EVALUATIONS)
    step = round((reference.last - reference.first) / steps / _NANO)
    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("dynamics")
    process.addTask(simulation.CreateNewTask("dynamics", step))
    root = robot_mjcf(motion.problem.model, shapes=False)
    try:
        scene = mujoco.MJScene(ET.tostring(root, encoding="unicode"))
    except BasiliskError as error:
        problem = f"basilisk rejects the robot ({one_line(str(error))})"
        raise InputError("engine", problem, "another") from None
    simulation.AddModelToTask("dynamics", scene)
    scene.AddFwdKinematicsToDynamicsTask(scene.FWD_KINEMATICS_PRIORITY)
    robot = _Robot(scene, motion)
    modules = [_module(_Servos(robot, reference).update)]
    if orbit is not None:
        modules.append(_module(_GravityGradient(robot, reference.first, orbit).update))
    for module in modules:
        scene.AddModelToDynamicsTask(module)
    simulation.InitializeSimulation()
    robot.place(reference)
    simulation.ConfigureStopTime(step * steps)
    simulation.ExecuteSimulation()
    return robot.state(reference.last)


def _module(update: Callable[[float], None]) -> Any:
    """A module of Basilisk that calls a function with the time [s] at every evaluation."""
    from Basilisk.architecture import sysModel

    class Module(sysModel.SysModel):  # type: ignore[misc]
        def UpdateState(self, nanoseconds: int) -> None:
            update(_NANO * nanoseconds)

    return Module()


class _Robot:
    """The bodies and joints of a scene."""

    def __init__(self, scene: Any, motion: Motion) -> None:
        self.scene, self.motion, self.model = scene, motion, motion.problem.model
        names = self.model.body_names
        self.bodies = [scene.getBody(name) for name in names]
        self._joints = [
            body.getScalarJoint(name)
            for body, name in zip(self.bodies[1:], self.model.joint_names, strict=True)
        ]
        self._readers = [
            (joint.stateOutMsg.addSubscriber(), joint.stateDotOutMsg.addSubscriber())
            for joint in self._joints
        ]

    def place(self, reference: Reference) -> None:
        """Set the state at the beginning of the reference, in the frame of the path."""
        problem, t = self.motion.problem, reference.first
        (state,), base = self.motion.sample(t), self.bodies[0]
        rates = reference(t, 1)
        velocity = base_velocity(problem.system, state, rates)
        base.setPosition(state.base_position + t * problem.path.drift)
        base.setVelocity(velocity[:3])
        base.setAttitude(Rotation.from_quat(state.attitude).as_mrp())
        base.setAttitudeRate(velocity[3:])
        for joint, value, rate in zip(self._joints, state.joints, rates, strict=True):
            joint.setPosition(value)
            joint.setVelocity(rate)

    def joints(self) -> tuple[Array, Array]:
        """Joints and their rates, shape (n,) each."""
        values = [(state().state, rate().state) for state, rate in self._readers]
        return np.array(values)[:, 0], np.array(values)[:, 1]

    def state(self, t: float) -> State:
        """The state at the end of the simulation, its time [s] given."""
        origin = self.bodies[0].getOrigin().stateOutMsg.read()
        position = np.array(origin.r_BN_N) - t * self.motion.problem.path.drift
        joints = np.array([joint.stateOutMsg.read().state for joint in self._joints])
        return State(t, Rotation.from_mrp(origin.sigma_BN).as_quat(), joints, position)


class _Servos:
    """Torques of the joints, from the deviation of joints and rates."""

    def __init__(self, robot: _Robot, reference: Reference) -> None:
        from Basilisk.architecture import messaging

        self._robot, self._reference = robot, reference
        self._payload = messaging.SingleActuatorMsgPayload
        self._outputs = [messaging.SingleActuatorMsg() for _ in robot.model.joint_names]
        for name, output in zip(robot.model.joint_names, self._outputs, strict=True):
            robot.scene.getSingleActuator(name).actuatorInMsg.subscribeTo(output)

    def update(self, elapsed: float) -> None:
        reference, t = self._reference, self._reference.first + elapsed
        stiff, damp = (STIFFNESS / reference.step) ** 2, 2.0 * STIFFNESS / reference.step
        joints, rates = self._robot.joints()
        errors = stiff * (reference(t) - joints) + damp * (reference(t, 1) - rates)
        M = mass_matrix(self._robot.model, joints)
        H = M[6:, 6:] - M[6:, :6] @ np.linalg.solve(M[:6, :6], M[:6, 6:])
        for output, torque in zip(self._outputs, H @ (reference(t, 2) + errors), strict=True):
            output.write(self._payload(input=float(torque)), round(elapsed / _NANO))


class _GravityGradient:
    """Forces and torques on all bodies at their centres of mass."""

    def __init__(self, robot: _Robot, first: float, orbit: CircularOrbit) -> None:
        from Basilisk.architecture import messaging

        self._first, self._orbit = first, orbit
        bodies = robot.model.bodies
        self._masses = np.array([body.mass for body in bodies])
        self._inertias = np.array([body.inertia for body in bodies])
        self._messages = messaging
        self._readers, self._outputs = [], []
        for body in robot.bodies:
            site = body.getCenterOfMass()
            name = f"gravity_gradient_{body.getName()}"
            actuator = robot.scene.addForceTorqueActuator(name, site)
            outputs = messaging.ForceAtSiteMsg(), messaging.TorqueAtSiteMsg()
            actuator.forceInMsg.subscribeTo(outputs[0])
            actuator.torqueInMsg.subscribeTo(outputs[1])
            self._outputs.append(outputs)
            self._readers.append(
                (site.stateOutMsg.addSubscriber(), body.getOrigin().stateOutMsg.addSubscriber())
            )

    def update(self, elapsed: float) -> None:
        t, nanoseconds = self._first + elapsed, round(elapsed / _NANO)
        centres = np.array([site().r_BN_N for site, _ in self._readers])
        sites, axes = (
            Rotation.from_mrp([pair[k]().sigma_BN for pair in self._readers]).as_matrix()
            for k in (0, 1)
        )
        inertias = axes @ self._inertias @ axes.swapaxes(1, 2)
        forces = self._orbit.forces(t, self._masses, centres)
        torques = self._orbit.torque(t, inertias)
        for outputs, R, *wrench in zip(self._outputs, sites, forces, torques, strict=True):
            force, torque = ((R.T @ vector).tolist() for vector in wrench)
            payloads = self._messages
            outputs[0].write(payloads.ForceAtSiteMsgPayload(force_S=force), nanoseconds)
            outputs[1].write(payloads.TorqueAtSiteMsgPayload(torque_S=torque), nanoseconds)
