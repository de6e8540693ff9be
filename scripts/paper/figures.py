"""The paper's figures 2 to 11, drawn from computed motions; figures 1 and 4a are sketches."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.optimize import brentq

import freefloat as ff
from freefloat.io.trajectory import Trajectory
from freefloat.motion.motion import Motion
from freefloat.planning.plane.arcs import BranchRanges
from freefloat.planning.plane.ranges import find_range_limits
from freefloat.planning.touch_point import TouchKind, motion_through
from freefloat.regions.planar_regions import PlanarArm, point_3_on_path
from freefloat.regions.workspace import workspace_regions
from freefloat.so3 import Array
from freefloat.visualization.figure_style import (
    BLACK,
    BLUE,
    COLUMN,
    GREEN,
    GREY,
    PALE,
    STROKES,
    draw_point,
    legend_above,
    new_figure,
    styled,
)
from freefloat.visualization.motion_figures import (
    draw_curves,
    euler_angles,
    headings,
    mark_times,
    shown_times,
)
from freefloat.visualization.planar_figures import joint_space_figure, motion_curve
from freefloat.visualization.scene_figures import from_above, outlines, snapshots_figure
from freefloat.visualization.workspace_figure import workspace_figure
from paper.examples import (
    BAD_ATTITUDE,
    example_1,
    example_2,
    limits,
    plan_of_example_1,
    planar_motion,
    spatial_motion,
)

_RESOLUTION = 230
_BELOW, _ABOVE, _LEFT = (-8.0, -8.0), (5.0, 4.0), (-10.0, 5.0)
_ASIDE = {"A": _ABOVE, "B": _LEFT, "D": _LEFT, "F": _BELOW, "A'": _ABOVE, "B'": _LEFT, "F'": _ABOVE}
"""Places of letters beside points in the plane [points]; A' is the one of point 3."""


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
    return {
        "fig_2a": lambda: joint_space_figure(example_1(), []),
        "fig_2b": figure_2b,
        "fig_3": figure_3,
        "fig_4": figure_4,
        "fig_5": figure_5,
        "fig_6": partial(planar_snapshots, 140.0),
        "fig_7": partial(planar_snapshots, 200.0),
        **curves_of_figure_8(followed),
        "fig_9": partial(spatial_snapshots, singular),
        "fig_10": partial(spatial_snapshots, spatial),
        **curves_of_figure_11(spatial),
    }


@styled
def figure_2b() -> Figure:
    """The areas with the path A'-F'-B' of point 3, and the points E at which it enters a PDW."""
    problem = example_1()
    figure = workspace_figure(problem, workspace_regions(problem))
    places = zip("AFB", [0.0, *(end for _, end in spans())], strict=True)
    letters = {f"{name}'": flat(point_3_on_path(problem, t)) for name, t in places}
    name_places(figure.axes[0], letters)
    return figure


@styled
def figure_3() -> Figure:
    """Motion 1 along AB, which touches at C, and motion 2 along AE, which touches at its end."""
    problem = example_1()
    last = time_of_e()
    ends = find_range_limits(problem, (0.0, last))
    points = (limit.touch_point for limit in ends)
    second = next(point for point in points if point.kind is TouchKind.END and point.level > 0.0)
    both = (limits(0)[1].touch_point, problem.path.duration), (second, last)
    touching = [(motion_through(problem, point, (0.0, end)), point) for point, end in both]
    figure = joint_space_figure(problem, [], (), touching)
    for (motion, _), number, share in zip(touching, "12", (0.85, 0.15), strict=True):
        curve = motion_curve(motion)
        place = curve[int(share * len(curve))]
        figure.axes[0].annotate(number, place, (-9.0, -4.0), textcoords="offset points")
    return figure


def time_of_e() -> float:
    """When point 3 enters PDW A [s]."""
    problem = example_1()
    s = next(s for (s, _), dependent in workspace_regions(problem).path if dependent and s > 0.0)
    duration = problem.path.duration
    return float(brentq(lambda t: problem.path.timing.s(t) - s, 0.0, duration))


