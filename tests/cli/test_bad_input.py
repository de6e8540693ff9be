"""Every kind of bad input: one line that says where, what and what else; never a traceback.

A case is what is written and what the line has to name. Cases that give the example scenario with
one passage replaced are written ``(old, new)``.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from freefloat.cli.app import app
from freefloat.robot.names import models_folder
from tests.scenarios import PARABOLA

pytestmark = pytest.mark.usefixtures("kernels")

WISH = "wish.yaml"
URDF = "planar_3dof.urdf"
CSV = "points.csv"

SPATIAL = """\
robot: {urdf: spatial_6dof.urdf, end_effector: end_effector}
task: pose
momentum: [0.5, 0.3, 0.1]
path:
  line: {from: [1, 0, 0], to: [-0.5, 0.8, 0.33]}
  attitude: {fixed: {quaternion: [0, 0, 0, 1]}}
timing: {law: quintic, duration: 100}
margin: {measure: arm, value: 5}
"""
POLYNOMIAL = "polynomial: {x: [2, -3], y: [0, 0.5, 1.5], z: [0]}"
FOLLOW = "{follow: {axis: -y, normal: [0, 0, 1]}}"
QUATERNION = "quaternion: [0, 0, 0, 1]"
HEADING = ("--heading", "0")
ATTITUDE = ("--attitude", "0", "0", "0", "1")


@dataclass(frozen=True)
class Bad:
    """Bad input, and what its message must name.

    Attributes:
        key: The key, or the option, or the place in the file.
        accepted: Words of what is accepted.
        old, new: What is replaced in the scenario.
        content: The whole scenario file instead; None for no such file.
        scenario: The text in which something is replaced.
        options: Given to ``simulate``; by default an attitude that suits the scenario.
        name: The scenario's name on the command line.
        file: The file that the message names; empty for what is wrong with an option.
        problem: Words of what is wrong.
        beside: Files beside the scenario, by name.
    """

    key: str
    accepted: str
    old: str = ""
    new: str = ""
    content: str | bytes | None = ""
    scenario: str = PARABOLA
    options: tuple[str, ...] | None = None
    name: str = WISH
    file: str = WISH
    problem: str = ""
    beside: dict[str, str | bytes] = field(default_factory=dict)

    def write(self, folder: Path) -> list[str]:
        """Put the files in a folder; the words of the command."""
        content = self.content
        if content == "" and self.key != "file":
            assert self.old in self.scenario
            content = self.scenario.replace(self.old, self.new, 1)
        if content is not None:
            _write(folder / WISH, content)
        for name, text in self.beside.items():
            _write(folder / name, text)
        default = ATTITUDE if self.scenario is SPATIAL else HEADING
        return ["simulate", self.name, *(default if self.options is None else self.options)]


def _write(file: Path, content: str | bytes) -> None:
    file.write_bytes(content if isinstance(content, bytes) else content.encode())


def planar_urdf(old: str, new: str) -> dict[str, str | bytes]:
    """The planar robot's URDF with one passage replaced."""
    text = (models_folder() / "planar_3dof" / URDF).read_text()
    assert old in text
    return {URDF: text.replace(old, new, 1)}


def edited(key: str, accepted: str, old: str, new: str, **rest: Any) -> Bad:
    return Bad(key, accepted, old, new, **rest)


def robot(key: str, accepted: str, old: str, new: str, **rest: Any) -> Bad:
    return Bad(key, accepted, file=URDF, beside=planar_urdf(old, new), **rest)


def samples(accepted: str, text: str | bytes, **rest: Any) -> Bad:
    path = f"samples: {CSV}"
    rest = {"file": CSV, "old": POLYNOMIAL, "new": path, "key": "path.samples", **rest}
    return Bad(accepted=accepted, beside={CSV: text}, **rest)


def option(key: str, accepted: str, *words: str, **rest: Any) -> Bad:
    return Bad(key, accepted, options=words, file="", **rest)


