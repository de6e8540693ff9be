"""Videos of a page, made of its pictures."""

from __future__ import annotations

import io
import itertools
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from freefloat.concurrency import Progress
from freefloat.errors import InputError, finite_number
from freefloat.io.files import written_beside
from freefloat.visualization.page.pictures import SIZE, take_pictures
from freefloat.visualization.page.playback import Playback

_GIF_SIZE = 800, 450
"""Default size of GIFs [pixels]."""
_RATE = 20.0
_MAX_DURATION = 15.0
"""Longest video that is not sped up [s]."""
_MAX_FRAMES = 6000
_MAX_GIF_RATE = 50.0
"""Frames per second; browsers play faster GIFs at ten."""
_PALETTE_FRAMES = 8


@dataclass(frozen=True)
class FrameTimes:
    """Frame times of a video.

    Attributes:
        times: Times since the beginning of the motion [s].
        rate: Frames per second.
        speed: Seconds of the motion per second of the video.
    """

    times: tuple[float, ...]
    rate: float
    speed: float

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
    rate = _RATE if rate is None else _positive("fps", rate, 100.0)
    if kind == ".gif":  # frame durations are multiples of 0.01 s
        rate = 100.0 / max(round(100.0 / rate), 100.0 / _MAX_GIF_RATE)
    if speed is None:
        factors = (digit * 10.0**power for power in itertools.count() for digit in (1, 2, 4, 5, 8))
        speed = next(factor for factor in factors if factor >= duration / _MAX_DURATION)
    else:
        _positive("speed", speed, 1e6)
    step, count = speed / rate, math.ceil(duration * rate / speed - 1e-9) + 1
    if count > _MAX_FRAMES:
        accepted = f"at most {_MAX_FRAMES:,}: a smaller --fps or a larger --speed"
        raise InputError("video", f"the video has {count:,} frames", accepted)
    return FrameTimes(tuple(min(k * step, duration) for k in range(count)), rate, speed)


def _positive(key: str, value: float, most: float) -> float:
    accepted = f"a positive number, at most {most:g}"
    return finite_number(key, value, accepted, sys.float_info.min, most)


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
