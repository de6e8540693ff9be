"""Pictures of a page at given times, taken by a headless Chromium through Playwright."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from freefloat.errors import InputError

if TYPE_CHECKING:
    from playwright.sync_api import Page

_SMALLEST, _LARGEST = 16, 4096
"""Limits of width and height [pixels]."""
_BROWSERS = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome",
    "microsoft-edge", "msedge", "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
)  # fmt: skip
_FLAGS = ("--enable-unsafe-swiftshader", "--disable-background-networking")
"""The first flag allows WebGL without a graphics card."""
_TIMEOUT = 120_000
"""Timeout of a picture [ms]."""


def find_browser() -> str | None:
    """Return the browser named by CHROMIUM_BIN, else a Chromium, Chrome or Edge on PATH.

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
    progress: Callable[[float], None] | None = None,
    key: str = "snapshots",
) -> Generator[bytes]:
    """Yield pictures of a page at some times; close the iterator if it is not exhausted.

    Args:
        html: Page, see :meth:`freefloat.visualization.playback.Playback.html`.
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
    if not all(_SMALLEST <= side <= _LARGEST for side in size):
        accepted = f"sides of {_SMALLEST} to {_LARGEST} pixels"
        raise InputError("size", f"{size[0]}x{size[1]} is out of range", accepted)
    with _opened(html, size, key) as page:
        page.evaluate("title => freefloat.capture(title)", scene)
        for number, time in enumerate(times, start=1):
            page.evaluate("t => freefloat.seek(t)", time)
            yield page.screenshot()
            if progress is not None:
                progress(number / len(times))


@contextmanager
def _opened(html: str, size: tuple[int, int], key: str) -> Iterator[Page]:
    """Open a page in a headless browser without a network."""
    try:
        from playwright.sync_api import Error, ViewportSize, sync_playwright
    except ModuleNotFoundError:
        raise InputError(
            key, "the package playwright is not installed", "pip install 'freefloat[video]'"
        ) from None
    program = find_browser()
    with sync_playwright() as playwright:
        if program is None and not Path(playwright.chromium.executable_path).exists():
            raise InputError(
                key, "no Chromium or Chrome was found",
                "a browser (apt install chromium, playwright install chromium) or CHROMIUM_BIN",
            )  # fmt: skip
        root = hasattr(os, "geteuid") and os.geteuid() == 0  # root cannot use the sandbox
        flags = [*_FLAGS, "--no-sandbox"] if root else [*_FLAGS]
        try:
            with playwright.chromium.launch(executable_path=program, args=flags) as browser:
                window = ViewportSize(width=size[0], height=size[1])
                page = browser.new_page(offline=True, viewport=window)
                page.set_default_timeout(_TIMEOUT)
                page.set_content(html)
                page.wait_for_function("window.freefloat || window.freefloatError")
                problem = page.evaluate("window.freefloatError")
                if problem is not None:
                    raise InputError(key, f"the page cannot be drawn: {problem}", "WebGL")
                yield page
        except Error as error:
            problem = f"{program or 'Chromium'} failed: {error.message.splitlines()[0]}"
            raise InputError(key, problem, "a Chromium or Chrome that can draw WebGL") from None
