"""Candidates that compiled motions show to violate limits.

Joint ranges and rates are compared along the whole motion, clearances at some instants: a candidate
that is screened out violates the limit; one that passes may still violate it in between.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from freefloat.ensemble.endings import COMPLETED, LIMITED
from freefloat.ensemble.feasibility import FeasibilityEvaluator
from freefloat.ensemble.result import BranchResults
from freefloat.limits.kinds.base_rate import BaseRateLimit
from freefloat.limits.kinds.clearance import ClearanceLimit
from freefloat.limits.kinds.joint_range import JointRangeLimit
from freefloat.limits.kinds.joint_rate import JointRateLimit
from freefloat.planning.candidates import ScreenedCandidate
from freefloat.planning.limits.trials import Violations
from freefloat.planning.objective import Comparison
from freefloat.robot.joint_ranges import largest_range_ratio
from freefloat.scene.scene_body import EndEffectorPoses
from freefloat.so3 import Array, IntArray

if TYPE_CHECKING:  # coal and trimesh import slowly
    from freefloat.limits.pairs import CollisionPairs

_FIRST_BATCH, _BATCH = 16, 256
"""Candidates screened together: few at first, for the best may pass."""
_SLACK = 1e-4
"""Error of compiled motions [m; fraction of a range or rate]."""
_INSTANTS = 16
"""Instants between start and end at which clearances are computed."""

_Entries = tuple[IntArray, IntArray]
"""Rows and arm branches of candidates in results of motions."""


def screen(
    results: BranchResults, compared: Comparison, pairs: CollisionPairs | None
) -> Iterator[ScreenedCandidate]:
    """Candidates that keep the margin, of the motions of an ensemble, the best first.

    Each has what its compiled motion violates of joint ranges and the limits compared; ``pairs``
    keep their clearance where they are given.
    """
    evaluator, limits = compared.evaluator, compared.limits
    samples, branches = np.nonzero(evaluator.problem.margin.keeps(results.margins))
    merits = Violations(evaluator, limits)(results.attitudes, results.motions)
    motions, endings = results.motions, results.motions.endings
    limited = (merits < -1.0 - _SLACK) & (endings == COMPLETED)
    motions = motions._replace(endings=np.where(limited, LIMITED, endings))
    ranks = compared.objective.ranks(compared, results.attitudes, motions)
    order = np.lexsort([keys[samples, branches] for keys in ranks])
    first, size = 0, _FIRST_BATCH
    while first < len(order):
        batch = order[first : first + size]
        first, size = first + size, min(2 * size, _BATCH)
        attitudes, columns = results.attitudes[samples[batch]], branches[batch]
        distinct, rows = np.unique(attitudes, axis=0, return_inverse=True)
        again, entries = evaluator.evaluate(distinct, extremes=True), (rows.ravel(), columns)
        low, high = again.motions.lower[entries], again.motions.upper[entries]
        ranges = largest_range_ratio(evaluator.problem.model_at(), low, high)
        violations = {JointRangeLimit.name: ranges > 1.0 + _SLACK}
        joint_rates, base_rates, deficits = np.zeros((3, len(batch)))
        if limits is not None and limits.joint_rate is not None:
            joint_rates = again.motions.rate_usage(limits.joint_rate)[entries]
        if limits is not None and limits.base_rate is not None:
            base_rates = again.motions.base_rate[entries] / limits.base_rate
        violations[JointRateLimit.name] = joint_rates > 1.0 + _SLACK
        violations[BaseRateLimit.name] = base_rates > 1.0 + _SLACK
        ratios = np.maximum(ranges, np.maximum(joint_rates, base_rates))
        if pairs is not None:
            left = ~np.any([*violations.values()], axis=0)
            remaining = entries[0][left], entries[1][left]
            deficits[left] = _clearance_deficits(evaluator, pairs, again, remaining)
        violations[ClearanceLimit.name] = deficits > 0.0
        for k, attitude in enumerate(attitudes):
            violation = next((name for name, violated in violations.items() if violated[k]), None)
            yield ScreenedCandidate(
                attitude, int(columns[k]), violation, float(ratios[k]), float(deficits[k])
            )


def _clearance_deficits(
    evaluator: FeasibilityEvaluator,
    pairs: CollisionPairs,
    results: BranchResults,
    entries: _Entries,
) -> Array:
    """Required less actual clearance [m] of motions at the first instant where it is too small.

    There is one for each entry of the results; zero where the clearance is kept at every instant.
    Start and end are examined first: many motions need not be integrated at all.
    """
    attitudes, joints = results.attitudes[entries[0]], results.joints[entries]
    problem, every = evaluator.problem, np.arange(len(pairs.pairs))
    path = problem.path
    deficits = np.zeros(len(joints))

    def deficits_at(t: float, attitudes: Array, joints: Array) -> list[float]:
        """Those of states (K, 4), (K, n) at a time."""
        prescribed, distances = path.pose(t), list[float]()
        poses = pairs.scene.poses(t, path, EndEffectorPoses.on(prescribed))
        for attitude, q in zip(attitudes, joints, strict=True):
            every_joint = problem.joints_at(t, q)
            if pairs.scene.holds:
                end = problem.model.end_effector_pose(attitude, every_joint)
                poses = pairs.scene.poses(t, path, EndEffectorPoses(prescribed, end))
            distances.append(pairs.distances(every_joint, every, attitude, poses).min())
        return [max(0.0, pairs.clearance - float(distance) - _SLACK) for distance in distances]

    deficits[:] = deficits_at(0.0, attitudes, joints)
    (left,) = np.nonzero(deficits == 0.0)
    last = entries[0][left], entries[1][left]
    motions = results.motions
    deficits[left] = deficits_at(path.duration, motions.attitudes[last], motions.joints[last])
    times = np.linspace(0.0, path.duration, _INSTANTS + 2)
    for start, end in pairwise(times[:-1]):
        (left,) = np.nonzero(deficits == 0.0)
        states = attitudes[left], joints[left]
        starts, ends = np.full(len(left), start), np.full(len(left), end)
        ensemble = evaluator.integrator.integrate(*states, starts=starts, ends=ends)
        attitudes[left], joints[left] = ensemble.attitudes, ensemble.joints
        deficits[left] = deficits_at(end, ensemble.attitudes, ensemble.joints)
    return deficits
