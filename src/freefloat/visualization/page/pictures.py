"""Pictures of a page, taken by a headless Chromium through Playwright."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from freefloat.concurrency import Progress
from freefloat.errors import InputError, require_extra
from freefloat.io.files import make_folder, written_beside
from freefloat.visualization.page.playback import Playback

if TYPE_CHECKING:
    from playwright.sync_api import Page

SIZE = 1280, 720
"""Default size [pixels]."""
_BROWSERS = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome",
    "microsoft-edge", "msedge", "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
)  # fmt: skip
_FLAGS = ("--enable-unsafe-swiftshader", "--disable-background-networking")
"""The first flag allows WebGL without a graphics card."""
_TIMEOUT = 120_000
"""Timeout of the browser's start and of a picture [ms]."""
_TWO_FRAMES = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"


def find_browser() -> str | None:
    """The browser named by CHROMIUM_BIN, else a Chromium, Chrome or Edge on PATH.

    Raises:
        InputError: If CHROMIUM_BIN is set to something else than a program.
    """
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
    """Yield pictures of a page at some times; close the iterator if it is not exhausted.

    Args:
        html: Page, see :meth:`freefloat.visualization.page.playback.Playback.html`.
        times: Times of the pictures [s].
        size: Width and height [pixels].
        scene: Title of the scene; the first by default.
        progress: Called with the fraction done, in [0, 1].
        key: Option named in errors.

    Yields:
        PNG files.

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
        name: Prefix of the file names; number and time, that of the picture's clock, follow.
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
