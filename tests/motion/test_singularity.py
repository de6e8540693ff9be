"""Kinds of singularities: at the boundary of the reach, of the arm alone, and dynamic ones."""

import numpy as np
import pytest

import freefloat as ff
from freefloat.attitude_grids import attitude_grid
from freefloat.motion.singularity import SingularityKind, singular_event, singularity_kind
from freefloat.so3 import heading_quaternion
from tests.motions import bundled


@pytest.mark.parametrize("seed", range(2))
def test_aligned_axes_of_a_massless_wrist_are_kinematic(seed: int) -> None:
    """S* is singular there, too, whatever the other joints."""
    model = ff.FreeFloatingModel.from_urdf("spatial_6dof")
    joints = np.random.default_rng(seed).uniform(-2.0, 2.0, 6)
    joints[4] = 0.0
    assert ff.singularity_measure(model, ff.Task.POSE, "sigma")(joints) < 1e-9
    assert singularity_kind(model, ff.Task.POSE, joints) is SingularityKind.KINEMATIC


def test_a_straight_planar_arm_is_at_the_boundary_of_its_reach() -> None:
    model = ff.FreeFloatingModel.from_urdf("planar_2dof")
    task = ff.Task.PLANAR_POSITION
    assert ff.singularity_measure(model, task, "sigma")(np.zeros(2)) < 1e-12
    assert singularity_kind(model, task, np.zeros(2)) is SingularityKind.BOUNDARY


def test_the_end_of_example_1_from_140_degrees_is_dynamic() -> None:
    """Its elbow is 14 degrees from folded."""
    simulation = ff.simulate(
        bundled("planar_3dof/parabola"), heading_quaternion(np.radians(140.0)), branch=0
    )
    event = singular_event(simulation.chosen.motion)
    assert event is not None
    assert event.kind is SingularityKind.DYNAMIC
    assert simulation.to_dict()["singular"] == event.to_dict()


@pytest.mark.slow
def test_a_heavy_spacecraft_s_arm_ends_stretched() -> None:
    """Of ETS-VII, whose elbow is half a degree from straight where S* is singular."""
    problem = bundled("ets_vii/line")
    branches = ff.simulate(problem, attitude_grid(24, 5)[16]).branches
    events = [singular_event(branch.motion) for branch in branches]
    assert {event.kind for event in events if event} == {SingularityKind.BOUNDARY}
