"""The work of ``view``: motions as one page, in a browser, in a file, as pictures or a video."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.ensemble.ensemble import Progress
from freefloat.errors import InputError
from freefloat.io.files import written_beside
from freefloat.io.map_file import load_map
from freefloat.io.plan_file import load_plan
from freefloat.io.result_file import ATTITUDE_MAP, MOTION, PLAN, kind_of
from freefloat.motion.motion import Motion
from freefloat.visualization.page import Capture
from freefloat.visualization.playback import Playback, play
from freefloat.visualization.server import open_browser, served, until_stopped
from freefloat.visualization.stills import browser_for, take_pictures
from freefloat.visualization.video import save_video, takes

_ACCEPTED = "plans and motions, several together, or one attitude map (others: map --plots)"
SIDE_BY_SIDE = "side by side"
_SIZE, _GIF_SIZE = (1280, 720), (800, 450)


@dataclass(frozen=True)
class Wishes:
    """What the command line wants written.

    Attributes:
        html: The page.
        snapshots: How many pictures, from the first instant to the last.
        folder: Where the pictures go; made if it is not there.
        video: A ``.gif`` or ``.mp4`` file.
        rate: Of the video, pictures a second.
        speed: Seconds of the motion in a second of the video.
        size: Width and height of pictures and video [pixels].
        scene: Title of what the page opens on and of what is seen in pictures and video, or "side
            by side"; else the first.
    """

    html: Path | None = None
    snapshots: int | None = None
    folder: Path | None = None
    video: Path | None = None
    rate: float | None = None
    speed: float | None = None
    size: tuple[int, int] | None = None
    scene: str | None = None

    def __post_init__(self) -> None:
        moving, pictured = self.video is not None, self.snapshots is not None
        needs = {
            "fps": (self.rate, moving, "--video"),
            "speed": (self.speed, moving, "--video"),
            "output": (self.folder, pictured, "--snapshots"),
            "size": (self.size, moving or pictured, "--snapshots or --video"),
            "scene": (
                self.scene,
                moving or pictured or self.html is not None,
                "--html, --snapshots or --video",
            ),
        }
        for key, (given, used, options) in needs.items():
            if given is not None and not used:
                raise InputError(key, "there is nothing that it could be of", f"{options}, too")

    @property
    def any(self) -> bool:
        """Whether anything is to be written."""
        return not (self.html is None and self.snapshots is None and self.video is None)


def pixels(text: str | None) -> tuple[int, int] | None:
    """Width and height from ``1280x720``.

    Raises:
        InputError: If that is not what it looks like.
    """
    if text is None:
        return None
    found = re.fullmatch(r"([0-9]{1,5})x([0-9]{1,5})", text)
    if found is None:
        raise InputError("size", f"{text!r} was given", "width and height in pixels: 1280x720")
    return int(found[1]), int(found[2])


Bar = Callable[[str], AbstractContextManager[Progress]]
"""Shows progress under a heading."""


@dataclass(frozen=True, eq=False)
class View:
    """Motions, or a map, to look at.

    Attributes:
        playback: Drawn.
    """

    playback: Playback

    @classmethod
    def of(cls, files: Sequence[Path]) -> View:
        """Read files of plans and motions, which are shown together, or of one map in space.

        Raises:
            InputError: If one is no such file, or holds no motion.
        """
        kinds = [kind_of(file) for file in files]
        if ATTITUDE_MAP in kinds and len(files) == 1:
            return cls(_map_playback(files[0]))
        for file, kind in zip(files, kinds, strict=True):
            if kind not in (PLAN, MOTION):
                raise InputError("file", f"what it holds is of kind {kind!r}", _ACCEPTED, str(file))
        motions = dict(zip(_titles(files), map(_motion, files), strict=True))
        return cls(play(motions, " · ".join(motions)))

    def document(self, **more: Any) -> dict[str, Any]:
        """What ``view`` answers."""
        told = {"scenes": list(self.playback.titles), "remarks": list(self.playback.remarks)}
        return {"address": None, "html": None, "snapshots": [], "video": None, **told, **more}

    def write(self, wishes: Wishes, name: str, bar: Bar) -> dict[str, Any]:
        """Write what is wanted.

        Args:
            wishes: What.
            name: What the names of pictures begin with.
            bar: Shows progress.

        Returns:
            What ``view`` answers.

        Raises:
            InputError: If something cannot be written, or pictures cannot be taken.
        """
        duration = self._duration(wishes.scene)
        if duration == 0.0 and (wishes.video is not None or (wishes.snapshots or 1) > 1):
            key = "snapshots" if wishes.video is None else "video"
            raise InputError(key, "nothing moves there", "--snapshots 1 or --html")
        if wishes.snapshots is not None:
            browser_for("snapshots")
        if wishes.video is not None:
            browser_for("video")
            shots = takes(wishes.video, duration, wishes.rate, wishes.speed)
        document = self.document()
        if wishes.html is not None:
            document["html"] = str(self.playback.save(wishes.html, wishes.scene))
        if wishes.snapshots is not None:
            shown = re.sub(r"[^\w.+-]+", "_", name)
            folder = wishes.folder or Path(f"{shown}_snapshots")
            times = tuple(np.linspace(0.0, duration, wishes.snapshots).tolist())
            with bar(f"taking {len(times)} pictures") as progress:
                pictures = self._pictures("snapshots", wishes, times, _SIZE, progress)
                document["snapshots"] = _written(pictures, times, folder, shown)
        if wishes.video is not None:
            usual = _GIF_SIZE if wishes.video.suffix.lower() == ".gif" else _SIZE
            with bar(f"taking {len(shots.times)} pictures") as progress:
                pictures = self._pictures("video", wishes, shots.times, usual, progress)
                with closing(pictures):
                    save_video(wishes.video, pictures, shots.rate)
            document["video"] = {
                "file": str(wishes.video), "pictures": len(shots.times), "fps": shots.rate,
                "speed": shots.speed, "duration": shots.duration,
            }  # fmt: skip
        return document

    def serve(self, port: int, told: Callable[[dict[str, Any]], None], opens: bool) -> None:
        """Show the page in a browser until Ctrl-C or SIGTERM.

        Args:
            port: Where to serve it, see :func:`~freefloat.visualization.server.served`.
            told: Called with what ``view`` answers, as soon as the page is there.
            opens: Whether to open it in the user's browser.

        Raises:
            InputError: If there is no free port.
        """
        html = self.playback.html()
        with until_stopped() as wait, served(lambda _: html, port) as address:
            told(self.document(address=address))
            if opens:
                open_browser(address)
            wait()

    def _duration(self, title: str | None) -> float:
        """Of what is shown in pictures [s]."""
        scenes = {scene["title"]: scene for scene in self.playback.recording.about["scenes"]}
        accepted = [*scenes, SIDE_BY_SIDE] if len(scenes) > 1 else list(scenes)
        if title is not None and title not in accepted:
            raise InputError("scene", f"there is no {title!r}", ", ".join(accepted))
        if title == SIDE_BY_SIDE:
            return self.playback.duration
        return float(scenes[title or accepted[0]]["end"])

    def _pictures(
        self,
        key: str,
        wishes: Wishes,
        times: tuple[float, ...],
        usual: tuple[int, int],
        progress: Progress,
    ) -> Any:
        size = wishes.size or usual
        return take_pictures(
            lambda address: self.playback.html(Capture(times, *size, address, wishes.scene)),
            len(times), size, progress, key=key,
        )  # fmt: skip


def _written(pictures: Any, times: Sequence[float], folder: Path, name: str) -> list[str]:
    """Write pictures, each named after its number and time; their files."""
    digits, files = len(str(len(times))), []
    with closing(pictures):
        for number, (time, picture) in enumerate(zip(times, pictures, strict=True), start=1):
            if number == 1:
                _make(folder)
            file = folder / f"{name}_{number:0{digits}}_{time:.2f}s.png"
            with written_beside(file) as temporary:
                temporary.write_bytes(picture)
            files.append(str(file))
    return files


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        problem = f"{folder}: {error.strerror}"
        raise InputError("output", problem, "a folder that is there or can be made") from None


def _map_playback(file: Path) -> Playback:
    # kernels take half a second to import: not before they are needed
    from freefloat.visualization.map_scene import map_recording

    stored = load_map(file)
    recording = map_recording(
        stored.problem(), stored.attitudes, stored.margins, stored.document, file.stem
    )
    return Playback(recording)


def _motion(file: Path) -> Motion:
    stored = load_plan(file)
    motion = stored.motion()
    if motion is None:
        reason = stored.document.get("reason", "none was told")
        told = f"there is no motion in it, the plan is not feasible: {reason}"
        raise InputError("file", told, "a feasible plan, or a motion", str(file))
    return motion


def _titles(files: Iterable[Path]) -> list[str]:
    """The files' names without endings; numbered where several have the same."""
    titles: list[str] = []
    for file in files:
        numbered = (f"{file.stem} ({number})" for number in range(2, len(titles) + 2))
        titles.append(next(t for t in (file.stem, *numbered) if t not in titles))
    return titles
