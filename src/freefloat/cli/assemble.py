"""``freefloat assemble``: one URDF of an arm, a spacecraft, a tool, a second arm, a payload."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import RenderableType

from freefloat.cli.console import Console, table
from freefloat.cli.options import Json, Quiet, numbers, prepare_outputs, robot_names
from freefloat.cli.robots import FileOptions, Packages, Root, Xacro, robot_source
from freefloat.errors import InputError

if TYPE_CHECKING:
    from freefloat.io.formats.urdf_file import UrdfFile
    from freefloat.robot.model import FreeFloatingModel
    from freefloat.robot.parts import Mount
    from freefloat.robot.source import RobotSource

Numbers = Sequence[float]
_Robot = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="An arm: a URDF, xacro or MJCF file, a bundled name, example-robot-data:NAME or "
        "robot_descriptions:NAME. Or a scenario, or a "
        "YAML file with its robot section alone, which has all parts.",
        autocompletion=robot_names,
    ),
]
_Output = Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The URDF to write.")]
_EndEffector = Annotated[
    str | None,
    typer.Option(
        metavar="LINK", help="The end-effector, a link or site; default the only last link."
    ),
]
_Mass = Annotated[float | None, typer.Option(metavar="KG", help="Mass of the spacecraft.")]
_Inertia = Annotated[
    Numbers | None,
    typer.Option(
        metavar="X Y Z ...",
        help="Its inertia about its centre of mass, kg m²: three principal moments, "
        "ixx ixy ixz iyy iyz izz, or nine numbers.",
        parser=numbers,
    ),
]
_Centre = Annotated[
    Numbers | None,
    typer.Option(
        metavar="X Y Z",
        help="Its centre of mass in its frame, m; default the origin.",
        parser=numbers,
    ),
]
_Size = Annotated[
    Numbers | None,
    typer.Option(metavar="X Y Z", help="Edges of the box drawn for this body [m].", parser=numbers),
]
_Mesh = Annotated[
    Path | None, typer.Option(metavar="FILE", help="A mesh that shows it instead, in its frame.")
]
_Mount = Annotated[
    Numbers | None,
    typer.Option(
        metavar="X Y Z R P Y",
        help="Pose of the arm's root link in its frame, m, rad.",
        parser=numbers,
    ),
]
_PayloadMass = Annotated[
    float | None, typer.Option(metavar="KG", help="Mass of a payload, fixed to the end-effector.")
]
_PayloadInertia = Annotated[
    Numbers | None, typer.Option(metavar="X Y Z ...", help="As --inertia.", parser=numbers)
]
_PayloadCentre = Annotated[
    Numbers | None,
    typer.Option(
        metavar="X Y Z", help="Its centre of mass in the end-effector's frame, m.", parser=numbers
    ),
]
_Tool = Annotated[
    str | None,
    typer.Option(metavar="URDF", help="Fixed to the end-effector; its names start with tool_."),
]
_SecondArm = Annotated[
    str | None,
    typer.Option(
        metavar="URDF",
        help="Fixed to the spacecraft, its joints fixed; its names start with second_. Needs "
        "--end-effector.",
    ),
]
_Placed = Annotated[
    Numbers | None,
    typer.Option(metavar="X Y Z R P Y", help="Pose of its root link, m, rad.", parser=numbers),
]
_CopyMeshes = Annotated[
    bool,
    typer.Option(
        "--copy-meshes",
        help="Copy mesh files to a folder next to the URDF; default: absolute paths.",
    ),
]


def assemble(
    robot: _Robot,
    output: _Output,
    end_effector: _EndEffector = None,
    root: Root = None,
    package: Packages = None,
    xacro: Xacro = None,
    mass: _Mass = None,
    inertia: _Inertia = None,
    com: _Centre = None,
    size: _Size = None,
    mesh: _Mesh = None,
    mount: _Mount = None,
    payload_mass: _PayloadMass = None,
    payload_inertia: _PayloadInertia = None,
    payload_com: _PayloadCentre = None,
    payload_size: _Size = None,
    payload_mesh: _Mesh = None,
    tool: _Tool = None,
    tool_mount: _Placed = None,
    second_arm: _SecondArm = None,
    second_mount: _Placed = None,
    copy_meshes: _CopyMeshes = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Assemble an arm, a spacecraft, a tool, a second arm and a payload; write one URDF.

    Example: freefloat assemble example-robot-data:ur5 -o servicer.urdf
    --end-effector tool0 --mass 200 --inertia 35 35 35 --size 1 1 1 --mount 0 0 0.5 0 0 0

    Example: freefloat assemble ur5_servicer/arc -o servicer.urdf
    """
    from freefloat.io.formats.urdf_file import write_urdf
    from freefloat.io.scenario.scenario import load_robot
    from freefloat.robot.bundled import is_scenario

    parts = _given(
        spacecraft={"mass": mass, "inertia": inertia, "com": com, "size": size, "mesh": mesh,
                    "mount": mount},
        payload={"mass": payload_mass, "inertia": payload_inertia, "com": payload_com,
                 "size": payload_size, "mesh": payload_mesh},
        tool={"urdf": tool, "mount": tool_mount},
        second_arm={"urdf": second_arm, "mount": second_mount},
    )  # fmt: skip
    options = FileOptions(root, package, xacro)
    if is_scenario(robot):
        if parts or end_effector is not None or options.given:
            accepted = "-o, --copy-meshes and --json"
            raise InputError("options", "the scenario has all parts of its robot", accepted)
        model = load_robot(robot)
    else:
        model = _assembled(robot_source(robot, options), end_effector, parts)
    prepare_outputs(Path(model.description.source), results=False, output=output)
    written = write_urdf(model, output, copy_meshes)
    console = Console(as_json, quiet)
    console.json(written.to_dict())
    console.tables(_tables(written))


