"""``freefloat view``: motions and maps in a browser, as a page, pictures or a video."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from freefloat.cli import options
from freefloat.cli.console import answer, answering, progress_bar
from freefloat.cli.options import Json, Page
from freefloat.errors import InputError

if TYPE_CHECKING:
    from freefloat.motion.motion import Motion
    from freefloat.visualization.playback import Playback

_ACCEPTED = "plans and motions, several together, or one attitude map (others: map --plots)"


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

    The page is served to this machine alone. Pictures and videos need freefloat[video] and a
    Chromium or Chrome on PATH, or the one that CHROMIUM_BIN names. Exit code 0, also after Ctrl-C.

    Example: freefloat view plan.h5

    Example: freefloat view good.h5 bad.h5 --html both.html --video bad.gif --scene bad
    """
    with answering(as_json):
        from freefloat.cli.tables import view_tables
        from freefloat.io.files import refuse_same_files

        needs: dict[str, tuple[Any, dict[str, Any]]] = {
            "fps": (fps, {"--video": video}),
            "speed": (speed, {"--video": video}),
            "output": (output, {"--snapshots": snapshots}),
            "size": (size, {"--snapshots": snapshots, "--video": video}),
            "scene": (scene, {"--html": html, "--snapshots": snapshots, "--video": video}),
        }
        for key, (value, outputs) in needs.items():
            if value is not None and all(wanted is None for wanted in outputs.values()):
                problem = "it has no effect without a file to write"
                raise InputError(key, problem, f"together with {' or '.join(outputs)}")
        pixels = None if size is None else _pixels(size)
        for file in files:
            refuse_same_files(file=file, html=html, video=video)
        playback = _playback(files)
        document: dict[str, Any] = {
            "address": None, "html": None, "snapshots": [], "video": None,
            "scenes": list(playback.titles), "remarks": list(playback.remarks),
        }  # fmt: skip
        if html is None and snapshots is None and video is None:
            _serve(playback, document, port, not (no_open or as_json), as_json)
            return
        _refuse_still(playback, scene, snapshots, video)
        name = scene if scene and len(files) > 1 else files[0].stem
        document |= _save_pictures(playback, name, scene, pixels, snapshots, output)
        document |= _save_video(playback, scene, pixels, video, fps, speed)
        if html is not None:
            document["html"] = str(playback.save(html, scene))
        answer(document, view_tables(document), as_json)


def _pixels(text: str) -> tuple[int, int]:
    """Width and height from ``1280x720``."""
    numbers = re.fullmatch(r"([0-9]{1,5})x([0-9]{1,5})", text)
    if numbers is None:
        raise InputError("size", f"{text!r} was given", "width and height in pixels: 1280x720")
    return int(numbers[1]), int(numbers[2])


def _playback(files: Sequence[Path]) -> Playback:
    """The playback of motions, which are shown together, or of one map."""
    from freefloat.io.map_file import load_map
    from freefloat.io.result_file import ATTITUDE_MAP, MOTION, PLAN, kind_of
    from freefloat.visualization.playback import Playback, playback

    kinds = [kind_of(file) for file in files]
    if kinds == [ATTITUDE_MAP]:
        from freefloat.visualization.map_scene import map_scene

        stored = load_map(files[0])
        title = files[0].stem
        return Playback(map_scene(
            stored.problem(), stored.attitudes, stored.margins, stored.document, title
        ))  # fmt: skip
    motions: dict[str, Motion] = {}
    for file, kind in zip(files, kinds, strict=True):
        if kind not in (PLAN, MOTION):
            raise InputError("file", f"it holds {kind!r}", _ACCEPTED, str(file))
        numbered = (f"{file.stem} ({number})" for number in range(2, len(files) + 1))
        name = next(one for one in (file.stem, *numbered) if one not in motions)
        motions[name] = _motion(file)
    return playback(motions, " · ".join(motions))


def _motion(file: Path) -> Motion:
    from freefloat.io.plan_file import load_plan

    stored = load_plan(file)
    motion = stored.motion()
    if motion is None:
        problem = f"it has no motion, the plan is not feasible: {stored.document.get('reason')}"
        raise InputError("file", problem, "a feasible plan, or a motion", str(file))
    return motion


def _serve(
    playback: Playback, document: dict[str, Any], port: int, opens: bool, as_json: bool
) -> None:
    from freefloat.cli.tables import view_tables
    from freefloat.visualization.server import open_browser, serve

    def ready(address: str) -> None:
        shown = {**document, "address": address}
        answer(shown, view_tables(shown), as_json)
        if opens:
            open_browser(address)

    serve(playback.html(), port, ready)


def _refuse_still(
    playback: Playback, scene: str | None, snapshots: int | None, video: Path | None
) -> None:
    still = playback.scene_duration(scene) == 0.0
    if still and (video is not None or (snapshots or 1) > 1):
        key = "snapshots" if video is None else "video"
        raise InputError(key, "nothing moves there", "--snapshots 1 or --html")


def _save_pictures(
    playback: Playback,
    name: str,
    scene: str | None,
    size: tuple[int, int] | None,
    count: int | None,
    folder: Path | None,
) -> dict[str, Any]:
    if count is None:
        return {}
    from freefloat.visualization.video import SIZE, save_snapshots

    folder = folder or Path(re.sub(r"[^\w.+-]+", "_", name) + "_snapshots")
    with progress_bar(f"taking {count} pictures") as progress:
        files = save_snapshots(
            playback, count, folder, name, size=size or SIZE, scene=scene, progress=progress
        )
    return {"snapshots": [str(file) for file in files]}


def _save_video(
    playback: Playback,
    scene: str | None,
    size: tuple[int, int] | None,
    file: Path | None,
    rate: float | None,
    speed: float | None,
) -> dict[str, Any]:
    if file is None:
        return {}
    from freefloat.visualization.video import frame_times, save_video

    frames = frame_times(file, playback.scene_duration(scene), rate, speed)
    with progress_bar(f"taking {len(frames.times)} pictures") as progress:
        save_video(playback, file, frames, size=size, scene=scene, progress=progress)
    return {"video": {
        "file": str(file), "pictures": len(frames.times), "fps": frames.rate,
        "speed": frames.speed, "duration": frames.duration,
    }}  # fmt: skip
