"""SRDF: pairs of links that are not compared for contact, as Pinocchio removes them."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml

import freefloat as ff
from freefloat.limits.pairs import CollisionPairs
from freefloat.robot.parts import Attachment
from tests.commands import document, error
from tests.prismatic import shape_text
from tests.robots import inertial_text, joint_text, link_text

BODY = inertial_text(5.0, np.eye(3)) + shape_text('<sphere radius="0.02"/>')
CHAIN = ("bus", "upper", "lower", "hand")
URDF = "".join((
    '<robot name="r">', *(link_text(name, BODY) for name in (*CHAIN, "antenna", "camera")),
    *(joint_text(f"q{k}", "R", *ends, "0.5 0 0", axis="0 1 0")
      for k, ends in enumerate(pairwise(CHAIN))),
    joint_text("a", "F", "bus", "antenna", "0 0.4 0"), joint_text("c", "F", "lower", "camera"),
    "</robot>",
))  # fmt: skip
SRDF = """<robot name="r"><group name="arm"><chain base_link="bus" tip_link="hand"/></group>
  <disable_collisions link1="hand" link2="antenna" reason="Never"/>
  <disable_collisions link1="bus" link2="camera"/>
  <passive_joint name="q2"/>
</robot>"""


@pytest.fixture
def files(tmp_path: Path) -> Path:
    (tmp_path / "robot.urdf").write_text(URDF)
    (tmp_path / "robot.srdf").write_text(SRDF)
    robot = {"urdf": "robot.urdf", "end_effector": "hand", "srdf": "robot.srdf"}
    line = {"from": [1.2, 0, 0.3], "to": [1.2, 0, 0.4]}
    scenario = {
        "robot": robot, "task": "position", "path": {"line": line},
        "timing": {"duration": 9}, "margin": {"measure": "gjm", "value": 0.1},
    }  # fmt: skip
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(scenario))
    return tmp_path


def compared(model: ff.FreeFloatingModel) -> set[frozenset[str]]:
    pairs = CollisionPairs(model)
    return {frozenset(pairs.links(number)) for number in range(len(pairs.pairs))}


def test_the_same_pairs_are_left_out_as_by_pinocchio(files: Path) -> None:
    """Links that fixed joints merge are links of pairs; results and other assemblies keep them."""
    model = pin.buildModelFromXML(URDF, pin.JointModelFreeFlyer())
    geometry = pin.buildGeomFromUrdfString(model, URDF, pin.COLLISION)
    geometry.addAllCollisionPairs()
    every = len(geometry.collisionPairs)
    pin.removeCollisionPairsFromXML(model, geometry, SRDF)
    names = [model.frames[shape.parentFrame].name for shape in geometry.geometryObjects]
    kept = {frozenset((names[pair.first], names[pair.second])) for pair in geometry.collisionPairs}
    assert len(kept) == every - 2
    source = ff.RobotSource(files / "robot.urdf", srdf=files / "robot.srdf")
    robot = ff.FreeFloatingModel.from_urdf(source, "hand")
    joined = {frozenset(ends) for ends in pairwise(CHAIN)}
    assert compared(robot) == kept - joined
    again = ff.FreeFloatingModel.from_urdf(robot.description.text, "hand")
    assert compared(again) == compared(robot)
    second = Attachment(source, prefix="b_")
    both = ff.FreeFloatingModel.from_urdf(robot.description.text, "hand", attached=[second])
    assert frozenset(("b_hand", "b_antenna")) in both.description.disabled_pairs


def test_what_else_srdf_says_is_listed(files: Path) -> None:
    entries = document("info", files / "robot.yaml")["not_read"]
    assert [(entry["element"], entry["line"]) for entry in entries] == [
        ("group arm", 1), ("passive_joint q2", 4)]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (SRDF.replace("antenna", "antena"), "antena"),
        (SRDF.replace('link2="camera"', ""), "without link2"),
        (URDF, "URDF"),
        ("<robot", "XML"),
    ],
)
def test_srdf_that_does_not_fit_is_refused(files: Path, text: str, problem: str) -> None:
    (files / "robot.srdf").write_text(text)
    refusal = error("plan", files / "robot.yaml")
    assert refusal["key"] == "srdf"
    assert problem in refusal["message"]
    (files / "robot.srdf").unlink()
    assert "robot.srdf" in error("plan", files / "robot.yaml")["message"]
