"""Distances along a motion: no contact hides, the right pair is named, every shape counts."""

import re
from functools import partial
from itertools import product

import numpy as np
import pytest

import freefloat as ff
from freefloat.errors import ModelError
from freefloat.limits.clearance import TOLERANCE, clearance
from freefloat.limits.collision import collision_shapes
from freefloat.limits.levers import frame_levers, joint_levers
from freefloat.limits.pairs import CollisionPairs
from freefloat.robot.model import FreeFloatingModel
from freefloat.robot.shapes import Sphere
from freefloat.scene.scene import Scene
from freefloat.scene.scene_body import SceneBody
from tests.errors import error_key
from tests.prismatic import RELATIVE, prismatic_motion, prismatic_robot, shape_text
from tests.robots import inertial_text, joint_text, link_text, random_robot

assert_close = partial(np.testing.assert_allclose, rtol=0)
BOX = '<box size="1 1 1"/>'
CUBE, BALL = shape_text(BOX), shape_text('<sphere radius="0.1"/>')


def mast(x, z, size=0.02, kind="F"):
    """A small box on the spacecraft, reached by a joint."""
    joint = joint_text("mast_joint", kind, "bus", "mast", f"{x} 0 {z}")
    shape = shape_text(f'<box size="{size} {size} {size}"/>')
    return joint + f'<link name="mast">{shape}</link>'


class CountingPairs(CollisionPairs):
    """Pairs with the number of distances that were computed."""

    count = 0

    def distances(self, joints, pairs, *pose):
        self.count += len(pairs)
        return super().distances(joints, pairs, *pose)


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


def test_deciding_only_agrees_with_few_distances():
    """The end-effector passes at 0.2 m over all the width of the box; first 25 places are tried."""
    motion = prismatic(more=mast(1.4, 0.3))
    pairs = CountingPairs(motion.problem.model)
    distance = clearance(motion, pairs).distance
    counts = [pairs.count]
    decide = partial(clearance, motion, pairs, decide_only=True)
    assert decide(distance + TOLERANCE).distance < distance + TOLERANCE
    counts.append(pairs.count)
    assert decide(distance - TOLERANCE).distance >= distance - TOLERANCE
    assert (np.diff([0, *counts, pairs.count]) <= [350, 54, 325]).all()


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


@pytest.mark.parametrize(("rpy", "end", "fixed", "least", "left_out"), [
    ("0 0 0", "fore", {"h2": np.pi, "x": 2.0}, 0.0, ()),  # the joint that moves turns it in the bus
    ("0 0 0", "hand", {"h2": 0.0}, 0.6, ("bus - fore: always too near",)),
    (f"0 {np.pi} 0", "hand", {"h1": 0.0}, 0.0, ()),
    (f"0 {np.pi} 0", "hand", {}, 0.0,
     ("bus - fore: too near with joints at zero that robot.held does not name",)),
])  # fmt: skip
def test_links_are_compared_where_other_values_of_held_joints_part_them(
    rpy, end, fixed, least, left_out
):
    """Or named. Parts of grippers, whose joints nobody holds at a value, overlap at zero."""
    pairs = CollisionPairs(
        FreeFloatingModel.from_urdf(folding_arm(rpy), end, fixed_joints=fixed), least
    )
    assert pairs.left_out == left_out
    assert ("bus - fore" in map(pairs.name, range(len(pairs.pairs)))) == (not left_out)


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
        collision_shapes(model)


NAMES = ["bus", "a", "b", "c", "d", "far"]
CENTRES = [0.0, 0.1, 0.0, 0.5, 0.2, 0.0]
"""Of thin rods of 0.3 m along the x axes of the links, and of a ball beside them [m]."""
BESIDE = SceneBody("far", Sphere(0.1), [0.0, 0.0, 9.0])


def plane_arm(bus=0.0, kind="C"):
    """An arm in the plane, stretched along x at zero; its third joint is prismatic."""
    text = ""
    for name, x in zip(NAMES, [bus, *CENTRES[1:5]], strict=False):
        shape = shape_text('<box size="0.3 0.002 0.002"/>', f"{x} 0 0")
        text += link_text(name, inertial_text(1.0, np.eye(3)) + shape)
    for k, (x, sort) in enumerate(zip((0.7, 0.6, 0.5, 0.4), (kind, "C", "P", "C"), strict=True)):
        axis = "1 0 0" if sort == "P" else "0 0 1"
        text += joint_text(f"j{k}", sort, *NAMES[k : k + 2], f"{x} 0 0", "0 0 0", axis, (-1, 1))
    return FreeFloatingModel.from_urdf(f'<robot name="arm">{text}</robot>', "d")


