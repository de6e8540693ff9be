"""Feasibility of attitudes agrees with single simulations."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import freefloat as ff
from freefloat.ensemble.endings import COMPLETED, UNREACHED
from freefloat.ensemble.feasibility import FeasibilityEvaluator, has_wrist_flipped_branches
from freefloat.ensemble.result import BranchResults
from freefloat.errors import UnreachableError
from freefloat.so3 import heading_quaternion
from tests.ensembles import CODES
from tests.motions import BAD, bundled

ROUNDING = 1e-4
"""Motions of wrist-flipped branches differ by the integrator's tolerance."""


@cache
def attitudes_for(name: str, count: int) -> np.ndarray:
    """All around for planar arms; at random, the bad attitude of Example 2 first, for others."""
    if bundled(name).task.planar:
        return heading_quaternion(np.linspace(0.05, 6.2, count))
    bad = bundled(name).attitude(BAD)
    rest = Rotation.random(count - 1, rng=np.random.default_rng(41)).as_quat()
    return np.vstack([bad, rest])


CASES = [("spatial_6dof/line", 3), ("planar_3dof/parabola", 9), ("ur5_servicer/arc", 15)]


@cache
def evaluated(name: str, count: int) -> tuple[ff.Problem, np.ndarray, BranchResults]:
    problem, attitudes = bundled(name), attitudes_for(name, count)
    return problem, attitudes, FeasibilityEvaluator(problem, 1).evaluate(attitudes)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "count"), CASES)
def test_results_are_those_of_simulations(name: str, count: int) -> None:
    """The same branches under the same numbers, endings, margins and last states."""
    problem, attitudes, results = evaluated(name, count)
    last = results.motions.joints
    for k, attitude in enumerate(attitudes):
        numbers = np.flatnonzero(results.motions.endings[k] != UNREACHED)
        try:
            simulation = ff.simulate(problem, attitude)
        except UnreachableError:
            assert len(numbers) == 0
            continue
        assert [arm.branch.index for arm in simulation.branches] == numbers.tolist()
        for arm, b in zip(simulation.branches, numbers, strict=True):
            np.testing.assert_allclose(results.joints[k, b], arm.branch.joints, atol=1e-9)
            assert results.motions.endings[k, b] == CODES[arm.motion.ending]
            if arm.motion.completed:
                assert results.motions.minimum[k, b] == pytest.approx(
                    arm.closest_approach.value, rel=3e-3
                )
                assert results.margins[k, b] == results.motions.minimum[k, b]
                np.testing.assert_allclose(last[k, b], arm.motion.final.joints, atol=1e-3)
            else:
                assert results.motions.minimum[k, b] == results.margins[k, b] == 0.0
    assert (results.motions.endings == COMPLETED).any()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "count"), CASES)
def test_stopping_at_the_margin_changes_no_verdict(name: str, count: int) -> None:
    """Simulations that stop at the margin agree, too."""
    problem, attitudes, results = evaluated(name, count)
    margins = np.sort(results.margins[results.margins > 0.0])
    level = float(margins[len(margins) // 2 : len(margins) // 2 + 2].mean())
    strict = replace(problem, margin=ff.Margin(problem.margin.measure, level))
    evaluator = FeasibilityEvaluator(strict, 1)
    stopped = evaluator.evaluate(attitudes, stop_at_margin=True)
    keeps = results.motions.keeps(level)
    np.testing.assert_array_equal(stopped.motions.endings == COMPLETED, keeps)
    np.testing.assert_array_equal(stopped.margins[keeps], results.margins[keeps])
    assert (stopped.margins[~keeps] == 0.0).all()
    np.testing.assert_array_equal(evaluator.keeps(attitudes, None), keeps.any(axis=1))
    assert keeps.any()
    assert not keeps.all()
    sure = np.abs(results.motions.minimum / level - 1.0) > ROUNDING
    for branch in range(keeps.shape[1]):
        clear = sure[:, branch] if evaluator.wrist_flipped else np.full(len(attitudes), True)
        alone = evaluator.keeps(attitudes, branch)
        np.testing.assert_array_equal(alone[clear], keeps[clear, branch])
    for k in np.flatnonzero((results.motions.endings != UNREACHED).any(axis=1))[:1]:
        for arm in ff.simulate(strict, attitudes[k], stop_at_margin=True).branches:
            nearly = abs(results.motions.minimum[k, arm.branch.index] / level - 1.0) < 3e-3
            assert nearly or arm.motion.completed == keeps[k, arm.branch.index]


def test_wrist_flipped_branches_need_a_perpendicular_massless_wrist() -> None:
    assert has_wrist_flipped_branches(bundled("spatial_6dof/line"))
    for name in ("ur5_servicer/arc", "panda_servicer/line", "planar_3dof/parabola"):
        assert not has_wrist_flipped_branches(bundled(name))
        assert not FeasibilityEvaluator(bundled(name), 1).wrist_flipped
    light, load = bundled("spatial_6dof/line"), ff.FreeFloatingModel.from_urdf
    for link, factor in product(("link_4", "link_5"), (10.0, 1e3)):
        model = load("spatial_6dof", "end_effector", scale_mass={link: factor})
        margin = ff.Margin(ff.singularity_measure(model, light.task, "gjm"), 0.0)
        problem = light.replace(model=model, margin=margin)
        assert has_wrist_flipped_branches(problem) is (factor < 1e3), (link, factor)
