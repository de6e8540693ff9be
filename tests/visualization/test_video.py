"""Frame times, GIF and MP4 files."""

import io
import itertools
import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

import freefloat as ff
from freefloat.visualization.page.pictures import frame_times, write_gif, write_mp4
from tests.errors import error_key

COUNT, WIDTH, HEIGHT = 12, 61, 40
GIF = Path("v.gif")
ffmpeg_only = pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg here")


def pictures() -> Iterator[bytes]:
    """A red square that moves by five pixels a picture over a blue gradient."""
    for index in range(COUNT):
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
    write_gif(tmp_path / "v.gif", pictures(), 12.5)
    with Image.open(tmp_path / "v.gif") as film:
        assert film.info["loop"] == 0
        frames = [(frame.info["duration"], frame.copy()) for frame in ImageSequence.Iterator(film)]
    assert [duration for duration, _ in frames] == [80] * COUNT
    assert [place(frame) for _, frame in frames] == [5.0 * k + 2.0 for k in range(COUNT)]


@ffmpeg_only
def test_an_mp4_has_every_picture(tmp_path: Path) -> None:
    """H.264, 4:2:0, even sides."""
    file = tmp_path / "v.mp4"
    write_mp4(file, pictures(), 25.0)
    words = ["ffprobe", "-v", "error", "-count_frames", "-show_streams", "-of", "json", str(file)]
    stream = json.loads(subprocess.run(words, capture_output=True, check=True).stdout)["streams"][0]
    assert (stream["codec_name"], stream["pix_fmt"]) == ("h264", "yuv420p")
    assert (stream["width"], stream["height"]) == (WIDTH + 1, HEIGHT)
    assert (stream["nb_read_frames"], stream["avg_frame_rate"]) == (str(COUNT), "25/1")
    with pytest.raises(ff.InputError, match="ffmpeg failed"):
        write_mp4(file, [b"no picture"], 25.0)


def test_motions_are_shown_in_real_time_or_sped_up_by_a_round_number() -> None:
    short = frame_times(GIF, 10.0)
    assert (short.speed, short.rate, len(short.times)) == (1.0, 20.0, 201)
    long = frame_times(GIF, 100.0)
    assert (long.speed, len(long.times), long.times[-1]) == (8.0, 251, 100.0)
    assert np.diff(long.times) == pytest.approx(0.4)
    assert long.to_dict()["duration"] == pytest.approx(12.55)
    for duration in (0.0, 0.01, 14.9, 15.1, 33.0, 1e5):
        frames = frame_times(GIF, duration)
        assert (frames.times[0], frames.times[-1]) == (0.0, duration)
        assert frames.to_dict()["duration"] <= 15.1
        assert all(late > early for early, late in itertools.pairwise(frames.times))
    slow = frame_times(GIF, 10.0, 12.5, 0.5)
    assert (slow.rate, slow.speed, len(slow.times)) == (12.5, 0.5, 251)
    assert frame_times(GIF, 10.0, 30.0).rate == pytest.approx(100 / 3)
    assert frame_times(GIF, 10.0, 90.0).rate == 50.0


@pytest.mark.parametrize(
    ("name", "rate", "speed", "key"),
    [
        ("v.webm", None, None, "video"),
        ("v.gif", float("nan"), None, "fps"),
        ("v.gif", 101.0, None, "fps"),
        ("v.gif", None, -1.0, "speed"),
        ("v.gif", 25.0, 0.1, "video"),
    ],
)
def test_impossible_videos_are_refused(name, rate, speed, key):
    assert error_key(frame_times, Path(name), 100.0, rate, speed) == key


def test_mp4_needs_ffmpeg(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ff.InputError, match="ffmpeg"):
        frame_times(tmp_path / "v.mp4", 10.0)
