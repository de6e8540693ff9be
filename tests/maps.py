"""Results of motions with chosen margins, for maps that are not computed."""

from typing import Any

import numpy as np

from freefloat.ensemble.endings import COMPLETED, UNREACHED
from freefloat.ensemble.result import BranchResults, EnsembleResult


def branch_results(
    attitudes: np.ndarray, margins: np.ndarray, n: int = 6, **motions: Any
) -> BranchResults:
    """Motions of n joints that complete with margins (K, B); where these are nan there is none."""
    table = EnsembleResult.empty(margins.shape, n)._replace(
        minimum=np.nan_to_num(margins.astype(float)),
        endings=np.where(np.isnan(margins), UNREACHED, COMPLETED).astype(np.int8),
        determinant_ratios=np.ones(margins.shape),
    )
    joints = np.full((*margins.shape, n), np.nan)
    return BranchResults(attitudes, joints, table._replace(**motions))


def with_motions(results: BranchResults, **motions: Any) -> BranchResults:
    """Results with other quantities of their motions."""
    return BranchResults(results.attitudes, results.joints, results.motions._replace(**motions))
