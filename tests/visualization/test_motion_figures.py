"""Figures of a motion show the motion: its numbers, its margin, its end, its errors."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.io.trajectory import Trajectory
from freefloat.motion.law import PathLaw
from freefloat.planning.motions import SimulatedBranch
from freefloat.so3 import heading_of, heading_quaternion
from freefloat.visualization.comparison_figure import comparison_figure
from freefloat.visualization.figure_style import PALE, VERMILION, axis_label
from freefloat.visualization.motion_figures import euler_angles, motion_figures, shown_times
from tests.figures import labels, line
from tests.motions import GOOD


def simulated(name: str, attitude: list[float] | float, branch: int) -> SimulatedBranch:
    start = attitude if isinstance(attitude, list) else heading_quaternion(np.deg2rad(attitude))
    return ff.simulate(ff.load_scenario(name).problem(), start, branch=branch).chosen


@pytest.fixture(scope="module")
def planar() -> SimulatedBranch:
    return simulated("planar_3dof/parabola", 200.0, 0)


@pytest.fixture(scope="module")
def singular() -> SimulatedBranch:
    return simulated("planar_3dof/parabola", 140.0, 0)


@pytest.fixture(scope="module")
def spatial() -> SimulatedBranch:
    return simulated("spatial_6dof/line", GOOD, 2)


Drawn = tuple[SimulatedBranch, dict[str, Figure]]


@pytest.fixture(scope="module", params=["planar", "singular", "spatial"])
def drawn(request: pytest.FixtureRequest) -> Drawn:
    """A motion and its figures."""
    branch: SimulatedBranch = request.getfixturevalue(request.param)
    return branch, motion_figures(branch.motion, branch.closest_approach)


@pytest.mark.slow
def test_the_motion_is_drawn_as_it_is(spatial: SimulatedBranch) -> None:
    motion = spatial.motion
    trajectory = Trajectory.of(motion, shown_times(motion))
    track = trajectory.end_effectors[0]
    figure = motion_figures(motion, spatial.closest_approach)["motion"]
    joints, rates, angles, spacecraft_rates, end, base = figure.axes
    turns = euler_angles(trajectory.attitudes)
    for k in range(6):
        for panel, values in ((joints, trajectory.joints), (rates, trajectory.joint_rates)):
            drawn = line(panel, f"q{k + 1}")
            assert np.array_equal(drawn[:, 0], trajectory.times)
            assert np.allclose(drawn[:, 1], np.degrees(values[:, k]))
    for k, letter in enumerate("xyz"):
        assert np.allclose(line(angles, f"${letter}$")[:, 1], turns[:, k])
        spin = line(spacecraft_rates, rf"$\omega_{letter}$")[:, 1]
        assert np.allclose(spin, np.degrees(trajectory.angular_velocities[:, k]))
        assert np.allclose(line(end, f"${letter}$")[:, 1], track.positions[:, k])
        assert np.allclose(line(base, f"${letter}$")[:, 1], trajectory.base_positions[:, k])


def test_euler_angles_rebuild_the_attitude_and_do_not_jump() -> None:
    for axis in (0, 2):
        angles = np.zeros((60, 3))
        angles[:, axis], angles[:, 1] = np.linspace(0.0, 720.0, 60), 20.0
        attitudes = Rotation.from_euler("XYZ", angles, degrees=True).as_quat()
        assert np.allclose(euler_angles(attitudes), angles, atol=1e-10)


@pytest.mark.slow
def test_the_margin_is_drawn_where_it_is(drawn: Drawn) -> None:
    branch, figures = drawn
    (axes,) = figures["margin"].axes
    margin = branch.motion.problem.margin
    level = branch.closest_approach.sign * margin.threshold
    marks = [item for item in axes.lines if item.get_label().startswith("margin")]
    assert marks[0].get_ydata() == [level, level]
    assert to_hex(marks[0].get_color()) == VERMILION.lower()
    (band,) = [patch for patch in axes.patches if to_hex(patch.get_facecolor()) == PALE.lower()]
    assert sorted([band.get_y(), band.get_y() + band.get_height()]) == sorted([0.0, level])
    (curve,) = [item for item in axes.lines if len(item.get_xdata()) > 100]
    trajectory = Trajectory.of(branch.motion, curve.get_xdata())
    assert np.array_equal(curve.get_ydata(), trajectory.measure)
    assert axes.get_ylabel() == axis_label(f"$S$ ({margin.measure.title})", margin.measure.unit)


@pytest.mark.slow
def test_compared_motions_share_scales_of_equal_units(planar, singular):
    first, second = planar.motion, singular.motion
    margin = second.problem.margin
    other = replace(margin, measure=replace(margin.measure, unit="m"))
    in_metres = replace(second, law=PathLaw(second.problem.replace(margin=other)))
    for compared, alike in ((second, True), (in_metres, False)):
        upper = comparison_figure({"first": first, "second": compared}).axes[:2]
        assert (upper[0].get_ylim() == upper[1].get_ylim()) == alike


@pytest.mark.slow
def test_errors_are_those_of_the_motion(drawn: Drawn) -> None:
    motion, (momentum, pose) = drawn[0].motion, drawn[1]["momentum"].axes
    assert momentum.get_yscale() == pose.get_yscale() == "log"
    dots = line(momentum, "momentum")
    errors = motion.momentum_errors(motion.node_coordinates)
    shown = np.isfinite(dots[:, 1])
    assert np.array_equal(dots[shown, 1], errors[shown])
    residuals = motion.residuals()
    assert np.nanmax(dots[:, 1]) == np.nanmax(errors) < 1.0001 * residuals.momentum
    assert np.nanmax(line(pose, "end-effector position")[:, 1]) == residuals.end_effector_position
    assert (
        np.nanmax(line(pose, "end-effector orientation")[:, 1])
        == residuals.end_effector_orientation
    )


ANTENNA = ff.PointingLimit(
    "spacecraft", [0.0, 1.0, 0.0], 0.6, direction=[-1.0, 0.0, 0.0], name="sun $x^$"
)
TRACKER = ff.PointingLimit("end_effector", [1.0, 0.0, 0.0], 0.5, "outside", point=[4.0, 1.0, 0.0])
NAMES = [r"sun \$x^\$", "end_effector (pointing.1)", "turn of the spacecraft"]


@pytest.mark.slow
def test_limited_angles_are_those_of_the_heading() -> None:
    """In the plane an angle is a difference of headings, from -180 to 180 degrees."""
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    limits = ff.Limits(pointing=[ANTENNA, TRACKER], base_turn=0.5)
    simulation = ff.simulate(problem, heading=np.radians(200.0), branch=0, limits=limits)
    panels = ff.figures(simulation)["angles"].axes
    assert [labels(axes)[0] for axes in panels] == NAMES
    motion = simulation.chosen.motion
    times, turns = line(panels[2], NAMES[2]).T
    headings = np.array([heading_of(state.attitude) for state in motion.sample(times)])
    for shown, origin in ((line(panels[0], NAMES[0])[:, 1], np.pi / 2.0), (turns, headings[0])):
        expected = np.abs((headings - origin + np.pi) % (2.0 * np.pi) - np.pi)
        assert shown == pytest.approx(np.degrees(expected), abs=1e-6)
