"""The paper's figures 2 to 11, drawn from computed motions; figures 1 and 4a are sketches."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.motion.motion import Motion
from freefloat.planning.plane.arcs import BranchRanges
from freefloat.regions.planar_regions import PlanarArm, point_3_on_path
from freefloat.regions.workspace import workspace_regions
from freefloat.so3 import Array
from freefloat.visualization.figure_style import (
    BLACK,
    BLUE,
    COLUMN,
    GREEN,
    STROKES,
    draw_point,
    legend_above,
    new_figure,
    styled,
)
from freefloat.visualization.figures.planar_figures import joint_space_figure
from freefloat.visualization.figures.scene_figures import snapshots_figure, workspace_figure
from paper.examples import (
    BAD_ATTITUDE,
    H_EXCHANGED,
    INITIAL_ATTITUDE,
    example_1,
    example_2,
    limits,
    plan_of_example_1,
    touch_point_of_example_2,
)

DESCRIPTIONS = {
    "fig_2a": "Figure 2a: singularity curves I and II, and margin curves III and IV beside them.",
    "fig_2b": "Figure 2b: PIW, PDW A (of curve I) and PDW B (of curve II). E is where point 3 "
    "enters a PDW, so that the arm may become singular.",
    "fig_3": "Figure 3: a motion that touches a margin curve inside its path, at C (Case I), and "
    "one that touches it where it ends, at E (Case II).",
    "fig_4": "Figure 4b: the barycentric vectors a to d lead from the centre of mass to the "
    "end-effector.",
    "fig_5": "Figure 5: what its steps yield for Example 1: feasible headings at F by each "
    "segment, by both, and those at A.",
    "fig_6": "Figure 6: from 140 degrees the arm becomes singular, at D.",
    "fig_7": "Figure 7: from 200 degrees the end-effector follows the whole path.",
    "fig_8a": "Figure 8a: spacecraft attitude and joint angles of that motion.",
    "fig_8b": "Figure 8b: their rates.",
    "fig_9": "Figure 9: in Example 2 the arm becomes singular on the way, at C.",
    "fig_10": "Figure 10: from the computed attitude the path is followed from A to B.",
    "fig_11a": "Figure 11a: position of the end-effector.",
    "fig_11b": "Figure 11b: joint angles of shoulder and elbow.",
    "fig_11c": "Figure 11c: joint angles of the wrist.",
    "fig_11d": "Figure 11d: spacecraft attitude, x-y-z Euler angles.",
    "fig_11e": "Figure 11e: rates of shoulder and elbow.",
    "fig_11f": "Figure 11f: rates of the wrist.",
    "fig_11g": "Figure 11g: angular velocity of the spacecraft in inertial axes.",
}
"""What each figure shows."""
_RESOLUTION = 150


def draw(folder: Path) -> list[Path]:
    """Draw all figures into a folder, which is made; return their files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name, figure in all_figures().items():
        files.append(folder / f"{name}.png")
        figure().savefig(files[-1], dpi=_RESOLUTION)
    return files


def all_figures() -> dict[str, Callable[[], Figure]]:
    """The functions that draw the figures, by name."""
    followed = planar_motion(200.0)
    spatial = spatial_motion()
    ends = ff.simulate(example_2(), BAD_ATTITUDE).branches
    singular = next(branch.motion for branch in ends if not branch.motion.completed)
    areas = workspace_regions(example_1())
    return {
        "fig_2a": lambda: joint_space_figure(example_1(), []),
        "fig_2b": figure_2b,
        "fig_3": figure_3,
        "fig_4": figure_4,
        "fig_5": figure_5,
        "fig_6": lambda: snapshots_figure(planar_motion(140.0), areas),
        "fig_7": lambda: snapshots_figure(followed, areas),
        **curves_of_figure_8(followed),
        "fig_9": lambda: snapshots_figure(singular),
        "fig_10": lambda: snapshots_figure(spatial),
        **curves_of_figure_11(spatial),
    }


