"""A self-contained page that plays a scene from a file, without a network."""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
from collections.abc import Iterable
from functools import cache
from importlib.resources import files
from pathlib import Path

import meshcat

from freefloat.visualization.scene_builder import Scene


def page(scene: Scene, opens: str | None = None) -> str:
    """Return the page as HTML text; its content security policy forbids all requests.

    Args:
        scene: What it shows.
        opens: Title of what is shown first, or ``"side by side"``; the first when left out.
    """
    about = {**scene.about, "copies": scene.copies, "opens": opens}
    parts = {
        "TITLE": html.escape(str(scene.about["title"])),
        "LICENCES": _licences(),
        "VIEWER": _viewer(),
        "SCENE": _packed(scene.objects),
        "TRACKS": _packed([] if scene.animation is None else [scene.animation]),
        "ABOUT": json.dumps(about, allow_nan=False).replace("<", "\\u003c"),
        "PLAYER": _text("player.js"),
    }
    return re.sub("@([A-Z]+)@", lambda match: parts[match[1]], _text("page.html"))


def _packed(commands: Iterable[bytes]) -> str:
    """Commands, each after its length, compressed; an empty text for none."""
    raw = b"".join(len(command).to_bytes(4, "little") + command for command in commands)
    return base64.b64encode(gzip.compress(raw, 6, mtime=0)).decode() if raw else ""


def _text(name: str) -> str:
    return files("freefloat.visualization").joinpath(name).read_text(encoding="utf-8")


@cache
def _viewer() -> str:
    return (_meshcat() / "dist" / "main.min.js").read_text(encoding="utf-8")


def _licences() -> str:
    """Licences of MeshCat and of what it bundles, as the text of a comment."""
    names = ("LICENSE", "dist/main.min.js.LICENSE.txt")
    texts = [(_meshcat() / name).read_text(encoding="utf-8") for name in names]
    return "MeshCat\n\n" + "\n".join(texts).replace("--", "- -")


def _meshcat() -> Path:
    return Path(meshcat.viewer_assets_path())
