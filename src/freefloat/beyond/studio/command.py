"""``freefloat studio``: edit a scenario in a browser and see its feasible attitudes at once."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from threading import Thread
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
    from freefloat.beyond.studio.redirect import redirect_page
    from freefloat.beyond.studio.server import serve_studio
    from freefloat.io.scenario.scenario import load_scenario
    from freefloat.visualization.page.server import has_display, open_browser

    load_scenario(scenario)  # its errors belong on the terminal
    make_folder("output", output)
    console, opens = Console(as_json, quiet), has_display() and not (no_open or as_json)
    with ExitStack() as at_end:

        def ready(address: str) -> None:
            console.json({"address": address})
            console.tables([f"{address}  (for this machine alone; Ctrl-C ends)"])
            if opens:  # in a thread, because some browsers are waited for
                page = at_end.enter_context(redirect_page(address, output))
                Thread(target=open_browser, args=(page.as_uri(),), daemon=True).start()

        serve_studio(scenario, output, port, ready)
