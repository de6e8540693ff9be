"""The bundled mission: its plan keeps all limits and is verified."""

from pathlib import Path

import pytest

import freefloat as ff
from freefloat.limits.kinds import KINDS
from tests.tutorials import MISSION, completed


@pytest.mark.slow
def test_the_plan_of_the_mission_is_verified(tmp_path: Path) -> None:
    """The script verifies it with MuJoCo, and says how far the cones move it."""
    plan = completed(MISSION, tmp_path)["plan"]
    assert plan.feasible, plan.reason
    assert {result.limit for result in plan.limit_results} == {kind.name for kind in KINDS} - {
        "joint_acceleration",
        "joint_jerk",
    }
    assert all(result.kept for result in plan.limit_results)
    loaded = ff.load(tmp_path / "plan.h5")
    assert ff.check(loaded).passed
    items = ff.playback(loaded).scene.description.items
    assert {"Scene bodies", "Corridor", "Pointing limits"} <= items.keys()
