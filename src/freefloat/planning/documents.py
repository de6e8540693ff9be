"""JSON documents of simulated motions and of limits."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from freefloat.limits.limits import LimitResult
from freefloat.motion.closest_approach import ClosestApproach
from freefloat.motion.motion import Motion
from freefloat.motion.simulation import Simulation

Document = dict[str, Any]


def simulation_document(simulation: Simulation, findings: Iterable[LimitResult] = ()) -> Document:
    """The chosen motion, its limits, and every branch in brief."""
    return {**simulation.to_dict(), "limits": limits_document(findings)}


def limits_document(findings: Iterable[LimitResult]) -> list[Document]:
    """Limits along a motion; null for values without bound."""
    return [result.to_dict() for result in findings]


def margin_document(motion: Motion, found: ClosestApproach) -> Document:
    """How near a motion came to a singularity, and whether that is as asked."""
    required = motion.problem.margin.threshold
    kept = motion.completed and motion.problem.margin.is_kept(found.value)
    return {**asdict(found), "required": required, "kept": kept}
