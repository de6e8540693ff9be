"""Motions: records that can be evaluated anywhere and cut, and their residuals."""

import pickle
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import freefloat as ff
from freefloat.dynamics.momentum import end_effector_jacobian
from freefloat.motion.law import PathLaw
from freefloat.motion.motion import Ending
from tests.differences import assert_close
from tests.errors import error_key
from tests.motions import BAD, GOOD, heading, simulated


@pytest.fixture(scope="module")
def motion(spatial):
    """Example 2, the branch with q1 near 1.25 that comes close to the margin."""
    return simulated(spatial, GOOD, 2)


@pytest.fixture(scope="module")
def singular(spatial):
    """Example 2 from the printed bad attitude."""
    return simulated(spatial, BAD, 2)


@pytest.fixture(scope="module")
def backwards(spatial, motion):
    """The same motion, from its end to its start."""
    final = motion.final
    return ff.integrate_motion(spatial, final.attitude, final.joints, start=100.0, end=0.0)


@pytest.fixture(scope="module")
def stopping(planar):
    """Example 1 from 200 degrees, at rest at F on the way."""
    return simulated(planar, heading(200.0), 0)


def test_a_motion_is_sampled_in_the_order_asked_for(motion):
    times = [70.0, 3.0, 70.0, 100.0, 0.0]
    states = motion.sample(times)
    assert [state.time for state in states] == times
    assert (states[0].joints == states[2].joints).all()
    (alone,) = motion.sample(3.0)
    assert (alone.joints == states[1].joints).all()
    assert motion.sample([]) == ()
    for outside in (-1e-9, 100.0001, np.nan, [50.0, 101.0]):
        assert error_key(motion.sample, outside) == "times"


@pytest.mark.parametrize("place", [0.0, 0.3, 7.0, 12.9999])
def test_a_cut_motion_is_the_motion_up_to_there(motion, place):
    part = motion.cut(place, Ending.MARGIN)
    t, attitude, joints = motion.evaluate(place)
    assert part.ending is Ending.MARGIN
    assert not part.completed
    assert part.panels == np.ceil(place)
    assert part.final.time == pytest.approx(t[0], abs=1e-12)
    assert_close(part.final.joints, joints[0], atol=1e-13)
    assert_close(part.final.attitude, attitude[0], atol=1e-13)
    for state in part.sample(np.linspace(0.0, part.times[-1], 23)):
        (whole,) = motion.sample(state.time)
        assert_close(state.joints, whole.joints, atol=1e-11)


def test_places_and_times_belong_together(motion, backwards, stopping):
    """coordinates_at is the inverse of evaluate, and nodes are where node_coordinates says."""
    for record in (motion, backwards, stopping):
        places = np.linspace(0.0, record.panels, 57)
        times = np.clip(record.evaluate(places)[0], 0.0, 100.0)
        assert_close(record.coordinates_at(times), places, atol=1e-7)
        t, attitudes, joints = record.evaluate(record.node_coordinates)
        assert_close(t, record.times, atol=1e-11)
        assert_close(attitudes, record.attitudes, atol=1e-12)
        assert_close(joints, record.joints, atol=1e-12)


def test_a_good_motion_has_small_residuals(motion, singular, backwards, stopping):
    for record in (motion, singular, backwards, stopping):
        residuals = record.residuals()
        assert residuals.end_effector_position < 1e-8
        assert residuals.end_effector_orientation < 1e-8
        assert residuals.momentum < (1e-5 if record is singular else 1e-6)  # rates without bound


@pytest.mark.parametrize("joint", [1, 4])
def test_one_shifted_joint_node_shows_in_the_end_effector(motion, joint):
    """The position residual is what the Jacobian says the shift does, and momentum jumps, too."""
    node, shift = 8 * 15 + 3, 1e-3
    joints = motion.joints.copy()
    joints[node, joint] += shift
    result = replace(motion, joints=joints).residuals()
    J = end_effector_jacobian(motion.problem.model, motion.joints[node], motion.attitudes[node])
    mass = pin.jacobianCenterOfMass(
        motion.problem.model.pin_model, motion.problem.model.scratch,
        motion.problem.model.configuration(motion.attitudes[node], motion.joints[node]),
    )  # fmt: skip
    moved = np.linalg.norm(J[:3, 6 + joint] - mass[:, 6 + joint])
    angle = np.linalg.norm(J[3:, 6 + joint])
    assert result.end_effector_position == pytest.approx(shift * moved, rel=1e-2)
    assert result.end_effector_orientation == pytest.approx(shift * angle, rel=1e-2)
    assert result.momentum > 1e-3 or joint > 2  # the wrist's bodies 4 and 5 weigh a milligram


@pytest.mark.parametrize("missing", [[1e-3, 0, 0], [0, -2e-3, 0], [0, 0, 0.1]])
def test_the_momentum_residual_is_in_newton_metre_seconds(motion, missing):
    """The residual of a motion with momentum h for a problem with h + d is |d|."""
    other = replace(motion.problem, momentum=motion.problem.momentum + missing)
    result = replace(motion, law=PathLaw(other)).residuals().momentum
    assert result == pytest.approx(np.linalg.norm(missing), rel=1e-3)


def test_a_motion_survives_pickling(motion, singular):
    for record in (motion, singular):
        _ = record.base_positions, record.sample(20.0)
        back = pickle.loads(pickle.dumps(record))
        assert back.ending is record.ending
        for name in ("times", "attitudes", "joints"):
            assert (getattr(back, name) == getattr(record, name)).all()
        assert back.residuals() == record.residuals()
        assert (back.sample(20.0)[0].joints == record.sample(20.0)[0].joints).all()
