"""Valid files: bundled robots, results, meshes."""

import base64
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml

import freefloat as ff
from freefloat.certificate.certificate import certify
from freefloat.planning.plan import Plan
from freefloat.planning.plane.arcs import BranchRanges, HeadingRange
from freefloat.robot.named_files import models_folder
from freefloat.so3 import heading_quaternion
from tests.example_studies import SHORT

NAME = "</script><script>window.hacked=1</script><img src=x onerror=alert(1)>"
"""A name that would be code on a page that does not escape it."""


def bundled(*names: str) -> tuple[bytes, ...]:
    """URDFs of bundled robots."""
    return tuple((models_folder() / name / f"{name}.urdf").read_bytes() for name in names)


@cache
def plans() -> tuple[bytes, bytes]:
    """A simulation, and its motion as a plan."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "base.yaml").write_text(yaml.safe_dump(SHORT, sort_keys=False))
        problem = ff.load_scenario(Path(folder) / "base.yaml").problem()
    simulation = ff.simulate(problem, heading_quaternion(np.radians(200.0)))
    ranges = (HeadingRange(np.radians(10.0), np.radians(20.0), ("margin",) * 2),)
    plan = Plan(
        problem, ff.Search(), True, "", (BranchRanges(0, "0", ranges, ()),), (), simulation.chosen,
        certificate=certify(simulation.chosen.motion),
    )  # fmt: skip
    return content(simulation), content(plan)


def content(result: Any) -> bytes:
    """Content of the file of a result."""
    with tempfile.TemporaryDirectory() as folder:
        ff.save(result, Path(folder) / "result.h5")
        return (Path(folder) / "result.h5").read_bytes()


@cache
def meshes() -> tuple[bytes, ...]:
    """A box in several formats."""
    box: Any = trimesh.creation.box()
    exported = [box.export(file_type=kind) for kind in ("stl", "stl_ascii", "ply", "glb", "dae")]
    lines = ["mtllib part.mtl", "usemtl a", *(f"v {x} {y} {z}" for x, y, z in box.vertices),
             *("vt 0 0" for _ in box.vertices),
             *(f"f {a + 1}/1 {b + 1}/1 {c + 1}/1" for a, b, c in box.faces)]  # fmt: skip
    gltf = box.export(file_type="gltf")
    text = gltf["model.gltf"].decode()
    named = {name: f"data:application/octet-stream;base64,{base64.b64encode(data).decode()}"
             for name, data in gltf.items() if name != "model.gltf"}  # fmt: skip
    for name, data in named.items():
        text = text.replace(name, data)
    files = (*exported, "\n".join(lines), text)
    return tuple(file if isinstance(file, bytes) else file.encode() for file in files)
