"""Limits of pointing and of the spacecraft's turn, against dense sampling of motions."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.attitude_grids import attitude_grid
from freefloat.ensemble.endings import COMPLETED, LIMITED
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.limits.limits import Limits, check_limits
from freefloat.motion.integration import integrate_motion
from freefloat.motion.motion import Motion
from freefloat.motion.pointing import AttitudeLimits, PointingLimit
from freefloat.so3 import angle_between, heading_quaternion
from tests.errors import error_key

SCENARIOS = ["spatial_6dof/line", "ets_vii/reach", "planar_3dof/parabola_nonstop"]


def axis_and_target(limit, model, attitudes, joints, centres):
    """Axis and direction of the target by a product of rotations, without Pinocchio, (K, 3).

    Points are given in a fixed frame in which the centre of mass has the positions ``centres``.
    """
    R, p = np.repeat(np.eye(3)[None], len(joints), axis=0), np.zeros((len(joints), 3))
    number, place = model.link_places[limit.body]
    centre = np.zeros((len(joints), 3))
    for k, body in enumerate(model.bodies):
        if k > 0:
            p = p + R @ body.placement.position
            R = R @ body.placement.rotation
            step = joints[:, k - 1 : k] * body.axis
            if body.prismatic:
                p = p + np.einsum("kij,kj->ki", R, step)
            else:
                R = R @ Rotation.from_rotvec(step).as_matrix()
        centre += body.mass * (p + R @ body.centre) / model.total_mass
        if k == number:
            axis, origin = R @ place.rotation @ limit.axis, p + R @ place.position
    R0 = Rotation.from_quat(attitudes)
    if limit.point is None:
        return R0.apply(axis), np.broadcast_to(limit.direction, axis.shape)
    sight = limit.point - centres - R0.apply(origin - centre)
    return R0.apply(axis), sight / np.linalg.norm(sight, axis=1, keepdims=True)


def cosines(motion: Motion, limits: AttitudeLimits) -> np.ndarray:
    """Extreme cosines of the angles of all limits along a motion, by dense sampling."""
    times, attitudes, joints = motion.evaluate(np.linspace(0.0, motion.panels, 20_001))
    centres = np.outer(times, motion.problem.path.drift)
    extremes = []
    for limit in limits.pointing:
        axis, target = axis_and_target(limit, motion.problem.model, attitudes, joints, centres)
        values = np.einsum("ki,ki->k", axis, target)
        extremes.append(values.min() if limit.keep == "inside" else values.max())
    turn = angle_between(attitudes, attitudes[0]).max()
    return np.array([*extremes, np.cos(turn / 2.0)])


def limits_of(model) -> AttitudeLimits:
    root, tip = model.body_names[0], model.body_names[-1]
    return AttitudeLimits(
        pointing=(
            PointingLimit(root, [0.0, 1.0, 0.2], 1.2, direction=[0.0, 1.0, 0.2]),
            PointingLimit(tip, [1.0, 0.2, 0.0], 0.8, "outside", direction=[0.3, 0.4, 0.0]),
            PointingLimit(model.body_names[2], [0.0, 0.3, 1.0], 2.0, point=[1.5, 0.4, 3.0]),
        ),
        base_turn=0.7,
    )


def starts(problem, count):
    """Attitudes and joints of motions of all arm branches."""
    attitudes = attitude_grid(count)
    if problem.task.planar:
        attitudes = heading_quaternion(np.linspace(0.0, 6.2, count))
    branches = problem.many_branches(attitudes)
    return attitudes[np.nonzero(branches.exist)[0]], branches.joints[branches.exist]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "drift"), [*((name, 0.0) for name in SCENARIOS), ("spatial_6dof/line", 0.004)]
)
def test_compiled_precise_and_sampled_extremes_agree(name: str, drift: float) -> None:
    problem = ff.load_scenario(name).problem()
    problem = replace(problem, path=replace(problem.path, drift=drift * np.array([0.3, 0.9, 0.5])))
    limits = limits_of(problem.model)
    attitudes, joints = starts(problem, 24)
    result = EnsembleIntegrator(problem, 1, limits=limits).integrate(attitudes, joints)
    signs = np.array([1.0, -1.0, 1.0, 1.0])
    bounds = np.cos([1.2, 0.8, 2.0, 0.35])
    ended = np.flatnonzero(np.isin(result.endings, (COMPLETED, LIMITED)))
    assert len(ended) > 12
    for k in ended[:: len(ended) // 6]:
        motion = integrate_motion(problem, attitudes[k], joints[k])
        sampled = cosines(motion, limits)
        np.testing.assert_allclose(result.slacks[k], signs * (sampled - bounds), atol=1e-4)
        turn, pointing = check_limits(
            motion, Limits(pointing=limits.pointing, base_turn=limits.base_turn, clearance="off")
        )[-2:]
        assert turn.worst == pytest.approx(2.0 * np.arccos(sampled[3]), abs=1e-6)
        assert turn.ratio == pytest.approx(turn.worst / limits.base_turn)
        ratios = (np.arccos(sampled[:3]) / [1.2, 0.8, 2.0]) ** signs[:3]
        assert pointing.ratio == pytest.approx(ratios.max(), abs=1e-6)
        assert pointing.where.endswith(f"(pointing.{ratios.argmax()})")
        kept = turn.kept and pointing.kept
        if abs((signs * (sampled - bounds)).min()) > 2e-4:
            assert bool(result.endings[k] == COMPLETED) is kept


def test_a_turn_through_half_a_revolution_is_one_of_180_degrees() -> None:
    """Where the angle from the first attitude has a kink, between the steps of the integrator."""
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    problem = problem.replace(momentum=np.array([0.0, 0.0, 6.0]))  # turns by more, about z
    attitudes, joints = starts(problem, 24)
    limits = AttitudeLimits(base_turn=np.radians(178.0))
    result = EnsembleIntegrator(problem, 1, limits=limits).integrate(attitudes, joints)
    through = result.endings == LIMITED
    assert through.sum() > 10
    np.testing.assert_allclose(result.slacks[through, -1], -np.cos(np.radians(89.0)), atol=1e-12)


def test_an_axis_on_the_wrist_is_followed_along_every_branch() -> None:
    """Wrist-flipped branches have the same motion, but not of the bodies in the wrist."""
    problem = ff.load_scenario("spatial_6dof/line").problem()
    body = problem.model.body_names[4]
    limit = PointingLimit(body, [1.0, 0.5, 0.2], 1.5, direction=[0, 0, 1])
    limits = AttitudeLimits(pointing=(limit,))
    slacks = FeasibilityEvaluator(problem, limits=limits).evaluate(attitude_grid(16)).motions.slacks
    assert np.nanmax(np.abs(slacks[:, ::2] - slacks[:, 1::2])) > 0.1


@pytest.mark.parametrize(("change", "key"), [
    ({"point": [1, 0, 0]}, "target"), ({"direction": [0, 0, 0]}, "target.direction"),
])  # fmt: skip
def test_errors_of_a_pointing_limit(change: dict, key: str) -> None:
    values = {"body": "spacecraft", "axis": [1, 0, 0], "angle": 0.5, "direction": [0, 0, 1]}
    assert error_key(lambda: PointingLimit(**values | change)) == key
    problem = ff.load_scenario("planar_2dof/line").problem()
    limits = Limits(pointing=(PointingLimit(**values | {"body": "antenna"}),))
    assert error_key(ff.plan, problem, limits=limits) == "limits.pointing.0.body"


def test_a_limit_is_shown_by_its_name_in_degrees() -> None:
    content = yaml.safe_load(ff.load_scenario("planar_2dof/line").text)
    cone = {"body": "spacecraft", "axis": [1, 0, 0], "target": {"direction": [1, 0, 0]}}
    cone |= {"name": "star tracker", "keep": "outside", "angle_deg": 20.0}
    scenario = ff.load_scenario(content | {"limits": {"pointing": [cone]}})
    motion = ff.simulate(scenario.problem(), heading=1.0).chosen.motion
    (result,) = [r for r in check_limits(motion, scenario.limits()) if r.limit == "pointing"]
    assert result.where == "star tracker"
    assert result.sentence == f"at least 20 deg: {np.degrees(result.worst):.4g}"
    assert scenario.limits().pointing[0].to_dict() | {"angle_deg": 20.0} == cone


@pytest.mark.parametrize("keep", ["inside", "outside"])
@pytest.mark.parametrize("angle", [0.4, 2.5])
def test_narrower_limits_leave_less_room(keep: str, angle: float) -> None:
    limit = ff.PointingLimit("spacecraft", [0, 0, 1], angle, direction=[1, 0, 0], keep=keep)
    narrower = Limits(pointing=(limit,), base_turn=1.0).narrower(0.1)
    (narrow,) = narrower.pointing
    assert narrower.base_turn == pytest.approx(0.9)
    room = [a if keep == "inside" else np.pi - a for a in (narrow.angle, angle)]
    assert 0.85 * room[1] < room[0] < room[1]
