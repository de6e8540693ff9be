"""Figures of motions to goals and of manoeuvres by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from matplotlib.figure import Figure

from freefloat.beyond.missions.goals.goal_motion import GoalMotion
from freefloat.beyond.missions.manoeuvre_figure import manoeuvre_figure
from freefloat.beyond.missions.phases.manoeuvre import Manoeuvre
from freefloat.concurrency import Progress
from freefloat.visualization.figure_style import Figures, styled
from freefloat.visualization.figures.figures import (
    angle_figures,
    drawn_motion_figures,
    plan_figures,
)


def goal_figures(result: GoalMotion, threads: int | None, progress: Progress | None) -> Figures:
    """The figures of a motion to a goal."""
    motion = result.phases[0].shown_motion
    if motion is None:
        return Figures({})
    return drawn_motion_figures(motion, threads, progress) | angle_figures(motion, result.limits)


def manoeuvre_figures(
    manoeuvre: Manoeuvre, threads: int | None, progress: Progress | None
) -> Figures:
    """The figures of a manoeuvre."""
    moves = any(phase.motion is not None for phase in manoeuvre.phases)
    drawn = Figures({"manoeuvre": partial(manoeuvre_figure, manoeuvre)} if moves else {})
    name = next((phase.name for phase in manoeuvre.phases if phase.kind == "path"), "path")
    first = plan_figures(manoeuvre.path, threads, progress).drawings
    return drawn | Figures({key: partial(_of_phase, name, draw) for key, draw in first.items()})


@styled
def _of_phase(phase: str, draw: Callable[[], Figure]) -> Figure:
    figure = draw()
    figure.suptitle(f", phase {phase}{figure.get_suptitle()}")
    return figure
