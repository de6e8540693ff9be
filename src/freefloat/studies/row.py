"""The results of one run of a study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

FEASIBLE, INFEASIBLE, ERROR = "feasible", "infeasible", "error"
VERDICTS = (FEASIBLE, INFEASIBLE, ERROR)
"""Verdicts."""
UNDISTURBED = -1
"""In place of the number of a run: the undisturbed simulation."""


@dataclass(frozen=True)
class Row:
    """Results of a run; None where a command does not compute a value.

    Attributes:
        number: Number of the run.
        verdict: ``feasible``, ``infeasible`` or ``error``.
        parameters: The varied keys and their values.
        error: Message of the error that ended the run.
        reason: Why the run is infeasible, or why a plan's attitude was chosen.
        measure: Name of the singularity measure.
        margin: Minimum margin of the chosen motion; of a map the largest one.
        margin_time: Time of the closest approach [s].
        margin_required: Margin threshold.
        completed: Whether the motion reached the end of the path.
        singular_time: Time of the dynamic singularity [s].
        branch: Arm branch.
        attitude: Initial attitude, quaternion x, y, z, w.
        heading_deg: Initial heading [degrees].
        joints: Initial joint values [rad or m].
        residuals: Largest errors of the motion by quantity.
        limits_kept: Whether the motion keeps all limits.
        limits: Ratio of the largest value to the limit, by limit.
        robust_radius_deg: Attitude tolerance [degrees].
        deviation_deg: Angle from the attitude ``search.from_attitude`` [degrees].
        feasible_fraction: Fraction of attitudes with a feasible motion.
        motion_fraction: Fraction of feasible motions.
        attitude_ranges_deg: Feasible heading ranges by arm branch [degrees].
        decided_by: What decided the verdict of a simulation: ``"ensemble"``, ``"ensemble at
            1e-10"``, or ``"motion"``, a precise one.
        seconds: Duration of the computation [s].
        began: When the computation started, UTC.
        file: Result file, relative to the study's folder.
        bytes: Its size.
    """

    number: int
    verdict: str
    parameters: dict[str, Any]
    error: str | None = None
    reason: str | None = None
    measure: str | None = None
    margin: float | None = None
    margin_time: float | None = None
    margin_required: float | None = None
    completed: bool | None = None
    singular_time: float | None = None
    branch: int | None = None
    attitude: list[float] | None = None
    heading_deg: float | None = None
    joints: list[float] | None = None
    residuals: dict[str, float] | None = None
    limits_kept: bool | None = None
    limits: dict[str, float] | None = None
    robust_radius_deg: float | None = None
    deviation_deg: float | None = None
    feasible_fraction: float | None = None
    motion_fraction: float | None = None
    attitude_ranges_deg: dict[str, list[list[float]]] | None = None
    decided_by: str | None = None
    seconds: float | None = None
    began: str | None = None
    file: str | None = None
    bytes: int | None = None