FILES = {
    "missing file": Bad("scenario", "planar_3dof/parabola", content=None, file=WISH),
    "misspelt bundled name": Bad(
        *("scenario", "spatial_6dof/line"), name="spatial_6dof/lin", content=None, file="",
        problem="did you mean spatial_6dof/line?",
    ),
    "directory": Bad("scenario", "a scenario file", name=".", file="", problem="directory"),
    "empty name": Bad("scenario", "a scenario file", name="", file=""),
    "empty": Bad("file", "keys and values", content="", problem="empty"),
    "only a comment": Bad("file", "keys and values", content="# later\n", problem="empty"),
    "a key with a bracket": edited(
        "task[0]", "task", "task: planar-pose", "task[0]: planar-pose", problem="no such key"
    ),
    "a key of pydantic's": edited(
        "timing.float", "law", "law: quintic", "float: quintic", problem="no such key"
    ),
    "a list": Bad("file", "keys and values", content="- task: pose\n"),
    "invalid YAML": Bad("line 2", "valid YAML", content="robot: {urdf: x\n"),
    "tabs": Bad("line 2", "valid YAML", content="robot:\n\turdf: x\n"),
    "YAML tag": edited(
        *("line 2", "plain values", "task: planar-pose"),
        "task: !!python/object/apply:os.system ['touch harm']",
        problem="python/object/apply:os.system",
    ),
    "alias bomb": Bad(
        *("line 2", "values written out"), problem="alias *a",
        content="a: &a [x, x, x]\nb: &b [*a, *a, *a, *a]\nc: [*b, *b, *b, *b, *b]\n",
    ),
    "duplicate key": Bad(
        "line 9", "", content=PARABOLA + "task: pose\n", problem="'task' is given twice"
    ),
    "duplicate key inside": edited(
        *("line 7", "", "duration: 100", "duration: 100, duration: 50"),
        problem="'duration' is given twice",
    ),
    "binary": Bad("file", "UTF-8 text", content=bytes(range(256)) * 8),
    "another encoding": Bad("file", "UTF-8 text", content="# größer\n".encode("latin-1")),
    "2 MB": Bad("file", "1000000 bytes", content="# much\n" * 300_000, problem="too large"),
    "deep nesting": Bad("", "valid YAML", content="robot: " + "[" * 800),
    "deep nesting that ends": Bad("", "", content="robot: " + "[" * 800 + "]" * 800),
    "a list as key": Bad("", "", content=PARABOLA + "? [a, b]\n: 1\n"),
    "a mapping as key": Bad("", "", content=PARABOLA + "{a: b}: 1\n"),
    "a number as key": Bad("3", "", content=PARABOLA + "3: 1\n"),
    "a key of two lines": Bad("", "momentum", content=PARABOLA + '"a\\nb": 1\n'),
    "the URDF instead": Bad(
        "", "", content=(models_folder() / "planar_3dof" / URDF).read_text()
    ),
    "two documents": Bad("line 9", "valid YAML", content=PARABOLA + "---\n" + PARABOLA),
    "a name too long for a file": Bad("scenario", "", name="x" * 300, content=None, file=""),
}  # fmt: skip