def _given(**parts: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The options of each part that have a value; parts without any are omitted."""
    options = {
        name: {key: value for key, value in values.items() if value is not None}
        for name, values in parts.items()
    }
    return {name: values for name, values in options.items() if values}


def _assembled(
    source: RobotSource, end_effector: str | None, parts: dict[str, dict[str, Any]]
) -> FreeFloatingModel:
    """The model of an arm with the parts that the options describe."""
    from freefloat.robot.assembly import end_effector_link
    from freefloat.robot.bundled import find_robot
    from freefloat.robot.model import FreeFloatingModel
    from freefloat.robot.parts import Attachment, Payload, Spacecraft
    from freefloat.robot.source import RobotSource
    from freefloat.robot.validation import read_urdf

    attached = []
    for key, prefix in (("tool", "tool_"), ("second_arm", "second_")):
        if key not in parts:
            continue
        if "urdf" not in parts[key]:
            raise InputError(key, "it is missing, only its pose was given", "a URDF")
        try:
            file = find_robot(parts[key]["urdf"], Path())
        except InputError as error:
            raise InputError(key, error.problem, error.accepted) from None
        link = end_effector_link(read_urdf(source), end_effector) if key == "tool" else None
        mount = _mount(f"{prefix}mount", parts[key].get("mount", (0.0,) * 6))
        part = RobotSource(file, packages=source.packages)
        attached.append(Attachment(part, link, mount, prefix))
    return FreeFloatingModel.from_urdf(
        source,
        end_effector,
        attached=attached,
        spacecraft=Spacecraft(**_body("spacecraft", parts)) if "spacecraft" in parts else None,
        payload=Payload(**_body("payload", parts)) if "payload" in parts else None,
    )


def _body(name: str, parts: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """The arguments of a spacecraft or a payload."""
    options = parts[name]
    for key in ("mass", "inertia"):
        if key not in options:
            raise InputError(f"{name}.{key}", "it is missing", "mass and inertia of every body")
    mount = {"mount": _mount("mount", options["mount"])} if "mount" in options else {}
    return {**options, **mount}


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
    yield f"centre of mass {_numbers(written.centre_of_mass)} m, root's frame, joints at 0"
    yield "inertia about it, axes of the root [kg m²]:"
    yield from (f"  {_numbers(row)}" for row in written.inertia)
    if written.meshes:
        yield f"{len(written.meshes)} mesh files, the first {written.meshes[0]}"
    yield from (f"warning: {warning}" for warning in written.warnings)


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.6g}" for value in values)
