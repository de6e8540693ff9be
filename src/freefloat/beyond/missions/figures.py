"""Figures and scenes of motions to goals and of manoeuvres."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from freefloat.beyond.missions.goals.goal_motion import GoalMotion
from freefloat.beyond.missions.manoeuvre import Manoeuvre
from freefloat.concurrency import Progress
from freefloat.errors import InputError
from freefloat.motion.motion import Motion
from freefloat.planning.answer import PhaseResult, violation_of
from freefloat.so3 import angle_between
from freefloat.visualization import figure_style as style
from freefloat.visualization.figures import angle_figures, drawn_motion_figures, plan_figures
from freefloat.visualization.motion_figures import joint_scale, limited_angles, shown_times
from freefloat.visualization.scenes.scene import Place, motion_scene
from freefloat.visualization.scenes.scene_builder import PageScene

_CURVE_POINTS = 201
_ANGLE = 1.5
"""Height of the axes of an angle [inch]."""


def goal_figures(result: GoalMotion, *_: Any) -> style.Drawings:
    """The figures of a motion to a goal."""
    motion = result.motion
    if motion is None:
        return {}
    return drawn_motion_figures(motion) | angle_figures(motion, result.limits)


def manoeuvre_figures(
    manoeuvre: Manoeuvre, threads: int | None, progress: Progress | None
) -> style.Drawings:
    """The figures of a manoeuvre."""
    drawn: style.Drawings = {}
    if any(phase.motion is not None for phase in manoeuvre.phases):
        drawn["manoeuvre"] = partial(_manoeuvre_figure, manoeuvre)
    name = next((phase.name for phase in manoeuvre.phases if phase.kind == "path"), "path")
    first = plan_figures(manoeuvre.path, threads, progress)
    return drawn | {key: partial(_of_phase, name, draw) for key, draw in first.items()}


@style.styled
def _of_phase(phase: str, draw: Callable[[], Figure]) -> Figure:
    figure = draw()
    figure.suptitle(f", phase {phase}{figure.get_suptitle()}")
    return figure


@style.styled
def _manoeuvre_figure(manoeuvre: Manoeuvre) -> Figure:
    """Turn, limited angles, joints and measure by time; a turn begins with its phase."""
    problem, limits = manoeuvre.problem, manoeuvre.path.limits
    count = 0 if limits is None else len(limits.pointing)
    figure = Figure(figsize=(7.0, 6.0 + _ANGLE * count), layout="constrained")
    turn, *angles, joints, measure = figure.subplots(3 + count, sharex=True)
    moving = [(phase, phase.motion) for phase in manoeuvre.phases if phase.motion is not None]
    every = [name for _, motion in moving for name in motion.model.joint_names]
    names = list(dict.fromkeys(every))  # arms that rest in a phase are not among its joints
    styles = dict(zip(names, style.strokes(len(names)), strict=False))
    unit, (scale, joint_unit) = problem.margin.measure.unit, joint_scale(problem.model)
    for phase, motion in moving:
        nodes = np.linspace(0.0, motion.panels, _CURVE_POINTS)
        times, attitudes, values = motion.evaluate(nodes)
        at = phase.start + times
        turns = angle_between(attitudes, motion.initial.attitude)
        turn.plot(at, np.degrees(turns), color="C0", linestyle="-")
        if phase.result.limits is not None and phase.result.limits.base_turn is not None:
            most = np.degrees(phase.result.limits.base_turn)
            turn.hlines(
                most, at[0], at[-1], label=f"at most {style.digits(most)}°", **style.MARGIN_LINE
            )
        _draw_pointing(angles, phase, motion)
        for name, joint in zip(motion.model.joint_names, values.T, strict=True):
            joints.plot(at, scale * joint, label=style.plain(name), **styles[name])
        of = motion.setting.margin.measure
        measure.semilogy(at, [max(abs(of(q)), 1e-12) for q in values], color="C2", linestyle="-")
        threshold = motion.setting.margin.threshold
        if phase.kind == "path" and threshold:
            label = f"margin {style.amount(threshold, unit)}"
            measure.plot(at[[0, -1]], [threshold, threshold], label=label, **style.MARGIN_LINE)
    turn.set_ylabel(style.axis_label("turn within\nthe phase", "deg"))
    joints.set_ylabel(style.axis_label("joints", joint_unit))
    measure.set_ylabel(style.axis_label(f"|{problem.margin.measure.title}|", unit))
    for axes in (turn, joints, measure):
        handles, labels = axes.get_legend_handles_labels()
        once = dict(zip(labels, handles, strict=True))
        axes.legend(once.values(), once, ncols=1, loc="center left", bbox_to_anchor=(1.0, 0.5))
    measure.set_xlabel("time from the beginning of the first path [s]")
    _mark(figure, manoeuvre.phases)
    return figure


def _draw_pointing(panels: list[Axes], phase: PhaseResult, motion: Motion) -> None:
    """Draw the angles of the limits of pointing of a phase, an axes each."""
    if phase.result.limits is None:
        return
    times = phase.start + shown_times(motion)
    curves = limited_angles(motion, phase.result.limits)
    for axes, (name, side, allowed, values) in zip(panels, curves, strict=False):
        axes.plot(times, np.degrees(values), color="C0", linestyle="-")
        axes.hlines(np.degrees(allowed), times[0], times[-1], **style.MARGIN_LINE)
        angle = style.axis_label(style.plain(name), "deg")
        axes.set_ylabel(f"{angle}\n{side} {style.digits(np.degrees(allowed))}°")


def _mark(figure: Figure, phases: tuple[PhaseResult, ...]) -> None:
    """Mark the beginnings of phases, and name them above the first axes."""
    for number, phase in enumerate(phases):
        for axes in figure.axes:
            axes.axvline(phase.start, color="0.6", linewidth=0.8)
        if phase.duration > 0.0:
            middle = phase.start + phase.duration / 2.0
            figure.axes[0].annotate(
                style.plain(phase.name), (middle, 1.0), (0, 3 + 9 * (number % 2)),
                ha="center", fontsize=8, textcoords="offset points",
                xycoords=("data", "axes fraction"),
            )  # fmt: skip


def goal_scene(result: GoalMotion, title: str) -> PageScene:
    """The scene of a motion to a goal; an InputError without one."""
    motion = result.motion
    if motion is None:
        accepted = "a goal with a motion"
        raise InputError("result", f"it has no motion: {result.reason}", accepted)
    violations = {result.kind: result.violation}
    return motion_scene({result.kind: motion}, title, result.limits, violations=violations)


def manoeuvre_scene(manoeuvre: Manoeuvre, title: str) -> PageScene:
    """The scene of the motions of a manoeuvre, in the frame of its first path.

    Raises an InputError if no phase has a motion.
    """
    motions: dict[str, Motion] = {}
    places: list[Place] = []
    violations: dict[str, str] = {}
    for number, phase in enumerate(manoeuvre.phases, 1):
        motion = phase.motion
        if motion is not None:
            name = f"{number} {phase.name}"
            motions[name], violations[name] = motion, violation_of(phase.limit_results)
            x, y, z = phase.centre.tolist()
            places.append(Place(phase.start, (x, y, z)))
    if not motions:
        raise InputError("manoeuvre", manoeuvre.reason, "a manoeuvre with a motion")
    return motion_scene(motions, title, manoeuvre.path.limits, places, violations)
