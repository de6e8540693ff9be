"""Margins: the required distance from dynamic singularities, and the rule that decides it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from freefloat.dynamics.measures import SingularityMeasure
from freefloat.errors import finite_number, require_type

ROUNDING = 1e-6
"""Relative deviation from a threshold or limit that is attributed to rounding."""


@dataclass(frozen=True, eq=False)
class Margin:
    """Required distance from dynamic singularities.

    Attributes:
        measure: The singularity measure.
        threshold: The measure must keep its initial sign and at least this magnitude.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_3dof", "end_effector")
        >>> margin = ff.Margin(ff.singularity_measure(model, "planar-pose", "system"), 5.0)
        >>> bool(margin.keeps(4.9))
        False
    """

    measure: SingularityMeasure
    threshold: float

    def __post_init__(self) -> None:
        accepted = "a measure, such as singularity_measure(model, Task.POSE, 'gjm')"
        require_type("margin.measure", self.measure, SingularityMeasure, accepted)
        threshold = finite_number("margin.value", self.threshold, "a magnitude, 0 or more", 0.0)
        object.__setattr__(self, "threshold", threshold)

    def keeps(self, values: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether motions keep the margin, from their smallest magnitudes of the measure.

        They do where the value is not zero and at least the threshold, less a millionth of it for
        rounding. The result has the shape of ``values``.
        """
        return keeps_threshold(values, self.threshold)


def keeps_threshold(values: npt.ArrayLike, threshold: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """The rule of :meth:`Margin.keeps` for any threshold, or one for each value."""
    magnitudes, required = np.asarray(values), np.asarray(threshold)
    return np.asarray((magnitudes > 0.0) & (magnitudes >= required * (1.0 - ROUNDING)))
