"""Gyrostats: motions with momentum stored in wheels, against robots with wheels as bodies."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import freefloat as ff
from freefloat.robot.named_files import find_robot
from freefloat.so3 import angle_between
from tests.motions import bundled
from tests.robots import inertial_text, joint_text, link_text, numbers

WHEELS = np.array([3.0, -4.0, 2.5])
NAMES = ["wheel_x", "wheel_y", "wheel_z"]
AXIAL, ACROSS, MASS = 0.05, 0.03, 5.0
"""Moments of inertia of a wheel [kg m²] and its mass [kg]."""


def urdf_with_wheels(path) -> str:
    """The robot with three wheels in its spacecraft, whose mass and inertia they are part of."""
    robot = ET.parse(path).getroot()
    for link in robot.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    inertial = robot.find("link[@name='spacecraft']/inertial")
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    mass.set("value", repr(float(mass.get("value")) - 3.0 * MASS))
    for key in ("ixx", "iyy", "izz"):
        inertia.set(key, repr(float(inertia.get(key)) - AXIAL - 2.0 * ACROSS))
    wheels = ""
    for name, axis in zip(NAMES, np.eye(3), strict=True):
        moments = np.diag(ACROSS + (AXIAL - ACROSS) * axis)
        wheels += joint_text(name, "C", "spacecraft", f"{name}_link", axis=numbers(axis))
        wheels += link_text(f"{name}_link", inertial_text(MASS, moments))
    robot.extend(ET.fromstring(f"<wheels>{wheels}</wheels>"))
    return ET.tostring(robot, encoding="unicode")


@pytest.mark.slow
def test_mujoco_with_wheels_as_bodies_ends_there() -> None:
    """Servos turn the wheels at constant rates and lead the arm along the recorded joints."""
    problem = bundled("ets_vii/inspect").replace(wheel_momentum=WHEELS)
    motion = ff.simulate(problem, [-0.01384, 0.0009, -0.0037, 0.9999]).chosen.motion
    spec = mujoco.MjSpec.from_string(urdf_with_wheels(find_robot("ets_vii", Path())))
    spec.compiler.fusestatic = False
    spec.worldbody.first_body().add_freejoint()
    model = spec.compile()
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_RK4)
    data = mujoco.MjData(model)
    names = [*problem.model.joint_names, *NAMES]
    places = [int(model.joint(name).qposadr[0]) for name in names]
    rates = [int(model.joint(name).dofadr[0]) for name in names]
    times = np.linspace(0.0, problem.path.duration, 4001)
    arm = CubicSpline(times, motion.evaluate(motion.coordinates_at(times))[2])

    def wanted(t: float, order: int) -> np.ndarray:
        wheels = (WHEELS / AXIAL * t, WHEELS / AXIAL, np.zeros(3))[order]
        return np.concatenate([arm(t, order), wheels])

    state = motion.initial
    data.qpos[:3], data.qpos[3:7] = state.base_position, np.roll(state.attitude, 1)
    data.qpos[places] = wanted(0.0, 0)
    data.qvel[rates] = wanted(0.0, 1)
    mujoco.mj_forward(model, data)
    momentum = _solve_base(model, data, problem.momentum)
    data.qvel[:6] = momentum
    steps = 8000
    h = model.opt.timestep = problem.path.duration / steps
    M = np.zeros((model.nv, model.nv))
    for step in range(steps):
        t = (step + 0.5) * h
        mujoco.mj_forward(model, data)
        for row, unit in zip(M, np.eye(model.nv), strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        error = wanted(step * h, 0) - data.qpos[places]
        slip = wanted(step * h, 1) - data.qvel[rates]
        a = wanted(t, 2) + 0.2 / h * slip + 0.01 / h**2 * error
        coupled = M[:6][:, rates] @ a + data.qfrc_bias[:6]
        base = -np.linalg.solve(M[:6, :6], coupled)
        torques = M[rates][:, :6] @ base + M[np.ix_(rates, rates)] @ a + data.qfrc_bias[rates]
        data.qfrc_applied[rates] = torques
        mujoco.mj_step(model, data)
    end = np.roll(data.qpos[3:7], -1)
    assert angle_between(end, motion.final.attitude) < 1e-5


def _solve_base(model, data, momentum: np.ndarray) -> np.ndarray:
    """Base velocity with which the system has a momentum, by MuJoCo's own sums."""
    root = model.body("spacecraft").id

    def momenta(base: np.ndarray) -> np.ndarray:
        data.qvel[:6] = base
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        return np.concatenate([data.subtree_linvel[root], data.subtree_angmom[root]])

    offset = momenta(np.zeros(6))
    columns = np.column_stack([momenta(unit) - offset for unit in np.eye(6)])
    return np.linalg.solve(columns, np.concatenate([np.zeros(3), momentum]) - offset)


@pytest.mark.slow
def test_in_the_plane_wheels_take_their_part_of_the_momentum() -> None:
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    momenta = replace(problem, momentum=np.array([0.0, 0.0, 2.0]))
    wheels = replace(momenta, momentum=np.array([0, 0, 3.5]), wheel_momentum=np.array([0, 0, 1.5]))
    plans = [ff.plan(entry) for entry in (momenta, wheels)]
    for first, second in zip(plans[0].ranges, plans[1].ranges, strict=True):
        np.testing.assert_allclose(first.limits, second.limits, atol=1e-9)
    wheels = replace(wheels, wheel_momentum=np.array([0.0, 0.0, 3.5]))
    still = replace(problem, momentum=np.zeros(3))
    motions = [ff.simulate(entry, heading=2.5, branch=1).chosen.motion for entry in (still, wheels)]
    np.testing.assert_allclose(*(motion.final.joints for motion in motions), atol=1e-9)
