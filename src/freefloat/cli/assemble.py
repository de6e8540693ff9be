"""``freefloat assemble``: the command with the most options."""

from __future__ import annotations

from freefloat.cli import options
from freefloat.cli.console import answer, answering


def assemble(
    robot: options.Robot,
    output: options.UrdfOutput,
    end_effector: options.EndEffector = None,
    mass: options.Mass = None,
    inertia: options.Inertia = None,
    com: options.Centre = None,
    size: options.Edges = None,
    mesh: options.MeshFile = None,
    mount: options.Mounting = None,
    payload_mass: options.PayloadMass = None,
    payload_inertia: options.PayloadInertia = None,
    payload_com: options.PayloadCentre = None,
    payload_size: options.PayloadEdges = None,
    payload_mesh: options.PayloadMesh = None,
    tool: options.Tool = None,
    tool_mount: options.Standing = None,
    second_arm: options.SecondArm = None,
    second_mount: options.Standing = None,
    copy_meshes: options.CopyMeshes = False,
    as_json: options.Json = False,
) -> None:
    """Mount an arm on a spacecraft, give it a tool, a second arm, a payload; write one URDF.

    Example: freefloat assemble example-robot-data:ur5 -o servicer.urdf
    --end-effector tool0 --mass 200 --inertia 35,35,35 --size 1 1 1 --mount 0 0 0.5 0 0 0

    Example: freefloat assemble ur5_servicer/arc -o servicer.urdf
    """
    with answering(as_json):
        from freefloat.cli.assembly_tables import assembly_tables
        from freefloat.io.assembled import Assembled
        from freefloat.tasks.assembling import Lump, Wishes, robot_parts

        craft = Lump("spacecraft", mass, inertia, com, size, mesh, mount)
        held = Lump(
            "payload", payload_mass, payload_inertia, payload_com, payload_size, payload_mesh
        )
        wishes = Wishes(end_effector, craft, held, (tool, tool_mount), (second_arm, second_mount))
        built = Assembled.of(robot_parts(robot, wishes))
        meshes, missing = built.write(output, copy_meshes)
        document = {"file": str(output), **built.document(), "meshes": meshes}
        document["warnings"] += missing
    answer(document, assembly_tables(document), as_json)