KEYS = {
    "unknown key": edited("momentm", "robot, task, momentum, path", "momentum", "momentm"),
    "unknown key inside": edited("timing.duraton", "duration, law, stops", "duration", "duraton"),
    "unknown key in a list": edited(
        *("timing.stops.0.x", "s, t", "duration: 100"),
        "duration: 100, stops: [{s: 0.5, t: 50, x: 1}]",
    ),
    "unknown path kind": edited("path.circle", "line, polynomial, arc", "polynomial", "circle"),
    "unknown attitude law": edited(
        "path.attitude.folow", "fixed, slerp, follow, point_at", "follow", "folow"
    ),
    "missing section": edited("timing", "", "timing: {law: quintic, duration: 100}\n", ""),
    "missing key": edited("timing.duration", "", ", duration: 100", ""),
    "missing coordinate": edited("path.polynomial.z", "", ", z: [0]", ""),
    "NaN momentum": edited("momentum.2", "a finite number", "0.5]", ".nan]", problem="nan"),
    "infinite momentum": edited("momentum.2", "a finite number", "0.5]", "-.inf]"),
    "degrees of an attitude": edited(
        *("path.attitude.fixed.rpy", "radians", QUATERNION, "rpy: [0, 90, 45]"),
        scenario=SPATIAL,
    ),
    "a momentum that is one number": edited("momentum", "three numbers", "[0, 0, 0.5]", "0.5"),
    "a robot that is a name": edited(
        *("robot", "keys: urdf, end_effector"),
        *("{urdf: planar_3dof.urdf, end_effector: end_effector}", "planar_3dof"),
    ),
    "nothing but a robot": Bad(
        *("task", "planar-pose"),
        problem="missing",
        content="robot: {urdf: planar_3dof.urdf, end_effector: end_effector}\n",
    ),
    "no path": Bad(
        *("path", "keys: line, polynomial, arc, waypoints, samples"),
        problem="missing",
        content=PARABOLA[: PARABOLA.index("path:")] + PARABOLA[PARABOLA.index("timing:") :],
    ),
    "momentum with two entries": edited("momentum", "three numbers", "[0, 0, 0.5]", "[0, 0.5]"),
    "momentum with four entries": edited(
        "momentum", "three numbers", "[0, 0, 0.5]", "[0, 0, 0.5, 1]"
    ),
    "momentum as text": edited("momentum", "", "[0, 0, 0.5]", "fast"),
    "empty momentum": edited("momentum", "", "[0, 0, 0.5]", ""),
    "a boolean where a number is due": edited(
        "momentum.0", "number", "[0, 0, 0.5]", "[true, 0, 0.5]"
    ),
    "a boolean as duration": edited("timing.duration", "number", "100", "yes"),
    "a number as text": edited("timing.duration", "number", "100", '"100"', problem="'100'"),
    "a date as duration": edited("timing.duration", "number", "100", "2026-01-01"),
    "zero duration": edited("timing.duration", "a positive number", "100", "0"),
    "negative duration": edited("timing.duration", "a positive number", "100", "-5"),
    "NaN duration": edited("timing.duration", "a finite number", "100", ".nan"),
    "a duration beyond all numbers": edited("timing.duration", "a finite number", "100", "1e400"),
    "unknown time law": edited("timing.law", "'quintic'", "quintic", "septic"),
    "unknown task": edited("task", "'planar-pose'", "planar-pose", "planar"),
    "unknown measure": edited("margin.measure", "'sigma'", "measure: system", "measure: det"),
    "negative margin": edited("margin.value", "0", "value: 5", "value: -5", problem="-5"),
    "a whole as fraction": edited("margin.fraction", "less than 1", "value: 5", "fraction: 1.0"),
    "negative fraction": edited("margin.fraction", "0", "value: 5", "fraction: -0.1"),
    "value and fraction": edited(
        "margin", "exactly one of value, fraction", "value: 5", "value: 5, fraction: 0.2"
    ),
    "neither value nor fraction": edited("margin", "exactly one of value", ", value: 5", ""),
    "two path kinds at once": edited(
        *("path", "exactly one of line, polynomial, arc, waypoints, samples", "polynomial"),
        "line: {from: [2, 0, 0], to: [1, 1, 0]}\n  polynomial",
    ),
    "no path kind": edited("path", "exactly one of line, polynomial", POLYNOMIAL + "\n  ", ""),
    "two attitude laws": edited(
        *("path.attitude", "exactly one of fixed, slerp, follow, point_at"),
        *("{follow", "{fixed: [0, 0, 0, 1], follow"),
    ),
    "no attitude for a pose": edited(
        "path.attitude", "fixed, slerp, follow or point_at", f"  attitude: {FOLLOW}\n", ""
    ),
    "a section as a list": edited("timing", "", "{law: quintic, duration: 100}", "[100]"),
    "a section left empty": edited("timing", "", "{law: quintic, duration: 100}", ""),
    "a name as number": edited("robot.urdf", "text", "urdf: planar_3dof.urdf", "urdf: 5"),
}

