"""Contact is a limit of every motion that is planned, also with other bodies.

With the elbow on one side the margin is larger, and the second link of ``planar_2dof`` swings
into its spacecraft.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.motion.motion import Motion
from freefloat.planning.answer import Answer
from tests.commands import document, run

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("kernels")]

HEADING = np.radians(16.0)
RATES = np.full(2, 0.25)
DEFAULT, OFF = ff.Limits(RATES), ff.Limits(RATES, clearance="off")
AROUND = ff.Search("margin", [0.0, 0.0, np.sin(HEADING / 2.0), np.cos(HEADING / 2.0)],
                   within=np.radians(2.5))  # fmt: skip


@pytest.fixture(scope="module")
def problem() -> ff.Problem:
    return ff.load_scenario("planar_2dof/line").problem()


def touches(motion: Motion) -> bool:
    """Whether bodies overlap at one of many instants; both are boxes of known size."""
    half, link = np.array([0.45, 0.45]), np.linspace(0.04, 0.86, 83)
    _, attitudes, joints = motion.evaluate(np.linspace(0.0, motion.panels, 400))
    model = motion.problem.model
    for attitude, q in zip(attitudes, joints, strict=True):
        base, _, second = model.body_poses(attitude, q)
        along = second.position + np.outer(link, second.rotation[:, 0])
        inside = np.abs((along - base.position) @ base.rotation[:, :2]) < half
        if inside.all(axis=1).any():
            return True
    return False


def assert_limits_verified(answer: Answer) -> None:
    """``check`` recomputes the clearance where it is a limit, and only there."""
    checks = [entry for entry in ff.check(answer).checks if entry.name.startswith("limit ")]
    assert all(entry.passed for entry in checks)
    (phase,) = answer.phases
    limited = phase.result.limits.clearance != "off"
    assert ("limit clearance" in {entry.name for entry in checks}) is limited


def assert_kept(default: Answer, off: Answer) -> None:
    """By default there is no contact; without the limit there is, as a warning."""
    assert default.feasible, default.reason
    assert off.feasible
    assert default.contact is None
    assert off.contact is not None
    assert off.contact.bodies == ("spacecraft", "link_2")
    for answer in (default, off):
        motions = [phase.motion for phase in answer.phases if phase.motion is not None]
        assert any(map(touches, motions)) is (answer is off)
        assert_limits_verified(answer)


def test_a_plan_avoids_contact(problem: ff.Problem, tmp_path: Path) -> None:
    default, off = (ff.plan(problem, AROUND, limits) for limits in (DEFAULT, OFF))
    assert_kept(default, off)
    assert default.chosen.minimum_margin < off.chosen.minimum_margin
    for number, plan in enumerate((default, off)):
        ff.save(plan, tmp_path / f"{number}.h5")
        saved = ff.load(tmp_path / f"{number}.h5")
        assert saved.limits.clearance == plan.limits.clearance
        assert_limits_verified(saved)


def test_a_simulation_chooses_the_branch_without_contact(problem: ff.Problem) -> None:
    assert_kept(*(ff.simulate(problem, heading=HEADING, limits=each) for each in (DEFAULT, OFF)))
    other = ff.simulate(problem, heading=HEADING, limits=DEFAULT, branch=1)
    assert not other.feasible
    assert "spacecraft - link_2" in other.reason
    assert " m: -0.03799" in other.reason


def test_no_phase_of_a_manoeuvre_is_in_contact(problem: ff.Problem) -> None:
    """A goal after the path, and a way there and back during which the link must not turn in."""
    bent = problem.replace(start_joints=None)
    fold = ff.GoalPhase(ff.Goal(joints=[2.6, 2.4], duration=60.0))
    default, off = (ff.plan_manoeuvre(bent, [fold], AROUND, each) for each in (DEFAULT, OFF))
    assert off.feasible
    assert any(touches(phase.motion) for phase in off.phases)
    scenes = ff.playback(off).scene.description.scenes
    assert any(f"warning: {off.contact}" in scene.lines for scene in scenes)
    for phase in default.phases:
        assert phase.motion is None or not phase.feasible or not touches(phase.motion)
    if not default.feasible:
        assert "clearance of spacecraft - link_2" in default.reason


def test_commands_name_bodies_distance_and_time(tmp_path: Path) -> None:
    """Exit code 1 by default, 0 with a warning where the limit is off."""
    text = run("models", "planar_2dof/line").stdout.replace("planar_2dof.urdf", "planar_2dof")
    lines = [line for line in text.splitlines() if not line.startswith("limits")]
    words = ("--heading", "16", "--branch", "1")
    for value, code in (("", 1), ("limits: {clearance: off}", 0), ("limits: {clearance: 0}", 1)):
        file = tmp_path / "scenario.yaml"
        file.write_text("\n".join([*lines, value]) + "\n")
        result = run("simulate", file, *words, "-o", tmp_path / "motion.h5")
        assert result.exit_code == code
        assert ("although link_2 overlaps" in result.stderr) is (code == 0)
        assert ("Warning: link_2 overlaps spacecraft by 0.038 m" in result.stdout) is (code == 0)
        answer = document("simulate", file, *words, code=code)
        found = [entry for entry in answer["limits"] if entry["limit"] == "clearance"]
        assert (answer["contact"] is None) is bool(found) is bool(code)
        for entry in found:
            assert (entry["where"], entry["kept"]) == ("spacecraft - link_2", False)
            assert entry["worst"] == pytest.approx(-0.038, abs=1e-4)
            assert f"{entry['time']:.4f}" in result.stdout


LIMITS = ff.Limits(clearance=0.02)
PLACE = [0.35, 0.75, 0.0]
"""The elbow of the best motion passes here [m]."""


def beside(*bodies):
    scenario = ff.load_scenario("planar_2dof/line")
    problem = scenario.problem().replace(scene=ff.Scene(bodies))
    return ff.plan(problem, scenario.search(), LIMITS)


@pytest.mark.slow
@pytest.mark.parametrize("in_the_way", [False, True])
def test_a_tumbling_body_is_an_obstacle_at_its_time_only(in_the_way):
    """The same ball on a wheel above: it is down there with the elbow or half a minute later."""
    fixed = ff.SceneBody("client", ff.Sphere(0.1), PLACE)
    free = beside()
    problem = ff.load_scenario("planar_2dof/line").problem().replace(scene=ff.Scene([fixed]))
    attitude, branch = free.chosen.motion.initial.attitude, free.chosen.branch.index
    motion = ff.simulate(problem, attitude, branch=branch).chosen.motion
    (clearance,) = (r for r in ff.check_limits(motion, LIMITS) if r.where == "link_1 - client")
    meeting = clearance.time + (0.0 if in_the_way else 30.0)
    rate = 2.0 * np.pi / 60.0
    body = ff.SceneBody(
        "client", ff.Sphere(0.1), PLACE,
        motion=ff.Tumbling([1.0, 1.0, 1.0], [0.0, rate, 0.0], com=[0.0, 0.0, 1.0]),
    )  # fmt: skip
    start = body.pose_at(-meeting, problem.path)
    body = replace(body, position=start.position, orientation=start.rotation)
    plan = beside(body)
    assert plan.feasible
    assert (plan.chosen.branch.label == "elbow+") is in_the_way
    assert ff.check(plan).passed
