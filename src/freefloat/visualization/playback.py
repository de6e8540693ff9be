"""Playback of motions: in a file, a notebook, a browser, or a MeshCat visualizer at hand."""

from __future__ import annotations

import html
import tempfile
import webbrowser
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import umsgpack

from freefloat.brief import brief
from freefloat.errors import require_type
from freefloat.io.files import written_beside
from freefloat.motion.motion import Motion
from freefloat.visualization.page import Capture, page
from freefloat.visualization.scene import Recording, record
from freefloat.visualization.stage import ROOT


@dataclass(frozen=True, eq=False)
class Playback:
    """A recording, ready to be shown.

    Attributes:
        recording: What is shown.
    """

    __repr__ = brief

    recording: Recording

    @property
    def duration(self) -> float:
        """Of the longest motion [s]; zero where nothing moves."""
        return float(self.recording.about["duration"])

    @property
    def titles(self) -> tuple[str, ...]:
        """Of the motions."""
        return tuple(scene["title"] for scene in self.recording.about["scenes"])

    @property
    def remarks(self) -> tuple[str, ...]:
        """What could not be shown as the robot's file has it, such as missing meshes."""
        return tuple(self.recording.about["remarks"])

    def html(self, capture: Capture | None = None, opens: str | None = None) -> str:
        """The page as text; with a capture one that takes pictures."""
        return page(self.recording, capture, opens)

    def save(self, path: str | Path, opens: str | None = None) -> Path:
        """Write the page: one file that plays without a network.

        Args:
            path: The file.
            opens: Title of the motion shown first, or ``"side by side"``.

        Raises:
            InputError: If the file cannot be written.
        """
        with written_beside(Path(path)) as temporary:
            temporary.write_text(self.html(opens=opens), encoding="utf-8")
        return Path(path)

    def show(self, height: int = 600) -> None:
        """Show the page in a notebook; elsewhere write it to a temporary file and open that.

        Args:
            height: Of the cell in pixels.
        """
        if _in_notebook():
            from IPython.display import HTML, display

            display(HTML(self._cell(height)))  # type: ignore[no-untyped-call] # IPython has no types
            return
        folder = Path(tempfile.mkdtemp(prefix="freefloat-"))
        webbrowser.open(self.save(folder / "playback.html").as_uri())

    def _repr_html_(self) -> str:
        return self._cell(600)

    def _cell(self, height: int) -> str:
        style = f"width: 100%; height: {height}px; border: 0"
        return f'<iframe style="{style}" srcdoc="{html.escape(self.html())}"></iframe>'

    def into(self, visualizer: Any) -> None:
        """Send everything to a visualizer; its own controls play the animation.

        What a page adds is left out: words, the trail that grows, motions to choose among.

        Args:
            visualizer: A ``meshcat.Visualizer``; the scene appears below its path.
        """
        root, known = visualizer.path.lower(), {}
        for packed in self.recording.objects:
            command = umsgpack.unpackb(packed)
            if command["type"] == "set_object":
                known[command["path"]] = command
            visualizer.window.send(_Command(_moved(command, root)))
        for source, target in self.recording.copies:
            command = {**known[f"/{source}"], "path": f"/{target}"}
            visualizer.window.send(_Command(_moved(command, root)))
        if self.recording.animation is not None:
            command = umsgpack.unpackb(self.recording.animation)
            clips = [_moved(clip, root) for clip in command["animations"]]
            visualizer.window.send(_Command({**command, "animations": clips}))


@dataclass(frozen=True)
class _Command:
    """A command as MeshCat's windows want it."""

    content: dict[str, Any]

    def lower(self) -> dict[str, Any]:
        return self.content


def _moved(command: dict[str, Any], root: str) -> dict[str, Any]:
    """A command whose path begins at another root than ours."""
    path = command["path"]
    if path.startswith(f"/{ROOT}/"):
        path = root + path.removeprefix(f"/{ROOT}")
    return {**command, "path": path}


def _in_notebook() -> bool:
    try:
        from IPython.core.getipython import get_ipython
    except ImportError:
        return False
    shell = get_ipython()
    return shell is not None and hasattr(shell, "kernel")


_BY_NAME = "a Motion for each name, such as simulate(...).chosen.motion"


@runtime_checkable
class NamesMotions(Protocol):
    """What has motions to show: plans, simulations, plans read from files."""

    def named_motions(self) -> Mapping[str, Motion]:
        """Motions by name.

        Raises:
            InputError: If there is none, telling why.
        """


def play(
    motions: Motion | NamesMotions | Mapping[str, Motion], title: str = "freefloat"
) -> Playback:
    """Prepare motions for showing.

    Args:
        motions: One; or several by name; or a plan, whose chosen motion is shown; or a simulation,
            whose arm branches are shown.
        title: Of the page.

    Raises:
        InputError: If it is none of them, or a plan without a motion.
    """
    if isinstance(motions, Motion):
        motions = {"motion": motions}
    elif isinstance(motions, NamesMotions):
        motions = motions.named_motions()
    accepted = "a Motion, Plan or Simulation, or motions by name: a Motion for each name"
    require_type("motions", motions, Mapping, accepted)
    for name, one in motions.items():
        require_type(f"motions.{name}", one, Motion, _BY_NAME)
    return Playback(record(motions, title))
