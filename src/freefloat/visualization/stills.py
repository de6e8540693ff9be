"""Pictures of a page, exact to the frame: drawn by a headless browser, sent back over loopback."""

from __future__ import annotations

import os
import secrets
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http import HTTPStatus
from pathlib import Path
from queue import Empty, Full, Queue

from freefloat.ensemble.ensemble import Progress
from freefloat.errors import InputError
from freefloat.visualization.server import served

SMALLEST, LARGEST = 16, 4096
"""Pixels a side."""
_NAMES = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome",
    "microsoft-edge", "microsoft-edge-stable", "msedge",
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
)  # fmt: skip
_FLAGS = (
    "--headless",
    "--enable-unsafe-swiftshader",  # WebGL without a graphics card
    "--force-device-scale-factor=1",
    "--hide-scrollbars",
    "--mute-audio",
    "--no-first-run",
    "--no-default-browser-check",
    "--no-proxy-server",
    "--password-store=basic",
    "--use-mock-keychain",
    "--disable-background-networking",
    "--disable-background-timer-throttling",
    "--disable-backgrounding-occluded-windows",
    "--disable-breakpad",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-dev-shm-usage",  # which is tiny in containers
    "--disable-extensions",
    "--disable-renderer-backgrounding",
    "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)
_PATIENCE = 120.0
"""Seconds without a new picture after which the browser is given up."""
_LOOK = 0.2
"""Seconds between two looks whether the browser still runs."""
_LONGEST = 40
"""Letters of a folder's name that leave room for those of a browser's sockets."""
_AHEAD = 8
"""Pictures the page may be ahead of whoever takes them."""
_PNG = b"\x89PNG\r\n\x1a\n"
_WEBGL = "a Chromium or Chrome that can draw WebGL; CHROMIUM_BIN names another one"


def find_browser() -> Path | None:
    """The program named by the variable CHROMIUM_BIN, else a Chromium, Chrome or Edge on PATH.

    Raises:
        InputError: If CHROMIUM_BIN is set and leads to no program.
    """
    named = os.environ.get("CHROMIUM_BIN")
    if named:
        found = shutil.which(named)
        if found is None:
            raise InputError("CHROMIUM_BIN", f"{named} is no program", "a Chromium or Chrome")
        return Path(found)
    found = next(filter(None, map(shutil.which, _NAMES)), None)
    return None if found is None else Path(found)


def browser_for(key: str) -> Path:
    """A browser, for pictures asked for with an option.

    Raises:
        InputError: If there is none.
    """
    browser = find_browser()
    if browser is None:
        raise InputError(
            key, "no Chromium or Chrome was found",
            "install one (such as apt install chromium) or set CHROMIUM_BIN",
        )  # fmt: skip
    return browser


def take_pictures(
    make_page: Callable[[str], str],
    count: int,
    size: tuple[int, int],
    progress: Progress | None = None,
    *,
    key: str = "snapshots",
) -> Iterator[bytes]:
    """Let a page draw itself, again and again.

    The page posts a PNG to its own address, a slash and 0, then 1 and so on; or, to ``error``
    instead, the words that tell why it cannot. The browser has a profile of its own, reaches
    nothing but the page, and is gone when the iterator is closed, exhausted or interrupted; close
    it (``contextlib.closing``) where the loop over it may end early.

    Args:
        make_page: The HTML text of such a page, given its address.
        count: How many pictures to take.
        size: Width and height [pixels].
        progress: Called with the share done, in [0, 1].
        key: The option that asked for pictures, named in errors.

    Yields:
        PNG files, in order.

    Raises:
        InputError: If there is no browser, it cannot draw the page, or gets stuck.
    """
    if not all(SMALLEST <= side <= LARGEST for side in size):
        accepted = f"{SMALLEST} to {LARGEST} pixels a side"
        raise InputError("size", f"{size[0]}x{size[1]} was given", accepted)
    browser, sent, path = browser_for(key), _Sent(key), f"/{secrets.token_urlsafe(24)}"
    with (
        _terminated_as_interrupted(),
        served(make_page, path=path, receive=sent.receive) as address,
        _running(browser, size, address) as process,
        sent.hearing(),
    ):
        for index in range(count):
            yield _sized(sent.picture(index, process), size, key)
            if progress is not None:
                progress((index + 1) / count)


class _Sent:
    """What the page has sent, waiting to be taken."""

    def __init__(self, key: str) -> None:
        """Nothing yet; ``key`` is named in errors."""
        self._key = key
        self._waiting: Queue[tuple[str, bytes]] = Queue(_AHEAD)
        self._heard = threading.Event()
        self._heard.set()

    @contextmanager
    def hearing(self) -> Iterator[None]:
        """While the block runs somebody takes pictures; afterwards the page is told to stop."""
        try:
            yield
        finally:
            self._heard.clear()

    def receive(self, path: str, content: bytes) -> HTTPStatus:
        """Keep what came until it is taken; a page that is far ahead waits."""
        while self._heard.is_set():
            with suppress(Full):
                self._waiting.put((path, content), timeout=_LOOK)
                return HTTPStatus.NO_CONTENT
        return HTTPStatus.GONE

    def picture(self, index: int, process: _Process) -> bytes:
        """The next picture, which must have this number."""
        path, content = self._next(process)
        if path == "error":
            reason = content[:500].decode(errors="replace").strip() or "no reason given"
            raise InputError(self._key, f"the page could not be drawn: {reason}", _WEBGL)
        if path != str(index) or not content.startswith(_PNG):
            told = f"the page sent {path[:20]!r} instead of picture {index}"
            raise InputError(self._key, told, _WEBGL)
        return content

    def _next(self, process: _Process) -> tuple[str, bytes]:
        deadline = time.monotonic() + _PATIENCE
        while True:
            with suppress(Empty):
                return self._waiting.get(timeout=_LOOK)
            if process.ended():
                told = f"the browser ended by itself: {process.last_words()}"
                raise InputError(self._key, told, _WEBGL)
            if time.monotonic() > deadline:
                told = f"no picture came for {_PATIENCE:g} s: {process.last_words()}"
                raise InputError(self._key, told, _WEBGL)


def _sized(picture: bytes, size: tuple[int, int], key: str) -> bytes:
    """The picture, if it has the size asked for, which a PNG tells in its bytes 16 to 24."""
    found = tuple(int.from_bytes(picture[first : first + 4], "big") for first in (16, 20))
    if found != size:
        told = f"a picture of {found[0]}x{found[1]} came instead of {size[0]}x{size[1]}"
        raise InputError(key, told, _WEBGL)
    return picture


class _Process:
    """A running browser and what it complained of."""

    def __init__(self, process: subprocess.Popen[bytes], log: Path) -> None:
        self._process, self._log = process, log

    def ended(self) -> bool:
        """Whether it is gone."""
        return self._process.poll() is not None

    def last_words(self) -> str:
        """The last line it wrote."""
        lines = self._log.read_text(errors="replace").strip().splitlines()
        return lines[-1][:300] if lines else "it said nothing"

    def kill(self) -> None:
        """End it and all its children, and see them gone."""
        group = self._process.pid
        with suppress(ProcessLookupError):
            os.killpg(group, signal.SIGKILL)
        self._process.wait()
        for _ in range(20):
            with suppress(PermissionError):
                try:
                    os.killpg(group, 0)
                except ProcessLookupError:
                    return
            time.sleep(0.05)


@contextmanager
def _running(browser: Path, size: tuple[int, int], address: str) -> Iterator[_Process]:
    """A headless browser at a page, in a session and with a profile of its own."""
    with tempfile.TemporaryDirectory(
        prefix="freefloat-", dir=_short_folder(), ignore_cleanup_errors=True
    ) as folder:
        log = Path(folder) / "log"
        flags = [*_FLAGS, f"--user-data-dir={folder}/profile", f"--window-size={size[0]},{size[1]}"]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            flags.append("--no-sandbox")  # which root cannot have
        homes = dict.fromkeys(("TMPDIR", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"), folder)
        with log.open("wb") as stream:
            started = subprocess.Popen(
                [str(browser), *flags, address], env={**os.environ, **homes},
                stdin=subprocess.DEVNULL, stdout=stream, stderr=stream, start_new_session=True,
            )  # fmt: skip
        process = _Process(started, log)
        try:
            yield process
        finally:
            process.kill()


def _short_folder() -> str | None:
    """Where temporary files go, unless sockets there would have names too long for the system."""
    usual = len(tempfile.gettempdir()) <= _LONGEST or not os.access("/tmp", os.W_OK)
    return None if usual else "/tmp"


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """SIGTERM is handled as Ctrl-C while the block runs, so that nothing is left behind."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
