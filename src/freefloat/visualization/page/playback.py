"""Pages that play motions and show maps: files, notebook cells, a browser."""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
import sys
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from freefloat.errors import InputError, require_type
from freefloat.io.files import written_beside
from freefloat.kinds import kind_of, named
from freefloat.motion.motion import Motion
from freefloat.planning.answer import Answer
from freefloat.planning.margin_map import MarginMap
from freefloat.visualization.page.server import open_browser
from freefloat.visualization.scenes import meshcat
from freefloat.visualization.scenes.description import Samples
from freefloat.visualization.scenes.scene import motion_scene
from freefloat.visualization.scenes.scene_builder import ROOT, PageScene

SIDE_BY_SIDE, ALL_PHASES = "side by side", "all phases"
_HERE = Path(__file__).parent
_MESHCAT = Path(meshcat.viewer_assets_path())
VIEWER, PLAYER = _MESHCAT / "dist" / "main.min.js", sorted(_HERE.glob("*.js"))
"""Scripts of pages: MeshCat's viewer, and those that play a scene with it."""


@dataclass(frozen=True, eq=False)
class Playback:
    """A scene and its page.

    Attributes:
        scene: The scene.
    """

    scene: PageScene = field(repr=False)

    @property
    def duration(self) -> float:
        """Duration of the longest motion [s]; zero for a map."""
        return self.scene.description.duration

    @property
    def titles(self) -> tuple[str, ...]:
        """Titles of the motions, or of a map's arm branches."""
        return tuple(scene.title for scene in self.scene.description.scenes)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Visuals of the robot's URDF that cannot be drawn, such as missing meshes."""
        return self.scene.description.remarks

    def scene_title(self, name: str | None) -> str | None:
        """The title of a scene from its end, such as ``berth`` for ``6 berth``, if that is unique.

        Another name, and None, are returned as they are.
        """
        titles = [title for title in self.titles if title.endswith(f" {name}")]
        return titles[0] if len(titles) == 1 and name not in self.titles else name

    def scene_times(self, title: str | None = None) -> tuple[float, float]:
        """Times of the page [s] from which to which a motion lasts, by default the first.

        The clocks show them after the ``start`` of the scene's description.

        Raises:
            InputError: If the title is unknown.
        """
        scenes, span = self.scene.description.scenes, (0.0, self.duration)
        times = {scene.title: (scene.begin, scene.end) for scene in scenes}
        if self.scene.description.sequence:
            times = {ALL_PHASES: span, **times}
        elif len(times) > 1:
            times[SIDE_BY_SIDE] = span
        title = next(iter(times)) if title is None else title
        if title not in times:
            raise InputError("scene", f"there is no {title!r}", ", ".join(times))
        return times[title]

    def html(self, opens: str | None = None) -> str:
        """The page as HTML text; its content security policy forbids all requests.

        Args:
            opens: Title of the motion shown first, or ``"side by side"``.
        """
        parts = self.parts(opens)
        texts = {
            "TITLE": html.escape(self.scene.description.title),
            "LICENCES": licences(),
            "VIEWER": VIEWER.read_text(encoding="utf-8"),
            **{key.upper(): parts[key] for key in ("scene", "tracks", "samples")},
            "ABOUT": json.dumps(parts["about"], allow_nan=False).replace("<", "\\u003c"),
            "PLAYER": "\n".join(file.read_text(encoding="utf-8") for file in PLAYER),
        }
        page = (_HERE / "page.html").read_text(encoding="utf-8")
        return re.sub("@([A-Z]+)@", lambda match: texts[match[1]], page)

    def parts(self, opens: str | None = None) -> dict[str, Any]:
        """What the scripts play: the description ``about``, and packed commands.

        Args:
            opens: As for :meth:`html`.
        """
        description, animation = self.scene.description, self.scene.animation
        samples = description.samples
        return {
            "about": {**description.to_dict(), "copies": self.scene.copies, "opens": opens},
            "scene": _packed(self.scene.objects),
            "tracks": _packed([] if animation is None else [animation]),
            "samples": _packed([] if samples is None else _floats(samples)),
        }

    def save(self, path: str | Path, opens: str | None = None) -> Path:
        """Write the page to a file, which needs no network, and return its path.

        Args:
            path: HTML file.
            opens: Title of the motion shown first, or ``"side by side"``.

        Raises:
            InputError: If the file cannot be written.
        """
        with written_beside(Path(path)) as temporary:
            temporary.write_text(self.html(opens), encoding="utf-8")
        return Path(path)

    def show(self, height: int = 600) -> None:
        """Show the page in a notebook cell, or write a temporary file and open a browser.

        Args:
            height: Height of the cell [pixels].
        """
        ipython = sys.modules.get("IPython")  # which notebooks have imported
        if ipython is not None and hasattr(ipython.get_ipython(), "kernel"):
            ipython.display.display(ipython.display.HTML(self._repr_html_(height)))
            return
        folder = Path(tempfile.mkdtemp(prefix="freefloat-"))
        open_browser(self.save(folder / "playback.html").as_uri())

    def into(self, visualizer: meshcat.Visualizer) -> None:
        """Send the scene to a visualizer, which shows the first instant and plays the animation.

        Panels, labels, the growing trail and the choice of a motion exist on pages only.

        Args:
            visualizer: Visualizer of MeshCat, such as ``meshcat.Visualizer()["plan"]``; its path
                becomes the root of the scene.

        Raises:
            InputError: If it is another object.
        """
        accepted = "a meshcat.Visualizer, such as meshcat.Visualizer()['plan']"
        require_type("viewer", visualizer, meshcat.Visualizer, accepted)
        root = visualizer.path.lower()
        for command in self.scene.commands():
            if "animations" in command:
                command["options"]["play"] = True
            for item in (command, *command.get("animations", ())):
                if item["path"].startswith(f"/{ROOT}/"):
                    item["path"] = root + item["path"].removeprefix(f"/{ROOT}")
            visualizer.window.send(SimpleNamespace(lower=lambda command=command: command))

    def _repr_html_(self, height: int = 600) -> str:
        style = f"width: 100%; height: {height}px; border: 0"
        frame = f'<iframe style="{style}" srcdoc="{html.escape(self.html())}"></iframe>'
        return f"<div>{frame}</div>"  # IPython warns of a lone frame


