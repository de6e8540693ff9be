"""Distances along a motion: no contact hides, every shape counts, meshes in convex parts."""

import re
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull, Delaunay

import freefloat as ff
from freefloat.errors import ModelError
from freefloat.limits.clearance import clearance, joint_levers
from freefloat.limits.collision_shapes import (
    all_shapes,
    convex_parts,
    shapes_of_bodies,
    shapes_of_links,
)
from freefloat.limits.pairs import CollisionPairs
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.validation import read_urdf
from freefloat.scene.scene import Scene
from freefloat.scene.scene_body import SceneBody
from tests.errors import error_key
from tests.prismatic import RELATIVE, prismatic_motion, prismatic_robot, shape_text
from tests.robots import joint_text, link_text, random_robot

assert_close = partial(np.testing.assert_allclose, rtol=0)
BOX = '<box size="1 1 1"/>'
CUBE, BALL = shape_text(BOX), shape_text('<sphere radius="0.1"/>')


def mast(x, z, size=0.02, kind="F"):
    """A small box on the spacecraft, reached by a joint."""
    joint = joint_text("mast_joint", kind, "bus", "mast", f"{x} 0 {z}")
    shape = shape_text(f'<box size="{size} {size} {size}"/>')
    return joint + f'<link name="mast">{shape}</link>'


def prismatic(bus=CUBE, hand=BALL, more=""):
    return prismatic_motion(prismatic_robot(bus, hand, more))


@pytest.mark.parametrize("fraction", [0.123, 0.5, 0.8317])
def test_the_distance_of_a_passing_end_effector_is_exact(fraction):
    """The end-effector passes under a mast on its way, between the nodes of the motion."""
    motion = prismatic(more=mast(1.0 + fraction * RELATIVE, 0.5))
    pairs = CollisionPairs(motion.problem.model)
    nearest = clearance(motion, pairs)
    assert pairs.name(nearest.pair) == "mast - hand"
    by_time = motion.problem.path.timing.s(nearest.time)
    assert_close(nearest.distance, 0.5 - 0.01 - 0.1, atol=1e-8)
    assert_close(by_time, fraction, atol=0.0101 / RELATIVE)


