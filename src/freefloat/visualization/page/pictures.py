"""Pictures of a page, taken by headless Chromium through Playwright, and videos of the pictures."""

from __future__ import annotations

import io
import itertools
import math
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from freefloat.concurrency import Progress
from freefloat.errors import InputError, finite_number, require_extra
from freefloat.io.files import make_folder, written_beside
from freefloat.visualization.page.playback import Playback

if TYPE_CHECKING:
    from playwright.sync_api import Page

SIZE, _GIF_SIZE = (1280, 720), (800, 450)
"""Default sizes of pictures and of GIFs [pixels]."""
_BROWSERS = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome",
    "microsoft-edge", "msedge", "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
)  # fmt: skip
_FLAGS = ("--enable-unsafe-swiftshader", "--disable-background-networking")
"""The first flag allows WebGL without a graphics card."""
_TIMEOUT = 120_000
"""Timeout of the browser's start and of a picture [ms]."""
_TWO_FRAMES = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
_RATE = 20.0
_MAX_DURATION = 15.0
"""Longest video that is not sped up [s]."""
_MAX_FRAMES = 6000
_MAX_GIF_RATE = 50.0
"""Frames per second; browsers play faster GIFs at ten."""
_PALETTE_FRAMES = 8


def find_browser() -> str | None:
    """The browser named by CHROMIUM_BIN, a program, else a Chromium, Chrome or Edge on PATH."""
    named = os.environ.get("CHROMIUM_BIN")
    if not named:
        return next(filter(None, map(shutil.which, _BROWSERS)), None)
    program = shutil.which(named)
    if program is None:
        raise InputError("CHROMIUM_BIN", f"{named} is not a program", "a Chromium or Chrome")
    return program


def take_pictures(
    html: str,
    times: Sequence[float],
    size: tuple[int, int],
    *,
    scene: str | None = None,
    progress: Progress | None = None,
    key: str = "snapshots",
) -> Generator[bytes]:
    """Yield PNG pictures of a page at some times; close the iterator if it is not exhausted.

    Args:
        html: Page, see :meth:`freefloat.visualization.page.playback.Playback.html`.
        times: Times of the pictures [s].
        size: Width and height [pixels].
        scene: Title of the scene; the first by default.
        progress: Called with the fraction done, in [0, 1].
        key: Option named in errors.

    Raises:
        InputError: If Playwright or a browser is missing, or the page cannot be drawn.
    """
    if not all(16 <= side <= 4096 for side in size):
        problem = f"{size[0]}x{size[1]} is out of range"
        raise InputError("size", problem, "sides of 16 to 4096 pixels")
    with _opened(html, size, key) as page:
        page.evaluate("title => freefloat.capture(title)", scene)
        page.evaluate(_TWO_FRAMES)  # the page resizes its canvas in the next frame
        for number, time in enumerate(times, start=1):
            page.evaluate("t => freefloat.seek(t)", time)
            yield page.screenshot()
            if progress is not None:
                progress(number / len(times))


@contextmanager
def _opened(html: str, size: tuple[int, int], key: str) -> Iterator[Page]:
    """Open a page in a headless browser without a network."""
    require_extra("video", "playwright")
    from playwright.sync_api import Error, ViewportSize, sync_playwright

    program = find_browser()
    with sync_playwright() as playwright:
        if program is None and not Path(playwright.chromium.executable_path).exists():
            accepted = "apt install chromium, playwright install chromium, or CHROMIUM_BIN"
            raise InputError(key, "no Chromium or Chrome was found", accepted)
        root = hasattr(os, "geteuid") and os.geteuid() == 0  # root cannot use the sandbox
        flags = [*_FLAGS, "--no-sandbox"] if root else [*_FLAGS]
        try:
            launch = playwright.chromium.launch
            with launch(executable_path=program, args=flags, timeout=_TIMEOUT) as browser:
                window = ViewportSize(width=size[0], height=size[1])
                page = browser.new_page(offline=True, viewport=window, bypass_csp=True)
                page.set_default_timeout(_TIMEOUT)
                page.set_content(html)
                page.wait_for_function("window.freefloat || window.freefloatError")  # needs eval
                problem = page.evaluate("window.freefloatError")
                if problem is not None:
                    raise InputError(key, f"the page cannot be drawn: {problem}", "WebGL")
                yield page
        except Error as error:
            problem = f"{program or 'Chromium'} failed: {error.message.splitlines()[0]}"
            raise InputError(key, problem, "a Chromium or Chrome that can draw WebGL") from None