PATHS = {
    "zero-length line": edited(
        "path", "moves or turns", "to: [-0.5, 0.8, 0.33]", "to: [1, 0, 0]", scenario=SPATIAL
    ),
    "zero-length line that is followed": edited(
        *("path.attitude.follow", "never stands still", POLYNOMIAL),
        "line: {from: [2, 0, 0], to: [2, 0, 0]}",
    ),
    "zero-length arc": edited(
        *("path", "moves or turns", "line: {from: [1, 0, 0], to: [-0.5, 0.8, 0.33]}"),
        "arc: {center: [0, 0, 0], normal: [0, 0, 1], from: [1, 0, 0], angle_deg: 0}",
        scenario=SPATIAL,
    ),
    "arc that starts off its plane": edited(
        *("path.arc.from", "in the plane", POLYNOMIAL),
        "arc: {center: [0, 0, 0.5], normal: [0, 0, 1], from: [1, 0, 0], angle_deg: 90}",
    ),
    "arc without a normal": edited(
        *("path.arc.normal", "nonzero length", POLYNOMIAL),
        "arc: {center: [0, 0, 0], normal: [0, 0, 0], from: [1, 0, 0], angle_deg: 90}",
    ),
    "one waypoint": edited("path.waypoints", "2", POLYNOMIAL, "waypoints: [[2, 0, 0]]"),
    "waypoints that coincide": edited(
        *("path.waypoints", "distinct neighbours", POLYNOMIAL),
        "waypoints: [[2, 0, 0], [1, 1, 0], [1, 1, 0]]",
        problem="points 2 and 3",
    ),
    "waypoint in the plane only": edited(
        "path.waypoints.1", "", POLYNOMIAL, "waypoints: [[2, 0, 0], [1, 1]]"
    ),
    "no coefficients": edited("path.polynomial.x", "1", "x: [2, -3]", "x: []"),
    "parallel axes": edited(
        *("path.attitude.fixed.axes", "not parallel", QUATERNION),
        "axes: {x: [1, 2, 3], z: [-2, -4, -6]}",
        scenario=SPATIAL,
        problem="axes x and z are parallel",
    ),
    "one axis": edited(
        *("path.attitude.fixed.axes", "exactly two of x, y, z", QUATERNION),
        "axes: {x: [1, 2, 3]}",
        scenario=SPATIAL,
    ),
    "three axes": edited(
        *("path.attitude.fixed.axes", "exactly two of x, y, z", QUATERNION),
        "axes: {x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1]}",
        scenario=SPATIAL,
    ),
    "an axis of zeros": edited(
        *("path.attitude.fixed.axes.z", "nonzero length", QUATERNION),
        "axes: {x: [1, 2, 3], z: [0, 0, 0]}",
        scenario=SPATIAL,
    ),
    "zero quaternion": edited(
        *("path.attitude.fixed.quaternion", "unit quaternion"),
        *("[0, 0, 0, 1]", "[0, 0, 0, 0]"),
        scenario=SPATIAL,
    ),
    "NaN quaternion": edited(
        *("path.attitude.fixed.quaternion.0", "a finite number"),
        *("[0, 0, 0, 1]", "[.nan, 0, 0, 1]"),
        scenario=SPATIAL,
    ),
    "quaternion of three": edited(
        "path.attitude.fixed.quaternion", "", "[0, 0, 0, 1]", "[0, 0, 1]", scenario=SPATIAL
    ),
    "quaternion far from unit length": edited(
        *("path.attitude.fixed.quaternion", "unit quaternion", "[0, 0, 0, 1]", "[1, 1, 1, 1]"),
        scenario=SPATIAL,
        problem="norm 2",
    ),
    "zero quaternion at the end of a slerp": edited(
        *("path.attitude.slerp.to", "unit quaternion", f"fixed: {{{QUATERNION}}}"),
        "slerp: {from: [0, 0, 0, 1], to: [0, 0, 0, 0]}",
        scenario=SPATIAL,
    ),
    "a slerp to a number": edited(
        *("path.attitude.slerp.to", "", f"fixed: {{{QUATERNION}}}"),
        "slerp: {from: [0, 0, 0, 1], to: 5}",
        scenario=SPATIAL,
    ),
    "an attitude in two ways": edited(
        *("path.attitude.fixed", "exactly one of quaternion, rpy, axes", QUATERNION),
        f"{QUATERNION}, rpy: [0, 0, 0]",
        scenario=SPATIAL,
    ),
    "a normal along the path": edited(
        "path.attitude.follow", "a normal across it", "[0, 0, 1]", "[-3, 0.5, 0]"
    ),
    "following with the normal axis": edited(
        "path.attitude.follow.axis", "'-y'", "axis: -y", "axis: z"
    ),
    "pointing at a place on the path": edited(
        *("path.attitude.point_at", "off the path", FOLLOW),
        "{point_at: {target: [2, 0, 0], axis: x}}",
    ),
    "stops out of order": edited(
        *("timing.stops", "rising", "duration: 100"),
        "duration: 100, stops: [{s: 0.8, t: 50}, {s: 0.5, t: 70}]",
    ),
    "stops at times out of order": edited(
        *("timing.stops", "rising", "duration: 100"),
        "duration: 100, stops: [{s: 0.5, t: 50}, {s: 0.8, t: 40}]",
    ),
    "a stop beyond the path": edited(
        "timing.stops", "0 < s < 1", "duration: 100", "duration: 100, stops: [{s: 1.5, t: 50}]"
    ),
    "a stop after the end": edited(
        "timing.stops", "0 < t < 100", "duration: 100", "duration: 100, stops: [{s: 0.5, t: 150}]"
    ),
    "planar task on the spatial robot": edited(
        *("task", "pose or position", "planar_3dof", "spatial_6dof"),
        problem="does not stay in the x-y plane",
    ),
    "pose task on the planar robot": edited(
        *("task", "planar-pose", "planar-pose", "pose"), options=ATTITUDE
    ),
    "spatial momentum on a planar task": edited("momentum", "[0, 0, hz]", "[0, 0,", "[0.1, 0,"),
    "a planar path whose hand tilts": edited(
        "path.attitude", "turn about z alone", FOLLOW, "{fixed: {rpy: [0.5, 0, 0]}}"
    ),
    "a planar path beside the plane": edited("path", "", "z: [0]", "z: [0.7]", problem="plane"),
    "measure arm on the planar robot": edited(
        "margin.measure", "gjm, system or sigma", "measure: system", "measure: arm"
    ),
    "unreachable start": edited(
        *("path", "begins within the reach", "from: [1, 0, 0]", "from: [10, 0, 0]"),
        scenario=SPATIAL,
        problem="[10.0, 0.0, 0.0]",
    ),
}

