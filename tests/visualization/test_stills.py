"""Pictures by a headless browser: exact, in order, and nothing left behind."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from urllib.request import Request, urlopen

import numpy as np
import pytest
from PIL import Image

from freefloat.errors import InputError
from freefloat.visualization import stills
from freefloat.visualization.stills import find_browser, take_pictures

PAGE = """<!DOCTYPE html><meta charset="utf-8"><script>
const capture = @CAPTURE@;
(async () => {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [capture.width, capture.height];
  const context = canvas.getContext("2d");
  for (const [index, time] of capture.times.entries()) {
    context.fillStyle = "rgb(10, 20, 30)";
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.fillStyle = "rgb(255, 0, 0)";
    context.fillRect(Math.round(10 * time), 0, 4, canvas.height);
    const blob = await new Promise(done => canvas.toBlob(done, "image/png"));
    await fetch(`${capture.address}/${index}`, {method: "POST", body: blob});
  }
  await fetch(`${capture.address}/done`, {method: "POST", body: ""});
})();
</script>"""
SAYING = """<!DOCTYPE html><script>
fetch(`@ADDRESS@/@WHERE@`, {method: "POST", body: @WHAT@});
</script>"""

browser_only = pytest.mark.skipif(find_browser() is None, reason="no Chromium or Chrome here")


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Temporary files go where other tests have none, also those of programs started.

    That is after pytest has made its own folder, whose name is long.
    """
    with tempfile.TemporaryDirectory(prefix="ff-") as folder:
        monkeypatch.setenv("TMPDIR", folder)
        monkeypatch.setattr(tempfile, "tempdir", folder)
        yield


Page = Callable[[str], str]


def drawing(times: Sequence[float], width: int, height: int) -> Page:
    content = {"times": list(times), "width": width, "height": height}
    return lambda address: PAGE.replace("@CAPTURE@", json.dumps({**content, "address": address}))


def saying(where: str, what: str = '""') -> Page:
    page = SAYING.replace("@WHERE@", where).replace("@WHAT@", what)
    return lambda address: page.replace("@ADDRESS@", address)


def browsers() -> list[str]:
    """Command lines of browsers started by this room, of zombies not."""
    lines = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            line = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except OSError:
            continue
        if "--user-data-dir=" + tempfile.gettempdir() + "/freefloat-" in line:
            lines.append(line)
    return lines


def profiles() -> set[Path]:
    """Whatever programs have left among the temporary files."""
    return set(Path(tempfile.gettempdir()).iterdir())


@browser_only
def test_every_time_becomes_its_picture_in_order() -> None:
    times, shares = (0.0, 3.0, 1.5, 7.25), list[float]()
    before = profiles()
    pictures = list(take_pictures(drawing(times, 120, 41), 4, (120, 41), shares.append))
    assert shares == [0.25, 0.5, 0.75, 1.0]
    for moment, picture in zip(times, pictures, strict=True):
        pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"))
        assert pixels.shape == (41, 120, 3)
        red = np.flatnonzero((pixels[20] == [255, 0, 0]).all(axis=1))
        assert red.tolist() == [round(10 * moment + 1e-9) + k for k in range(4)]
    assert (browsers(), profiles() - before) == ([], set())


