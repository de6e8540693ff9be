"""Playback of motions and maps: in a file, a notebook's cell or a browser."""

from __future__ import annotations

import html
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import meshcat

from freefloat.errors import InputError, require_type
from freefloat.io.files import written_beside
from freefloat.motion.motion import Motion
from freefloat.planning.plan import Plan
from freefloat.planning.simulation import SimulatedBranch, Simulation
from freefloat.visualization.page import page
from freefloat.visualization.scene import motion_scene
from freefloat.visualization.scene_builder import ROOT, Scene
from freefloat.visualization.server import open_browser

if TYPE_CHECKING:  # imports compiled kernels
    from freefloat.planning.attitude_map import AttitudeMap

SIDE_BY_SIDE = "side by side"
_ACCEPTED = "a Motion, Plan, Simulation or AttitudeMap, or motions by name: a Motion for each name"


@dataclass(frozen=True, eq=False)
class Playback:
    """A scene, ready to be shown.

    Attributes:
        scene: What is shown.
    """

    scene: Scene = field(repr=False)

    @property
    def duration(self) -> float:
        """Duration of the longest motion [s]; zero where nothing moves."""
        return float(self.scene.about["duration"])

    @property
    def titles(self) -> tuple[str, ...]:
        """Titles of the motions, or of the arm branches of a map."""
        return tuple(scene["title"] for scene in self.scene.about["scenes"])

    @property
    def remarks(self) -> tuple[str, ...]:
        """What of the robot's URDF could not be drawn, such as missing meshes."""
        return tuple(self.scene.about["remarks"])

    def scene_duration(self, title: str | None = None) -> float:
        """Return the duration [s] of what has a title: the first when left out.

        Raises:
            InputError: If there is no such title.
        """
        ends = {scene["title"]: float(scene["end"]) for scene in self.scene.about["scenes"]}
        if len(ends) > 1:
            ends[SIDE_BY_SIDE] = self.duration
        title = next(iter(ends)) if title is None else title
        if title not in ends:
            raise InputError("scene", f"there is no {title!r}", ", ".join(ends))
        return ends[title]

    def html(self, opens: str | None = None) -> str:
        """Return the page as text; see :meth:`save`."""
        return page(self.scene, opens)

    def save(self, path: str | Path, opens: str | None = None) -> Path:
        """Write the page: one file that plays without a network.

        Args:
            path: The file.
            opens: Title of the motion shown first, or ``"side by side"``.

        Raises:
            InputError: If the file cannot be written.
        """
        with written_beside(Path(path)) as temporary:
            temporary.write_text(self.html(opens), encoding="utf-8")
        return Path(path)

    def show(self, height: int = 600) -> None:
        """Show the page in a notebook's cell; elsewhere write a temporary file and open it.

        Args:
            height: Of the cell [pixels].
        """
        if _in_notebook():
            from IPython.display import HTML, display

            display(HTML(self._cell(height)))  # type: ignore[no-untyped-call] # IPython has no types
            return
        folder = Path(tempfile.mkdtemp(prefix="freefloat-"))
        open_browser(self.save(folder / "playback.html").as_uri())

    def into(self, visualizer: meshcat.Visualizer) -> None:
        """Send the scene to a visualizer, whose own controls play the animation.

        Panels, labels, the growing trail and the choice of a motion exist on pages only.

        Args:
            visualizer: The scene appears below its path.
        """
        root = visualizer.path.lower()
        for command in self.scene.commands():
            for item in (command, *command.get("animations", ())):
                if item["path"].startswith(f"/{ROOT}/"):
                    item["path"] = root + item["path"].removeprefix(f"/{ROOT}")
            visualizer.window.send(SimpleNamespace(lower=lambda command=command: command))

    def _repr_html_(self) -> str:
        return self._cell(600)

    def _cell(self, height: int) -> str:
        style = f"width: 100%; height: {height}px; border: 0"
        return f'<iframe style="{style}" srcdoc="{html.escape(self.html())}"></iframe>'


def _in_notebook() -> bool:
    try:
        from IPython.core.getipython import get_ipython
    except ImportError:
        return False
    shell = get_ipython()
    return shell is not None and hasattr(shell, "kernel")


def show(result: Any, title: str = "freefloat", *, height: int = 600) -> None:
    """Show a result in a notebook's cell or a browser; see :func:`playback`."""
    playback(result, title).show(height)


def playback(
    result: Motion | Plan | Simulation | AttitudeMap | Mapping[str, Motion],
    title: str = "freefloat",
) -> Playback:
    """Return the playback of a result.

    Args:
        result: A motion; several by name; a plan, whose chosen motion is shown; a simulation, whose
            arm branches are shown; or a map over all attitudes.
        title: Of the page.

    Raises:
        InputError: If it is none of them, or a plan without a motion.
    """
    if isinstance(result, Motion | Plan | Simulation | Mapping):
        return Playback(motion_scene(_named_motions(result), title))
    from freefloat.planning.attitude_map import AttitudeMap
    from freefloat.visualization.map_scene import map_scene

    require_type("result", result, AttitudeMap, _ACCEPTED)
    return Playback(map_scene(result, title))


def _named_motions(result: Any) -> dict[str, Motion]:
    """Return the motions of a result by name; of a simulation the chosen one first.

    Raises:
        InputError: If there is none.
    """
    if isinstance(result, Motion):
        return {"motion": result}
    if isinstance(result, Plan):
        if result.chosen is None:
            problem = f"it has no motion to show: {result.reason}"
            raise InputError("plan", problem, "a feasible plan")
        return _by_title([result.chosen])
    if isinstance(result, Simulation):
        return _by_title(sorted(result.branches, key=lambda branch: branch is not result.chosen))
    require_type("result", result, Mapping, _ACCEPTED)
    for name, motion in result.items():
        accepted = "a Motion for each name, such as simulate(...).chosen.motion"
        require_type(f"motions.{name}", motion, Motion, accepted)
    return dict(result)


def _by_title(branches: list[SimulatedBranch]) -> dict[str, Motion]:
    motions: dict[str, Motion] = {}
    for branch in branches:
        title = branch.title if branch.title not in motions else f"{branch.title} ({len(motions)})"
        motions[title] = branch.motion
    return motions