ROBOTS = {
    "missing URDF": edited(
        *("robot.urdf", "planar_3dof, spatial_6dof", "planar_3dof.urdf", "planar_4dof.urdf"),
        problem="planar_4dof.urdf (did you mean planar_3dof?)",
    ),
    "URDF that is a directory": edited("robot.urdf", "a URDF file", "planar_3dof.urdf", "."),
    "URDF with a name too long": edited("robot.urdf", "", "planar_3dof.urdf", "x" * 300),
    "URDF with a name of two lines": edited("robot.urdf", "", "planar_3dof.urdf", '"a\\nb"'),
    "unknown frame": edited(
        *("robot.end_effector", "link_3, end_effector", "end_effector: end_effector"),
        "end_effector: hand",
        problem="'hand'",
    ),
    "frame that does not move": edited(
        *("robot.end_effector", "link_1", "end_effector: end_effector"),
        "end_effector: spacecraft",
    ),
    "frame without a name": edited(
        "robot.end_effector", "", "end_effector: end_effector", "end_effector: ''"
    ),
    "scale_mass of an unknown link": edited(
        *("robot.scale_mass.link_9", "link_1, link_2, link_3", "end_effector}"),
        "end_effector, scale_mass: {link_9: 2}}",
    ),
    "negative scale_mass": edited(
        "robot.scale_mass", "a number from 1e-06", "end_effector}", "end_effector, scale_mass: -1}"
    ),
    "scale_mass of zero for a link": edited(
        *("robot.scale_mass", "a number from 1e-06", "end_effector}"),
        "end_effector, scale_mass: {link_1: 0}}",
    ),
    "scale_mass as text": edited(
        *("robot.scale_mass", "number", "end_effector}"),
        "end_effector, scale_mass: {link_1: two}}",
        problem="'two'",
    ),
    "non-numeric mass": robot(
        *("link link_1", "finite numbers", 'value="40"', 'value="heavy"'), problem='"heavy"'
    ),
    "an expression as mass": robot(
        "link link_1", "expressions are not evaluated", 'value="40"', 'value="${2 * 20}"'
    ),
    "NaN mass": robot("link link_1", "finite numbers", 'value="40"', 'value="nan"'),
    "negative mass": robot("link link_1", "zero or more", 'value="40"', 'value="-40"'),
    "mass without a value": robot("link link_1", "", '<mass value="40"/>', "<mass/>"),
    "inertia with a moment missing": robot("link link_1", "", 'ixx="0.05" ', ""),
    "non-numeric inertia": robot("link link_1", "finite numbers", 'ixx="0.05"', 'ixx="light"'),
    "unfinished XML": robot("urdf", "a URDF file", "</robot>", "", problem="not well-formed"),
    "XML entities": robot("urdf", "without <!...>", "<robot", "<!DOCTYPE a><robot"),
    "joint without limits": robot(
        "joint q1", "<limit", 'name="q1" type="continuous"', 'name="q1" type="revolute"'
    ),
    "joint that is no single axis": robot(
        "joint q1", "revolute", 'name="q1" type="continuous"', 'name="q1" type="floating"'
    ),
    "joint of an unknown type": robot(
        "q1", "revolute", 'name="q1" type="continuous"', 'name="q1" type="continous"'
    ),
    "joint without an axis direction": robot("q1", "", 'axis xyz="0 0 1"', 'axis xyz="0 0 0"'),
    "joint with half an axis": robot("q1", "", 'axis xyz="0 0 1"', 'axis xyz="0 1"'),
    "joint on a link that is not there": robot(
        "q2", "", '<parent link="link_1"/>', '<parent link="link_7"/>', problem="link_7"
    ),
    "link given twice": robot("link_1", "", '<link name="link_2">', '<link name="link_1">'),
    "links in a circle": robot(
        "", "every other link the child of exactly one joint",
        '<parent link="spacecraft"/>', '<parent link="link_3"/>',
    ),
    "binary URDF": Bad(
        "robot.urdf", "a URDF file", beside={URDF: bytes(range(256))}, problem=URDF
    ),
    "empty URDF": Bad("urdf", "a URDF file", file=URDF, beside={URDF: ""}),
    "URDF that is another document": Bad(
        "urdf", "<robot>", file=URDF, beside={URDF: "<html></html>"}
    ),
    "robot without mass": Bad("urdf", "<mass", file=URDF, beside={URDF: "<robot/>"}),
}  # fmt: skip

