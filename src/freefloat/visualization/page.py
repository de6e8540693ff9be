"""One self-contained page around a recording: it plays from a file, without a network."""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import meshcat

from freefloat.visualization.scene import Recording

_LEVEL = 6
"""Of gzip: more takes longer and gains a percent."""


@dataclass(frozen=True)
class Capture:
    """Makes a page send pictures of itself to the server it came from.

    The page posts a PNG to ``address/0``, ``address/1`` and so on; or what failed, in words, to
    ``address/error``.

    Attributes:
        times: When to take a picture [s].
        width: In pixels.
        height: In pixels.
        address: Path on the server.
        motion: Title of the motion to show, or ``"side by side"``; the first when left out.
    """

    times: tuple[float, ...]
    width: int
    height: int
    address: str
    motion: str | None = None


def page(recording: Recording, capture: Capture | None = None, opens: str | None = None) -> str:
    """The page as HTML text.

    It may not load anything from anywhere: its content security policy says so to the browser.

    Args:
        recording: What it shows.
        capture: Pictures to take, for a page that comes from a server.
        opens: Title of the motion shown first, or ``"side by side"``; the first when left out.
    """
    about = {
        **recording.about,
        "copies": recording.copies,
        "capture": None if capture is None else asdict(capture),
        "opens": opens,
    }
    parts = {
        "TITLE": html.escape(str(recording.about["title"])),
        "LICENCES": _licences(),
        "CONNECT": "data: blob:" + ("" if capture is None else " 'self'"),
        "VIEWER": _viewer(),
        "SCENE": _packed(recording.objects),
        "TRACKS": _packed([] if recording.animation is None else [recording.animation]),
        "ABOUT": _json(about),
        "PLAYER": _own("player.js"),
    }
    return re.sub("@([A-Z]+)@", lambda match: parts[match[1]], _own("page.html"))


def _packed(commands: Iterable[bytes]) -> str:
    """Commands, each after its length, compressed; nothing for none."""
    raw = b"".join(len(command).to_bytes(4, "little") + command for command in commands)
    return base64.b64encode(gzip.compress(raw, _LEVEL, mtime=0)).decode() if raw else ""


def _json(about: dict[str, Any]) -> str:
    """JSON inside a script: no name may end it."""
    return json.dumps(about, allow_nan=False).replace("<", "\\u003c")


def _own(name: str) -> str:
    return files("freefloat.visualization").joinpath(name).read_text(encoding="utf-8")


@cache
def _viewer() -> str:
    return (_meshcat() / "dist" / "main.min.js").read_text(encoding="utf-8")


def _licences() -> str:
    """What MeshCat and what it is made of ask to be told, as the text of a comment."""
    names = ("LICENSE", "dist/main.min.js.LICENSE.txt")
    texts = [(_meshcat() / name).read_text(encoding="utf-8") for name in names]
    return "MeshCat\n\n" + "\n".join(texts).replace("--", "- -")


def _meshcat() -> Path:
    return Path(meshcat.viewer_assets_path())