@browser_only
def test_a_long_name_of_the_folder_for_temporary_files_does_no_harm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The sockets of browsers may not have names of more than 107 letters."""
    long = tmp_path / ("x" * 60)
    long.mkdir()
    monkeypatch.setenv("TMPDIR", str(long))
    monkeypatch.setattr(tempfile, "tempdir", str(long))
    assert len(list(take_pictures(drawing([0], 32, 32), 1, (32, 32)))) == 1


@browser_only
def test_whoever_ends_early_leaves_no_browser_and_no_thread() -> None:
    before, threads = profiles(), threading.active_count()
    with closing(take_pictures(drawing(range(200), 64, 64), 200, (64, 64))) as pictures:
        next(pictures)
        assert browsers()
    assert (browsers(), profiles() - before, threading.active_count()) == ([], set(), threads)


@browser_only
@pytest.mark.parametrize(
    ("page", "words"),
    [
        (saying("error", '"no WebGL here"'), "could not be drawn: no WebGL here"),
        (saying("error"), "could not be drawn: no reason given"),
        (saying("done"), "sent 'done' instead of picture 0"),
        (saying("1", r'"\x89PNG"'), "sent '1' instead of picture 0"),
        (saying("0", '"text"'), "sent '0' instead of picture 0"),
        (saying("0", r"new Uint8Array([137,80,78,71,13,10,26,10])"), "0x0 came instead of 32x32"),
    ],
)
def test_pages_that_fail_are_one_clear_error(page: Page, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        list(take_pictures(page, 1, (32, 32), key="video"))
    assert caught.value.key == "video"
    assert browsers() == []


@browser_only
def test_a_page_that_says_nothing_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stills, "_PATIENCE", 1.0)
    with pytest.raises(InputError, match="no picture came for 1 s"):
        list(take_pictures(lambda _: "<p>silence", 1, (32, 32)))
    assert browsers() == []


def test_a_browser_that_ends_by_itself_is_told_with_its_last_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "chrome"
    program.write_text("#!/bin/sh\necho first >&2\necho no usable sandbox >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("CHROMIUM_BIN", str(program))
    with pytest.raises(InputError, match="ended by itself: no usable sandbox"):
        list(take_pictures(drawing([0], 32, 32), 1, (32, 32)))


def test_a_picture_that_comes_too_late_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page is told to stop; its request does not hang."""
    program = tmp_path / "chrome"
    program.write_text("#!/bin/sh\nexec sleep 60\n")
    program.chmod(0o755)
    monkeypatch.setenv("CHROMIUM_BIN", str(program))
    addresses: list[str] = []

    def page(address: str) -> str:
        addresses.append(address)
        return "page"

    picture = io.BytesIO()
    Image.new("RGB", (32, 32)).save(picture, "PNG")
    codes: list[int] = []

    def post() -> None:
        while not addresses:
            time.sleep(0.01)
        for index in range(20):
            try:
                request = Request(f"{addresses[0]}/{index}", picture.getvalue(), method="POST")
                codes.append(urlopen(request, timeout=10).status)
            except OSError:
                codes.append(0)

    thread = threading.Thread(target=post)
    thread.start()
    with closing(take_pictures(page, 20, (32, 32))) as pictures:
        assert next(pictures) == picture.getvalue()
        time.sleep(0.5)
    thread.join()
    taken = codes.count(204)
    assert 1 <= taken <= 1 + stills._AHEAD + 1  # no further ahead than that
    assert codes[taken:] == [0] * (20 - taken)


@pytest.mark.parametrize("size", [(15, 400), (400, 4097), (0, 0), (-3, 100)])
def test_sizes_out_of_reason_are_refused(size: tuple[int, int]) -> None:
    with pytest.raises(InputError, match="16 to 4096 pixels a side"):
        next(take_pictures(drawing([0], *size), 1, size))


def test_browsers_are_found_by_name_or_variable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("CHROMIUM_BIN", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(stills, "_NAMES", ("chromium", "google-chrome"))
    assert find_browser() is None
    with pytest.raises(InputError, match="video: no Chromium or Chrome was found") as caught:
        next(take_pictures(drawing([0], 32, 32), 1, (32, 32), key="video"))
    assert "CHROMIUM_BIN" in caught.value.accepted
    program = tmp_path / "google-chrome"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    assert find_browser() == program
    other = tmp_path / "mine"
    other.write_text("#!/bin/sh\n")
    other.chmod(0o755)
    monkeypatch.setenv("CHROMIUM_BIN", "mine")
    assert find_browser() == other
    monkeypatch.setenv("CHROMIUM_BIN", "/no/such/thing")
    with pytest.raises(InputError, match="CHROMIUM_BIN: /no/such/thing is no program"):
        find_browser()


SLOW = """
import sys
sys.path.insert(0, sys.argv[1])
from freefloat.visualization.stills import take_pictures
print("begun", flush=True)
try:
    list(take_pictures(lambda _: "<p>silence", 1, (32, 32)))
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@browser_only
@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_ends_the_browser_too(stop: signal.Signals, tmp_path: Path) -> None:
    before = profiles()
    with subprocess.Popen(
        [sys.executable, "-c", SLOW, str(Path(stills.__file__).parents[2])],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        deadline = time.monotonic() + 20.0
        while not browsers() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(0.5)
        process.send_signal(stop)
        output, errors = process.communicate(timeout=20)
    assert (output, errors) == ("begun\ninterrupted\n", "")
    assert (browsers(), profiles() - before) == ([], set())
