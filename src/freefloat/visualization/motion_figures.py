"""Figures of a motion over time: joints and attitude, singularity measure, errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from freefloat.motion.closest_approach import ClosestApproach
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import Problem
from freefloat.motion.time_series import TimeSeries
from freefloat.so3 import Array
from freefloat.visualization.figure_style import (
    BLACK,
    BLUE,
    GREY,
    PAGE,
    PALE,
    STROKES,
    VERMILION,
    axis_label,
    digits,
    legend_above,
    new_figure,
    styled,
)

_SAMPLES = 401
_BOUNDED = 0.97
"""Initial fraction of a singular motion whose rates set the axis limits."""
_HEADROOM = 1.5


def motion_figures(motion: Motion, closest: ClosestApproach) -> dict[str, Figure]:
    """Return the figures of a motion: ``motion``, ``margin`` and ``momentum``.

    Args:
        motion: The motion.
        closest: Closest approach of the motion to a singularity.
    """
    series = TimeSeries.of(motion, shown_times(motion))
    return {
        "motion": motion_figure(motion, series),
        "margin": margin_figure(motion, series, closest),
        "momentum": momentum_figure(motion),
    }


def shown_times(motion: Motion) -> Array:
    """Return evenly spaced times and those of the integration nodes [s]."""
    even = np.linspace(motion.times.min(), motion.times.max(), _SAMPLES)
    return np.unique(np.concatenate([even, motion.times]))


@styled
def motion_figure(motion: Motion, series: TimeSeries) -> Figure:
    """Return the figure of joints, attitude, rates and positions (Figs. 8 and 11)."""
    problem = motion.problem
    figure = new_figure(PAGE, 5.0)
    panels = figure.subplots(3, 2, sharex=True)
    names = [f"$q_{{{number + 1}}}$" for number in range(problem.model.dof)]
    joints, unit = _joint_scale(problem)
    _curves(panels[0, 0], series, joints * series.joints, names)
    panels[0, 0].set_ylabel(axis_label("joints", unit))
    _curves(panels[0, 1], series, joints * series.joint_rates, names)
    panels[0, 1].set_ylabel(axis_label("joint rates", _per_second(unit)))
    _attitude(panels[1, 0], panels[1, 1], problem, series)
    axes = "xy" if problem.task.planar else "xyz"
    _curves(panels[2, 0], series, series.end_effector[:, : len(axes)], _italic(axes))
    panels[2, 0].set_ylabel(axis_label("end-effector", "m"))
    _curves(panels[2, 1], series, series.base_positions[:, : len(axes)], _italic(axes))
    panels[2, 1].set_ylabel(axis_label("spacecraft", "m"))
    for panel in panels.flat:
        _mark_times(panel, motion, named=panel is panels[2, 1])
        legend_above(panel)
    for panel in panels[:2, 1]:
        _bound(panel, motion, series)
    for panel in panels[-1]:
        panel.set_xlabel(axis_label("time", "s"))
    figure.align_ylabels()
    return figure


def _joint_scale(problem: Problem) -> tuple[float, str]:
    """Return factor and unit of the joint axis: degrees unless a joint is prismatic."""
    prismatic = any(body.prismatic for body in problem.model.bodies[1:])
    return (1.0, "rad, m") if prismatic else (float(np.degrees(1.0)), "deg")


def _per_second(unit: str) -> str:
    return ", ".join(f"{part}/s" for part in unit.split(", "))


def _italic(letters: str) -> list[str]:
    return [f"${letter}$" for letter in letters]


def _attitude(angles: Any, rates: Any, problem: Problem, series: TimeSeries) -> None:
    """Draw the spacecraft's attitude and angular velocity in two axes."""
    rates_deg = np.degrees(series.angular_velocities)
    if problem.task.planar:
        _curves(angles, series, np.degrees(series.headings)[:, None], ["heading"])
        _curves(rates, series, rates_deg[:, 2:], [r"$\omega_z$"])
    else:
        euler = np.degrees(series.euler_angles)
        _curves(angles, series, euler, _italic("xyz"))
        _curves(rates, series, rates_deg, [rf"$\omega_{axis}$" for axis in "xyz"])
    quantity = "attitude" if problem.task.planar else "x-y-z Euler angles"
    angles.set_ylabel(axis_label(quantity, "deg"))
    rates.set_ylabel(axis_label("spacecraft rate", "deg/s"))