SAMPLES = {
    "missing samples": Bad("path.samples", "CSV", POLYNOMIAL, f"samples: {CSV}", file=CSV),
    "samples with a NaN": samples(
        "3 finite numbers", "x,y,z\n2,0,0\n1,nan,0\n", problem="'1,nan,0'"
    ),
    "samples with words": samples("3 finite numbers", "x,y,z\n2,0,0\n1,one,0\n", problem="one"),
    "samples with a short row": samples("3 finite numbers", "x,y,z\n2,0,0\n1,0\n"),
    "samples with a missing column": samples("x, y, z", "x,y\n2,0\n1,0\n", problem="columns x, y"),
    "samples with an unknown column": samples("x, y, z", "x,y,z,t\n2,0,0,0\n1,1,0,1\n"),
    "samples with half a quaternion": samples("qx, qy, qz, qw", "x,y,z,qx\n2,0,0,0\n1,1,0,0\n"),
    "samples without a header": samples("x, y, z", "2,0,0\n1,1,0\n", problem="columns 2, 0, 0"),
    "samples with one row": samples("two or more", "x,y,z\n2,0,0\n", problem="1 row"),
    "samples without rows": samples("two or more", "x,y,z\n"),
    "empty samples": samples("x, y, z", ""),
    "binary samples": samples("CSV", bytes(range(256))),
    "samples that coincide": samples("distinct neighbours", "x,y,z\n2,0,0\n2,0,0\n"),
    "samples with s out of order": samples(
        "0 to 1", "s,x,y,z\n0,2,0,0\n0.7,1,0,0\n0.6,1,1,0\n1,0,0,0\n", problem="column s"
    ),
    "samples with a zero quaternion": samples(
        *("unit quaternion", "x,y,z,qx,qy,qz,qw\n2,0,0,0,0,0,1\n1,0,0,0,0,0,0\n"),
        old=f"{POLYNOMIAL}\n  attitude: {FOLLOW}",
        problem="norm 0",
    ),
    "samples with quaternions and an attitude": samples(
        *("one of the two", "x,y,z,qx,qy,qz,qw\n2,0,0,0,0,0,1\n1,0,0,0,0,0,1\n"),
        key="path.attitude",
        file=WISH,
    ),
    "samples that are a directory": Bad("path.samples", "CSV", POLYNOMIAL, "samples: .", file=""),
    "samples with a name of no file": Bad(
        "path.samples", "", POLYNOMIAL, 'samples: "a\\0b"', file=""
    ),
}

