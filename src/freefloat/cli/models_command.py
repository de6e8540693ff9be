"""``freefloat models``: what comes with the package, by name."""

from __future__ import annotations

from freefloat.cli.options import Json
from freefloat.tasks.console import answer, answering


def models(as_json: Json = False) -> None:
    """List the bundled robots, scenarios and studies, and what they are.

    Robots are names for info and assemble, scenarios for all that plans, studies for batch.

    Example: freefloat models

    Example: freefloat info ssrms
    """
    with answering(as_json):
        from freefloat.answers.catalogue import catalogue, catalogue_tables

        document = catalogue()
    answer(document, catalogue_tables(document), as_json)
