"""Videos: every instant once, at the pace told, in a file that others play."""

from __future__ import annotations

import io
import itertools
import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from freefloat.errors import InputError
from freefloat.visualization.video import save_video, takes

COUNT, WIDTH, HEIGHT = 12, 61, 40
ffmpeg_only = pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg here")


def pictures(count: int = COUNT) -> Iterator[bytes]:
    """A red square that moves by five pixels a picture over a blue gradient."""
    for index in range(count):
        pixels = np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)
        pixels[..., 2] = np.linspace(20, 60, HEIGHT)[:, None]
        pixels[10:20, 5 * index : 5 * index + 5] = [230, 40, 30]
        stream = io.BytesIO()
        Image.fromarray(pixels).save(stream, "PNG")
        yield stream.getvalue()


def place(picture: Image.Image) -> float:
    """Mean column of what is red."""
    pixels = np.asarray(picture.convert("RGB")).astype(int)
    return float(np.flatnonzero((pixels[15, :, 0] > 140) & (pixels[15, :, 2] < 120)).mean())


def test_a_gif_shows_every_picture_for_its_time_and_repeats(tmp_path: Path) -> None:
    save_video(tmp_path / "v.gif", pictures(), 12.5)
    with Image.open(tmp_path / "v.gif") as film:
        assert film.info["loop"] == 0
        frames = [(frame.info["duration"], frame.copy()) for frame in ImageSequence.Iterator(film)]
    assert [duration for duration, _ in frames] == [80] * COUNT
    assert [place(frame) for _, frame in frames] == [5.0 * k + 2.0 for k in range(COUNT)]
    first = np.asarray(Image.open(io.BytesIO(next(pictures()))).convert("RGB")).astype(int)
    shown = np.asarray(frames[0][1].convert("RGB")).astype(int)
    assert np.abs(shown - first).max() <= 16  # colours as they were
    assert os.listdir(tmp_path) == ["v.gif"]


@ffmpeg_only
def test_an_mp4_plays_everywhere(tmp_path: Path) -> None:
    """H.264, 4:2:0, even sides, its index at the front, every picture there in order."""
    file = tmp_path / "v.mp4"
    save_video(file, pictures(), 25.0)
    words = ["ffprobe", "-v", "error", "-count_frames", "-show_streams", "-of", "json", str(file)]
    stream = json.loads(subprocess.run(words, capture_output=True, check=True).stdout)["streams"][0]
    assert (stream["codec_name"], stream["pix_fmt"]) == ("h264", "yuv420p")
    assert (stream["width"], stream["height"]) == (WIDTH + 1, HEIGHT)
    assert (stream["nb_read_frames"], stream["avg_frame_rate"]) == (str(COUNT), "25/1")
    content = file.read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")
    words = ["ffmpeg", "-v", "error", "-i", str(file), "-f", "image2", str(tmp_path / "%02d.png")]
    subprocess.run(words, check=True)
    files = sorted(tmp_path.glob("*.png"))
    assert [place(Image.open(one)) for one in files] == pytest.approx(
        [5.0 * k + 2.0 for k in range(COUNT)], abs=1.0
    )


def test_motions_are_shown_in_real_time_or_sped_up_by_a_round_number() -> None:
    gif = Path("v.gif")
    short = takes(gif, 10.0)
    assert (short.speed, short.rate, len(short.times)) == (1.0, 20.0, 201)
    long = takes(gif, 100.0)
    assert (long.speed, len(long.times), long.times[-1]) == (8.0, 251, 100.0)
    assert np.diff(long.times) == pytest.approx(0.4)
    assert long.duration == pytest.approx(12.55)
    for duration in (0.0, 0.01, 14.9, 15.1, 33.0, 1e5):
        chosen = takes(gif, duration)
        assert (chosen.times[0], chosen.times[-1]) == (0.0, duration)
        assert chosen.duration <= 15.1
        assert all(late > early for early, late in itertools.pairwise(chosen.times))
    slow = takes(gif, 10.0, 12.5, 0.5)
    assert (slow.rate, slow.speed, len(slow.times)) == (12.5, 0.5, 251)
    assert takes(gif, 10.0, 30.0).rate == pytest.approx(100 / 3)  # what a GIF can tell
    assert takes(gif, 10.0, 90.0).rate == 50.0


@pytest.mark.parametrize(
    ("name", "rate", "speed", "words"),
    [
        ("v.webm", None, None, "a .gif or .mp4 file"),
        ("gif", None, None, "a .gif or .mp4 file"),
        ("v.gif", 0.0, None, "fps: 0 was given"),
        ("v.gif", float("nan"), None, "fps: nan was given"),
        ("v.gif", 101.0, None, "100 at most"),
        ("v.gif", None, -1.0, "speed: -1 was given"),
        ("v.gif", 25.0, 0.1, "25,001 pictures would be needed"),
    ],
)
def test_what_makes_no_video_is_refused(
    name: str, rate: float | None, speed: float | None, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        takes(Path(name), 100.0, rate, speed)


def test_without_ffmpeg_a_gif_is_offered(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    for attempt in (
        lambda: takes(tmp_path / "v.mp4", 10.0),
        lambda: save_video(tmp_path / "v.mp4", pictures(), 20.0),
    ):
        with pytest.raises(InputError, match="ffmpeg, which is not on PATH") as caught:
            attempt()
        assert ".gif" in caught.value.accepted
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("name", ["v.gif", pytest.param("v.mp4", marks=ffmpeg_only)])
def test_pictures_that_fail_on_the_way_leave_no_file(name: str, tmp_path: Path) -> None:
    def failing() -> Iterator[bytes]:
        yield from pictures(3)
        raise InputError("video", "the browser ended by itself", "another one")

    with pytest.raises(InputError, match="the browser ended"):
        save_video(tmp_path / name, failing(), 20.0)
    assert os.listdir(tmp_path) == []


@ffmpeg_only
def test_an_ffmpeg_that_fails_is_told_in_its_own_words(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="ffmpeg failed: "):
        save_video(tmp_path / "v.mp4", [b"no picture"] * 3, 20.0)
    assert os.listdir(tmp_path) == []