def _packed(commands: Iterable[bytes]) -> str:
    """Commands, each after its length, compressed; an empty text without commands."""
    raw = b"".join(len(command).to_bytes(4, "little") + command for command in commands)
    return base64.b64encode(gzip.compress(raw, 6, mtime=0)).decode() if raw else ""


def _floats(samples: Samples) -> list[bytes]:
    """Points and margins of a map in single precision."""
    arrays = samples.points, samples.margins
    return [np.ascontiguousarray(array, dtype="<f4").tobytes() for array in arrays]


def licences() -> str:
    """Licences of MeshCat and of the code in it, as the text of a comment."""
    names = ("LICENSE", "dist/main.min.js.LICENSE.txt")
    texts = [(_MESHCAT / name).read_text(encoding="utf-8") for name in names]
    return "MeshCat\n\n" + "\n".join(texts).replace("--", "- -")


def show(
    result: Any,
    viewer: meshcat.Visualizer | None = None,
    *,
    title: str = "freefloat",
    height: int = 600,
) -> None:
    """Show a result in a notebook cell or a browser, or play it in a visualizer of MeshCat.

    Args:
        result: As for :func:`playback`.
        viewer: Visualizer, see :meth:`Playback.into`; a page is shown when left out.
        title: Title of the page.
        height: Height of a notebook's cell [pixels].

    Raises:
        InputError: As for :func:`playback`, or if the viewer is another object.

    Example:
        >>> ff.show(ff.plan(ff.load_scenario("planar_2dof/line").problem()))
    """
    played = playback(result, title)
    if viewer is None:
        played.show(height)
    else:
        played.into(viewer)


def playback(
    result: Answer | MarginMap | Motion | Mapping[str, Motion] | Any, title: str = "freefloat"
) -> Playback:
    """The playback of a result.

    Args:
        result: A motion, motions by name, a plan (its chosen motion), a manoeuvre (its phases one
            after another), a simulation (its arm branches), a motion to a goal or a map; see
            :func:`singularity_scene` for maps of the joint space. Limits of pointing are drawn with
            plans, manoeuvres and simulations.
        title: Title of the page.

    Raises:
        InputError: If the result is of another class, or a plan without a motion.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> playback = ff.playback(ff.simulate(problem, [0.0, 0.0, 0.0, 1.0]))
        >>> playback.titles
        ('branch 0 elbow+', 'branch 1 elbow-')
    """
    require_type("title", title, str, "text")
    match result:
        case Mapping():
            for name, motion in result.items():
                accepted = "a Motion for each name, such as simulate(...).chosen.motion"
                require_type(f"motions.{name}", motion, Motion, accepted)
            return Playback(motion_scene(result, title))
    return Playback(named(kind_of(result).scene)(result, title))