def save_snapshots(
    playback: Playback,
    count: int,
    folder: Path,
    name: str,
    *,
    size: tuple[int, int] | None = None,
    scene: str | None = None,
    progress: Progress | None = None,
) -> list[Path]:
    """Write pictures at evenly spaced times and return the files.

    Args:
        playback: Scene and page.
        count: Number of pictures.
        folder: Output folder, created if missing.
        name: Prefix of the file names; number and time on the picture's clock follow.
        size: Width and height [pixels].
        scene: Title of the scene, or ``"side by side"``; the first by default.
        progress: Called with the fraction done, in [0, 1].

    Raises:
        InputError: If pictures cannot be taken or written.
    """
    times = np.linspace(*playback.scene_times(scene), count)
    clocks = np.round(times + playback.scene.description.start, 2) + 0.0  # without -0
    shots = take_pictures(
        playback.html(), times.tolist(), size or SIZE, scene=scene, progress=progress
    )
    plain, digits, files = re.sub(r"[^\w.+-]+", "_", name), len(str(count)), []
    make_folder("output", folder)
    with closing(shots):
        for number, (clock, picture) in enumerate(zip(clocks, shots, strict=True), start=1):
            file = folder / f"{plain}_{number:0{digits}}_{clock:.2f}s.png"
            with written_beside(file) as temporary:
                temporary.write_bytes(picture)
            files.append(file)
    return files


def save_picture(
    playback: Playback, file: Path, *, size: tuple[int, int] | None = None, scene: str | None = None
) -> None:
    """Write a picture of the start of a scene, see :func:`save_snapshots`."""
    begin, _ = playback.scene_times(scene)
    shots = take_pictures(playback.html(), [begin], size or SIZE, scene=scene, key="output")
    with closing(shots), written_beside(file) as temporary:
        temporary.write_bytes(next(shots))


@dataclass(frozen=True)
class FrameTimes:
    """Frame times of a video."""

    times: tuple[float, ...]  # times since the beginning of the motion [s]
    rate: float  # frames per second
    speed: float  # seconds of the motion per second of the video

    @property
    def duration(self) -> float:
        """Length of the video [s]."""
        return len(self.times) / self.rate

    def to_dict(self) -> dict[str, float]:
        """Numbers of pictures and of pictures per second, speed, and length [s]."""
        numbers = {"pictures": len(self.times), "fps": self.rate, "speed": self.speed}
        return {**numbers, "duration": self.duration}


