"""Precise motions by the kernels are those of the reference engine, and many without them."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

import freefloat as ff
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.integrators import PreciseIntegrator, precise_motion
from freefloat.motion.pointing import AttitudeLimits
from freefloat.motion.problem import Problem
from freefloat.paths.timing import Stop
from freefloat.so3 import Array
from tests.ensembles import headings, states
from tests.errors import error_key
from tests.motions import GOOD, bundled


def dense(motion, count: int = 301) -> Array:
    """Attitudes and joints at evenly spread times, shape (count, 4 + n)."""
    states = motion.sample(np.linspace(0.0, motion.final.time, count))
    return np.array([[*state.attitude, *state.joints] for state in states])


def starts(name: str) -> tuple[Problem, Array, Array]:
    """A problem with a start whose motion completes."""
    problem = bundled(name)
    attitude = np.array({"spatial_6dof/line": GOOD}.get(name, [0.0, 0.0, 0.0, 1.0]))
    attitude = attitude / np.linalg.norm(attitude)
    if problem.task.planar:
        attitude = problem.plane.attitudes(np.radians(200.0))
    branches = problem.branches(attitude)
    return problem, attitude, branches[0].joints


@pytest.mark.parametrize(
    "name", ["spatial_6dof/line", "panda_servicer/line", "planar_3dof/parabola"]
)
def test_a_trajectory_is_that_of_the_reference_engine_at_any_time(name: str) -> None:
    """The paths of the planar case rest in between, where the time law has a break."""
    problem, attitude, joints = starts(name)
    motion = precise_motion(problem, attitude, joints)
    exact = ff.integrate_motion(problem, attitude, joints, tolerance=1e-12)
    assert motion.completed
    assert len(motion.times) != len(exact.times)  # it is the kernels'
    np.testing.assert_allclose(dense(motion), dense(exact), rtol=0.0, atol=1e-9)


def test_all_breaks_of_a_time_law_are_nodes():
    """Also where the kernels' times of breaks are rounded."""
    problem, attitude, _ = starts("planar_3dof/parabola")
    for t in np.linspace(11.3, 22.9, 12).tolist():
        law = ff.Timing(28.617043699785825, "trapezoidal", (Stop(0.6, t),))
        timed = problem.replace(path=ff.TimedPath(problem.path.path, law))
        for start in timed.branches(attitude):
            motion = precise_motion(timed, attitude, start.joints)
            assert not motion.completed or set(timed.breaks) <= set(motion.times)


@pytest.mark.parametrize("branch", [0, 1])
def test_singular_motions_and_those_that_nearly_are_come_from_the_reference_engine(planar, branch):
    """The first ends singular, rates of the second reach 45 rad/s."""
    attitude = planar.plane.attitudes(np.radians(140.0))
    joints = planar.branches(attitude)[branch].joints
    motion, exact = (f(planar, attitude, joints) for f in (precise_motion, ff.integrate_motion))
    assert motion.completed == (branch == 1)
    np.testing.assert_array_equal(motion.joints, exact.joints)


class Own(ff.paths.Curve):
    """A cubic spline through five points, whose third derivative jumps at the middle one."""

    def __init__(self, named: bool) -> None:
        points = [[0.9, 0.2, 0.0], [0.85, 0.3, 0.0], [0.75, 0.38, 0.0], [0.7, 0.5, 0.0],
                  [0.6, 0.55, 0.0]]  # fmt: skip
        self.spline = make_interp_spline([0.0, 0.23, 0.48, 0.81, 1.0], points, k=3)
        self.breaks = np.unique(self.spline.t)[1:-1] if named else np.zeros(0)

    def __call__(self, s: float | Array, order: int = 0) -> Array:
        return np.asarray(self.spline(s, order))


def test_curves_with_unnamed_breaks_are_refused() -> None:
    named, unnamed = (
        ff.Problem("planar_2dof", "end_effector", path=Own(named), duration=20.0)
        for named in (True, False)
    )
    plan = ff.plan(named)
    assert plan.motion is not None
    assert plan.motion.residuals().end_effector_position < 1e-9
    assert error_key(lambda: ff.plan(unnamed)) == "path"


LIMITS = AttitudeLimits(
    pointing=(
        ff.PointingLimit("link_1", [1, 0, 0], 1.0, keep="outside", direction=[0, 1, 0]),
        ff.PointingLimit("link_2", [1, 0, 0], 2.0, point=[3.0, 1.0, 0.0]),
    ),
    base_turn=0.6,
)
MARGIN = 5.0
"""Some motions keep it."""


@pytest.mark.slow
@pytest.mark.parametrize("backward", [False, True])
def test_results_are_those_of_the_kernels(backward: bool) -> None:
    problem = ff.load_scenario("planar_2dof/line").problem()
    attitudes, joints = states(problem, headings(*range(0, 360, 20)))
    given = {"stop_below": MARGIN}
    if backward:
        forward = EnsembleIntegrator(problem, tolerance=1e-11).integrate(attitudes, joints)
        done = forward.endings == 0
        attitudes, joints = forward.attitudes[done], forward.joints[done]
        given |= {"starts": forward.ended_at[done], "ends": 0.4 * forward.ended_at[done]}
    compiled, precise = (
        kind(problem, tolerance=1e-11, limits=LIMITS).integrate(attitudes, joints, **given)
        for kind in (EnsembleIntegrator, PreciseIntegrator)
    )
    assert len(set(precise.endings.tolist())) > 1
    np.testing.assert_array_equal(precise.endings, compiled.endings)
    whole = ~np.isin(precise.endings, [1, 2])  # others stop where they use up the margin
    for name in ("ended_at", "minimum", "attitudes", "joints", "slacks"):
        values, expected = (getattr(result, name)[whole] for result in (precise, compiled))
        np.testing.assert_allclose(values, expected, rtol=1e-6, atol=1e-6, err_msg=name)
    for name in ("rates", "lower", "upper", "determinant_ratios"):  # at other steps
        values, expected = (getattr(result, name)[whole] for result in (precise, compiled))
        np.testing.assert_allclose(values, expected, rtol=0.03, atol=0.03, err_msg=name)
