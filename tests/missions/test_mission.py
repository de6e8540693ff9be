"""The bundled mission: its plan keeps all limits, is verified, and is what the limits make it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import freefloat as ff
from freefloat.limits.kinds import KINDS
from freefloat.planning.plan import Plan
from freefloat.so3 import angle_between
from tests.tutorials import MISSION, completed

SCENARIO = ff.load_scenario("servicing/inspect_client")
LIMITS = SCENARIO.limits()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("mission")


@pytest.fixture(scope="module")
def script(folder: Path) -> dict[str, Any]:
    """Names of the tutorial script, which plans with the cones and without, and verifies."""
    return completed(MISSION, folder)


def worst(plan: Plan, limits: ff.Limits) -> list[float]:
    """Extreme values of the limits of attitude along the motion of a plan [rad]."""
    kinds = ("pointing", "base_turn")
    results = ff.check_limits(plan.chosen.motion, limits)
    return [result.worst for result in results if result.limit in kinds]


@pytest.mark.slow
def test_the_plan_of_the_mission_is_verified(script: dict[str, Any], folder: Path) -> None:
    """The script verifies it with MuJoCo."""
    plan = script["plan"]
    assert plan.feasible, plan.reason
    assert {result.limit for result in plan.limit_results} == {kind.name for kind in KINDS} - {
        "joint_acceleration",
        "joint_jerk",
    }
    assert all(result.kept for result in plan.limit_results)
    loaded = ff.load(folder / "plan.h5")
    assert ff.check(loaded).passed
    items = ff.playback(loaded).scene.description.items
    assert {"Scene bodies", "Corridor", "Pointing limits"} <= items.keys()


@pytest.mark.slow
def test_without_the_cones_antenna_and_star_tracker_are_on_the_wrong_side(
    script: dict[str, Any],
) -> None:
    """They exclude the attitude with the largest weighted sum."""
    plan, free = script["plan"], script["free"]
    antenna, tracker = LIMITS.pointing
    (seen,) = worst(free, ff.Limits(pointing=[antenna]))
    (glare,) = worst(free, ff.Limits(pointing=[tracker]))
    assert seen > antenna.angle + np.radians(1.0)
    assert glare < tracker.angle - np.radians(1.0)
    attitudes = [entry.chosen.motion.initial.attitude for entry in (plan, free)]
    assert angle_between(*attitudes) > np.radians(5.0)
