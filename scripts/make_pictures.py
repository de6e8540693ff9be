"""Make the pictures of README and docs in ``docs/pictures``.

Usage: ``python scripts/make_pictures.py [NAME ...]``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from signal import SIGINT
from subprocess import PIPE, Popen
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from playwright.sync_api import ViewportSize, sync_playwright

import freefloat as ff
from freefloat.io.files import written_beside
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.regions.workspace import exact_workspace
from freefloat.so3 import heading_quaternion
from freefloat.visualization.figure_style import PAGE, new_figure, save_figures, styled
from freefloat.visualization.motion_figures import motion_figures
from freefloat.visualization.page.pictures import find_browser, take_pictures, write_gif
from freefloat.visualization.planar_figures import joint_space_figure
from freefloat.visualization.scene_figures import draw_snapshots

DOTS = 120
"""Dots per inch."""
FOLDER = Path(__file__).resolve().parents[1] / "docs" / "pictures"
HEADINGS = (200.0, 140.0)
"""Figs. 7 and 6 of the paper: the first is feasible, the second becomes singular [deg]."""
TANGENT = [0.46008, 0.09337, 0.73519, -0.48898]
"""The initial attitude of Figs. 10 and 11, whose motion is tangent to the margin surface."""


def example_1() -> tuple[Problem, list[Motion]]:
    """The planar example, simulated from both headings with the paper's arm branch."""
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    starts = [heading_quaternion(np.deg2rad(heading)) for heading in HEADINGS]
    return problem, [ff.simulate(problem, start, branch=0).chosen.motion for start in starts]


TURNED = {"turned by −20° about y": [0.0, -0.1736, 0.0, 0.9848],
          "turned by −20° about x": [-0.1736, 0.0, 0.0, 0.9848]}  # fmt: skip
"""Initial attitudes of the UR5 on a servicer: from the first an arm branch follows its path, from
the second it is at a dynamic singularity after 29 s; neither motion has contact."""
SIZE = (1200, 560)
WINDOW = ViewportSize(width=1200, height=700)
BROWSER = ["--no-sandbox", "--enable-unsafe-swiftshader"]
SMALL, FRAMES, RATE = (840, 392), 40, 8.0
"""Animation: size [pixels], frames before the pause, frames per second."""


@styled
def snapshots() -> Figure:
    """Figs. 6 and 7 side by side."""
    problem, (feasible, singular) = example_1()
    workspace = exact_workspace(problem)
    figure = new_figure(PAGE, 4.35)
    panels = figure.subplots(1, 2, sharey=True)
    for axes, motion, heading in zip(panels, (singular, feasible), HEADINGS[::-1], strict=True):
        draw_snapshots(axes, motion, workspace)
        axes.text(0.02, 0.98, f"from {heading:g}°", transform=axes.transAxes, va="top")
    panels[1].set_ylabel("")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=(len(handles) + 1) // 2)
    return figure


def joint_space() -> Figure:
    """Fig. 3, with the motions of Figs. 6 and 7."""
    return joint_space_figure(*example_1())


def motion() -> Figure:
    """Fig. 11: the motion of Example 2 from the attitude of the touch point."""
    problem = ff.load_scenario("spatial_6dof/line").problem()
    chosen = ff.simulate(problem, TANGENT, branch=2).chosen
    return motion_figures(chosen.motion, chosen.closest_approach)["motion"]


def page_of_two() -> str:
    """The page of the same path of a UR5 from two attitudes, side by side."""
    problem = ff.load_scenario("ur5_servicer/arc").problem()
    shown = {
        name: ff.simulate(problem, attitude, branch=4).chosen.motion
        for name, attitude in TURNED.items()
    }
    return ff.playback(shown).html("side by side")


def screenshot(address: str, ready: str, change: str, file: Path) -> Path:
    """What a browser shows at an address after an expression is true and another was evaluated."""
    with (
        sync_playwright() as playwright,
        playwright.chromium.launch(executable_path=find_browser(), args=BROWSER) as browser,
        written_beside(file) as temporary,
    ):
        page = browser.new_page(viewport=WINDOW, bypass_csp=True)
        page.goto(address)
        page.wait_for_function(ready, timeout=120_000)
        page.evaluate(change)
        page.wait_for_timeout(500)
        temporary.write_bytes(page.screenshot())
    return file


