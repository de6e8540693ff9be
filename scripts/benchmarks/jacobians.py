"""One generalized Jacobian of six joints, by four engines."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.arm import arm_urdf
from benchmarks.plain import PlainJacobian
from benchmarks.result import Result, race
from freefloat.dynamics.generalized_jacobian import generalized_jacobian
from freefloat.robot.model import FreeFloatingModel

Jacobian = Callable[[np.ndarray], np.ndarray]


def mujoco_jacobian(urdf: str) -> Jacobian:
    """MuJoCo's mass matrix and body Jacobian, numpy's solve."""
    drift = (
        '<mujoco><compiler fusestatic="false" balanceinertia="false"/></mujoco><link name="world"/>'
        '<joint name="drift" type="floating"><parent link="world"/><child link="bus"/></joint>'
    )
    model = mujoco.MjModel.from_xml_string(
        urdf.replace('<link name="bus">', drift + '<link name="bus">', 1)
    )
    data = mujoco.MjData(model)
    last = model.nbody - 1
    H, J = np.zeros((model.nv, model.nv)), np.zeros((6, model.nv))

    def jacobian(joints: np.ndarray) -> np.ndarray:
        data.qpos[7:] = joints
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_crb(model, data)
        mujoco.mj_fullM(model, data, H)
        mujoco.mj_jac(model, data, J[:3], J[3:], data.xpos[last], last)
        return J[:, 6:] - J[:, :6] @ np.linalg.solve(H[:6, :6], H[:6, 6:])

    return jacobian


def spart_jacobian(urdf: str) -> Jacobian:
    """SPART's kinematics and inertias; it has no function for the rest, so numpy does that."""
    from SPARTpy import SPART

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "arm.urdf"
        file.write_text(urdf, encoding="utf-8")
        spart = SPART(str(file))
    body = spart.robot
    n, R0, r0 = body.n_links_joints, np.eye(3), np.zeros(3)
    M, M0 = np.zeros((n, 6, 6)), np.zeros((6, 6))
    M[:, 3:, 3:] = np.array([link.mass for link in body.links])[:, None, None] * np.eye(3)
    M0[3:, 3:] = body.base_link_mass * np.eye(3)
    moved = [(j, int(joint.q_id) - 1) for j, joint in enumerate(body.joints) if joint.q_id > 0]
    Am = np.zeros((n, 6, body.n_q))

    def jacobian(joints: np.ndarray) -> np.ndarray:
        _, RL, _, rL, e, g = spart.kinematics(R0, r0, joints)
        Bij, Bi0, P0, pm = spart.diff_kinematics(R0, r0, rL, e, g)
        M0[:3, :3], M[:, :3, :3] = spart.i_i(R0, RL)
        A0 = Bi0 @ P0
        for j, column in moved:
            Am[:, :, column] = Bij[:, j] @ pm[:, j]
        H0 = P0.T @ M0 @ P0 + np.einsum("iab,iac,icd->bd", A0, M, A0, optimize=True)
        H0m = np.einsum("iab,iac,icd->bd", A0, M, Am, optimize=True)
        S = Am[-1] - A0[-1] @ np.linalg.solve(H0, H0m)
        return S[[3, 4, 5, 0, 1, 2]]

    return jacobian


def jacobian_results(quick: bool) -> list[Result]:
    urdf = arm_urdf(6)
    model = FreeFloatingModel.from_urdf(urdf, "link_6")
    engines: dict[str, tuple[Jacobian, float | None]] = {
        "plain Pinocchio + numpy": (PlainJacobian(model), 1.5),
        "MuJoCo + numpy": (mujoco_jacobian(urdf), None),
    }
    if not quick and shutil.which("gcc"):  # it compiles itself when first used
        engines["spartpy + numpy"] = (spart_jacobian(urdf), 20.0)
    Q = np.random.default_rng(0).uniform(-2.0, 2.0, (20 if quick else 200, 6))
    for name, (jacobian, _) in engines.items():
        off = max(np.abs(jacobian(q) - generalized_jacobian(model, q)).max() for q in Q[:10])
        if off > 1e-12:
            raise SystemExit(f"{name} finds another generalized Jacobian, off by {off:.1e}")

    def all_of(jacobian: Jacobian) -> Callable[[], object]:
        return lambda: [jacobian(q) for q in Q]

    ours = all_of(partial(generalized_jacobian, model))
    theirs = [all_of(jacobian) for jacobian, _ in engines.values()]
    seconds, *baselines = (best / len(Q) for best in race(ours, *theirs, rounds=1 if quick else 40))
    return [
        Result("a generalized Jacobian, six joints", seconds, name, baseline, wanted)
        for (name, (_, wanted)), baseline in zip(engines.items(), baselines, strict=True)
    ]
