"""``freefloat view``: motions and maps in a browser, as a page, pictures or a video."""

from __future__ import annotations

from typing import Any

from freefloat.cli import options
from freefloat.cli.console import answer, answering, progress_bar
from freefloat.cli.options import Json, Page


def view(
    files: options.Files,
    port: options.Port = 7007,
    no_open: options.NoOpen = False,
    html: Page = None,
    snapshots: options.Snapshots = None,
    output: options.Folder = None,
    video: options.Video = None,
    fps: options.Rate = None,
    speed: options.Speed = None,
    size: options.Size = None,
    scene: options.Scene = None,
    as_json: Json = False,
) -> None:
    """Play motions or show a map in a browser until Ctrl-C; or write the page, pictures, a video.

    The page is served to this machine alone. Pictures and videos are taken by a Chromium or
    Chrome on PATH, or the one that CHROMIUM_BIN names. Exit code 0, also after Ctrl-C.

    Example: freefloat view plan.h5

    Example: freefloat view good.h5 bad.h5 --html both.html --video bad.gif --scene bad
    """
    with answering(as_json):
        from freefloat.cli.tables import view_tables
        from freefloat.io.files import refuse_same_files
        from freefloat.tasks.viewing import View, Wishes, pixels

        wishes = Wishes(html, snapshots, output, video, fps, speed, pixels(size), scene)
        for file in files:
            refuse_same_files(file=file, html=html, video=video)
        shown = View.of(files)

        def tell(document: dict[str, Any]) -> None:
            answer(document, view_tables(document), as_json)

        if wishes.any:
            name = scene if scene and len(files) > 1 else files[0].stem
            tell(shown.write(wishes, name, progress_bar))
        else:
            shown.serve(port, tell, opens=not (no_open or as_json))
