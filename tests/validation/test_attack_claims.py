"""What plans claim, attacked by the searches of ``scripts/attack_claims.py``."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import freefloat as ff
from freefloat.planning.plane.arcs import BranchRanges, HeadingRange

SCRIPT = Path(__file__).parents[2] / "scripts" / "attack_claims.py"


@pytest.fixture(scope="module")
def attack() -> ModuleType:
    """The script as a module, with smaller searches."""
    spec = importlib.util.spec_from_file_location("attack_claims", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    module.POINTS, module.ROUNDS, module.HEADINGS = 1000, 8, 2400
    return module


def planned(attack: ModuleType, number: int) -> tuple[ff.Plan, np.random.Generator]:
    rng = np.random.default_rng([1, number])
    _, problem, search = attack.random_problem(rng)
    return ff.plan(problem, search), rng


@pytest.mark.slow
@pytest.mark.parametrize("number", [3, 7, 8, 26, 32])
def test_no_claim_of_a_plan_of_a_random_problem_is_broken(attack: ModuleType, number: int) -> None:
    """Planar and spatial arms, redundant and not, with momentum and without."""
    plan, rng = planned(attack, number)
    assert plan.feasible
    claims = list(attack.attacks(plan, rng))
    assert claims
    assert [claim.broken for claim in claims if claim.broken] == []


@pytest.mark.slow
def test_false_claims_are_broken(attack: ModuleType) -> None:
    """A larger radius, a larger tolerance, and a range on the whole circle."""
    plan, rng = planned(attack, 26)
    tolerance = replace(plan.tolerance, momentum=2.0 * plan.tolerance.momentum)
    false = replace(plan, robust_radius=2.0 * plan.robust_radius, tolerance=tolerance)
    assert all(claim.broken for claim in attack.attacks(false, rng))
    plan, rng = planned(attack, 8)
    circle = BranchRanges(0, "elbow+", (HeadingRange(0.0, 2.0 * np.pi, ()),), ())
    assert any(claim.broken for claim in attack.attacks(replace(plan, ranges=(circle,)), rng))
