"""``freefloat view``: motions and maps in a browser, as a page, pictures or a video."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from freefloat.cli.console import Console
from freefloat.cli.delivery import load_motion
from freefloat.cli.options import (
    Json,
    NoOpen,
    Page,
    Quiet,
    Threads,
    distinct_stems,
    option,
    prepare_outputs,
)
from freefloat.errors import InputError, require_extra
from freefloat.io.files import make_folder

if TYPE_CHECKING:
    from freefloat.concurrency import Progress
    from freefloat.motion.motion import Motion
    from freefloat.visualization.page.playback import Playback

_Files = Annotated[list[Path], typer.Argument(
    metavar="FILE", help="Files of motions, which one page shows; or one file of any kind.",
)]  # fmt: skip
_Port = Annotated[
    int, option("P", "Port of the page; if it is in use, the next free one.", min=0, max=65535)
]
_Snapshots = Annotated[
    int | None, option("N", "Take N pictures from start to end.", min=1, max=1000)
]
_Output = Annotated[Path | None, option(
    "FILE", "Write a page, a video or the first picture: .html, .gif, .mp4 or .png. With "
    "--snapshots the folder of the pictures; default NAME_snapshots.", "--output", "-o",
)]  # fmt: skip
_Plots = Annotated[Path | None, option(
    "DIR", "Draw all figures into this folder, as PDF and PNG. Of several files each has a "
    "folder of its own, and a figure compares up to four motions.",
)]  # fmt: skip
_Video = Annotated[Path | None, option("FILE", "Write a .gif, or a .mp4 (needs ffmpeg).")]
_Fps = Annotated[float | None, option("F", "Frames per second of the video; default 20.")]
_Speed = Annotated[float | None, option(
    "X", "Speed of the video; default 1. Longer motions are sped up; the factor is printed.",
)]  # fmt: skip
_Size = Annotated[
    str | None, option("WxH", "Size of pictures and video; default 1280x720, GIF 800x450.")
]
_Scene = Annotated[str | None, option(
    "NAME", "Which of several scenes the page opens, and pictures and video show: the "
    'name of a file, the arm branch of a map or a simulation, or "side by side".',
)]  # fmt: skip


def view(
    files: _Files,
    port: _Port = 7007,
    no_open: NoOpen = False,
    html: Page = None,
    snapshots: _Snapshots = None,
    output: _Output = None,
    video: _Video = None,
    fps: _Fps = None,
    speed: _Speed = None,
    size: _Size = None,
    scene: _Scene = None,
    plots: _Plots = None,
    threads: Threads = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Play motions or show a map in a browser until Ctrl-C; or write page, pictures, video, plots.

    The page is served to this machine alone. Pictures and videos need freefloat[video] and a
    Chromium or Chrome on PATH, or the one that CHROMIUM_BIN names. Exit code 0, also after Ctrl-C.

    Example: freefloat view plan.h5

    Example: freefloat view feasible.h5 singular.h5 --html both.html --scene singular

    Example: freefloat view plan.h5 --plots figures
    """
    from freefloat.visualization.page.pictures import save_picture, save_snapshots, save_video

    picture = None
    if output is not None and snapshots is None:
        match output.suffix.lower():
            case ".html" if html is None:
                html = output
            case ".gif" | ".mp4" if video is None:
                video = output
            case ".png":
                picture = output
            case _:
                accepted = ".html, .gif, .mp4 or .png, once each; or --snapshots N"
                raise InputError("output", f"{output} was given", accepted)
    _require_outputs(
        fps=(fps, {"--video": video}),
        speed=(speed, {"--video": video}),
        size=(size, {"--snapshots": snapshots, "--video": video, "-o": picture}),
        scene=(scene, {"--html": html, "--snapshots": snapshots, "--video": video, "-o": picture}),
        threads=(threads, {"--plots": plots}),
    )
    if (snapshots, video, picture) != (None, None, None):
        require_extra("video", "playwright")
    console, pixels = Console(as_json, quiet), _pixels(size)
    prepare_outputs(*files, kind="png", html=html, video=video, output=picture)
    with console.progress("making the page"):
        playback = _playback(files)
    if plots is not None:
        make_folder("plots", plots)
    scene = playback.scene_title(scene)
    options: dict[str, Any] = {"size": pixels, "scene": scene}
    shown: dict[str, Any] = {"address": None, "html": None, "snapshots": [], "video": None}
    shown |= {"figures": [], "scenes": [*playback.titles], "remarks": [*playback.remarks]}
    if (html, snapshots, video, picture, plots) == (None, None, None, None, None):
        _serve(console, playback, shown, port, opens=not (no_open or as_json))
        return
    begin, end = playback.scene_times(scene)
    if begin == end and (video or (snapshots or 1) > 1):
        key = "snapshots" if video is None else "video"
        raise InputError(key, "the scene has no motion", "--snapshots 1 or --html")
    if snapshots is not None:
        name = scene if scene and len(files) > 1 else files[0].stem
        folder = output or Path(re.sub(r"[^\w.+-]+", "_", name) + "_snapshots")
        make_folder("output", folder)
        with console.progress(f"taking {snapshots} pictures") as update:
            pictures = save_snapshots(playback, snapshots, folder, name, **options, progress=update)
        shown["snapshots"] = list(map(str, pictures))
    if picture is not None:
        save_picture(playback, picture, **options)
        shown["snapshots"] = [str(picture)]
    if video is not None:
        with console.progress("taking the pictures of the video") as update:
            frames = save_video(playback, video, rate=fps, speed=speed, **options, progress=update)
        shown["video"] = {"file": str(video), **frames.to_dict()}
    if html is not None:
        shown["html"] = str(playback.save(html, scene))
    if plots is not None:
        with console.progress("drawing") as update:
            shown["figures"] = _save_figures(files, plots, threads, update)
    _print(console, shown)