OPTIONS = {
    "no attitude": option("heading", "--heading DEG"),
    "attitude and heading": option("heading", "--heading DEG", *HEADING, *ATTITUDE),
    "zero quaternion": option("attitude", "unit quaternion", "--attitude", *"0000"),
    "NaN quaternion": option("attitude", "4 finite numbers", "--attitude", "nan", *"001"),
    "attitude of three": option("attitude", "4", "--attitude", *"001"),
    "attitude in words": option("attitude", "number", "--attitude", *"abcd"),
    "attitude out of the plane": option("attitude", "[0, 0, z, w]", "--attitude", *"1000"),
    "NaN heading": option("heading", "number", "--heading", "nan"),
    "infinite heading": option("heading", "number", "--heading", "inf"),
    "heading in words": option("heading", "number", "--heading", "north"),
    "heading for a spatial task": option(
        "heading", "--attitude X Y Z W", *HEADING, scenario=SPATIAL
    ),
    "wrong number of joints": option("joints", "3 values: q1, q2, q3", *HEADING, "--joints", "1,2"),
    "joints that do not meet the start pose": option(
        "joints", "0 [-0.3257, 1.9468, 2.9261]; 1 [", *HEADING, "--joints", "0,0,0"
    ),
    "joints in words": option("joints", "numbers with commas", *HEADING, "--joints", "a,b,c"),
    "joints with spaces": option("joints", "numbers with commas", *HEADING, "--joints", "1 2 3"),
    "empty joints": option("joints", "numbers with commas", *HEADING, "--joints", ""),
    "NaN joints": option("joints", "3 finite numbers", *HEADING, "--joints", "nan,0,0"),
    "branch that is not there": option("branch", "0, 1", *HEADING, "--branch", "2"),
    "negative branch": option("branch", "0, 1", *HEADING, "--branch", "-1"),
    "branch in words": option("branch", "integer", *HEADING, "--branch", "left"),
    "unknown option": option("--headin", "", "--headin", "0"),
    "option without its value": option("--heading", "", "--heading"),
}

CASES = {
    f"{group}: {name}": case
    for group, cases in {
        "file": FILES,
        "key": KEYS,
        "path": PATHS,
        "robot": ROBOTS,
        "samples": SAMPLES,
        "option": OPTIONS,
    }.items()
    for name, case in cases.items()
}
every_case = pytest.mark.parametrize("case", CASES.values(), ids=CASES)

