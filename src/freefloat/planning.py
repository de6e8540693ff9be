"""The work of ``plan --html``: a page with the motion that was chosen."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from freefloat.plans import Plan


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
    from freefloat.playback import play  # MeshCat takes a third of a second to import

    play({f"{scenario}, {plan.chosen.branch.label}": plan.chosen.motion}, scenario).save(file)
    return {"html": str(file)}


def page_lines(document: Mapping[str, Any]) -> list[str]:
    """What a terminal tells of the page."""
    if "html" not in document:
        return []
    return [f"Page: {document['html'] or 'none, there is no motion to show'}"]