def test_a_contact_thinner_than_any_sampling_is_found():
    """The end-effector, a ball of 1 mm, touches a needle for a two-thousandth of its way."""
    hand = shape_text('<sphere radius="0.001"/>')
    for x in (1.2345, 1.54321, 1.8888):
        motion = prismatic(hand=hand, more=mast(x, 0.00099, size=0.001))
        pairs = CollisionPairs(motion.problem.model)
        nearest = clearance(motion, pairs)
        assert pairs.name(nearest.pair) == "mast - hand"
        assert nearest.distance < 0.0
        assert_close(nearest.distance, 0.00099 - 0.0005 - 0.001, atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_distances_change_no_faster_than_the_levers_say(seed):
    """On random robots with revolute and prismatic joints, a cube on every link."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, ["RRRR", "RPRC", "PRFRP", "RFRRR", "CPCP", "RRPF"][seed], "R")
    cube = shape_text('<box size="0.3 0.2 0.1"/>', "0.1 0.2 0.3")
    text = re.sub(r"</link>", cube + "</link>", robot.text)
    model = FreeFloatingModel.from_urdf(text, robot.end_effector)
    pairs = CollisionPairs(model)
    everything = np.arange(len(pairs.pairs))
    for _ in range(40):
        q = rng.uniform(-3.0, 3.0, model.dof)
        step = rng.normal(size=model.dof) * rng.choice([1e-3, 0.1, 1.0])
        levers = joint_levers(pairs, np.maximum(np.abs(q), np.abs(q + step)))
        change = np.abs(pairs.distances(q + step, everything) - pairs.distances(q, everything))
        assert (change <= levers @ np.abs(step) + 1e-6).all()


@pytest.mark.parametrize("offset", [9e-5, -9e-5])
def test_the_depth_between_nearly_deepest_places_is_refined(offset):
    """A box through a wall: the depth has a kink beside one of the places that are tried first."""
    x = prismatic().evaluate(5.5)[2][0, 0] + offset
    wall = joint_text("wall_joint", "F", "bus", "wall", f"{x} 0 0")
    wall += link_text("wall", shape_text('<box size="0.1 3 3"/>'))
    motion = prismatic(BALL, shape_text('<box size="0.2 0.4 0.4"/>'), wall)
    nearest = clearance(motion, CollisionPairs(motion.problem.model))
    assert_close(nearest.distance, -0.15, atol=1e-7)
    assert_close(motion.sample([nearest.time])[0].joints[0], x, atol=1e-7)


def test_pairs_that_always_overlap_are_left_out_and_named():
    """A ring of a shape around all that the end-effector can reach."""
    shell = shape_text('<sphere radius="50"/>')
    for far, note in ("", "always"), (shape_text(BOX, "0 0 60"), "parts are always"):
        motion = prismatic(CUBE, BALL, f'<link name="shell">{shell}{far}</link>'
                         + joint_text("shell_joint", "F", "bus", "shell"))  # fmt: skip
        pairs = CollisionPairs(motion.problem.model)
        assert pairs.left_out == (f"shell - hand: {note} too near",)
        assert_close(clearance(motion, pairs).distance, 0.4, atol=1e-9)


def folding_arm(rpy="0 0 0"):
    """A robot with a second arm over the bus, whose link ``fore`` a joint can fold into it."""
    rod = '<box size="0.02 0.02 {0}"/>'
    arm = joint_text("h1", "R", "bus", "upper", "0 0 0.6")
    arm += link_text("upper", shape_text(rod.format(0.4), "0 0 0.2"))
    arm += joint_text("h2", "R", "upper", "fore", "0 0 0.4", rpy, "0 1 0", (-4.0, 4.0))
    return prismatic_robot(
        CUBE, BALL, arm + link_text("fore", shape_text(rod.format(0.8), "0 0 0.4"))
    )


@pytest.mark.parametrize(("rpy", "held", "where", "distance"), [
    ("0 0 0", {"h2": np.pi}, "bus - fore", -0.3), (f"0 {np.pi} 0", {}, "bus - fore", -0.3),
    ("0 0 0", {"h2": np.pi / 2.0}, "bus - hand", 0.4),
])  # fmt: skip
def test_links_that_held_joints_separate_are_compared(tmp_path, rpy, held, where, distance):
    """An arm at rest, inside the bus and outside; its links are at constant distances."""
    file = tmp_path / "robot.urdf"
    file.write_text(folding_arm(rpy))
    arms = {"main": {"end_effector": "hand"}, "side": {"end_effector": "fore", "law": "held"}}
    content = {
        "robot": {"urdf": str(file), "end_effector": "main", "arms": arms, "held": held},
        "task": "position", "path": {"line": {"from": [0.9, 0, 0], "to": [1, 0, 0]}},
        "timing": {"duration": 20}, "margin": {"value": 0.0}, "limits": {"clearance": 0.0},
    }  # fmt: skip
    scenario = ff.load_scenario(content)
    problem, limits = scenario.problem(), scenario.limits()
    permitted = ff.Limits(clearance="off")
    result, free = (
        ff.simulate(problem, ff.so3.UPRIGHT, limits=each) for each in (limits, permitted)
    )
    (limit,) = (entry for entry in result.limit_results if entry.limit == "clearance")
    assert (limit.where, limit.kept, limit.time, limit.notes) == (where, distance > 0.0, 0.0, ())
    assert_close(limit.worst, distance, atol=1e-6)
    assert str(free.contact or "").startswith("fore overlaps bus by 0.3 m") == (distance < 0.0)
    file.write_text(folding_arm(rpy).replace('lower="-4.0"', 'lower="0.5"'))
    assert held or error_key(ff.load_scenario(content).model) == "robot.held.h1"


def test_every_kind_of_shape_has_its_size(tmp_path):
    """A ball's extent as box, cylinder and mesh: the distance to the bus differs."""
    corners = np.array([[-0.1, 0, 0], [0.2, 0.2, 0.2], [0.2, -0.2, 0.2], [0.2, 0.0, -0.2]])
    faces = "".join(f"f {a} {b} {c}\n" for a, b, c in [(1, 2, 3), (1, 3, 4), (1, 4, 2), (2, 4, 3)])
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
    (tmp_path / "hand.obj").write_text(vertices + faces)
    shapes = {
        '<sphere radius="0.1"/>': 0.1,
        '<box size="0.3 0.1 0.1"/>': 0.15,
        '<cylinder radius="0.12" length="0.2"/>': 0.12,
        '<mesh filename="hand.obj"/>': 0.1,
        '<mesh filename="hand.obj" scale="2 2 2"/>': 0.2,
        '<mesh filename="hand.obj" scale="-1 1 1"/>': 0.2,
    }
    for geometry, towards in shapes.items():
        file = tmp_path / "robot.urdf"
        file.write_text(prismatic_robot(CUBE, shape_text(geometry)))
        motion = prismatic_motion(file)
        nearest = clearance(motion, CollisionPairs(motion.problem.model))
        assert_close(nearest.distance, 0.5 - towards, atol=1e-6), geometry


@pytest.mark.parametrize(
    "geometry", ['<mesh filename="none.stl"/>', '<box size="1 0 1"/>', "<capsule/>", ""]
)
def test_shapes_that_cannot_be_read_are_refused(geometry):
    model = FreeFloatingModel.from_urdf(prismatic_robot(CUBE, shape_text(geometry)), "hand")
    with pytest.raises(ModelError):
        CollisionPairs(model)


def volume(parts):
    return sum(ConvexHull(part.points).volume for part in parts)


def cuboids(*bounds):
    """Boxes between lowest and highest corners, as triangles."""
    return np.concatenate([trimesh.creation.box(bounds=each).triangles for each in bounds])


def step(edge, height):
    """A unit cube that is lower from a place on the x axis on."""
    return cuboids(([0, 0, 0], [edge, 1, 1]), ([edge, 0, 0], [1, height, 1]))


ANGLED = cuboids(([0, 0, 0], [3, 1, 1]), ([2, 1, 0], [3, 3, 1]))


@pytest.mark.parametrize(("axis", "fraction"), [(0, 0.2), (1, 0.5), (2, 0.65)])
def test_a_step_is_cut_beside_its_edge(axis, fraction):
    """Air remains in a wedge between edge and cut, wherever the mesh is."""
    edge, height = fraction - 0.01, 0.43
    triangles = 2.0 * np.roll(step(edge, height), axis, axis=2) + np.array([1.0, 2.0, 3.0])
    solid, air = edge + (1.0 - edge) * height, 0.01 * (1.0 - height) / 2.0
    assert volume(convex_parts(triangles, 2)) == pytest.approx(8.0 * (solid + air), abs=1e-9)


@pytest.mark.parametrize("height", [0.0, 0.9, 1.4])
def test_distances_of_capsules_are_those_of_a_segment(height):
    """Beside the cylinder, at its end, and beyond it; length is that of the cylinder alone."""
    capsule = shape_text('<capsule radius="0.2" length="1.8"/>')
    ball = shape_text('<sphere radius="0.1"/>', f"0 0 {height}")
    model = FreeFloatingModel.from_urdf(prismatic_robot(capsule, ball), "hand")
    pairs = CollisionPairs(model)
    (distance,) = pairs.distances(np.array([0.8, 0.0, 0.0]), np.arange(len(pairs.pairs)))
    expected = np.hypot(0.8, max(height - 0.9, 0.0)) - 0.2 - 0.1
    assert distance == pytest.approx(expected, abs=1e-6)
    (shape,) = [shape for shape in pairs.shapes if shape.link == "bus"]
    assert np.abs(shape.points).max(axis=0).tolist() == pytest.approx([0.2, 0.2, 1.1])


def test_a_thousand_shapes_are_the_most():
    def owners(count):
        balls = shape_text('<sphere radius="0.1"/>') * count
        model = FreeFloatingModel.from_urdf(prismatic_robot(hand=balls), "hand")
        many = read_urdf(f'<robot name="r"><link name="a">{balls}</link></robot>', mounted=True)
        scene = Scene([SceneBody("many", many)])
        return shapes_of_links(model, visuals=True), shapes_of_bodies(scene, 4)

    assert [len(all_shapes(every)) for every in owners(1000)] == [1000, 1000]
    assert [error_key(all_shapes, every) for every in owners(1001)] == ["limits.clearance"] * 2


def test_the_parts_hold_all_of_the_mesh(rng):
    knot = trimesh.creation.torus(major_radius=1.0, minor_radius=0.2)
    for triangles in (ANGLED, knot.triangles):
        parts = [Delaunay(part.points) for part in convex_parts(triangles)]
        weights = rng.dirichlet([1.0, 1.0, 1.0], 4000)
        chosen = triangles[rng.integers(len(triangles), size=4000)]
        points = np.einsum("kc,kcx->kx", weights, chosen)
        centre = triangles.mean(axis=(0, 1))
        inside = [part.find_simplex(points + 1e-9 * (centre - points), tol=1e-6) >= 0
                  for part in parts]  # fmt: skip
        assert np.any(inside, axis=0).all()


def test_faces_look_outwards():
    for part in convex_parts(ANGLED):
        a, b, c = np.moveaxis(part.points[part.faces], 1, 0)
        outward = np.einsum("fx,fx->f", np.cross(b - a, c - a), a - part.points.mean(axis=0))
        assert (outward > 0.0).all()


@pytest.mark.parametrize("slope", [0.0, 0.7])
def test_flat_meshes_are_thin_plates(slope):
    """Of three points, of a strip, of an angled panel in two parts."""
    angled = np.array([[0.0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4]])
    for corners, most in (([[0.0, 0], [2, 0], [0, 1]], 1), (angled, 6)):
        flat = np.insert(np.asarray(corners), 2, 1.0, axis=1)
        flat[:, 2] += slope * flat[:, 0]
        fan = np.array([[flat[0], a, b] for a, b in pairwise(flat[1:])])
        parts = convex_parts(fan)
        assert 1 <= len(parts) <= most
        points = np.vstack([part.points for part in parts])
        assert np.ptp(points, axis=0)[:2] == pytest.approx(np.ptp(flat, axis=0)[:2], abs=1e-5)
        assert np.abs(points[:, 2] - 1.0 - slope * points[:, 0]).max() < 1e-6
