"""Areas, paths and outlines of robots are drawn where they are."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.patches import Circle, Polygon, Wedge
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.spatial import ConvexHull

import freefloat as ff
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Motion
from freefloat.regions.workspace import exact_workspace
from freefloat.so3 import heading_quaternion
from freefloat.visualization.scene_figures import outline_points, outlines, snapshots_figure
from freefloat.visualization.workspace_figure import workspace_figure
from tests.figures import line

PLANAR = ff.load_scenario("planar_3dof/parabola").problem()
AREAS = exact_workspace(PLANAR)


@pytest.fixture(scope="module")
def good() -> Motion:
    return ff.simulate(PLANAR, heading=np.radians(200.0), branch=0).chosen.motion


@pytest.fixture(scope="module")
def spatial() -> Motion:
    problem = ff.load_scenario("spatial_6dof/line").problem()
    return ff.simulate(problem, [0.1, 0.5, 0.2, -0.8367], branch=2).chosen.motion


def test_areas_are_rings_around_the_centre_of_mass() -> None:
    (axes,) = workspace_figure(PLANAR, AREAS).axes
    rings = [item for item in axes.patches if isinstance(item, Wedge)]
    drawn = [(ring.r - ring.width, ring.r) for ring in rings]
    assert np.allclose(drawn, [*AREAS.area_a, *AREAS.area_b, *AREAS.path_independent])
    names = [ring.get_label() for ring in rings if not ring.get_label().startswith("_")]
    assert names == ["PDW A", "PDW B", "PIW"]
    greys = [np.mean(ring.get_facecolor()[:3]) for ring in rings[:3]]
    assert min(np.diff(greys)) > 0.04  # different without colours
    circles = [item for item in axes.patches if isinstance(item, Circle)]
    assert [circle.radius for circle in circles] == list(AREAS.reach)
    assert all(ring.center == (0.0, 0.0) for ring in rings)


def test_e_is_where_point_3_enters_an_area() -> None:
    """The only radii at its E are those of the borders."""
    (axes,) = workspace_figure(PLANAR, ff.workspace_regions(PLANAR)).axes
    places = [item.get_xydata()[0] for item in axes.lines if item.get_marker() == "D"]
    borders = [AREAS.area_a[0][1], AREAS.area_b[0][0]]
    assert np.allclose(np.linalg.norm(places, axis=1), borders, atol=5e-3)
    assert [text.get_text() for text in axes.texts] == ["E", "E"]


def test_the_section_in_space_keeps_distances_and_lengths() -> None:
    problem = ff.load_scenario("spatial_6dof/line").problem()
    regions = ff.workspace_regions(problem)
    section, over_s = workspace_figure(problem, regions).axes
    path, distances = line(section, regions.point), line(over_s, regions.point)[:, 1]
    assert np.allclose(np.linalg.norm(path, axis=1), distances)
    poses = [problem.path.pose_at(s) for s in np.linspace(0.0, 1.0, len(path)).tolist()]
    points = np.array([pose.position + pose.rotation @ regions.offset for pose in poses])
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert np.allclose(np.linalg.norm(np.diff(path, axis=0), axis=1), lengths)
    rings = [item for item in section.patches if isinstance(item, Wedge)]
    drawn = [(ring.r - ring.width, ring.r) for ring in rings]
    assert np.allclose(drawn, [*regions.area_a, *regions.area_b, *regions.path_independent])
    assert section.get_aspect() == 1.0


def test_the_robot_is_drawn_at_several_instants_the_last_the_darkest(good: Motion) -> None:
    (axes,) = snapshots_figure(good, AREAS).axes
    arms = [item for item in axes.lines if len(item.get_xdata()) == 5]
    wanted = outlines(good, np.linspace(0.0, 100.0, 5))
    assert len(arms) == len(wanted)
    for drawn, robot in zip(arms, wanted, strict=True):
        assert np.allclose(drawn.get_xydata(), robot.arm[:, :2])
    greys = [float(drawn.get_color()) for drawn in arms]
    assert greys == sorted(greys, reverse=True)
    assert greys[-1] == 0.0
    outline = [item for item in axes.patches if isinstance(item, Polygon)][-1].get_xy()
    corners = wanted[-1].spacecraft[0, :, :2]
    assert np.allclose(np.ptp(outline, axis=0), np.ptp(corners, axis=0))
    edges = np.linalg.norm(np.diff(outline, axis=0), axis=1)
    assert np.allclose(edges, 1.0)  # a square of 1 m, not a bow tie


def test_snapshots_in_space_show_the_first_and_the_last_state(spatial: Motion) -> None:
    figure = snapshots_figure(spatial)
    times = np.linspace(0.0, spatial.final.time, 3)
    for axes, robot, time in zip(figure.axes, outlines(spatial, times), times, strict=True):
        arms = [item for item in axes.lines if len(item.get_data_3d()[0]) == 8]
        assert np.allclose(np.transpose(arms[0].get_data_3d()), robot.arm)
        assert axes.get_title() == f"{time:.4g} s"
        faces = [item for item in axes.collections if isinstance(item, Poly3DCollection)]
        assert len(faces) == 1
        spans = [np.ptp(getattr(axes, f"get_{letter}lim")()) for letter in "xyz"]
        scales = spans / axes._box_aspect
        assert np.allclose(scales, scales[0])  # a metre is as long one way as the other
    singular = [text.get_text() for text in figure.legends[0].get_texts()]
    assert singular[-1].startswith("singular at 54.66")


RATE = 0.1
BODIES = (
    ff.SceneBody("ball", ff.Sphere(0.2), [3.0, 0.0, 0.0]),
    ff.SceneBody(
        "bar", ff.Box([1.0, 0.1, 0.2]), [0.0, 3.0, 0.0],
        motion=ff.Tumbling([1.0, 1.0, 1.0], [0.0, 0.0, RATE]),
    ),
)  # fmt: skip


def motion_beside(name: str, attitude: list[float]) -> Motion:
    problem = ff.load_scenario(name).problem().replace(scene=ff.Scene(BODIES))
    return ff.simulate(problem, attitude).chosen.motion


def test_moving_bodies_are_drawn_at_every_instant_of_a_planar_figure() -> None:
    motion = motion_beside("planar_2dof/line", list(heading_quaternion(0.5)))
    (axes,) = snapshots_figure(motion).axes
    patches = [patch for patch in axes.patches if isinstance(patch, Polygon) and patch.get_fill()]
    assert len(patches) == 1 + 5
    assert [patch.get_label() for patch in patches].count("other bodies") == 1
    ball, *bars = (patch.get_xy()[:-1] for patch in patches)
    assert np.linalg.norm(ball - [3.0, 0.0], axis=1) == pytest.approx(0.2, abs=0.01)
    for bar, time in zip(bars, np.linspace(0.0, motion.final.time, 5), strict=True):
        edges = np.diff(np.vstack([bar, bar[:1]]), axis=0)
        longest = edges[np.linalg.norm(edges, axis=1).argmax()]
        direction = [np.cos(RATE * time), np.sin(RATE * time)]
        assert abs(longest @ direction) == pytest.approx(1.0, abs=1e-6)
        assert (bar.min(axis=0) + bar.max(axis=0)) / 2.0 == pytest.approx([0.0, 3.0], abs=1e-6)


def test_outlines_have_nearly_the_volume_of_the_shapes() -> None:
    shapes = [(ff.Sphere(0.5), 4.0 / 3.0 * np.pi * 0.125), (ff.Box([1, 2, 3]), 6.0),
              (ff.Cylinder(0.5, 2.0), 0.5 * np.pi)]  # fmt: skip
    motion = motion_beside("planar_2dof/line", list(heading_quaternion(0.5)))
    for shape, volume in shapes:
        scene = ff.Scene([ff.SceneBody("body", shape, [5.0, 0.0, 0.0])])
        beside = replace(motion, law=PathLaw(motion.problem.replace(scene=scene)))
        ((_, points),) = outline_points(beside, 0.0)
        assert ConvexHull(points).volume == pytest.approx(volume, rel=0.03)
        assert points.mean(axis=0) == pytest.approx([5.0, 0.0, 0.0], abs=0.01)