def frame_times(
    file: Path, duration: float, rate: float | None = None, speed: float | None = None
) -> FrameTimes:
    """The frame times of a video, up to the end of the motion.

    The default speed is real time or, if the video would be longer than 15 s, the smallest of 2,
    4, 5, 8, 10, 20, ... that makes it shorter.

    Args:
        file: Video file.
        duration: Duration of the motion [s].
        rate: Frames per second, 20 by default.
        speed: Seconds of the motion per second of the video.

    Raises:
        InputError: If a number is out of range, the file type is unknown, or ffmpeg is missing.
    """
    kind = file.suffix.lower()
    if kind not in (".gif", ".mp4"):
        raise InputError("video", f"{file.name} has an unknown file type", "a .gif or .mp4 file")
    if kind == ".mp4" and shutil.which("ffmpeg") is None:
        accepted = "ffmpeg (apt install ffmpeg) or a .gif file"
        raise InputError("video", "MP4 files need ffmpeg, which is not on PATH", accepted)
    for key, value, most in (("fps", rate, 100.0), ("speed", speed, 1e6)):
        if value is not None:
            accepted = f"a positive number, at most {most:g}"
            finite_number(key, value, accepted, sys.float_info.min, most)
    rate = rate or _RATE
    if kind == ".gif":  # frame durations are multiples of 0.01 s
        rate = 100.0 / max(round(100.0 / rate), 100.0 / _MAX_GIF_RATE)
    if speed is None:
        factors = (digit * 10.0**power for power in itertools.count() for digit in (1, 2, 4, 5, 8))
        speed = next(factor for factor in factors if factor >= duration / _MAX_DURATION)
    step, count = speed / rate, math.ceil(duration * rate / speed - 1e-9) + 1
    if count > _MAX_FRAMES:
        accepted = f"at most {_MAX_FRAMES:,}: a smaller --fps or a larger --speed"
        raise InputError("video", f"the video has {count:,} frames", accepted)
    return FrameTimes(tuple(min(k * step, duration) for k in range(count)), rate, speed)


def save_video(
    playback: Playback,
    file: Path,
    *,
    rate: float | None = None,
    speed: float | None = None,
    size: tuple[int, int] | None = None,
    scene: str | None = None,
    progress: Progress | None = None,
) -> FrameTimes:
    """Write a video and return its frame times.

    Args:
        playback: Scene and page.
        file: A ``.gif`` (repeats forever) or ``.mp4`` (H.264, needs ffmpeg) file.
        rate: Frames per second, see :func:`frame_times`.
        speed: Seconds of the motion per second of the video.
        size: Width and height [pixels].
        scene: Title of the scene, or ``"side by side"``; the first by default.
        progress: Called with the fraction done, in [0, 1].

    Raises:
        InputError: If pictures cannot be taken, the file cannot be written or ffmpeg fails.
    """
    begin, end = playback.scene_times(scene)
    frames = frame_times(file, end - begin, rate, speed)
    gif = file.suffix.lower() == ".gif"
    size = size or (_GIF_SIZE if gif else SIZE)
    times = [*(begin + time for time in frames.times[:-1]), end]
    shots = take_pictures(playback.html(), times, size, scene=scene, progress=progress, key="video")
    with closing(shots), written_beside(file) as temporary:
        (write_gif if gif else write_mp4)(temporary, shots, frames.rate)
    return frames


def write_gif(file: Path, pictures: Iterable[bytes], rate: float) -> None:
    """Write PNG pictures as a GIF with one palette for all frames, which avoids flicker."""
    images = [Image.open(io.BytesIO(picture)).convert("RGB") for picture in pictures]
    chosen = np.linspace(0, len(images) - 1, _PALETTE_FRAMES).astype(int)
    samples = Image.fromarray(np.vstack([np.asarray(images[k]) for k in chosen]))
    palette = samples.quantize(256, Image.Quantize.FASTOCTREE)
    first, *others = (i.quantize(palette=palette, dither=Image.Dither.NONE) for i in images)
    duration = round(1000.0 / rate)
    first.save(file, "GIF", save_all=True, append_images=others, loop=0, duration=duration)


def write_mp4(file: Path, pictures: Iterable[bytes], rate: float) -> None:
    """Write PNG pictures as an H.264 video with ffmpeg."""
    program = [
        *("ffmpeg", "-loglevel", "error", "-y"),
        *("-f", "image2pipe", "-c:v", "png", "-framerate", repr(rate), "-i", "-"),
        *("-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p"),
        *("-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-movflags", "+faststart"),
        *("-f", "mp4", os.fspath(file.resolve())),
    ]
    done = subprocess.run(program, input=b"".join(pictures), capture_output=True, check=False)
    if done.returncode != 0:
        lines = done.stderr.decode(errors="replace").strip().splitlines() or ["no reason given"]
        problem = f"ffmpeg failed: {lines[-1][:300]}"
        raise InputError("video", problem, "an ffmpeg with H.264, or a .gif file")
