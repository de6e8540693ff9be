"""The figure of a manoeuvre: attitude, joints and measure over all phases."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from freefloat.motion.motion import Motion
from freefloat.planning.answer import PhaseResult
from freefloat.planning.phases.manoeuvre import Manoeuvre
from freefloat.so3 import Array, angle_between
from freefloat.visualization.figure_style import MARGIN_LINE, strokes, styled

_SAMPLES = 201


@styled
def manoeuvre_figure(manoeuvre: Manoeuvre) -> Figure:
    """Return turn, joints and measure by time; each phase turns from its beginning, as limited."""
    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    turn, joints, measure = figure.subplots(3, sharex=True)
    moving = [(phase, phase.motion) for phase in manoeuvre.phases if phase.motion is not None]
    for phase, motion in moving:
        times, attitudes, values = _sampled(motion)
        at = phase.start + times
        turns = angle_between(attitudes, motion.initial.attitude)
        turn.plot(at, np.degrees(turns), color="C0", linestyle="-")
        if phase.limits is not None and phase.limits.base_turn is not None:
            turn.hlines(np.degrees(phase.limits.base_turn), at[0], at[-1], **MARGIN_LINE)
        joints.set_prop_cycle(strokes(values.shape[1]))
        joints.plot(at, np.degrees(values))
        of = motion.problem.margin.measure
        measure.semilogy(at, [max(abs(of(q)), 1e-12) for q in values], color="C2", linestyle="-")
        if phase.kind == "path":
            threshold = motion.problem.margin.threshold
            if threshold:
                measure.hlines(threshold, at[0], at[-1], **MARGIN_LINE)
    problem = manoeuvre.problem
    turn.set_ylabel("turn within\nthe phase [°]")
    joints.set_ylabel("joints [°]")
    joints.legend(problem.model.joint_names, ncols=1, loc="center left", bbox_to_anchor=(1.0, 0.5))
    measure.set_ylabel(f"|{problem.margin.measure.name}|")
    measure.set_xlabel("time from the beginning of the first path [s]")
    _mark(figure, manoeuvre.phases)
    return figure


def _sampled(motion: Motion) -> tuple[Array, Array, Array]:
    return motion.evaluate(np.linspace(0.0, motion.panels, _SAMPLES))


def _mark(figure: Figure, phases: tuple[PhaseResult, ...]) -> None:
    """Mark the beginnings of phases, and name them above the first axes."""
    for number, phase in enumerate(phases):
        for axes in figure.axes:
            axes.axvline(phase.start, color="0.6", linewidth=0.8)
        if phase.duration > 0.0:
            middle = phase.start + phase.duration / 2.0
            figure.axes[0].annotate(
                phase.name, (middle, 1.0), (0, 3 + 9 * (number % 2)), ha="center", fontsize=8,
                xycoords=("data", "axes fraction"), textcoords="offset points",
            )  # fmt: skip