def playback() -> Path:
    """The page when one of the motions is about to become singular."""
    with TemporaryDirectory() as folder:
        page = Path(folder) / "page.html"
        page.write_text(page_of_two(), encoding="utf-8")
        change = "freefloat.seek(26)"
        return screenshot(page.as_uri(), "window.freefloat", change, FOLDER / "playback.png")


def studio() -> Path:
    """The studio when all is computed."""
    command = [sys.executable, "-m", "freefloat", "studio", "--no-open", "--port", "0"]
    with (
        TemporaryDirectory() as folder,
        Popen(command, stdout=PIPE, text=True, cwd=folder) as server,
    ):
        address = server.stdout.readline().split()[0] if server.stdout else ""
        ready = "studio.player && element('status').textContent === 'ready'"
        try:
            return screenshot(address, ready, "studio.player.seek(40)", FOLDER / "studio.png")
        finally:
            server.send_signal(SIGINT)


def scene(name: str) -> Path:
    """The page of a result."""
    result, time = SCENES[name]
    file = FOLDER / f"{name}.png"
    (picture,) = take_pictures(ff.playback(result()).html(), [time], SIZE)
    with written_beside(file) as temporary:
        temporary.write_bytes(picture)
    return file


def gallery(name: str) -> Figure:
    """A figure of a result as commands with ``--plots`` draw it."""
    return ff.figures(GALLERY[name]())[name]


def plan(name: str) -> Any:
    """What is planned for a bundled scenario."""
    return ff.load_scenario(name).plan()


def simulated(name: str, attitude: Sequence[float]) -> ff.Simulation:
    """The motion of a bundled scenario from an attitude."""
    return ff.load_scenario(name).simulate(attitude)


def singular_regions() -> ff.SingularityMap:
    """The certified map of the joint space of the spatial robot."""
    model = ff.load_scenario("spatial_6dof/line").problem().model
    return ff.singularity_map(model, "pose", np.radians(5.0))


GALLERY: dict[str, Callable[[], Any]] = {
    "headings": lambda: plan("planar_3dof/parabola"),
    "map_slices": lambda: plan("spatial_6dof/line"),
    "map_histogram": lambda: plan("spatial_6dof/line"),
    "workspace": lambda: plan("spatial_6dof/line"),
    "margin": lambda: simulated("ur5_servicer/arc", TURNED["turned by −20° about y"]),
    "angles": lambda: plan("servicing/inspect_client"),
    "slices": singular_regions,
    "manoeuvre": lambda: plan("servicing/capture_client"),
}
"""Results whose figures with these names are in the gallery."""
SCENES: dict[str, tuple[Callable[[], Any], float]] = {
    "capture": (lambda: plan("servicing/capture_client"), 80.0),
    "mission": (lambda: plan("servicing/inspect_client"), 45.0),
    "ball": (lambda: plan("spatial_6dof/line").map, 0.0),
    "surfaces": (singular_regions, 0.0),
    "two_arms": (lambda: simulated("servicing/two_arms", [0.0, 0.0, 0.0, 1.0]), 20.0),
}
"""Results whose pages are shown, and the time [s] of the picture."""


def door() -> Path:
    """Animation of the page, the first picture of README."""
    file = FOLDER / "door.gif"
    times = np.concatenate([np.linspace(0.0, 40.0, FRAMES), np.full(FRAMES // 4, 40.0)])
    write_gif(file, take_pictures(page_of_two(), times.tolist(), SMALL, scene="side by side"), RATE)
    return file


PICTURES: dict[str, Callable[[], Figure | Path]] = {
    "door": door,
    "playback": playback,
    "studio": studio,
    "snapshots": snapshots,
    "joint_space": joint_space,
    "motion": motion,
    **{name: partial(gallery, name) for name in GALLERY},
    **{name: partial(scene, name) for name in SCENES},
}


def main(names: list[str]) -> int:
    unknown = sorted(set(names) - set(PICTURES))
    if unknown:
        print(f"no such picture: {', '.join(unknown)}; there are {', '.join(PICTURES)}")
        return 2
    for name in names or PICTURES:
        made = PICTURES[name]()
        file = made
        if isinstance(made, Figure):
            (file,) = save_figures(FOLDER, {name: made}, ("png",), DOTS)
        print(f"{file}: {file.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
