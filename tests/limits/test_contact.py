"""Contact is a limit where collision shapes exist, unless it is switched off, which warns."""

from functools import partial

import numpy as np
import pytest
import trimesh

import freefloat as ff
from freefloat.errors import ModelError
from freefloat.limits.limits import deepest_contact, why_unchecked
from freefloat.limits.pairs import CollisionPairs
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from tests.errors import error_key
from tests.prismatic import RELATIVE, prismatic_motion, prismatic_robot, shape_text
from tests.robots import inertial_text, joint_text

CUBE, BALL = shape_text('<box size="1 1 1"/>'), shape_text('<sphere radius="0.1"/>')
MISSING = shape_text('<mesh filename="none.stl"/>')
assert_close = partial(np.testing.assert_allclose, rtol=0, atol=1e-6)


def drawn(shape: str) -> str:
    return shape.replace("collision>", "visual>")


def mast(x: float, z: float = 0.15, shape: str = BALL) -> str:
    """A ball on the spacecraft, near the line along which the end-effector moves, with a mass."""
    inertial = inertial_text(1e-9, 1e-9 * np.eye(3))
    joint = joint_text("mast_joint", "F", "bus", "mast", f"{x} 0 {z}")
    return f'{joint}<link name="mast">{inertial}{shape}</link>'


SCENARIO = """
robot: {urdf: r.urdf, end_effector: hand}
task: position
path: {line: {from: [1, 0, 0], to: [1.4, 0, 0]}}
timing: {duration: 10}
margin: {value: 0}
"""
IN_THE_WAY = mast(1.0 + 0.37 * RELATIVE)
"""Two balls of 0.1 m whose centres pass each other at 0.15 m: they overlap by 0.05 m."""


def clearance_of(motion: Motion, *given: object) -> LimitResult | None:
    """The result of the clearance under limits with a value of it, or with none."""
    limits = ff.Limits(clearance=given[0]) if given else ff.Limits()
    results = [entry for entry in ff.check_limits(motion, limits) if entry.limit == "clearance"]
    assert len(results) < 2
    return results[0] if results else None


@pytest.mark.parametrize("off", ["off", False])
def test_contact_is_a_limit_unless_it_is_switched_off(off: object) -> None:
    """The same as of a clearance of zero; without it, the contact is stated as a warning."""
    motion = prismatic_motion(prismatic_robot(CUBE, BALL, IN_THE_WAY))
    result = clearance_of(motion)
    assert result == clearance_of(motion, 0.0)
    assert (result.kept, result.at_least, result.where) == (False, True, "mast - hand")
    assert result.notes == ()
    assert_close([result.worst, result.allowed], [-0.05, 0.0])
    assert_close(motion.problem.path.timing.s(result.time), 0.37)
    assert clearance_of(motion, off) is None
    attitude = motion.initial.attitude
    default, silent = (
        ff.simulate(motion.problem, attitude, limits=ff.Limits(clearance=value))
        for value in (None, off)
    )
    assert (default.feasible, silent.feasible) == (False, True)
    assert default.contact is None
    assert " - ".join(silent.contact.bodies) == result.where
    assert_close([silent.contact.depth, silent.contact.time], [-result.worst, result.time])


def test_visuals_count_for_a_clearance_that_is_asked_for_alone() -> None:
    """A link with mass that has no collision shape is named."""
    visual = prismatic_motion(
        prismatic_robot(drawn(CUBE), drawn(BALL), mast(1.5, 0.15, drawn(BALL)))
    )
    assert clearance_of(visual) is None
    assert not clearance_of(visual, 0.0).kept
    one = prismatic_motion(prismatic_robot(CUBE, BALL, mast(1.5, 0.15, drawn(BALL))))
    result = clearance_of(one)
    assert (result.kept, result.where) == (True, "bus - hand")
    assert result.notes == ("mast: without collision shape",)
    assert not clearance_of(one, 0.0).kept


@pytest.mark.parametrize("shapes", [(CUBE, ""), ("", BALL), ("", "")])
def test_one_body_with_a_shape_touches_nothing(shapes: tuple[str, str]) -> None:
    motion = prismatic_motion(prismatic_robot(*shapes))
    assert ff.check_limits(motion, ff.Limits()) == ff.check_limits(
        motion, ff.Limits(clearance="off")
    )
    assert deepest_contact(motion) is None
    assert error_key(ff.check_limits, motion, ff.Limits(clearance=0.0)) == "limits.clearance"
    assert why_unchecked(motion.problem.model) is not None


