"""The checks of a map of the joint space: its polynomial and its boxes against the robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from freefloat.beyond.joint_space.singularity_map import Kind, SingularityMap, singularity_map
from freefloat.dynamics.joint_space import joint_box
from freefloat.errors import InputError
from freefloat.records import Known, Origin, Tree
from freefloat.robot.model import FreeFloatingModel
from freefloat.singularities.singularity_polynomial import SingularityPolynomial, determinants
from freefloat.so3 import Array
from freefloat.verification.check import PINOCCHIO, CheckReport
from freefloat.verification.comparisons import Check
from freefloat.verification.tolerances import CODEC

_CONFIGURATIONS, _BOXES = 4096, 512
"""Configurations, and boxes with a singular configuration, that are looked at."""
_DEVIATION = 1e-8
"""Deviation of the polynomial from det A, and magnitude of det A whose sign may be rounding, over
the largest det A of the samples."""
_SEED = 20_260
_MOST_NODES = 500_000
"""Boxes of maps that are computed again; of larger ones samples are looked at."""


def singularity_map_report(found: SingularityMap, engine: str) -> tuple[CheckReport, Known]:
    """All checks of a map of the joint space, and what is recomputed.

    The boxes are subdivided again and compared, where a map has at most half a million nodes.
    Raises an InputError if another engine than freefloat's own is given.
    """
    if engine != PINOCCHIO:
        raise InputError("engine", f"{engine} was given for a singularity map", PINOCCHIO)
    polynomial = SingularityPolynomial.of(found.model, found.task, found.fixed)
    known: dict[str, Any] = dict.fromkeys(("task", "fixed", "resolution"), Origin.GIVEN)
    known["polynomial"] = polynomial
    if len(found.nodes) <= _MOST_NODES:
        again = singularity_map(found.model, found.task, found.resolution, fixed=found.fixed)
        known["nodes"] = again.nodes
    report = CheckReport(found.kind, tuple(singularity_map_checks(found)))
    return report, Known(SingularityMap, known)


def decoded(tree: Tree, model: FreeFloatingModel) -> SingularityMap:
    """The map of a file, compared with the robot; a ValueError if it is not the robot's."""
    result = CODEC.decode(SingularityMap, tree, {FreeFloatingModel: model})
    for check in singularity_map_checks(result):
        if not check.passed:
            raise ValueError(f"it is no map of its robot: {check.reason}")
    return result


def singularity_map_checks(found: SingularityMap) -> Iterator[Check]:
    """Det A of the robot at random configurations, compared with the polynomial and the boxes."""
    rng = np.random.default_rng(_SEED)
    names = found.model.joint_names
    fixed = {names.index(name): value for name, value in found.fixed.items()}
    joints = rng.uniform(*joint_box(found.model, fixed), (_CONFIGURATIONS, len(names)))
    joints[:, [*fixed]] = [*fixed.values()]
    exact = determinants(found.model, joints, found.task)
    scale = float(np.abs(exact).max())
    deviation = float(np.abs(found.polynomial.values(joints) - exact).max() / scale)
    yield Check(
        "polynomial", deviation <= _DEVIATION,
        f"it deviates from det A of the robot by {deviation:.1g} at {_CONFIGURATIONS:,} "
        "configurations",
        recomputed=deviation, allowed=_DEVIATION, unit="1",
    )  # fmt: skip
    kinds = found.kinds(joints)
    wrong = (kinds == Kind.POSITIVE) & (exact < -_DEVIATION * scale)
    wrong |= (kinds == Kind.NEGATIVE) & (exact > _DEVIATION * scale)
    free = np.isin(kinds, (Kind.POSITIVE, Kind.NEGATIVE))
    yield _count("boxes without singularities", int(wrong.sum()), int(free.sum()))
    low, high = _ends(found, fixed, rng)
    if len(low):
        signs = [np.sign(determinants(found.model, q, found.task)) for q in (low, high)]
        same = int((signs[0] * signs[1] > 0.0).sum())
        yield _count("boxes with a singularity", same, len(low))


def _ends(
    found: SingularityMap, fixed: Mapping[int, float], rng: np.random.Generator
) -> tuple[Array, Array]:
    """Corners of some boxes with a singularity, between which det A changes most, (K, n) each."""
    boxes = [
        (centres[kinds], halves[kinds])
        for part, centres, halves in found.iterate_boxes()
        for kinds in (found.nodes[part] == Kind.SINGULAR,)
    ]
    centres, halves = (np.concatenate(column) for column in zip(*boxes, strict=True))
    chosen = rng.permutation(len(centres))[:_BOXES]
    centres, halves = centres[chosen], halves[chosen]
    steps = np.sign(found.polynomial.gradients(centres)) * halves  # zero across fixed joints
    centres[:, [*fixed]] = [*fixed.values()]
    return centres - steps, centres + steps


def _count(name: str, wrong: int, looked_at: int) -> Check:
    detail = f"{looked_at:,} looked at"
    if wrong:
        detail = f"{wrong:,} of {looked_at:,} are not what the map says"
    return Check(name, not wrong, detail, recomputed=float(wrong), allowed=0.0, unit="1")