def _print(console: Console, shown: dict[str, Any]) -> None:
    """Print the address and the files where a playback is, as a JSON document or as lines."""
    console.json(shown)
    console.tables(_lines(shown))


def _lines(shown: dict[str, Any]) -> Iterator[str]:
    """Addresses and files of the page, the pictures and the video."""
    yield from (f"remark: {remark}" for remark in shown["remarks"])
    if shown["address"] is not None:
        yield f"{shown['address']}  (for this machine alone; Ctrl-C ends)"
    if shown["html"] is not None:
        yield f"page: {shown['html']}"
    if pictures := shown["snapshots"]:
        yield f"pictures: {' to '.join(dict.fromkeys([pictures[0], pictures[-1]]))}"
    yield from (f"figure: {name}" for name in shown["figures"] if name.endswith(".png"))
    if (video := shown["video"]) is not None:
        times = "" if video["speed"] == 1.0 else f", {video['speed']:g} times the motion's speed"
        yield f"video: {video['file']}, {video['duration']:.1f} s{times}"


def _serve(
    console: Console, playback: Playback, shown: dict[str, Any], port: int, opens: bool
) -> None:
    """Serve the page until Ctrl-C; print its address and open it in a browser."""
    from freefloat.visualization.page.server import open_beside, serve

    def ready(address: str) -> None:
        _print(console, shown | {"address": address})
        if opens:
            open_beside(address)

    serve(playback.html(), port, ready)


def _require_outputs(**options: tuple[Any, dict[str, Any]]) -> None:
    """Raise where an option was given, but none of the outputs that it concerns."""
    for key, (value, outputs) in options.items():
        if value is not None and all(output is None for output in outputs.values()):
            accepted = f"together with {' or '.join(outputs)}"
            raise InputError(key, "it has no effect without a file to write", accepted)


def _pixels(text: str | None) -> tuple[int, int] | None:
    """Width and height from ``1280x720``."""
    if text is None:
        return None
    numbers = re.fullmatch(r"([0-9]{1,5})x([0-9]{1,5})", text)
    if numbers is None:
        raise InputError("size", f"{text!r} was given", "width and height in pixels: 1280x720")
    return int(numbers[1]), int(numbers[2])


def _playback(files: Sequence[Path]) -> Playback:
    """The playback of motions, which are shown together, or of one result of any kind."""
    from freefloat.io.results import load
    from freefloat.visualization.page.playback import playback

    if len(files) == 1:
        return playback(load(files[0]), files[0].stem)
    motions = {}
    for name, file in zip(distinct_stems(files), files, strict=True):
        motion, violation = load_motion(file)
        motions[f"{name}, {violation}" if violation else name] = motion
    return playback(motions, " · ".join(motions))


def _save_figures(
    files: Sequence[Path], folder: Path, threads: int | None, progress: Progress
) -> list[str]:
    """Draw the figures of files, and one that compares their motions; the names of all."""
    from freefloat.io.results import load
    from freefloat.visualization.comparison_figure import comparison_figure
    from freefloat.visualization.figure_style import save_figures
    from freefloat.visualization.figures import figures

    written: list[Path] = []
    motions: dict[str, Motion] = {}
    for name, file in zip(distinct_stems(files), files, strict=True):
        result = load(file)
        place = folder / name if len(files) > 1 else folder
        written += save_figures(place, figures(result, threads=threads, progress=progress))
        moving = [p.motion for p in getattr(result, "phases", ()) if p.motion is not None]
        if len(moving) == 1:
            motions[name] = moving[0]
    if len(motions) > 1:
        written += save_figures(folder, {"comparison": comparison_figure(motions)})
    return [str(file) for file in written]
