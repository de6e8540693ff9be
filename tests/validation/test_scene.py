"""Bodies beside the robot: tumbling by elliptic functions, distances in closed form, by MuJoCo."""

from itertools import pairwise

import coal
import mujoco
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation
from scipy.special import ellipj

import freefloat as ff
from freefloat.limits.pairs import CollisionPairs
from freefloat.robot.shapes import MeshFile
from freefloat.robot.source import find_mesh
from freefloat.so3 import Pose
from tests.prismatic import shape_text
from tests.robots import random_robot
from tests.validation.comparisons import assert_agrees

TURNS = 10.0
RADIUS = 0.1
"""Of a ball on the end-effector [m]."""


def to_z(direction):
    """The shortest rotation of a unit vector onto z, shape (3, 3)."""
    x, y, z = direction
    return Rotation.from_quat([y, -x, 0.0, 1.0 + z]).as_matrix()


class Elliptic:
    """Jacobi's solution: moments A < B < C, no rate about the middle axis at time zero.

    The attitude is the shortest rotation of the angular momentum's direction u onto z after the
    rotation about z by an angle, of rate (omega . (u + z)) / (1 + u_z).
    """

    def __init__(self, moments, p, r):
        A, B, C = self.moments = np.array(moments)
        self.rate = np.array([p, 0.0, r])
        self.twice_energy = A * p**2 + C * r**2
        self.momentum = float(np.hypot(A * p, C * r))
        across, along = (
            self.twice_energy * C - self.momentum**2,
            self.momentum**2 - A * self.twice_energy,
        )
        assert along > across * (B - A) / (C - B)  # it circles about the axis of C
        self.speed = np.sqrt((C - B) * along / (A * B * C))
        self.parameter = (B - A) * across / ((C - B) * along)
        self.sizes = np.sqrt(
            [across / (A * (C - A)), across / (B * (C - B)), along / (C * (C - A))]
        )

    def rates(self, t):
        sn, cn, dn, _ = ellipj(self.speed * t, self.parameter)
        return self.sizes * [cn, sn, dn]

    def precession(self, t):
        r = self.rates(t)[2]
        return (self.twice_energy / self.momentum + r) / (1.0 + self.moments[2] * r / self.momentum)

    def rotation(self, t):
        steps = np.linspace(0.0, t, 2 + int(t / 2.0))
        angle = sum(
            quad(self.precession, low, high, epsabs=1e-13, epsrel=1e-13)[0]
            for low, high in pairwise(steps)
        )
        turn = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix()
        first, last = (to_z(self.moments * self.rates(u) / self.momentum) for u in (0.0, t))
        return first.T @ turn @ last


@pytest.mark.parametrize(("moments", "p", "r"), [
    ((40.0, 70.0, 90.0), 0.05, 0.1),
    ((40.0, 70.0, 90.0), 0.0979, 0.08),  # near the unstable rotation
    ((1.0, 1.5, 2.2), -0.7, 0.9),
    ((5.0, 5.1, 9.0), 2.0, 1.9),
])  # fmt: skip
def test_ten_revolutions_are_those_of_jacobi(moments, p, r):
    exact = Elliptic(moments, abs(p), r)
    sign = np.diag([np.sign(p), np.sign(p), 1.0])  # a half-turn about z of the whole motion
    tumbling = ff.Tumbling(np.array(moments), [p, 0.0, r])
    revolution = 2.0 * np.pi / np.linalg.norm(exact.rate)
    for t in TURNS * revolution * np.array([0.013, 0.21, 0.5, 0.77, 1.0]):
        expected = sign @ exact.rotation(t) @ sign
        deviation = np.abs(tumbling.rotation(t) - expected).max()
        assert_agrees("test_ten_revolutions_are_those_of_jacobi", deviation)