@pytest.mark.parametrize("more", ["", mast(1.5)])
def test_shapes_that_cannot_be_used_are_left_out_and_named(more: str) -> None:
    """Also where nothing is left to compare; a clearance that is asked for is refused."""
    motion = prismatic_motion(prismatic_robot(MISSING, BALL, more))
    result = clearance_of(motion)
    assert result.notes == ("bus: no collision shape from none.stl: no such file",)
    assert (result.kept, result.where) == ((False, "mast - hand") if more else (True, "no pair"))
    assert result.to_dict()["worst"] == (pytest.approx(-0.05) if more else None)
    with pytest.raises(ModelError):
        clearance_of(motion, 0.0)
    unchecked = why_unchecked(motion.problem.model)
    assert (unchecked is None) if more else ("none.stl" in unchecked)
    assert why_unchecked(prismatic_motion(prismatic_robot(CUBE, BALL)).problem.model) is None


def between_cubes(folder, gap: float) -> Motion:
    """An end-effector of radius 0.1 m that passes between two cubes of one mesh."""
    away = gap / 2.0 + 0.05
    cubes = [trimesh.creation.box([0.1] * 3).apply_translation([0, 0, z]) for z in (-away, away)]
    trimesh.util.concatenate(cubes).export(folder / "gate.stl")
    mesh = shape_text('<mesh filename="gate.stl"/>')
    gate = f'<link name="gate">{mesh}</link>'
    file = folder / "robot.urdf"
    more = joint_text("gate_joint", "F", "bus", "gate", "1.4 0 0") + gate
    file.write_text(prismatic_robot(CUBE, BALL, more))
    return prismatic_motion(file)


def test_meshes_in_contact_are_divided_into_convex_parts(tmp_path) -> None:
    """The convex hull of the two cubes closes the gap between them."""
    assert deepest_contact(between_cubes(tmp_path, 0.24)) is None
    motion = between_cubes(tmp_path, 0.18)
    contact = deepest_contact(motion)
    assert contact.bodies == ("gate", "hand")
    assert str(contact) == f"hand overlaps gate by 0.01 m at t = {contact.time:.4f} s"
    assert contact.to_dict() == {**vars(contact), "bodies": ["gate", "hand"]}
    assert contact.s == motion.problem.path.timing.s(contact.time)
    assert_close(contact.depth, 0.01)


@pytest.mark.slow
@pytest.mark.usefixtures("kernels")
def test_motions_to_goals_keep_away_from_bodies_without_a_clearance() -> None:
    """A ball where the end-effector would pass; by default it is passed without contact."""
    system = ff.System(ff.FreeFloatingModel.from_urdf("planar_2dof"))
    state, there = ([0.0, 0.0, 0.0, 1.0], [0.2, 0.4]), ff.Goal(joints=[1.2, 0.4])
    rates = np.full(2, 0.1)
    half = ff.move(system, state, ff.Goal(joints=[0.7, 0.4]), ff.Limits(rates)).motion.final
    place = system.model.end_effector_pose(half.attitude, half.joints).position
    ball = ff.Scene((ff.SceneBody("ball", ff.Sphere(0.2), place),))
    around = ff.move(system, state, there, ff.Limits(rates), ball)
    through = ff.move(system, state, there, ff.Limits(rates, clearance="off"), ball)
    assert around.feasible, around.reason
    assert around.contact is None
    assert clearance_of(around.motion).kept
    assert through.feasible
    assert through.contact.bodies[1] == "ball"
    assert through.contact.depth > 0.04
    assert through.duration < around.duration


def test_robots_and_scenarios_are_of_the_folder_where_they_were_read(tmp_path, monkeypatch) -> None:
    """Also after the program has changed its working folder, where other files have these names."""
    text = prismatic_robot(shape_text('<mesh filename="m.stl"/>'), BALL)
    for name, size in (("read", 3.0), ("other", 0.2)):
        folder = tmp_path / name
        folder.mkdir()
        trimesh.creation.box((size, size, size)).export(folder / "m.stl")
        (folder / "r.urdf").write_text(text.replace("90.0", f"{30.0 * size}"))
        (folder / "s.yaml").write_text(SCENARIO)
    monkeypatch.chdir(tmp_path / "read")
    whole = ff.load_scenario(tmp_path / "read" / "s.yaml").problem().model
    scenario, model = ff.load_scenario("s.yaml"), ff.FreeFloatingModel.from_urdf("r.urdf", "hand")
    monkeypatch.chdir(tmp_path / "other")
    for found in (model, scenario.problem().model):
        assert found.total_mass == whole.total_mass
        distances = (CollisionPairs(robot).distances(np.zeros(3), [0]) for robot in (found, whole))
        assert next(distances) == next(distances)