@pytest.fixture(scope="module")
def pairs():
    return CollisionPairs(plane_arm(), scene=Scene([BESIDE]))


def bodies_of(pairs):
    return [[NAMES.index(link) for link in pairs.links(k)] for k in range(len(pairs.pairs))]


@pytest.mark.parametrize("bus", [0.0, 5.0])
def test_levers_are_the_largest_distances_from_the_axes(bus):
    """Of the nearer of two shapes; attained where the arm is stretched or folded."""
    model, stroke, far = plane_arm(bus), 0.8, np.zeros((4, 5))
    rods = np.add.outer([bus, *CENTRES[1:5]], [-0.15, 0.15])
    pairs = CollisionPairs(model, scene=Scene([BESIDE]))
    for first, second, last in product([0.0, np.pi], repeat=3):
        poses = model.body_poses([0.0, 0.0, 0.0, 1.0], np.array([first, second, stroke, last]))
        for k, link in product(range(4), range(5)):
            place = poses[link].position[0] - poses[k + 1].position[0]
            ends = place + poses[link].rotation[0, 0] * rods[link]
            far[k, link] = max(far[k, link], np.abs(ends).max())
    levers = joint_levers(pairs, np.full(4, stroke))
    for (first, second), row in zip(bodies_of(pairs), levers, strict=True):
        moved = np.array([first <= k < second < 5 for k in range(4)])
        expected = [far[k, [first, second % 5]].min() if k != 2 else 1.0 for k in range(4)]
        assert_close(row, moved * expected, atol=2e-5)


def test_frames_move_shapes_by_their_translation_and_radius(pairs):
    """Links that a joint connects are no pairs."""
    own = [[0, 2], [0, 3], [0, 4], [1, 3], [1, 4], [2, 4]]
    assert bodies_of(pairs) == own + [[link, 5] for link in range(5)]
    radii = np.append(np.abs(CENTRES[:5]) + 0.15, 0.1 * np.sqrt(3.0))  # of a cube around the ball
    levers, (centres, sizes) = frame_levers(pairs).reshape(-1, 2, 6), pairs.spheres
    for k, bodies in enumerate(bodies_of(pairs)):
        expected = np.zeros((2, 6))
        if bodies[1] == 5:
            expected[:, bodies] = [1.0, 1.0], radii[bodies]
        assert_close(levers[k], expected, atol=2e-5)
        assert_close(centres[k], np.outer(np.take(CENTRES, bodies), [1, 0, 0]), atol=1e-12)
        assert_close(sizes[k], np.where(np.equal(bodies, 5), radii[5], 0.15), atol=2e-5)


@pytest.mark.parametrize(("kind", "reached"), [("R", 0.5507), ("C", 1.149)])
def test_pairs_too_near_in_the_whole_range_of_the_joints_are_left_out(kind, reached):
    """A rod on the spacecraft, and the second link, which a joint of one radian keeps beside it."""
    near, far = (CollisionPairs(plane_arm(1.4, kind), reached + d) for d in (0.005, -0.005))
    assert (near.left_out, far.left_out) == (("bus - b: always too near",), ())
    assert bodies_of(near) == bodies_of(far)[1:]
    assert error_key(CollisionPairs, plane_arm(1.4, kind), 9.0) == "limits.clearance"


@pytest.mark.parametrize("gap", [0.3, 0.0, -0.05])
def test_directions_lead_from_the_first_to_the_second_shape(pairs, gap):
    """The ball beside the last rod: apart, touching, overlapping."""
    below, rod, q = 0.9, 0.001, np.zeros(4)
    chosen = np.array([bodies_of(pairs).index(bodies) for bodies in ([0, 2], [2, 4], [4, 5])])
    placed = np.eye(3)[None, None], np.array([[[2.4, rod + gap + 0.1, 0.0]]])
    below, rows = np.full(3, below), np.zeros(3, np.int64)
    distances, normals, points = pairs.nearest(q[None], rows, chosen, placed, below)
    assert_close(distances, [1.0, 0.8, gap], atol=1e-6)
    assert_close(normals, [[0, 0, 0], [1, 0, 0], [0, 1, 0]], atol=1e-5)
    assert_close(points[:2, :, 0], [[0, 0], [1.45, 2.25]], atol=1e-6)
    assert_close(points[2], [[2.4, rod, 0], [2.4, rod + gap, 0]], atol=1e-5)
