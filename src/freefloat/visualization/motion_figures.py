"""Figures of a motion over time: joints, attitude, limited angles, measure, errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from freefloat.dynamics.plane import Plane
from freefloat.io.trajectory import Trajectory
from freefloat.motion.extrema import ClosestApproach
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.pointing import AttitudeLimits, Keep, angle_of
from freefloat.motion.setting import Setting
from freefloat.planning.touch_point import touches
from freefloat.robot.model import FreeFloatingModel
from freefloat.rotations import Rotation
from freefloat.so3 import Array, angle_between
from freefloat.visualization import figure_style as style

_CURVE_POINTS = 401
_TURN_ERROR = 1e-9
_BOUNDED = 0.97
"""Initial fraction of a singular motion whose rates set the axis limits."""
_HEADROOM = 1.5
_AXES = ("$x$", "$y$", "$z$")
_STRIP, _AXIS = 1.15, 0.35
"""Height of an axes and of the time axis [inch]."""


def motion_figures(motion: Motion, closest: ClosestApproach) -> style.Figures:
    """The figures of a motion: ``motion``, ``margin`` and ``momentum``."""
    trajectory = Trajectory.of(motion, shown_times(motion))
    return style.Figures({
        "motion": partial(_motion_figure, motion, trajectory),
        "margin": partial(_margin_figure, motion, trajectory, closest),
        "momentum": partial(_momentum_figure, motion),
    })  # fmt: skip


def shown_times(motion: Motion) -> Array:
    """Evenly spaced times and the times of the integration nodes [s]."""
    even = np.linspace(motion.times.min(), motion.times.max(), _CURVE_POINTS)
    return np.unique(np.concatenate([even, motion.times]))


def euler_angles(attitudes: Array) -> Array:
    """Rotation angles about x, the new y and the new z axis [deg], without jumps, (K, 3)."""
    angles = -Rotation.from_quat(attitudes).inv().as_rpy()
    return np.asarray(np.degrees(np.unwrap(angles, axis=0)))


def headings(attitudes: Array, plane: Plane) -> Array:
    """Headings of a planar spacecraft [deg], without jumps from [0, 360), shape (K,)."""
    angles = np.unwrap(2.0 * np.arctan2(attitudes[:, :3] @ plane.normal, attitudes[:, 3]))
    turns = np.floor((angles[0] + _TURN_ERROR) / (2.0 * np.pi))  # zero is not a whole turn
    return np.asarray(np.degrees(angles - 2.0 * np.pi * turns))


def joint_scale(model: FreeFloatingModel) -> tuple[float, str]:
    """Factor and unit of joint values in figures: degrees where all joints are revolute."""
    return (1.0, "rad, m") if model.prismatic.any() else (np.degrees(1.0), "deg")


def attitude_curves(setting: Setting, trajectory: Trajectory) -> tuple[str, Array, Sequence[str]]:
    """Quantity, values [deg], shape (K, 1) or (K, 3), and names of attitude angles."""
    if setting.has_headings:
        return "attitude", headings(trajectory.attitudes, setting.plane)[:, None], ("heading",)
    return "x-y-z Euler angles", euler_angles(trajectory.attitudes), _AXES


def draw_curves(axes: Any, times: Array, values: Array, names: Sequence[str]) -> None:
    """Draw columns of values (K, C) over time, as many as there are names."""
    axes.set_prop_cycle(style.strokes(len(names)))
    axes.plot(times, values[:, : len(names)], label=list(names))


def draw_panel(
    axes: Any, trajectory: Trajectory, curves: tuple[str, Array, Sequence[str], str], named: bool
) -> None:
    """Draw quantity, values (K, C), names of columns and unit over time, and name its marks."""
    quantity, values, names, unit = curves
    draw_curves(axes, trajectory.times, values, names)
    axes.set_ylabel(style.axis_label(quantity, unit))
    mark_times(axes, trajectory.motion, named)


@style.styled
def _motion_figure(motion: Motion, trajectory: Trajectory) -> Figure:
    """The figure of joints, attitude, rates and positions (Figs. 8 and 11)."""
    setting = motion.setting
    figure = style.new_figure(style.PAGE, 5.0)
    panels = figure.subplots(3, 2, sharex=True)
    scale, unit = joint_scale(setting.model)
    joints = [*map(style.plain, setting.model.joint_names)]
    axes: Sequence[str] = _AXES
    level, spun, frame = axes, "xyz", np.eye(3)
    if setting.has_headings:
        letters, frame = setting.plane.letters, setting.plane.axes
        level, spun = tuple(f"${letter}$" for letter in letters[:2]), letters[2]
        axes = level if setting.task.planar else _AXES
    spins = np.degrees(trajectory.angular_velocities @ frame)[:, 3 - len(spun) :]
    spin_names = [rf"$\omega_{axis}$" for axis in spun]
    rate_unit = ", ".join(f"{part}/s" for part in unit.split(", "))
    tracks = trajectory.end_effectors
    positions = [(track.positions @ frame)[:, : len(axes)] for track in tracks]
    tips = [f"{axis} {track.arm}".strip() for track in tracks for axis in axes]
    word = "end-effector,\ninertial axes" if len(tracks) == 1 else "end-effectors,\ninertial axes"
    curves = [
        ("joints", scale * trajectory.joints, joints, unit),
        ("joint rates", scale * trajectory.joint_rates, joints, rate_unit),
        (*attitude_curves(setting, trajectory), "deg"),
        ("spacecraft rate,\ninertial axes", spins, spin_names, "deg/s"),
        (word, np.hstack(positions), tips, "m"),
        ("spacecraft origin,\ninertial axes", trajectory.base_positions @ frame, level, "m"),
    ]
    for panel, drawn in zip(panels.flat, curves, strict=True):
        draw_panel(panel, trajectory, drawn, named=panel is panels[2, 1])
        style.legend_above(panel)
    if motion.ending is Ending.SINGULAR:
        _limit_rates(panels[0, 1], scale * trajectory.joint_rates, motion, trajectory.times)
        _limit_rates(panels[1, 1], spins, motion, trajectory.times)
    figure.align_ylabels()
    return figure


def mark_times(axes: Any, motion: Motion, named: bool = False) -> None:
    """Set the time axis; mark, and name, stops and the end of a motion that is not completed."""
    axes.set_xlim(0.0, motion.law.timing.duration)
    if axes.get_subplotspec().is_last_row():
        axes.set_xlabel(style.axis_label("time", "s"))
    for index, stop in enumerate(motion.law.timing.stops):
        label = "at rest" if named and index == 0 else None
        line = {"color": style.GREY, "linestyle": (0, (4, 3)), "linewidth": 0.8, "zorder": 1}
        axes.axvline(stop.t, label=label, **line)
    if not motion.completed:
        name = f"{motion.ending.name.lower()} at {style.digits(motion.final.time)} s"
        label = name if named else None
        axes.axvline(motion.final.time, color=style.VERMILION, linewidth=0.8, zorder=1, label=label)


def _limit_rates(axes: Any, rates: Array, motion: Motion, times: Array) -> None:
    """Limit the axis of rates, which are unbounded near a singularity."""
    first, last = motion.initial.time, motion.final.time
    early = np.abs(times - first) <= _BOUNDED * abs(last - first)
    largest = float(np.nanmax(np.abs(rates[early]), initial=0.0))
    if largest > 0.0:
        axes.set_ylim(-_HEADROOM * largest, _HEADROOM * largest)


@style.styled
def _margin_figure(motion: Motion, trajectory: Trajectory, closest: ClosestApproach) -> Figure:
    """The figure of S over time with the margin and the closest approach."""
    measure, threshold = motion.setting.margin.measure, motion.setting.margin.threshold
    figure = style.new_figure(height=2.6)
    axes = figure.subplots()
    axes.axhline(0.0, color=style.BLACK, linewidth=0.6)
    axes.plot(trajectory.times, trajectory.measure, color=style.BLUE)
    if threshold > 0.0:
        level = closest.sign * threshold
        axes.axhspan(0.0, level, color=style.PALE, linewidth=0.0, zorder=0)
        axes.axhline(
            level, label=f"margin {style.amount(level, measure.unit)}", **style.MARGIN_LINE
        )
    lowest = np.array([closest.time, closest.sign * closest.value])
    look: Any = {"color": style.BLACK, "zorder": 5, "clip_on": False}
    if motion.ending is Ending.SINGULAR:  # named at its end
        style.draw_point(axes, lowest, "X", 4.0, **look)
    else:
        name = "touch point, $|S|$" if touches(closest.value, threshold) else "minimum $|S|$"
        label = f"{name} {style.digits(closest.value)} at {style.digits(closest.time)} s"
        style.draw_point(axes, lowest, "o", 4.0, label=label, **look)
    mark_times(axes, motion, named=True)
    axes.set_ylabel(style.axis_label(f"$S$ ({measure.title})", measure.unit))
    style.legend_above(axes, longest=1)
    return figure


@style.styled
def _momentum_figure(motion: Motion) -> Figure:
    """The figure of momentum and end-effector errors at the integration nodes.

    With prescribed joints there is no path that the end-effector could leave.
    """
    follows = motion.law.follows_path
    oriented = motion.setting.task.prescribes_orientation
    errors = [("momentum", motion.momentum_errors(motion.node_coordinates), ".", style.BLUE)]
    rows = [(errors, "N m s")]
    if follows:
        position, orientation = motion.end_effector_errors.T
        errors = [("end-effector position", position, ".", style.BLUE)]
        if oriented:
            errors.append(("end-effector orientation", orientation, "x", style.VERMILION))
        rows.append((errors, "m, rad" if oriented else "m"))
    figure = style.new_figure(height=3.2 if follows else 1.8)
    panels = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (curves, unit) in zip(panels, rows, strict=True):
        for name, values, marker, colour in curves:
            axes.plot(
                motion.times, np.where(values > 0.0, values, np.nan), color=colour, label=name,
                linestyle="none", marker=marker, markersize=2.2, markeredgewidth=0.6,
            )  # fmt: skip
        axes.set_ylabel(style.axis_label("error", unit))
        axes.set_yscale("log")
        mark_times(axes, motion, named=axes is panels[0])
        style.legend_above(axes)
    figure.align_ylabels()
    return figure


@style.styled
def angles_figure(motion: Motion, limits: AttitudeLimits) -> Figure:
    """The figure of limited angles, at least one, over time, with an axes per limit."""
    figure = style.new_figure(style.COLUMN, _AXIS + _STRIP * limits.number)
    panels = figure.subplots(limits.number, 1, sharex=True, squeeze=False)[:, 0]
    times = shown_times(motion)
    curves = limited_angles(motion, limits)
    for axes, (name, side, allowed, angles) in zip(panels, curves, strict=True):
        axes.plot(times, np.degrees(angles), color=style.BLUE, label=style.plain(name))
        bound = np.degrees(allowed)
        axes.axhline(bound, label=f"{side} {style.digits(bound)}°", **style.MARGIN_LINE)
        low, high = axes.get_ylim()
        forbidden = (low, bound) if side == Keep.OUTSIDE else (bound, high)
        axes.axhspan(*forbidden, color=style.PALE, linewidth=0.0, zorder=0)
        axes.set_ylim(low, high)
        axes.set_ylabel(style.axis_label("angle", "deg"))
        mark_times(axes, motion, named=axes is panels[0])
        style.legend_above(axes)
    figure.align_ylabels()
    return figure


def limited_angles(
    motion: Motion, limits: AttitudeLimits
) -> Iterator[tuple[str, str, float, Array]]:
    """Yield name, allowed side, allowed angle and angles at the shown times [rad] of each limit."""
    setting = motion.setting
    times, attitudes, joints = motion.evaluate(motion.coordinates_at(shown_times(motion)))
    for number, limit in enumerate(limits.pointing):
        vectors = limit.vectors(setting.model, attitudes, joints, setting.origin(times))
        yield limit.title(number), limit.keep, limit.angle, angle_of(*vectors)
    if limits.base_turn is not None:
        turns = angle_between(attitudes, motion.initial.attitude)
        yield "turn of the spacecraft", "at most", limits.base_turn, turns