def spatial_motion() -> Motion:
    """The motion of Example 2 from the printed attitude, of the arm branch with the touch point."""
    problem, point = example_2(), touch_point_of_example_2(H_EXCHANGED)
    back = ff.integrate_motion(problem, point.attitude, point.joints, start=point.time, end=0.0)
    branches = problem.branches(INITIAL_ATTITUDE)
    branch = min(branches, key=lambda b: problem.model.joint_distance(b.joints, back.final.joints))
    return ff.integrate_motion(problem, INITIAL_ATTITUDE, branch.joints)


def planar_motion(degrees: float) -> Motion:
    """The motion of Example 1 with S > 0 from a heading."""
    return ff.simulate(example_1(), heading=np.radians(degrees), branch=0).chosen.motion


@styled
def figure_2b() -> Figure:
    """The areas with the path of point 3, and the points E at which it enters a PDW."""
    problem = example_1()
    workspace = workspace_regions(problem)
    figure = workspace_figure(problem, workspace)
    (axes,) = figure.axes
    for (start, _), dependent in workspace.path:
        if dependent and start > 0.0:
            t = next(t for t in np.linspace(0, 100, 20001) if problem.path.timing.s(t) >= start)
            place = point_3_on_path(problem, float(t))
            axes.annotate("E", (place.real, place.imag), (5, 5), textcoords="offset points")
            draw_point(axes, np.array([place.real, place.imag]), "D", 4.0, color=BLACK, zorder=8)
    return figure


@styled
def figure_3() -> Figure:
    """Motion 1 along AF, which touches at C, and motion 2 along FB, which touches at its end E."""
    problem = example_1()
    first, second = limits(0)[1], limits(1)[1]
    motions = [
        ff.integrate_motion(problem, *state_at(problem, limit.touch_point, span[0]), start=span[0],
                            end=span[1])
        for limit, span in zip((first, second), spans(), strict=True)
    ]  # fmt: skip
    return joint_space_figure(problem, motions, ("", ""), (first.touch_point, second.touch_point))


def spans() -> list[tuple[float, float]]:
    """First and last time of AF and of FB [s]."""
    return [segment.span for segment in plan_of_example_1().segments]


def state_at(problem: ff.Problem, point: object, t: float) -> tuple[Array, Array]:
    """Attitude and joints at a time of the motion through a touch point."""
    motion = ff.integrate_motion(problem, point.attitude, point.joints, start=point.time, end=t)
    return motion.final.attitude, motion.final.joints


@styled
def figure_4() -> Figure:
    """The barycentric vectors of one configuration, from the centre of mass."""
    arm = PlanarArm.of(example_1().model)
    angles = arm.angles(np.radians(30.0), np.radians([40.0, 60.0, -50.0]))
    ends = np.concatenate([[0.0], np.cumsum(arm.vectors(angles))])
    figure = new_figure(COLUMN, COLUMN)
    axes = figure.subplots()
    for k, name in enumerate("abcd"):
        start, end = ends[k], ends[k + 1]
        style = {"arrowstyle": "-|>", "color": STROKES[k][0], "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", (end.real, end.imag), (start.real, start.imag), arrowprops=style)
        middle = (start + end) / 2.0
        axes.annotate(name, (middle.real, middle.imag), (6, -4), textcoords="offset points",
                      fontweight="bold")  # fmt: skip
    draw_point(axes, np.zeros(2), "+", 7.0, color=BLACK, label="centre of mass")
    draw_point(axes, np.array([ends[3].real, ends[3].imag]), "o", 4.0, color=BLUE, label="point 3")
    draw_point(
        axes, np.array([ends[4].real, ends[4].imag]), "s", 4.0, color=GREEN, label="end-effector"
    )
    axes.update_datalim(np.column_stack([ends.real, ends.imag]))  # arrows do not count
    axes.set(aspect="equal", xlabel="$x$ [m]", ylabel="$y$ [m]")
    axes.margins(0.15)
    legend_above(axes, columns=3)
    return figure


