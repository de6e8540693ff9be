"""The work of ``plan``: the search, with more time if that helps, and the page of its motion."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from freefloat.ensemble.ensemble import Progress
from freefloat.io.scenario import Scenario
from freefloat.planning.plan import Plan
from freefloat.planning.planner import plan

_STRETCHES = 6
"""How often the duration is made longer; without momentum once is enough."""
_OVER = 1.0 + 1e-5
"""A little more than what just keeps a limit."""


def search_plan(
    loaded: Scenario, progress: Progress, threads: int | None, stretch: bool
) -> tuple[Scenario, Plan]:
    """Plan a scenario within its limits.

    Args:
        loaded: The scenario.
        progress: Called with the share done, in [0, 1].
        threads: How many cores to use.
        stretch: Whether the duration may grow until rates and torques are kept.

    Returns:
        The scenario, its times as they were planned, and the plan.
    """
    for _ in range(_STRETCHES):
        problem = loaded.problem()
        with loaded.told():
            limits = loaded.limits(problem.model)
            found = plan(problem, loaded.search(), progress, threads=threads, limits=limits)
        if not stretch or found.stretch is None:
            break
        loaded = loaded.stretched(_OVER * found.stretch)
    return loaded, found


def save_page(file: Path | None, plan: Plan, scenario: str) -> dict[str, Any]:
    """Write the page, if one is wanted and there is a motion to show.

    Args:
        file: Where; None for no page.
        plan: The plan.
        scenario: Its name, the title.

    Returns:
        What is added to the plan's document: ``html``, the file or None.

    Raises:
        InputError: If the file cannot be written.
    """
    if file is None:
        return {}
    if plan.chosen is None:
        return {"html": None}
    from freefloat.visualization.playback import play  # MeshCat takes a third of a second to import

    play({f"{scenario}, {plan.chosen.branch.label}": plan.chosen.motion}, scenario).save(file)
    return {"html": str(file)}


def page_lines(document: Mapping[str, Any]) -> list[str]:
    """What a terminal tells of the page."""
    if "html" not in document:
        return []
    return [f"Page: {document['html'] or 'none, there is no motion to show'}"]
