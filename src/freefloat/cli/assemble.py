"""``freefloat assemble``: one URDF of an arm on a spacecraft, or of the robot of a scenario."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import RenderableType

from freefloat.cli.console import Console, table
from freefloat.cli.options import Json, Quiet, numbers, option, prepare_outputs, robot_names
from freefloat.cli.robots import FileOptions, Packages, Root, Xacro, robot_source
from freefloat.errors import InputError

if TYPE_CHECKING:
    from freefloat.io.urdf_file import UrdfFile
    from freefloat.robot.parts import Mount, Spacecraft

Numbers = Sequence[float]
_Robot = Annotated[str, typer.Argument(
    metavar="ROBOT",
    help="An arm: a URDF, xacro or MJCF file, a bundled name, example-robot-data:NAME or "
    "robot_descriptions:NAME. Or a scenario, or a YAML file with its robot section alone, "
    "which has all parts: spacecraft, payload, tools, further arms.", autocompletion=robot_names,
)]  # fmt: skip
_Output = Annotated[Path, option("FILE", "The URDF to write.", "--output", "-o")]
_EndEffector = Annotated[
    str | None, option("LINK", "The end-effector, a link or site; default the only last link.")
]
_Mass = Annotated[float | None, option("KG", "Mass of the spacecraft.")]
_Inertia = Annotated[Numbers | None, option(
    "X Y Z ...", "Its inertia about its centre of mass, kg m²: three principal moments, "
    "ixx ixy ixz iyy iyz izz, or nine numbers.", parser=numbers,
)]  # fmt: skip
_Size = Annotated[Numbers | None, option("X Y Z", "Edges of its box [m].", parser=numbers)]
_Mount = Annotated[
    Numbers | None,
    option("X Y Z R P Y", "Pose of the arm's root link in its frame, m, rad.", parser=numbers),
]
_CopyMeshes = Annotated[bool, typer.Option(
    "--copy-meshes", help="Copy mesh files to a folder next to the URDF; default: absolute paths.",
)]  # fmt: skip


def assemble(
    robot: _Robot,
    output: _Output,
    end_effector: _EndEffector = None,
    root: Root = None,
    package: Packages = None,
    xacro: Xacro = None,
    mass: _Mass = None,
    inertia: _Inertia = None,
    size: _Size = None,
    mount: _Mount = None,
    copy_meshes: _CopyMeshes = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Mount an arm on a spacecraft, or assemble the robot of a scenario; write one URDF.

    Example: freefloat assemble example-robot-data:ur5 -o servicer.urdf
    --end-effector tool0 --mass 200 --inertia 35 35 35 --size 1 1 1 --mount 0 0 0.5 0 0 0

    Example: freefloat assemble ur5_servicer/arc -o servicer.urdf
    """
    from freefloat.io.scenario.loading import load_robot
    from freefloat.io.urdf_file import write_urdf
    from freefloat.robot.model import FreeFloatingModel
    from freefloat.robot.named_files import is_scenario

    values = {"mass": mass, "inertia": inertia, "size": size, "mount": mount}
    craft = {key: value for key, value in values.items() if value is not None}
    options = FileOptions(root, package, xacro)
    if is_scenario(robot):
        if craft or end_effector is not None or options.given:
            accepted = "-o, --copy-meshes and --json"
            raise InputError("options", "the scenario has all parts of its robot", accepted)
        model, files = load_robot(robot)
    else:
        source, spacecraft = robot_source(robot, options), _spacecraft(craft) if craft else None
        model = FreeFloatingModel.from_urdf(source, end_effector, spacecraft=spacecraft)
        files = [Path(model.description.source)]
    prepare_outputs(*files, kind="urdf", output=output)
    written = write_urdf(model, output, copy_meshes)
    console = Console(as_json, quiet)
    console.json(written.to_dict())
    console.tables(_tables(written))


def _spacecraft(options: dict[str, Any]) -> Spacecraft:
    """The spacecraft that the options describe."""
    from freefloat.robot.parts import Spacecraft

    for key in ("mass", "inertia"):
        if key not in options:
            raise InputError(f"spacecraft.{key}", "it is missing", "its mass and inertia")
    mount = {"mount": _mount("mount", options["mount"])} if "mount" in options else {}
    return Spacecraft(**options | mount)


def _mount(key: str, placement: Numbers) -> Mount:
    import numpy as np

    from freefloat.robot.parts import Mount

    if max(map(abs, placement[3:])) > 2.0 * math.pi:
        angles = " ".join(f"{angle:g}" for angle in placement[3:])
        raise InputError(key, f"the angles {angles} were given", "x y z [m], angles in radians")
    return Mount(np.array(placement[:3]), np.array(placement[3:]))


def _tables(written: UrdfFile) -> Iterator[RenderableType]:
    """The robot's mass, joints, centre of mass, inertia, meshes and warnings."""
    model = written.model
    yield f"{written.file}: {model.description.name}, {model.total_mass:.6g} kg"
    joints = table("joint", "type", "")
    for joint, value in written.joints:
        joints.add_row(joint.name, joint.type, "moves" if value is None else f"fixed at {value:g}")
    yield joints
    yield f"root {model.body_names[0]}, end-effector {model.end_effector}"
    yield f"centre of mass {_numbers(written.centre_of_mass)} m, root's frame, moving joints at 0"
    yield "inertia about it, axes of the root [kg m²]:"
    yield from (f"  {_numbers(row)}" for row in written.inertia)
    if written.meshes:
        yield f"{len(written.meshes)} mesh files, the first {written.meshes[0]}"
    yield from (f"warning: {warning}" for warning in written.warnings)


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.6g}" for value in values)
