"""What plans claim, attacked by the searches of ``scripts/attack_claims.py``."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import freefloat as ff
from freefloat.planning.plan import Plan
from freefloat.planning.plane.arcs import BranchRanges, HeadingRange

Attacks = Callable[[Plan, np.random.Generator], Iterator[Any]]
SCRIPTS = Path(__file__).parents[2] / "scripts"


@pytest.fixture(scope="module")
def attacks() -> Iterator[Attacks]:
    """The attacks on the claims of a plan, with smaller searches."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(SCRIPTS))
        from attacks import claims, descent

        patch.setattr(descent, "POINTS", 1000)
        patch.setattr(descent, "ROUNDS", 8)
        patch.setattr(claims, "HEADINGS", 2400)
        yield claims.attacks


def posed(number: int) -> tuple[Any, ff.Search, np.random.Generator]:
    from attacks.problems import random_problem

    rng = np.random.default_rng([1, number])
    _, problem, search = random_problem(rng)
    return problem, search, rng


@cache
def plan_of(number: int) -> Plan:
    problem, search, _ = posed(number)
    return ff.plan(problem, search)


def planned(number: int) -> tuple[Plan, np.random.Generator]:
    """A plan, and random numbers that its problem has not used."""
    *_, rng = posed(number)
    return plan_of(number), rng


@pytest.mark.slow
@pytest.mark.parametrize("number", [3, 8, 26])
def test_no_claim_of_a_plan_of_a_random_problem_is_broken(attacks: Attacks, number: int) -> None:
    """Planar and spatial arms, redundant and not, with momentum and without."""
    plan, rng = planned(number)
    assert plan.feasible
    claims = list(attacks(plan, rng))
    assert claims
    assert [claim.broken for claim in claims if claim.broken] == []


@pytest.mark.slow
def test_false_claims_are_broken(attacks: Attacks) -> None:
    """A larger radius, a larger tolerance, and a range on the whole circle."""
    plan, rng = planned(26)
    tolerance = replace(plan.tolerance, momentum=2.0 * plan.tolerance.momentum)
    false = replace(plan, robust_radius=2.0 * plan.robust_radius, tolerance=tolerance)
    assert all(claim.broken for claim in attacks(false, rng))
    plan, rng = planned(8)
    circle = BranchRanges(0, "elbow+", (HeadingRange(0.0, 2.0 * np.pi, ()),), ())
    assert any(claim.broken for claim in attacks(replace(plan, ranges=(circle,)), rng))
