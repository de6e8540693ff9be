"""Random queries: a robot at rest, with its limits and scene, and a goal."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.limits.pairs import CollisionPairs
from freefloat.so3 import Array

JOINTS = {
    "spatial_6dof/line": [0.0, 0.8, -1.2, 0.0, 0.6, 0.0],
    "ur5_servicer/arc": [0.0, -1.2, 1.4, 0.0, 1.2, 0.0],
    "ets_vii/line": [0.0, 0.5, -1.0, 0.0, 0.8, 0.0],
    "panda_servicer/line": [0.0, -0.5, 0.0, -1.8, 0.0, 2.9, 0.3],
    "ten_joints": [0.3, 0.5, -0.2, -0.6, 0.2, 0.5, -0.3, -0.6, 0.2, 0.4],
}
"""Where the arms begin [rad]."""
RATE = 0.1
"""Limit of the joint rates where the scenario has none [rad/s]."""
CLEARANCE = 0.01
"""Clearance where the scenario has none and there is a client [m]."""
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
STILL = np.zeros(3)
_SIZE, _GAP, _BESIDE = 0.3, 0.15, 0.12
"""Edge of the client, its distance from the end-effector at the start, and the largest distance of
a goal beside it; in units of the end-effector's distance from the centre of mass."""


@dataclass(frozen=True)
class Query:
    """A state at rest, limits, a scene and a goal.

    Attributes:
        system: Robot and momentum.
        joints: Joint values at the start [rad], shape (n,); the attitude is the identity.
        goal: The goal.
        end: Joint values at which the goal is reached at some attitude [rad], shape (n,).
        limits: The limits.
        scene: The client, or nothing.
        pairs: The pairs that keep the clearance; None without one.
    """

    system: ff.System
    joints: Array
    goal: ff.Goal
    end: Array
    limits: ff.Limits
    scene: ff.Scene
    pairs: CollisionPairs | None

    def beside_box(self, position: Array) -> Query:
        """The same beside a box, the client."""
        start = self.system.model.end_effector_pose(IDENTITY, self.joints).position
        edge = _SIZE * float(np.linalg.norm(start))
        scene = ff.Scene([ff.SceneBody("client", ff.Box([edge] * 3), position)])
        pairs = CollisionPairs(self.system.model, self.limits.clearance, scene=scene)
        return replace(self, scene=scene, pairs=pairs)

    def clearance(self, attitude: Array, joints: Array) -> float:
        """Smallest distance in a configuration beyond the clearance [m]."""
        if self.pairs is None:
            return np.inf
        poses, every = [body.pose for body in self.scene.bodies], np.arange(len(self.pairs.pairs))
        distances = self.pairs.distances(joints, every, attitude, poses)
        return float(distances.min()) - self.limits.clearance


def queries(
    name: str, kind: str, momentum: Array = STILL, wheels: Array = STILL
) -> Iterator[Query]:
    """Queries of a scenario or of the arm with ten joints, without end.

    Args:
        name: A key of :data:`JOINTS`.
        kind: ``attitude``: rotations by up to 60 degrees about random axes, the joints back where
            they were; ``pose`` and ``joints``: those of random configurations; ``client``: poses
            beside a box in front of the end-effector; ``narrow``: joints, with that box on the
            straight way to them.
        momentum: Angular momentum of the system [N m s], shape (3,).
        wheels: That of reaction wheels, spacecraft frame [N m s], shape (3,).
    """
    model, limits = _ten_joints() if name == "ten_joints" else _bundled(name)
    joints = np.array(JOINTS[name])
    if limits.joint_rate is None:
        limits = replace(limits, joint_rate=np.full(model.dof, RATE))
    if kind in ("client", "narrow") and limits.clearance is None:
        limits = replace(limits, clearance=CLEARANCE)
    pairs = None if limits.clearance is None else CollisionPairs(model, limits.clearance)
    system = ff.System(model, momentum, wheels)
    blank = Query(system, joints, ff.Goal(joints=joints), joints, limits, ff.Scene(), pairs)
    if kind == "client":
        place = model.end_effector_pose(IDENTITY, joints).position
        blank = blank.beside_box(place * (1.0 + _GAP + _SIZE / 2.0))
    if blank.clearance(IDENTITY, joints) < 0.0:
        raise SystemExit(f"{name}: the arm begins nearer than the clearance")
    yield from _turns(blank) if kind == "attitude" else _configurations(blank, kind)


def _bundled(name: str) -> tuple[ff.FreeFloatingModel, ff.Limits]:
    scenario = ff.load_scenario(name)
    return scenario.model(), scenario.limits()