def spans() -> list[tuple[float, float]]:
    """First and last time of AF and of FB [s]."""
    return [segment.span for segment in plan_of_example_1().segments]


def flat(point: complex) -> Array:
    return np.array([point.real, point.imag])


def name_places(axes: Any, places: dict[str, Array]) -> None:
    """Write the paper's letters beside places, shape (2,) or (3,) [m]."""
    bold: Any = {"fontweight": "bold", "zorder": 10}
    for name, place in places.items():
        if len(place) == 3:
            axes.text(*place, f" {name}  ", ha="right" if name == "A" else "left", va="top", **bold)
        else:
            draw_point(axes, place, ".", 3.0, color=BLACK, zorder=9)
            axes.annotate(name, place, _ASIDE[name], textcoords="offset points", **bold)


@styled
def planar_snapshots(degrees: float) -> Figure:
    """Figs. 6 and 7 with A, F, F' of point 3, B and, where the arm becomes singular, D."""
    motion = planar_motion(degrees)
    figure = snapshots_figure(motion, workspace_regions(example_1()))
    times = dict(zip("AFB", [0.0, *(end for _, end in spans())], strict=True))
    if not motion.completed:
        times["D"] = motion.final.time
    path = motion.problem.path
    letters = {name: path.pose(t).position[:2] for name, t in times.items()}
    letters["F'"] = flat(point_3_on_path(motion.problem, times["F"]))
    name_places(figure.axes[0], letters)
    return figure


@styled
def spatial_snapshots(motion: Motion) -> Figure:
    """Figs. 9 and 10 with A, B and, where the arm becomes singular, C."""
    figure, path = snapshots_figure(motion), motion.problem.path
    places = {"A": path.pose(0.0).position, "B": path.pose(path.duration).position}
    for letter, axes in zip("abc", figure.axes, strict=True):
        axes.set_title(f"({letter}) {axes.get_title()}", y=1.0)
        name_places(axes, places)
    if not motion.completed:
        name_places(figure.axes[-1], {"C": path.pose(motion.final.time).position})
    return figure