def _curves(axes: Any, series: TimeSeries, values: Array, names: list[str]) -> None:
    shown = np.where(np.isfinite(values), values, np.nan)
    for (colour, dashes), column, name in zip(STROKES, shown.T, names, strict=False):
        axes.plot(series.times, column, color=colour, linestyle=dashes, label=name)


def _mark_times(axes: Any, motion: Motion, named: bool = False) -> None:
    """Set the time axis; mark stops and the end of a motion that is not completed."""
    axes.set_xlim(0.0, motion.problem.path.duration)
    for index, stop in enumerate(motion.problem.path.timing.stops):
        label = "at rest" if named and index == 0 else None
        line = {"color": GREY, "linestyle": (0, (4, 3)), "linewidth": 0.8, "zorder": 1}
        axes.axvline(stop.t, label=label, **line)
    if not motion.completed:
        label = motion.ending.name.lower() if named else None
        axes.axvline(motion.final.time, color=VERMILION, linewidth=0.8, zorder=1, label=label)


def _bound(axes: Any, motion: Motion, series: TimeSeries) -> None:
    """Limit the axis of rates, which are unbounded near a singularity."""
    if motion.ending is not Ending.SINGULAR:
        return
    first, last = motion.initial.time, motion.final.time
    early = np.abs(series.times - first) <= _BOUNDED * abs(last - first)
    shown = [line.get_ydata()[early] for line in axes.lines if line.get_ydata() is not None
             and len(line.get_ydata()) == len(early)]  # fmt: skip
    largest = float(np.nanmax(np.abs(shown), initial=0.0))
    if largest > 0.0:
        axes.set_ylim(-_HEADROOM * largest, _HEADROOM * largest)


@styled
def margin_figure(motion: Motion, series: TimeSeries, closest: ClosestApproach) -> Figure:
    """Return the figure of S over time with the margin and the closest approach."""
    measure, threshold = motion.problem.margin.measure, motion.problem.margin.threshold
    figure = new_figure()
    axes = figure.subplots()
    axes.axhline(0.0, color=BLACK, linewidth=0.6)
    axes.plot(series.times, series.measure, color=BLUE)
    if threshold > 0.0:
        level = closest.sign * threshold
        axes.axhspan(0.0, level, color=PALE, linewidth=0.0, zorder=0)
        style: Any = {"color": VERMILION, "linestyle": "--", "linewidth": 1.0}
        axes.axhline(level, label=f"margin {digits(level)}", **style)
    lowest, singular = closest.sign * closest.value, motion.ending is Ending.SINGULAR
    name = "singular" if singular else f"minimum {digits(lowest)}"
    axes.plot(
        closest.time, lowest, marker="X" if singular else "o", color=BLACK, linestyle="none",
        zorder=5, label=f"{name} at {digits(closest.time)} s",
    )  # fmt: skip
    _mark_times(axes, motion)
    axes.set_xlabel(axis_label("time", "s"))
    axes.set_ylabel(axis_label(f"$S$ ({measure.name})", measure.unit))
    legend_above(axes)
    return figure


@styled
def momentum_figure(motion: Motion) -> Figure:
    """Return the figure of momentum and end-effector errors at the integration nodes."""
    figure = new_figure(height=3.2)
    momentum, pose = figure.subplots(2, 1, sharex=True)
    errors = motion.momentum_errors(motion.node_parameters)
    _errors(momentum, motion.times, errors, 0, "momentum")
    oriented = motion.problem.task.prescribes_orientation
    for index, name in enumerate(("position", "orientation")[: 2 if oriented else 1]):
        label = f"end-effector {name}"
        _errors(pose, motion.times, motion.end_effector_errors[:, index], index, label)
    momentum.set_ylabel(axis_label("error", "N m s"))
    pose.set_ylabel(axis_label("error", "m, rad" if oriented else "m"))
    pose.set_xlabel(axis_label("time", "s"))
    for axes in (momentum, pose):
        axes.set_yscale("log")
        _mark_times(axes, motion)
        legend_above(axes)
    figure.align_ylabels()
    return figure


def _errors(axes: Any, times: Array, errors: Array, index: int, name: str) -> None:
    """Draw nonzero errors as dots."""
    shown = np.where(errors > 0.0, errors, np.nan)
    marker, size = (".", 2.0) if index == 0 else ("x", 2.5)
    axes.plot(
        times, shown, color=STROKES[index][0], linestyle="none", marker=marker, markersize=size,
        markeredgewidth=0.6, label=name,
    )  # fmt: skip