def _turns(blank: Query) -> Iterator[Query]:
    rng = np.random.default_rng(23)
    while True:
        axis = rng.normal(size=3)
        vector = np.radians(rng.uniform(0.0, 60.0)) * axis / np.linalg.norm(axis)
        goal = ff.Goal(attitude=Rotation.from_rotvec(vector).as_quat(), joints=blank.joints)
        yield replace(blank, goal=goal)


def _configurations(blank: Query, kind: str) -> Iterator[Query]:
    model, rng = blank.system.model, np.random.default_rng(5)
    ends = np.clip(model.joint_ranges, -np.pi, np.pi)
    low, high = ends.mean(axis=0) + 0.475 * np.outer([-1.0, 1.0], np.ptp(ends, axis=0))
    while True:
        q = np.clip(blank.joints + 0.8 * rng.normal(size=model.dof), low, high)
        attitude = Rotation.from_rotvec(0.1 * rng.normal(size=3)).as_quat()
        if blank.clearance(attitude, q) < 1e-3:
            continue
        pose = model.end_effector_pose(attitude, q)
        if kind == "client" and not _beside(blank, pose.position):
            continue
        goal = ff.Goal(pose) if kind in ("pose", "client") else ff.Goal(joints=q)
        query = replace(blank, goal=goal, end=q)
        if kind == "narrow":
            query = query.beside_box(_halfway(query))
            if min(query.clearance(*ends) for ends in _ends(query)) < 1e-3:
                continue
        yield query


def _halfway(query: Query) -> Array:
    """Place of the end-effector halfway on the straight way of the joints [m], shape (3,)."""
    ways = np.linspace(query.joints, (query.joints + query.end) / 2.0, 41)
    model, attitude = query.system.model, drifted(query, ways)[-1]
    return np.array(model.end_effector_pose(attitude, ways[-1]).position)


def _ends(query: Query) -> list[tuple[Array, Array]]:
    """Attitude and joints at the start, and at the end of the straight way of the joints."""
    ways = np.linspace(query.joints, query.end, 81)
    return [(IDENTITY, query.joints), (drifted(query, ways)[-1], query.end)]


def drifted(query: Query, joints: Array) -> Array:
    """Attitudes of the drifting spacecraft while joints follow values (K, n), shape (K, 4).

    Without momentum they depend on the way of the joints alone.
    """
    steps, middles = np.diff(joints, axis=0), (joints[1:] + joints[:-1]) / 2.0
    still = ff.System(query.system.model)
    turns = still.base_rate(np.tile(IDENTITY, (len(steps), 1)), middles, steps)
    attitudes, now = [IDENTITY], Rotation.identity()
    for turn in turns:
        now = now * Rotation.from_rotvec(turn)
        attitudes.append(now.as_quat())
    return np.array(attitudes)


def _beside(query: Query, position: Array) -> bool:
    (client,) = query.scene.bodies
    start = query.system.model.end_effector_pose(IDENTITY, query.joints).position
    outside = np.abs(position - client.position) - client.shape.size / 2.0
    return float(np.linalg.norm(np.maximum(outside, 0.0))) < _BESIDE * np.linalg.norm(start)


def _ten_joints() -> tuple[ff.FreeFloatingModel, ff.Limits]:
    """An arm of ten links of 0.35 m, whose axes are z, y, y, x in turn, on a cube of 400 kg."""
    axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0"]
    text = _link("spacecraft", 400.0, 60.0, '<box size="1 1 1"/>', "0 0 0")
    for k in range(10):
        parent, height = (f"link_{k}", 0.35) if k else ("spacecraft", 0.5)
        text += f"""<joint name="q{k + 1}" type="revolute"><parent link="{parent}"/>
          <child link="link_{k + 1}"/><origin xyz="0 0 {height}"/><axis xyz="{axes[k % 4]}"/>
          <limit lower="-2.6" upper="2.6" effort="50" velocity="0.2"/></joint>"""
        rod = '<cylinder radius="0.04" length="0.25"/>'
        text += _link(f"link_{k + 1}", 4.0, 0.05, rod, "0 0 0.175")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "ten_joints.urdf"
        file.write_text(f'<robot name="ten_joints">{text}</robot>')
        model = ff.FreeFloatingModel.from_urdf(file, "link_10")
    return model, ff.Limits()


def _link(name: str, mass: float, inertia: float, shape: str, middle: str) -> str:
    values = f'ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"'
    return f"""<link name="{name}"><inertial><origin xyz="{middle}"/><mass value="{mass}"/>
      <inertia {values}/></inertial><collision><origin xyz="{middle}"/><geometry>{shape}</geometry>
      </collision></link>"""
