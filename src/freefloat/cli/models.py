"""``freefloat models``: what comes with the package, by name."""

from __future__ import annotations

from typing import Annotated

import typer

from freefloat.cli.completion import bundled_names
from freefloat.cli.console import answer, answering, print_json, print_text
from freefloat.cli.options import Json


def models(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[NAME]",
            help="Print this file instead: a URDF, or the YAML of a scenario or study.",
            autocompletion=bundled_names,
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """List the bundled robots, scenarios and studies, and what they are, or print one of them.

    Robots are names for info and assemble, scenarios for all that plans, studies for batch. With a
    name the file's text is all that is printed: a copy to start from, which can stand in any
    folder.

    Example: freefloat models

    Example: freefloat models spatial_6dof/line > mine.yaml

    Example: freefloat info ssrms
    """
    with answering(as_json):
        from freefloat.cli.catalogue import bundled_file, catalogue, catalogue_tables

        document = catalogue() if name is None else bundled_file(name)
    if name is None:
        answer(document, catalogue_tables(document), as_json)
    elif as_json:
        print_json(document)
    else:
        print_text(document["text"])
