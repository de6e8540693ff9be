"""``freefloat studio``: edit a scenario in a browser and see its feasible attitudes at once."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from threading import Timer
from typing import Annotated

import typer

from freefloat.cli.console import Console
from freefloat.cli.options import Json, NoOpen, Quiet, option, scenario_names
from freefloat.io.files import make_folder

_Scenario = Annotated[
    str,
    typer.Argument(metavar="[SCENARIO]", help="A file or a bundled name, which the page opens.",
                   autocompletion=scenario_names),
]  # fmt: skip
_Port = Annotated[
    int, option("P", "Port of the page; if it is in use, the next free one.", min=0, max=65535)
]
_Folder = Annotated[Path, option("DIR", "Folder in which plans are saved.", "--output", "-o")]
_LIFETIME = 60.0
"""Time that a browser has to read the page [s]."""
_PAGE = """<!DOCTYPE html>
<meta charset="utf-8">
<meta http-equiv="refresh" content="0; url={address}">
<title>freefloat studio</title>
<a href="{address}">freefloat studio</a>
"""


def studio(
    scenario: _Scenario = "spatial_6dof/above",
    port: _Port = 7008,
    no_open: NoOpen = False,
    output: _Folder = Path(),
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Edit a scenario in a browser and see at once from which attitudes it is feasible.

    Drag the path, set the orientation, momentum, duration and margin; choose an attitude to play
    its motion, and save the plan. The page is served to this machine alone, at a secret address:
    whoever knows it can edit the scenario and save plans. Exit code 0, also after Ctrl-C.

    Example: freefloat studio

    Example: freefloat studio planar_3dof/parabola -o plans
    """
    from freefloat.beyond.studio.server import serve_studio
    from freefloat.io.scenario.loading import load_scenario
    from freefloat.visualization.page.server import has_display, open_beside

    load_scenario(scenario)  # its errors belong on the terminal
    make_folder("output", output)
    console, opens = Console(as_json, quiet), has_display() and not (no_open or as_json)
    with ExitStack() as at_end:

        def ready(address: str) -> None:
            console.json({"address": address})
            console.tables([f"{address}  (for this machine alone; Ctrl-C ends)"])
            if opens:
                page = at_end.enter_context(redirect_page(address, output))
                open_beside(page.as_uri())

        serve_studio(scenario, output, port, ready)


@contextmanager
def redirect_page(address: str, folder: Path) -> Iterator[Path]:
    """A page that leads to an address; it is deleted after a minute, or at the end of the context.

    All users of a machine can read the arguments of its processes, and an address that a browser
    opens is one. So the browser opens the page; its owner alone can read it. The address must have
    nothing that HTML would escape; the page's path is absolute.
    """
    handle, name = tempfile.mkstemp(".html", "freefloat-studio-", folder.resolve())
    page = Path(name)
    expiry = Timer(_LIFETIME, page.unlink, kwargs={"missing_ok": True})
    expiry.daemon = True
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(_PAGE.format(address=address))
        expiry.start()
        yield page
    finally:
        expiry.cancel()
        page.unlink(missing_ok=True)
