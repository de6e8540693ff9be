"""Plans beside other bodies: the attitude is one from which the arm passes them."""

from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff

pytestmark = pytest.mark.usefixtures("kernels")
LIMITS = ff.Limits(clearance=0.02)
PLACE = [0.35, 0.75, 0.0]
"""The elbow of the best motion passes here [m]."""


def beside(*bodies):
    """The plan beside some bodies."""
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
