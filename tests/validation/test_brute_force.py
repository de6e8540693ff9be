"""Exact ranges against brute force, and maps against precise motions."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

import freefloat as ff
from freefloat.attitude_grids import attitude_grid
from freefloat.ensemble.endings import COMPLETED
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from tests.motions import bundled
from tests.validation.comparisons import assert_agrees

SCRIPT = Path(__file__).parents[2] / "scripts" / "lab" / "verify_planar_ranges.py"


@pytest.fixture(scope="module")
def verify():
    spec = importlib.util.spec_from_file_location("verify_planar_ranges", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 2, 4, 8, 13])
def test_random_ranges_agree_with_brute_force(verify, number):
    """Every range is found, none invented, limits are even in number.

    The cases have two and three joints, zero and nonzero momentum, and one to three areas.
    """
    problem = verify.random_problem(np.random.default_rng(1000 + number))
    verdict = verify.compare(problem, number, spacing=1.0, steps=700)
    assert verdict.disagreements == []
    assert verdict.limits % 2 == 0
    assert_agrees("test_random_ranges_agree_with_brute_force", verdict.worst)


@pytest.mark.slow
def test_a_map_agrees_with_precise_motions():
    """Endings and smallest |S| over its first value of every fifth motion of a small map."""
    problem = bundled("spatial_6dof/line")
    result = FeasibilityEvaluator(problem, 1).evaluate(attitude_grid(10))
    for at, branch in np.argwhere(result.motions.endings >= 0)[::5]:
        joints = result.joints[at, branch]
        motion = ff.integrate_motion(problem, result.attitudes[at], joints)
        assert motion.completed == (result.motions.endings[at, branch] == COMPLETED)
        lowest = ff.closest_approach(motion, problem.margin.measure)
        off = abs(lowest.value - result.motions.minimum[at, branch])
        assert_agrees(
            "test_a_map_agrees_with_precise_motions", off / abs(problem.margin.measure(joints))
        )