@styled
def figure_5() -> Figure:
    """Feasible headings by step: bars from 0 to 360 degrees."""
    AF, FB = plan_of_example_1().segments
    rows: dict[str, BranchRanges] = {
        "FB, at F": FB.at_start[0], "AF, at F": AF.at_end[0],
        "AF and FB, at F": AF.joined_at_end[0], "AF and FB, at A": plan_of_example_1().ranges[0],
    }  # fmt: skip
    figure = new_figure(COLUMN, 1.9)
    axes = figure.subplots()
    for number, entry in enumerate(rows.values()):
        bars = [(low, high - low) for low, high in entry.degrees]
        axes.broken_barh(bars, (number - 0.3, 0.6), color=BLUE if number < 3 else GREEN)
    axes.set_yticks(range(len(rows)), list(rows))
    axes.invert_yaxis()
    axes.set(xlim=(0.0, 360.0), xlabel="feasible heading [deg]")
    axes.set_xticks(np.arange(0, 361, 60))
    return figure


def curves_of_figure_8(motion: Motion) -> dict[str, Callable[[], Figure]]:
    """Angles and rates of the planar motion over time."""
    t, attitudes, joints, omega, rates = sampled(motion)
    heading = np.unwrap(2.0 * np.arctan2(attitudes[:, 2], attitudes[:, 3]))
    names = ["$\\theta_0$", *(f"$q_{k}$" for k in (1, 2, 3))]
    angles = np.degrees(np.column_stack([heading, joints]))
    speeds = np.degrees(np.column_stack([omega[:, 2], rates]))
    return {
        "fig_8a": lambda: lines(t, angles, names, "angle [deg]"),
        "fig_8b": lambda: lines(t, speeds, names, "rate [deg/s]"),
    }


def curves_of_figure_11(motion: Motion) -> dict[str, Callable[[], Figure]]:
    """Positions, angles and rates of the spatial motion over time."""
    t, attitudes, joints, omega, rates = sampled(motion)
    positions = np.array([motion.problem.path.pose(time).position for time in t.tolist()])
    euler = np.unwrap(Rotation.from_quat(attitudes).as_euler("XYZ"), axis=0)
    inertial = Rotation.from_quat(attitudes).apply(omega)
    arm, wrist = ([f"$q_{k}$" for k in numbers] for numbers in ((1, 2, 3), (4, 5, 6)))
    axes, turns = ["$x$", "$y$", "$z$"], ["about $x$", "about $y$", "about $z$"]
    drawn = {
        "a": (positions, [f"{name}" for name in axes], "position [m]"),
        "b": (np.degrees(joints[:, :3]), arm, "angle [deg]"),
        "c": (np.degrees(joints[:, 3:]), wrist, "angle [deg]"),
        "d": (np.degrees(euler), turns, "Euler angle [deg]"),
        "e": (np.degrees(rates[:, :3]), arm, "rate [deg/s]"),
        "f": (np.degrees(rates[:, 3:]), wrist, "rate [deg/s]"),
        "g": (np.degrees(inertial), ["$\\omega_x$", "$\\omega_y$", "$\\omega_z$"], "rate [deg/s]"),
    }
    return {
        f"fig_11{letter}": lambda curves=curves: lines(t, *curves)
        for letter, curves in drawn.items()
    }


def sampled(motion: Motion) -> tuple[Array, Array, Array, Array, Array]:
    """Times, attitudes, joints, angular velocity in spacecraft axes and joint rates, by row."""
    times, attitudes, joints = motion.evaluate(np.linspace(0.0, motion.panels, 401))
    solver, path = motion.problem.resolved_rate_solver(), motion.problem.path
    pairs = [
        solver.rates(attitude, q, path.twist(float(t)))
        for t, attitude, q in zip(times, attitudes, joints, strict=True)
    ]
    omega, rates = (np.array(part) for part in zip(*pairs, strict=True))
    return times, attitudes, joints, omega, rates


@styled
def lines(t: Array, values: Array, names: list[str], label: str) -> Figure:
    """Curves over time."""
    figure = new_figure(COLUMN, 2.3)
    axes = figure.subplots()
    for column, name, (colour, dashes) in zip(values.T, names, STROKES, strict=False):
        axes.plot(t, column, color=colour, linestyle=dashes, label=name)
    axes.set(xlim=(t[0], t[-1]), xlabel="time [s]", ylabel=label)
    legend_above(axes, columns=4)
    return figure