INTERNALS = re.compile(
    r"after validation|instance of|\btuple\b|\bTuple\b|\bdict\b|constrained|np\.float64|array\(|"
    r"Errno|recursion|codec|Python|sys\.|XML stream|datetime\.|Section\b|JointModel"
)
"""Words of the libraries underneath, which no user has ever written."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(words: list[str], folder: Path) -> tuple[str, str]:
    """What a refused command prints: stdout and the one line on stderr."""
    before = sorted(folder.iterdir())
    result = CliRunner().invoke(app, words)
    assert isinstance(result.exception, SystemExit), repr(result.exception)
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.output
    assert sorted(folder.iterdir()) == before
    assert len(result.stderr.splitlines()) == 1, result.stderr
    return str(result.stdout), result.stderr.removesuffix("\n")


@every_case
def test_bad_input_gets_one_line_that_names_file_and_key_and_what_is_accepted(
    case: Bad, folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    stdout, line = refused(case.write(folder), folder)
    assert stdout == ""
    assert capfd.readouterr() == ("", ""), "the URDF parser writes past us"
    assert line.startswith("freefloat: ")
    where, _, accepted = line.partition("; accepted: ")
    for name in (case.file, case.key, case.problem):
        assert name in where, line
    assert case.accepted in accepted, line
    assert accepted.strip() != "", line


@every_case
def test_bad_input_gets_one_json_document_with_the_same_words(case: Bad, folder: Path) -> None:
    stdout, line = refused([*case.write(folder), "--json"], folder)
    document = json.loads(stdout)
    assert document.keys() == {"error"}
    error = document["error"]
    assert error.keys() == {"message", "key", "problem", "accepted", "file", "line"}
    assert line == f"freefloat: {error['message']}"
    for told in (error["key"], error["problem"], error["accepted"]):
        assert told in error["message"]
    if case.file and error["file"] is not None:
        assert Path(error["file"]).name == case.file


@every_case
def test_bad_input_is_answered_in_the_users_words(case: Bad, folder: Path) -> None:
    result = CliRunner().invoke(app, case.write(folder))
    found = INTERNALS.search(result.stderr)
    assert found is None, result.stderr


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("duration: 100", "duration: 1e-300"),
        ("duration: 100", "duration: 1e300"),
        ("duration: 100", "duration: 100, stops: [{s: 0.5, t: 1e-320}]"),
        ("duration: 100", "duration: 1" + "0" * 400),
        ("[0, 0, 0.5]", "[0, 0, 1e300]"),
        ("x: [2, -3]", "x: [2, 1e308, 1e308]"),
        (POLYNOMIAL, "waypoints: [[2, 0, 0], [1e200, 0, 0]]"),
        ("end_effector}", "end_effector, scale_mass: 1e300}"),
        ("end_effector}", "end_effector, scale_mass: 1e-300}"),
        ("value: 5", "value: 1e300"),
        ("[0, 0, 1]", "[0, 0, 1e300]"),
        ("[0, 0, 1]", "[0, 0, 1e-300]"),
    ],
)
def test_extreme_numbers_end_in_an_answer_or_in_one_line(old: str, new: str, folder: Path) -> None:
    assert old in PARABOLA
    (folder / WISH).write_text(PARABOLA.replace(old, new))
    result = CliRunner().invoke(app, ["simulate", WISH, *HEADING])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert len(result.stderr.splitlines()) == (1 if result.exit_code == 2 else 0)


@pytest.mark.parametrize(
    "text", ["x,y,z\n2,0,0\n1e200,0,0\n", "s,x,y,z\n0,2,0,0\n1e-320,1,0,0\n1,1,1,0\n"]
)
def test_extreme_samples_end_in_one_line(text: str, folder: Path) -> None:
    (folder / CSV).write_text(text)
    (folder / WISH).write_text(PARABOLA.replace(POLYNOMIAL, f"samples: {CSV}"))
    refused(["simulate", WISH, *HEADING], folder)


@pytest.mark.parametrize("words", [["simulate"], ["info"], ["dance"], ["info", "a", "b"]])
def test_a_command_that_cannot_be_understood_exits_with_2(words: list[str]) -> None:
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize("name", ["nothing", "nothing.yaml", ".", "", "x" * 300])
def test_info_refuses_what_is_no_robot_in_one_line(name: str, folder: Path) -> None:
    stdout, line = refused(["info", name], folder)
    assert stdout == ""
    assert "planar_3dof" in line
    stdout, _ = refused(["info", name, "--json"], folder)
    assert json.loads(stdout)["error"]["message"] in line


@pytest.mark.parametrize("case", KEYS.values(), ids=KEYS)
def test_info_refuses_the_same_scenarios_in_the_same_line(case: Bad, folder: Path) -> None:
    _, line = refused(case.write(folder), folder)
    assert refused(["info", WISH], folder) == ("", line)


BROKEN = {name: case for name, case in ROBOTS.items() if isinstance(case.beside.get(URDF), str)}


@pytest.mark.parametrize("case", BROKEN.values(), ids=BROKEN)
def test_info_refuses_a_broken_urdf_in_one_line_for_each_finding(case: Bad, folder: Path) -> None:
    words = case.write(folder)
    _, line = refused(words, folder)
    result = CliRunner().invoke(app, ["info", URDF])
    assert (result.exit_code, result.stdout) == (2, "")
    told = result.stderr.splitlines()
    assert told[0] == line
    assert all(re.match(rf"freefloat: (\w+: )?{URDF}:\d+: ", one) for one in told)
    document = json.loads(CliRunner().invoke(app, ["info", URDF, "--json"]).stdout)
    assert document.keys() == {"findings", "error"}
    assert f"freefloat: {document['error']['message']}" == line
    assert len(document["findings"]) == len(told)
    first = document["findings"][0]
    assert first["severity"] == "error"
    assert (first["file"], first["line"]) == (URDF, document["error"]["line"])


@pytest.mark.parametrize("frame", ["hand", "spacecraft"])
def test_info_refuses_an_end_effector_in_one_line(frame: str, folder: Path) -> None:
    _, line = refused(["info", "spatial_6dof", "--end-effector", frame], folder)
    assert f"'{frame}'" in line
    assert "end_effector" in line
    assert "link_6" in line


SOME = ["file: missing file", "key: unknown key", "key: NaN momentum", "robot: missing URDF"]


@pytest.mark.parametrize("command", ["workspace", "plan", "map"])
@pytest.mark.parametrize("name", SOME)
def test_every_command_refuses_a_bad_scenario_in_the_same_line(
    command: str, name: str, folder: Path
) -> None:
    _, line = refused(CASES[name].write(folder), folder)
    assert refused([command, WISH], folder) == ("", line)
    stdout, again = refused([command, WISH, "--json"], folder)
    assert again == line
    assert json.loads(stdout)["error"]["message"] in line
