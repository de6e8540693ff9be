"""Numerical edges: what is expected of very long, small, tumbling and singular cases."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.engines.mujoco import forward_run, inverse_run
from freefloat.beyond.engines.mujoco_model import MuJoCoModel
from freefloat.certificate.certificate import certify
from freefloat.ensemble.endings import COMPLETED, SINGULAR
from freefloat.errors import IntegrationError
from freefloat.motion import integration
from freefloat.motion.margin import keeps_threshold
from freefloat.motion.motion import Ending
from freefloat.paths.curves import PolynomialCurve
from freefloat.robot.named_files import models_folder
from freefloat.so3 import heading_of
from tests.motions import GOOD, along, bundled, compiled_motion, heading, lasting, simulated
from tests.robots import in_units

assert_close = partial(np.testing.assert_allclose, rtol=0)
UPRIGHT = np.eye(3)


@pytest.fixture(scope="module")
def spatial():
    """Example 2."""
    return bundled("spatial_6dof/line")


@pytest.fixture(scope="module")
def planar():
    """Example 1, without the stop."""
    return bundled("planar_3dof/parabola_nonstop")


def assert_equal_ends(motion, other, tolerance):
    """Two motions have the same attitude and joints at both ends."""
    for state, reference in ((motion.initial, other.initial), (motion.final, other.final)):
        assert_close(state.joints, reference.joints, atol=tolerance)
        assert_close(state.attitude, reference.attitude, atol=tolerance)


def assert_compiled_agrees(motion, tolerance):
    compiled = compiled_motion(motion)
    assert compiled.endings[0] == (COMPLETED if motion.completed else SINGULAR)
    assert_close(compiled.joints[0], motion.final.joints, atol=tolerance)


@pytest.mark.parametrize(("name", "joints", "step"), [
    ("planar_3dof/parabola", [0.0, 0.0, 0.4], [0.2, 0.0, 0.0]),  # stretched
    ("planar_3dof/parabola", [0.0, np.pi, 0.4], [0.2, 0.0, 0.0]),  # folded back
    ("spatial_6dof/line", [0.0] * 6, [-0.3, 0.0, 0.0]),  # elbow and wrist straight
    ("spatial_6dof/line", [0.3, 0.4, 1.1, 0.2, 0.0, -0.5], [-0.3, 0.0, 0.0]),  # wrist straight
])  # fmt: skip
def test_a_singular_start_is_the_end_of_the_motion(name, joints, step):
    """Expected: singular at 0 s, nothing moves.

    Compiled motions see a change of sign alone: they end as soon, or leave with a det S* below
    1e-9 of its largest, from which no margin is kept.
    """
    usual = bundled(name)
    pose = usual.model.end_effector_pose([0, 0, 0, 1], joints)
    problem = along(
        usual.model, usual.task, pose.position, pose.position + step, pose.rotation, 20.0
    )
    motion = ff.integrate_motion(problem, [0, 0, 0, 1], joints)
    assert motion.ending is Ending.SINGULAR
    assert (len(motion.times), motion.final.time) == (1, 0.0)
    compiled = compiled_motion(motion)
    ended = compiled.endings[0] == SINGULAR and compiled.ended_at[0] < 1e-2
    assert ended or compiled.determinant_ratios[0] < 1e-9
    assert not compiled.keeps(1e-6 * abs(problem.margin.measure(np.array(joints) + 0.3)))[0]


@pytest.mark.parametrize("above", [-1e-9, 1e-9])
def test_a_margin_grazed_to_a_billionth_is_reported(planar, above):
    """Expected: a threshold 1e-9 below the smallest |S| is kept, 1e-9 above it is not.

    The verdict on a finished motion allows a millionth of S0 for rounding.
    """
    motion = simulated(planar, heading(200.0), 0)
    lowest = ff.closest_approach(motion, planar.margin.measure)
    margin = ff.Margin(planar.margin.measure, lowest.value + above)
    problem = replace(planar, margin=margin)
    grazing = simulated(problem, heading(200.0), 0, stop_at_margin=True)
    assert grazing.completed == (above < 0.0)
    if not grazing.completed:
        assert grazing.ending is Ending.MARGIN
        assert grazing.final.time == pytest.approx(lowest.time, abs=1e-3)
    assert margin.keeps(lowest.value)
    assert not keeps_threshold(lowest.value, lowest.value * (1.0 + 2e-6))
    fine = compiled_motion(motion, tolerance=1e-11)
    assert fine.minimum[0] == pytest.approx(lowest.value, abs=1e-7)


def test_many_rotations_raise_an_error(spatial, monkeypatch):
    """Expected: rotations that need more steps than allowed end in an error with the time."""
    monkeypatch.setattr(integration, "_MAX_STEPS", 100)
    with pytest.raises(IntegrationError) as caught:
        simulated(lasting(spatial, 5e4), GOOD, 2)
    assert 0.0 < caught.value.time < 5e4


@pytest.mark.slow
def test_a_spacecraft_that_tumbles_is_confirmed_by_both_engines(planar):
    """Expected: 20 N m s rotate it four times and more in 100 s; errors stay those of rounding."""
    problem = along(
        planar.model, ff.Task.PLANAR_POSE, [2.1, 0, 0], [2.1, 0.2, 0], UPRIGHT, 100.0, [0, 0, 20.0]
    )
    motion = simulated(problem, heading(10.0), 0)
    assert motion.completed
    headings = np.unwrap([heading_of(attitude) for attitude in motion.attitudes])
    assert (headings[-1] - headings[0]) / (2.0 * np.pi) > 4.0
    assert_compiled_agrees(motion, 1e-3)
    certificate = certify(motion)
    assert certificate.momentum.value < 1e-6 * certificate.momentum_scale
    assert certificate.end_effector_position.value < 1e-8
    assert certificate.integration.attitude < 1e-6
    engine = MuJoCoModel(problem.system)
    inverse = inverse_run(motion, engine)
    assert inverse.wrench < 1e-5 * inverse.torque
    assert forward_run(motion, engine).attitude < 1e-3


def small(name, metres, kilograms=1.0):
    """A bundled problem with all lengths and masses scaled, and what follows from them."""
    robot = name.split("/")[0]
    text = (models_folder() / robot / f"{robot}.urdf").read_text()
    model = ff.FreeFloatingModel.from_urdf(in_units(text, metres, kilograms), "end_effector")
    usual = bundled(name)
    path = ff.EndEffectorPath(
        PolynomialCurve(metres * usual.path.path.curve.coefficients), usual.path.path.orientation
    )
    timed = ff.TimedPath(path, usual.path.timing)
    momentum = metres**2 * kilograms * usual.momentum
    plain = along(model, usual.task, [0, 0, 0], [1, 0, 0], UPRIGHT)
    value = metres**4 * kilograms * usual.margin.threshold  # S of (21a): an inertia times an area
    return ff.Problem(model, timed, usual.task, momentum, ff.Margin(plain.margin.measure, value))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "attitude", "branch", "kilograms"),
    [("spatial_6dof/line", GOOD, 2, 2.5e-6),
     ("planar_3dof/parabola_nonstop", heading(246.0), 0, 1.0)],
)  # fmt: skip
def test_an_arm_of_millimetres_moves_as_one_of_metres(
    name, attitude, branch, kilograms, tmp_path, monkeypatch
):
    """Expected: a thousandth in length, and of 1 g instead of 400 kg: the same joints to 1e-7."""
    monkeypatch.chdir(tmp_path)
    problem = small(name, 1e-3, kilograms)
    motion = simulated(problem, attitude, branch)
    assert_equal_ends(motion, simulated(bundled(name), attitude, branch), 1e-7)
    assert_compiled_agrees(motion, 1e-3)
    inverse = inverse_run(motion, MuJoCoModel(problem.system))
    assert inverse.wrench < 1e-4 * inverse.torque
    assert not Path("MUJOCO_LOG.TXT").exists()  # of inertias near zero
