"""The words of the command line: options of several commands, or of commands with many."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from freefloat.cli.completion import robot_names, scenario_names, study_names

Json = Annotated[bool, typer.Option("--json", help="One JSON document on stdout, nothing else.")]
ScenarioName = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        help="A file or a bundled name: spatial_6dof/line",
        autocompletion=scenario_names,
    ),
]
Output = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="FILE", help="Write an HDF5 file.")
]
Page = Annotated[
    Path | None,
    typer.Option("--html", metavar="FILE", help="Write a page that plays it, without a network."),
]
Plots = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Draw figures into this folder, as PDF and PNG."),
]
Stretch = Annotated[
    bool,
    typer.Option("--stretch", help="Take more time where rates or torques ask for it."),
]
Threads = Annotated[
    int | None, typer.Option(min=1, metavar="T", help="How many cores to use; all when left out.")
]

# --- simulate -----------------------------------------------------------------------------------

Attitude = Annotated[
    tuple[float, float, float, float] | None,
    typer.Option(metavar="X Y Z W", help="Initial spacecraft attitude, a quaternion."),
]
Heading = Annotated[
    float | None, typer.Option(metavar="DEG", help="The same for planar tasks, in degrees.")
]
Joints = Annotated[
    str | None,
    typer.Option(metavar="Q1,Q2,...", help="Follow the arm branch near these joint values, rad."),
]
Branch = Annotated[
    int | None, typer.Option(metavar="K", help="Follow the arm branch with this number.")
]
StopAtMargin = Annotated[
    bool, typer.Option("--stop-at-margin", help="End where the scenario's margin is used up.")
]

# --- map ----------------------------------------------------------------------------------------

Samples = Annotated[
    int | None,
    typer.Option(
        min=8,
        max=100_000_000,
        metavar="N",
        help="How many attitudes; else search.samples of the scenario, else 36,864 "
        "(planar tasks: 360 headings).",
    ),
]
Seed = Annotated[
    int | None,
    typer.Option(min=0, help="Turns the grid of attitudes; else search.seed of the scenario."),
]
Nearest = Annotated[
    tuple[float, float, float, float] | None,
    typer.Option(
        metavar="X Y Z W", help="Find the attitude nearest to this that keeps the margin."
    ),
]
Boundary = Annotated[
    int | None,
    typer.Option(
        min=1,
        metavar="N",
        help="Find N attitudes for each arm branch where the margin is just kept.",
    ),
]
Touch = Annotated[
    int | None,
    typer.Option(
        min=1,
        metavar="N",
        help="For arms with an elbow and a spherical wrist: carry N points of the boundary "
        "back from touch points (Section VI) and compare.",
    ),
]

# --- view ---------------------------------------------------------------------------------------

Files = Annotated[
    list[Path],
    typer.Argument(metavar="FILE", help="Written with -o by plan, simulate or map; one page."),
]
Port = Annotated[
    int, typer.Option(min=0, max=65535, metavar="P", help="When taken, the next free one.")
]
NoOpen = Annotated[bool, typer.Option("--no-open", help="Open no browser; so it is with --json.")]
Snapshots = Annotated[
    int | None,
    typer.Option(min=1, max=1000, metavar="N", help="Take N pictures from start to end."),
]
Folder = Annotated[
    Path | None,
    typer.Option(
        *("--output", "-o"),
        metavar="DIR",
        help="Where the pictures go; else NAME_snapshots here, NAME being that of the file.",
    ),
]
Video = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Write a .gif, or a .mp4 where ffmpeg is installed."),
]
Rate = Annotated[
    float | None, typer.Option(metavar="F", help="Pictures a second of the video; else 20.")
]
Speed = Annotated[
    float | None,
    typer.Option(
        metavar="X",
        help="How many times faster than the motion the video is; else 1, or a round number that "
        "makes it last a quarter of a minute at most.",
    ),
]
Size = Annotated[
    str | None,
    typer.Option(metavar="WxH", help="Of pictures and video; else 1280x720, GIF 800x450."),
]
Scene = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Of several, the one that the page opens on and that is in pictures and video: a "
        'file\'s name, of a map an arm branch, or "side by side".',
    ),
]

# --- assemble -----------------------------------------------------------------------------------

Robot = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="An arm: a URDF, a bundled name or example-robot-data:NAME. Or a scenario, or a YAML "
        "file with its robot section alone: all parts are told there.",
        autocompletion=robot_names,
    ),
]
UrdfOutput = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE", help="The URDF to write.")
]
EndEffector = Annotated[
    str | None,
    typer.Option(metavar="LINK", help="Follows paths and holds; else the only last link."),
]
Mass = Annotated[float | None, typer.Option(metavar="KG", help="The spacecraft's mass.")]
Inertia = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,Z",
        help="Its inertia about its centre of mass, kg m²: three principal moments, "
        "ixx,ixy,ixz,iyy,iyz,izz, or nine numbers.",
    ),
]
Centre = Annotated[
    tuple[float, float, float] | None,
    typer.Option(metavar="X Y Z", help="Its centre of mass in its frame, m; else the origin."),
]
Edges = Annotated[
    tuple[float, float, float] | None,
    typer.Option(metavar="X Y Z", help="Edges of the box that stands for it, m."),
]
MeshFile = Annotated[
    Path | None, typer.Option(metavar="FILE", help="A mesh that stands for it instead.")
]
Mounting = Annotated[
    tuple[float, float, float, float, float, float] | None,
    typer.Option(metavar="X Y Z R P Y", help="Where the arm stands on it, m, and how, rad."),
]
PayloadMass = Annotated[
    float | None, typer.Option(metavar="KG", help="Of what the end-effector holds.")
]
PayloadInertia = Annotated[str | None, typer.Option(metavar="X,Y,Z", help="As --inertia.")]
PayloadCentre = Annotated[
    tuple[float, float, float] | None,
    typer.Option(metavar="X Y Z", help="Its centre of mass in the end-effector's frame, m."),
]
PayloadEdges = Annotated[
    tuple[float, float, float] | None,
    typer.Option(metavar="X Y Z", help="Edges of a box about its centre of mass, m."),
]
PayloadMesh = Annotated[
    Path | None, typer.Option(metavar="FILE", help="A mesh in the end-effector's frame instead.")
]
Tool = Annotated[
    str | None,
    typer.Option(metavar="URDF", help="Fixed to the end-effector; its names get tool_ in front."),
]
SecondArm = Annotated[
    str | None,
    typer.Option(
        metavar="URDF",
        help="Fixed to the spacecraft; its names get second_ in front. Needs "
        "--end-effector: the other arm is held still.",
    ),
]
Standing = Annotated[
    tuple[float, float, float, float, float, float] | None,
    typer.Option(metavar="X Y Z R P Y", help="Where its root link stands, m, and how, rad."),
]
CopyMeshes = Annotated[
    bool,
    typer.Option(
        "--copy-meshes",
        help="Copy mesh files into a folder beside the URDF, to be moved with it; else they are "
        "named by absolute paths.",
    ),
]

# --- batch --------------------------------------------------------------------------------------

StudyName = Annotated[
    str,
    typer.Argument(
        metavar="STUDY",
        help="A file or a bundled name: spatial_6dof/montecarlo",
        autocompletion=study_names,
    ),
]
StudyOutput = Annotated[
    Path | None,
    typer.Option(
        *("--output", "-o"),
        metavar="DIR",
        help="Where results go; in a folder of the same study the rest of it is done.",
    ),
]
Workers = Annotated[
    int | None,
    typer.Option(
        min=1, metavar="N", help="Processes to start, a core each; all cores when left out."
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", help="Use the workers of this Dask scheduler instead: tcp://host:8786"
    ),
]
DryRun = Annotated[
    bool,
    typer.Option("--dry-run", help="List the cases and estimate the time, run no more than two."),
]
Report = Annotated[
    bool, typer.Option("--report", help="Also write report.html, one page with figure and cases.")
]
