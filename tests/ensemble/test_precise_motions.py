"""Many motions without kernels have the results of those with them."""

from __future__ import annotations

import numpy as np
import pytest

import freefloat as ff
from freefloat.ensemble.ensemble import EnsembleIntegrator
from freefloat.ensemble.integrators import PreciseIntegrator
from freefloat.motion.pointing import AttitudeLimits
from tests.ensembles import headings, states

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