@pytest.mark.parametrize("seed", range(5))
def test_distances_from_a_ball_are_exact(seed):
    """From a ball on the end-effector, whatever the attitude, to a ball and the faces, edges and
    corners of a box."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, "RPRCRR")
    last = robot.text.rindex("</link>")
    text = robot.text[:last] + shape_text(f'<sphere radius="{RADIUS}"/>') + robot.text[last:]
    size, radius = rng.uniform(0.1, 1.0, 3), 0.3
    scene = ff.Scene([ff.SceneBody("box", ff.Box(size)), ff.SceneBody("ball", ff.Sphere(radius))])
    model = ff.FreeFloatingModel.from_urdf(text, robot.end_effector)
    pairs = CollisionPairs(model, scene=scene)
    for _ in range(100):
        attitude, joints = Rotation.random(rng=rng).as_quat(), rng.uniform(-2.0, 2.0, model.dof)
        hand = model.end_effector_pose(attitude, joints).position
        poses = [
            Pose(hand + rng.normal(size=3), Rotation.random(rng=rng).as_matrix()) for _ in range(2)
        ]
        local = np.abs(poses[0].rotation.T @ (hand - poses[0].position)) - size / 2.0
        expected = [np.linalg.norm(np.maximum(local, 0.0)) + min(local.max(), 0.0),
                    np.linalg.norm(hand - poses[1].position) - radius]  # fmt: skip
        distances = pairs.distances(joints, np.array([0, 1]), attitude, poses)
        deviation = np.abs(distances - (np.array(expected) - RADIUS)).max()
        assert_agrees("test_distances_from_a_ball_are_exact", deviation)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5_servicer/arc", "panda_servicer/line"])
def test_distances_of_meshes_are_those_of_mujoco(name, rng):
    """Convex parts of the arm's meshes, and a box, a cylinder and a mesh in the scene."""
    model = ff.load_scenario(name).model()
    link = next(shape for link in model.description.links for shape in link.collisions
                if isinstance(shape.geometry, MeshFile))  # fmt: skip
    mesh = find_mesh(link.geometry.filename, model.description.source)
    scene = ff.Scene([
        ff.SceneBody("box", ff.Box([0.6, 0.5, 0.9])),
        ff.SceneBody("mast", ff.Cylinder(0.05, 1.0)),
        ff.SceneBody("part", str(mesh)),
    ])  # fmt: skip
    pairs = CollisionPairs(model, scene=scene)
    shapes, others = pairs.shapes, np.flatnonzero(pairs.bodies[:, 1] > model.dof)
    for _ in range(3):
        attitude, joints = Rotation.random(rng=rng).as_quat(), rng.uniform(-2.0, 2.0, model.dof)
        poses = [
            Pose(rng.uniform(-1.5, 1.5, 3), Rotation.random(rng=rng).as_matrix())
            for _ in scene.bodies
        ]
        distances = pairs.distances(joints, others, attitude, poses)
        expected = mujoco_distances(
            shapes, [*model.body_poses(attitude, joints), *poses], pairs.pairs[others]
        )
        apart = expected > 0.0
        assert apart.sum() > len(apart) / 2
        deviation = np.abs(distances - expected)[apart].max()
        assert_agrees("test_distances_of_meshes_are_those_of_mujoco", deviation)


def mujoco_distances(shapes, poses, pairs):
    """Distances of pairs of shapes on bodies with these frames."""
    spec = mujoco.MjSpec()
    for number, shape in enumerate(shapes):
        at = poses[shape.body] @ shape.placement
        geom = spec.worldbody.add_geom(name=f"{number}", pos=at.position)
        geom.quat = at.quaternion[[3, 0, 1, 2]]
        if isinstance(shape.geometry, coal.Box):
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_BOX, shape.geometry.halfSide
        elif isinstance(shape.geometry, coal.Sphere):
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, [shape.geometry.radius, 0, 0]
        elif isinstance(shape.geometry, coal.Cylinder):
            geom.type = mujoco.mjtGeom.mjGEOM_CYLINDER
            geom.size = [shape.geometry.radius, shape.geometry.halfLength, 0.0]
        else:
            vertices = poses[shape.body].position + shape.points @ poses[shape.body].rotation.T
            mesh = spec.add_mesh(name=f"mesh {number}")
            mesh.uservert = vertices.ravel()
            geom.type, geom.meshname = mujoco.mjtGeom.mjGEOM_MESH, mesh.name
            geom.pos, geom.quat = np.zeros(3), [1.0, 0.0, 0.0, 0.0]
    spec.option.ccd_tolerance, spec.option.ccd_iterations = 1e-9, 200
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return np.array([
        mujoco.mj_geomDistance(model, data, int(i), int(j), 100.0, None) for i, j in pairs
    ])  # fmt: skip