@styled
def figure_4() -> Figure:
    """The barycentric vectors on the robot, from the centre of mass."""
    motion = planar_motion(200.0)
    arm = PlanarArm.of(motion.problem.model)
    heading = motion.problem.plane.heading(motion.initial.attitude)
    vectors = arm.vectors(arm.angles(heading, motion.initial.joints))
    ends = [flat(end) for end in np.concatenate([[0.0], np.cumsum(vectors)])]
    (robot,) = outlines(motion, [motion.initial.time])
    figure = new_figure(COLUMN, 2.2)
    axes = figure.subplots()
    box = robot.spacecraft[0][:, :2]
    axes.add_patch(Polygon(from_above(box), fill=False, edgecolor=GREY))
    style = {"linestyle": "-", "linewidth": 2.5, "marker": "o", "markersize": 5.0}
    axes.plot(*robot.arm[:, :2].T, color=PALE, markeredgecolor=GREY, label="robot", **style)
    for (start, end), name, (colour, _) in zip(pairwise(ends), "abcd", STROKES, strict=False):
        arrow = {"arrowstyle": "-|>", "color": colour, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", end, start, arrowprops=arrow, zorder=5)
        x, y = (end - start) / np.linalg.norm(end - start)
        aside = 0.12 * np.array([y, -x] if name == "a" else [-y, x])
        place = (start + end) / 2.0 + aside
        axes.text(*place, name, fontweight="bold", ha="center", va="center")
    draw_point(axes, ends[0], "+", 8.0, color=BLACK, label="centre of mass", zorder=6)
    draw_point(axes, ends[3], "o", 4.0, color=BLUE, label="point 3", zorder=6)
    draw_point(axes, ends[4], "s", 4.0, color=GREEN, label="end-effector", zorder=6)
    axes.update_datalim(np.array(ends))  # arrows do not count
    axes.set(aspect="equal", xlabel="$x$ [m]", ylabel="$y$ [m]")
    axes.margins(0.1)
    legend_above(axes, columns=2)
    return figure


@styled
def figure_5() -> Figure:
    """Feasible headings by step: bars from 0 to 360 degrees."""
    AF, FB = plan_of_example_1().segments
    rows: dict[str, BranchRanges] = {
        "FB, at F": FB.at_start[0], "AF, at F": AF.at_end[0],
        "AF and FB, at F": AF.joined_at_end[0], "AF and FB, at A": plan_of_example_1().ranges[0],
    }  # fmt: skip
    figure = new_figure(COLUMN, 2.2)
    axes = figure.subplots()
    for number, entry in enumerate(rows.values()):
        bars = [(low, high - low) for low, high in entry.degrees]
        axes.broken_barh(bars, (number - 0.3, 0.6), color=BLUE if number < 3 else GREEN)
        for edge in {edge for bar in entry.degrees for edge in bar} - {0.0, 360.0}:
            axes.text(edge, number - 0.32, f"{edge:.1f}", ha="center", va="bottom", fontsize=6.5)
    axes.set_title("Feasible headings that the steps of Fig. 5 yield")
    axes.set_yticks(range(len(rows)), list(rows))
    axes.invert_yaxis()
    axes.set(xlim=(0.0, 360.0), ylim=(3.5, -0.7), xlabel="heading [deg]")
    axes.set_xticks(np.arange(0, 361, 60))
    return figure


def curves_of_figure_8(motion: Motion) -> dict[str, Callable[[], Figure]]:
    """Angles and rates of the planar motion over time."""
    found = Trajectory.of(motion, shown_times(motion))
    names = [r"$\theta_0$", *symbols(motion)]
    heading = headings(found.attitudes, motion.problem.plane)
    angles = np.column_stack([heading, np.degrees(found.joints)])
    rates = np.degrees(np.column_stack([found.angular_velocities[:, 2], found.joint_rates]))
    return {
        "fig_8a": partial(curves, motion, found.times, angles, names, "angle [deg]"),
        "fig_8b": partial(curves, motion, found.times, rates, dotted(names), "rate [deg/s]"),
    }


def symbols(motion: Motion) -> list[str]:
    """The paper's names of the joints."""
    return [f"$q_{number}$" for number in range(1, motion.problem.model.dof + 1)]


def dotted(names: list[str]) -> list[str]:
    """The rates of angles whose names are q or theta with an index, as formulas."""
    return [re.sub(r"(q|\\theta)_", r"\\dot{\1}_", name) for name in names]


def curves_of_figure_11(motion: Motion) -> dict[str, Callable[[], Figure]]:
    """Positions, angles and rates of the spatial motion over time."""
    found = Trajectory.of(motion, shown_times(motion))
    joints = symbols(motion)
    axes, turns = ["$x_E$", "$y_E$", "$z_E$"], ["about $x$", "about $y$", "about $z$"]
    spins = [r"$\omega_x$", r"$\omega_y$", r"$\omega_z$"]
    q, rates = np.degrees(found.joints), np.degrees(found.joint_rates)
    drawn = {
        "a": (found.end_effectors[0].positions, axes, "position [m]"),
        "b": (q[:, :3], joints[:3], "angle [deg]"),
        "c": (q[:, 3:], joints[3:], "angle [deg]"),
        "d": (euler_angles(found.attitudes), turns, "Euler angle [deg]"),
        "e": (rates[:, :3], dotted(joints[:3]), "rate [deg/s]"),
        "f": (rates[:, 3:], dotted(joints[3:]), "rate [deg/s]"),
        "g": (np.degrees(found.angular_velocities), spins, "rate [deg/s]"),
    }
    return {
        f"fig_11{letter}": partial(curves, motion, found.times, *each)
        for letter, each in drawn.items()
    }


@styled
def curves(motion: Motion, t: Array, values: Array, names: list[str], label: str) -> Figure:
    """Columns of values over time."""
    figure = new_figure(COLUMN, 2.3)
    axes = figure.subplots()
    draw_curves(axes, t, values, names)
    mark_times(axes, motion, named=True)
    axes.set(xlabel="time [s]", ylabel=label)
    legend_above(axes)
    return figure
