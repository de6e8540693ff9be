"""Videos of pictures: GIF by Pillow, MP4 by ffmpeg, and which instants they show."""

from __future__ import annotations

import io
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

from freefloat.errors import InputError
from freefloat.io.files import written_beside

_RATE = 20.0
"""Pictures a second unless asked otherwise; one that GIF can tell, in hundredths of a second."""
_LONGEST = 15.0
"""Seconds that a video may take before it is sped up."""
_MOST = 6000
"""Pictures in a video."""
_FASTEST_GIF = 50.0
"""Pictures a second; browsers slow down faster ones to ten."""
_LOOKS = 8
"""Pictures that a GIF's colours are chosen from."""
_COARSE = 3
"""Bits of a colour that are too fine to tell it from others."""
_ENDINGS = (".gif", ".mp4")


@dataclass(frozen=True)
class Takes:
    """Which instants a video shows, and how fast.

    Attributes:
        times: Of the motion [s].
        rate: Pictures a second.
        speed: Seconds of the motion in a second of the video.
    """

    times: tuple[float, ...]
    rate: float
    speed: float

    @property
    def duration(self) -> float:
        """Of the video [s]."""
        return len(self.times) / self.rate


def takes(
    file: Path, duration: float, rate: float | None = None, speed: float | None = None
) -> Takes:
    """Choose the instants of a video.

    In real time, unless that would take more than a quarter of a minute: then 2, 4, 5, 8, 10, 20
    and so on times faster. The last instant is always the end of the motion.

    Args:
        file: The video.
        duration: Of the motion [s].
        rate: Pictures a second, 20 when left out.
        speed: Seconds of the motion in a second of the video.

    Raises:
        InputError: If a number is out of reason, the file is of an unknown kind, or ffmpeg is
            needed and missing.
    """
    kind = _kind(file)
    wanted = _RATE if rate is None else _positive("fps", rate, 100.0)
    if kind == ".gif":
        wanted = 100.0 / max(round(100.0 / wanted), 100.0 / _FASTEST_GIF)
    pace = _pace(duration) if speed is None else _positive("speed", speed, 1e6)
    step = pace / wanted
    count = math.ceil(duration / step - 1e-9) + 1
    if count > _MOST:
        told = f"{count:,} pictures would be needed"
        raise InputError("video", told, f"{_MOST:,} at most: a smaller --fps or a larger --speed")
    return Takes(tuple(min(k * step, duration) for k in range(count)), wanted, pace)


def _positive(key: str, given: float, most: float) -> float:
    if not 0.0 < given <= most:
        raise InputError(key, f"{given:g} was given", f"a positive number, {most:g} at most")
    return given


def _pace(duration: float) -> float:
    """The smallest round speed-up that makes a motion short enough."""
    wanted, power = duration / _LONGEST, 1.0
    while True:
        for round_number in (1.0, 2.0, 4.0, 5.0, 8.0):
            if round_number * power >= wanted:
                return round_number * power
        power *= 10.0


def _kind(file: Path) -> str:
    kind = file.suffix.lower()
    if kind not in _ENDINGS:
        raise InputError("video", f"{file.name} is of no kind known here", "a .gif or .mp4 file")
    if kind == ".mp4" and shutil.which("ffmpeg") is None:
        raise InputError(
            "video", "MP4 needs the program ffmpeg, which is not on PATH",
            "install it (such as apt install ffmpeg), or a .gif file",
        )  # fmt: skip
    return kind


def save_video(file: Path, pictures: Iterable[bytes], rate: float) -> None:
    """Write a video: whole or not at all.

    Args:
        file: Its ending says which kind, ``.gif`` (which repeats for ever) or ``.mp4`` (H.264,
            which needs the program ffmpeg).
        pictures: PNG files, all of one size, taken one by one.
        rate: Pictures a second.

    Raises:
        InputError: If the file cannot be written, is of an unknown kind, or ffmpeg fails or is
            missing.
    """
    write = {".gif": _write_gif, ".mp4": _write_mp4}[_kind(file)]
    with written_beside(file) as temporary:
        write(temporary, pictures, rate)


def _write_gif(file: Path, pictures: Iterable[bytes], rate: float) -> None:
    """All pictures share their colours, or they would flicker; so all are taken first."""
    stored = list(pictures)
    looks = [_image(stored[k * (len(stored) - 1) // _LOOKS]) for k in range(_LOOKS + 1)]
    palette = _palette(np.concatenate([np.asarray(look).reshape(-1, 3) for look in looks]))

    def reduced(picture: bytes) -> Image.Image:
        return _image(picture).quantize(palette=palette, dither=Image.Dither.NONE)

    reduced(stored[0]).save(
        file, "GIF", save_all=True, append_images=map(reduced, stored[1:]), loop=0,
        duration=round(1000.0 / rate), optimize=False,
    )  # fmt: skip


def _palette(pixels: npt.NDArray[np.uint8]) -> Image.Image:
    """256 colours for some pixels, shape (K, 3).

    The sky is nearly all of a picture, and what matters are a few bright lines: a colour's weight
    is the fourth root of how often it is seen.
    """
    bins, place, counts = np.unique(
        pixels >> _COARSE, axis=0, return_inverse=True, return_counts=True
    )
    sums = [np.bincount(place.ravel(), pixels[:, k], len(bins)) for k in range(3)]
    means = np.rint(np.column_stack(sums) / counts[:, None]).astype(np.uint8)
    row = np.repeat(means, np.ceil(counts**0.25).astype(int), axis=0)
    return Image.fromarray(row[None]).quantize(256, Image.Quantize.MEDIANCUT, kmeans=3)


def _image(picture: bytes) -> Image.Image:
    return Image.open(io.BytesIO(picture)).convert("RGB")


def _write_mp4(file: Path, pictures: Iterable[bytes], rate: float) -> None:
    with _ffmpeg(file, rate) as process:
        for picture in pictures:
            if process.stdin is None or process.poll() is not None:
                break
            with suppress(BrokenPipeError):
                process.stdin.write(picture)


@contextmanager
def _ffmpeg(file: Path, rate: float) -> Iterator[subprocess.Popen[bytes]]:
    """An ffmpeg that reads PNG files; ended, or made to, with the block."""
    program = [
        *("ffmpeg", "-loglevel", "error", "-nostdin", "-y"),
        *("-f", "image2pipe", "-c:v", "png", "-framerate", repr(rate), "-i", "-"),
        *("-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p"),
        *("-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-movflags", "+faststart"),
        *("-f", "mp4", os.fspath(file.resolve())),
    ]
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(
            program, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=log,
            start_new_session=True,  # Ctrl-C is this program's to handle
        )  # fmt: skip
        try:
            yield process
            if process.stdin is not None:
                with suppress(BrokenPipeError):
                    process.stdin.close()
            status = process.wait()
        finally:
            process.kill()
            process.wait()
            if process.stdin is not None:
                with suppress(OSError):
                    process.stdin.close()
        if status != 0:
            log.seek(0)
            lines = log.read().decode(errors="replace").strip().splitlines()
            told = lines[-1][:300] if lines else f"exit code {status}"
            raise InputError("video", f"ffmpeg failed: {told}", "an ffmpeg with H.264, or a .gif")
