"""Problems: the robot, path, task and momentum must be consistent."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import freefloat as ff
from freefloat.beyond.joint_space.distance import distance_to_singularity
from freefloat.singularities.singularity_polynomial import SingularityPolynomial
from freefloat.so3 import heading_quaternion
from tests.differences import assert_close
from tests.errors import error_key
from tests.motions import GOOD


def lifted(model):
    """The planar arm with the mass of its second link moved across the plane."""
    place, mass = '<origin xyz="0.5 0 0"/>', '\n      <mass value="30"/>'
    text = model.description.text
    assert place + mass in text
    raised = text.replace(place + mass, place.replace("0.5 0 0", "0.5 0 0.05") + mass)
    return ff.FreeFloatingModel.from_urdf(raised, "end_effector")


def test_a_planar_task_wants_a_planar_robot_wherever_it_is_named(planar, spatial):
    """A centre of mass off the plane gives momentum about x and y: the plane tips."""
    for model in (spatial.model, lifted(planar.model)):
        q = np.full(model.dof, 0.3)
        for call in (
            lambda task, model=model: replace(planar, model=model, task=task),
            lambda task, model=model: ff.singularity_measure(model, task, "gjm"),
            *(partial(f, model, q) for f in (ff.generalized_jacobian, distance_to_singularity)),
            *(partial(f, model) for f in (SingularityPolynomial.of, ff.singularity_map)),
        ):
            assert error_key(call, "planar-position") == "task"


def test_another_model_brings_its_measure(planar):
    heavier = ff.FreeFloatingModel.from_urdf(
        planar.model.description.text, "end_effector", scale_mass=2.0
    )
    problem = planar.replace(model=heavier)
    measure = ff.singularity_measure(heavier, planar.task, planar.margin.measure.name)
    q = np.full(heavier.dof, 0.7)
    assert problem.margin.measure(q) == measure(q) != planar.margin.measure(q)
    assert problem.margin.threshold == planar.margin.threshold


def test_task_and_momentum_must_fit_robot_and_duration(planar, spatial):
    """Rows as many as joints, momentum along z in the plane, few revolutions of the system."""
    assert error_key(replace, planar, task=ff.Task.POSE) == "task"
    assert error_key(replace, planar, momentum=[0, -0.1, 0.5]) == "momentum"
    assert error_key(replace, spatial, momentum=[1000, 0, 0]) == "momentum"
    replace(spatial, momentum=[100, 0, 0])


def test_an_attitude_is_normalized(spatial):
    result = spatial.attitude(GOOD)
    assert_close(result, np.array(GOOD) / np.linalg.norm(GOOD), atol=1e-15)
    assert error_key(spatial.attitude, 2.0 * result, key="somewhere") == "somewhere"


def test_a_redundant_arm_can_be_asked_for_any_configuration_on_the_path(spatial):
    """Six joints, three coordinates: the configuration given is met, not one of a list."""
    problem = replace(spatial, task=ff.Task.POSITION)
    attitude = problem.attitude(GOOD)
    branches = problem.branches(attitude)
    on_path = spatial.branches(attitude)[3].joints
    chosen = problem.branch_near(attitude, on_path + 0.01, branches)
    assert np.abs(chosen.joints - on_path).max() < 0.05
    assert_close(problem.branch_near(attitude, on_path, branches).joints, on_path, atol=1e-8)
    reached = problem.model.end_effector_pose(attitude, chosen.joints).position
    assert_close(reached, problem.path.pose(0.0).position, atol=1e-8)
    with pytest.raises(ff.InputError):
        problem.branch_near(attitude, on_path + 0.3 * np.eye(6)[1], branches)


def test_a_heading_stands_for_an_attitude_in_the_plane(planar, spatial):
    attitude = planar.attitude(heading=2.0)
    assert_close(attitude, heading_quaternion(2.0), atol=1e-15)
    for problem, wrong in (
        (spatial, {"heading": 2.0}),
        (planar, {"heading": 2.0, "values": attitude}),
        (planar, {"heading": np.nan}),
        (planar, {}),
    ):
        assert error_key(problem.attitude, **wrong) == ("heading" if wrong else "attitude")


def test_plain_values_make_the_problem_of_a_scenario(spatial):
    """A name, a path with its duration, and a measure: the same motion as of Example 2's file."""
    path = spatial.path.path
    problem = ff.Problem(
        "spatial_6dof", "end_effector", path=path, duration=spatial.path.duration,
        momentum=spatial.momentum.tolist(), margin=("in-plane factor", 5),
    )  # fmt: skip
    assert (problem.task, problem.margin.threshold) == (ff.Task.POSE, 5.0)
    motions = [ff.simulate(p, GOOD, branch=0).chosen for p in (problem, spatial)]
    assert_close(*(m.motion.final.joints for m in motions), atol=1e-9)
    assert_close(*(m.minimum_margin for m in motions), atol=1e-9)
    positions = ff.Problem(problem.model, path.curve, duration=50.0, margin=("gjm", 0.1))
    assert (positions.task, positions.redundant) == (ff.Task.POSITION, True)


def test_plain_values_that_are_missing_or_contradict_are_named(spatial):
    path, measure = spatial.path.path, ("gjm", 0.1)
    build = partial(ff.Problem, "spatial_6dof", "end_effector")
    for values, key in (
        ({"duration": 9.0, "margin": measure}, "path"),
        ({"path": path, "margin": measure}, "duration"),
        ({"path": spatial.path, "duration": 9.0, "margin": measure}, "duration"),
        ({"path": path, "duration": 9.0, "margin": ("gjm",)}, "margin"),
        ({"path": path, "duration": 9.0, "margin": ("det", 0.1)}, "measure"),
    ):
        assert error_key(partial(build, **values)) == key
    margin = build(path=path, duration=9.0).margin
    assert (margin.measure.name, margin.threshold) == ("gjm", 0.0)
    other = partial(ff.Problem, spatial.model, "tool", path=spatial.path, margin=measure)
    assert error_key(other) == "end_effector"
