"""The bundled models: what they are made of, and published numbers where there are some."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import freefloat as ff
from freefloat.planning.limits.keeping import keep_limits
from freefloat.planning.motions import evaluator_for
from freefloat.planning.path_planner import plan_attitude

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
SAMPLES = 64


def test_the_two_real_arms_have_the_published_masses_and_lengths() -> None:
    ets_vii, ssrms = map(ff.FreeFloatingModel.from_urdf, ("ets_vii", "ssrms"))
    assert ets_vii.warnings == ssrms.warnings == ()
    assert [body.mass for body in ets_vii.bodies] == [2550, 35, 22.5, 21.9, 16.5, 26, 18.5]
    assert np.isclose(ssrms.total_mass, 1e5 + 2 * 243.66 + 4 * 105.98 + 314.88 + 279.2, rtol=1e-12)
    straight = ets_vii.body_poses(IDENTITY, np.zeros(6))
    shoulder = straight[2].position
    position = ets_vii.end_effector_pose(IDENTITY, np.zeros(6)).position
    assert np.isclose(np.linalg.norm(position - shoulder), np.hypot(0.87 + 0.63 + 0.53, np.hypot(
        0.26, 0.28)), rtol=1e-12)  # fmt: skip
    upright = ssrms.end_effector_pose(IDENTITY, np.zeros(7)).position
    foot = ssrms.body_poses(IDENTITY, np.zeros(7))[0].position[2] + 2.2
    assert np.isclose(upright[2] - foot, 2 * (1.3589 + 7.11), rtol=1e-12)


PLANNED = ("planar_2dof/line", "ur5_servicer/inspect", "ssrms/transfer")
"""Scenarios with limits: in the plane, with meshes, redundant. scripts/lab/verify_plans.py plans
all of them, and docs/how-to/limits.md that of ETS-VII."""


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANNED)
def test_a_scenario_plans_within_its_limits(name: str) -> None:
    scenario = ff.load_scenario(name)
    problem, limits = scenario.problem(), scenario.limits()
    assert limits is not None
    evaluator = evaluator_for(problem)
    search = replace(scenario.search(), samples=SAMPLES)
    plan = keep_limits(evaluator, plan_attitude(evaluator, search), limits)
    assert plan.feasible, plan.reason
    assert plan.chosen is not None
    assert problem.margin.keeps(plan.chosen.closest_approach.value)
    assert plan.disagreements == ()
    kept = {result.limit: result.kept for result in plan.limit_results}
    assert {"joint_rate", "joint_torque", "base_rate", "clearance"} <= kept.keys()
    assert all(kept.values())
    wrench = next(r.base_wrench for r in plan.limit_results if r.limit == "joint_torque")
    assert wrench is not None
    assert wrench < 1e-6
