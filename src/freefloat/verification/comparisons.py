"""Checks of a motion: its certificate compared with tolerances."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from freefloat.certificate.certificate import (
    Certificate,
    CertifiedMinimum,
    SecondIntegration,
    integrate_again,
    momentum_scale,
)
from freefloat.dynamics.generalized_jacobian import generalized_jacobian
from freefloat.dynamics.measures import measure_title, singularity_measure
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.dynamics.redundancy import singular_speed
from freefloat.errors import FreeFloatError, InputError
from freefloat.motion.margin import keeps_threshold
from freefloat.motion.motion import Ending, Motion
from freefloat.rounding import digits_apart, rounded_down
from freefloat.so3 import angle_between

_ON_CURVE = 1e-8
"""Deviation of further arms from their curves: rounding [rad or m]."""
_ON_PATH = 1e-7
"""Fraction of the reach, and angle [rad], by which a motion may leave its path, per revolution of
the spacecraft."""
_MOMENTUM = 1e-6
"""Error of the momentum as a fraction of the momentum of the arm."""
_MOMENTUM_ERROR = 1e-12
"""Error of the momentum as a fraction of the momentum of the system when it rotates by one radian
in the duration: the arm's momentum is near zero where it hardly moves."""
_ENDS = 1e-9
"""Fraction of the duration by which a motion may miss its ends."""
_RATES = 1e-5
"""Fraction of the largest joint rate by which rates may differ from the rates of equation (4)."""
_RESTING = 1e-8
"""Error of joint rates times the duration that is rounding [rad, m]."""
_SECOND = 1e-6
"""Difference of the second integration [rad, m]."""
_VANISHED = 1e-3
"""Fraction of its largest value that the smallest singular value may have at a singular end."""
_AT_MARGIN = 1e-6
"""Difference from the margin, as a fraction of it, of a motion that ends there."""
_RANK_LOST = 1e-8
"""Fraction of the largest singular value of S* that the smallest may have at a singular start."""
_FAST = 0.99
"""Fraction of the speed at which redundant arms count as singular: it includes the pace of time."""


@dataclass(frozen=True)
class Check:
    """A comparison of a stated value; a discrepancy if it failed.

    Attributes:
        name: What was checked.
        passed: Whether the stated value is true.
        detail: What was found, and where.
        stated: Value in the record.
        recomputed: Value that was found.
        allowed: Largest or smallest value, or largest deviation from the stated one.
        unit: Unit of the values.
        time: Where on the motion [s].
        relation: Relation of the recomputed value to what is allowed: ≤, ≥, or ± about the stated
            value; = where a stated value is compared with the recomputed one.
    """

    name: str
    passed: bool
    detail: str = ""
    stated: Any = None
    recomputed: Any = None
    allowed: float | None = None
    unit: str = ""
    time: float | None = None
    relation: str = "≤"

    @property
    def exceeds(self) -> bool:
        """Whether the value that was found is beyond what is allowed; a file may state so."""
        if self.recomputed is None or self.allowed is None or self.relation not in "≤≥":
            return False
        recomputed, allowed = self.recomputed, self.allowed
        return bool(recomputed > allowed if self.relation == "≤" else recomputed < allowed)

    @property
    def reason(self) -> str:
        """Name and detail."""
        return f"{self.name}: {self.detail}" if self.detail else self.name

    def to_dict(self) -> dict[str, Any]:
        """The JSON document."""
        keys = {"detail": "told", "recomputed": "found"}
        return {
            keys.get(key, key): None
            if isinstance(value, float) and not np.isfinite(value)
            else value
            for key, value in asdict(self).items()
        }


def missing_motion_check(feasible: bool, reason: str) -> Check:
    """The check of a result without a motion, which is a discrepancy unless it is infeasible."""
    if feasible:
        return Check("motion", False, "there is none")
    return Check("feasible", False, reason, False)


def error_check(
    name: str, error: float, allowed: float, unit: str, time: float | None, detail: str = ""
) -> Check:
    """Check that an error is not larger than allowed."""
    passed = bool(error <= allowed)
    where = "" if time is None else f" at t = {time:.6g} s"
    words = f"{detail or 'it differs'} by {error:.3g} {unit}{where}, more than {allowed:.3g}"
    return Check(name, passed, "" if passed else words, 0.0, error, allowed, unit, time)


def span_check(motion: Motion) -> Check:
    """Check that a motion begins where its path does and, if it is completed, ends there."""
    first, last = float(motion.times[0]), float(motion.times[-1])
    duration = motion.law.timing.duration
    error = max(abs(first), abs(last - duration) if motion.completed else last - duration)
    whole = motion.panels > 0 and motion.ending is not Ending.PART
    passed = whole and error <= _ENDS * duration
    words = f"the path takes {duration:g} s, the motion goes from {first:g} to {last:g} s"
    detail, allowed = "" if passed else words, _ENDS * duration
    return Check("whole motion", passed, detail, duration, last, allowed, "s", relation="±")


def arms_check(motion: Motion) -> Iterator[Check]:
    """Check that further arms move along their curves."""
    if not motion.setting.robot_varies:
        return
    joints = motion.setting.joints_at(motion.times, motion.joints)
    error = np.abs(motion.joints - joints).max(axis=1)
    worst = int(error.argmax())
    yield error_check("further arms", float(error[worst]), _ON_CURVE, "rad or m",
                      float(motion.times[worst]))  # fmt: skip


def path_tolerances(motion: Motion) -> tuple[float, float]:
    """Allowed distance [m] and angle [rad] of the end-effector from the path of a motion."""
    rotation = float(angle_between(motion.attitudes[1:], motion.attitudes[:-1]).sum())
    angle = _ON_PATH * max(1.0, rotation / (2.0 * np.pi))
    return angle * max(1.0, motion.setting.reach()), angle  # at least a metre


def certificate_checks(certificate: Certificate, motion: Motion, feasible: bool) -> Iterator[Check]:
    """Check the errors and bounds of a certificate."""
    distance, angle = path_tolerances(motion)
    momentum = _MOMENTUM * certificate.momentum_scale + _rounding(motion)
    errors = [
        ("end-effector position", certificate.end_effector_position, distance, "m"),
        ("end-effector orientation", certificate.end_effector_orientation, angle, "rad"),
        ("angular momentum", certificate.momentum, momentum, "N m s"),
        ("joint rates", certificate.rates, _rate_tolerance(motion), "of the largest"),
    ]
    for name, worst, allowed, unit in errors:
        if worst is not None:
            yield error_check(name, worst.value, allowed, unit, worst.time)
    yield from _second_checks(certificate.integration)
    yield from (_margin_check(minimum, motion, feasible) for minimum in certificate.minima)
    yield from end_checks(motion)
    if feasible and not motion.completed:
        yield Check("whole path", False, motion.ending.value, time=motion.final.time)


def _rate_tolerance(motion: Motion) -> float:
    """Allowed error of joint rates over the largest one; joints that rest have rounding alone."""
    fastest = float(np.nanmax(np.abs(motion.node_rates[..., 3:]), initial=0.0))
    moved = max(fastest * motion.law.timing.duration, np.finfo(float).tiny)
    return _RATES + _RESTING / moved


def residual_checks(motion: Motion) -> Iterator[Check]:
    """Check a motion by its path and momentum, of a redundant arm also by integrating it again."""
    residuals = motion.residuals()
    distance, angle = path_tolerances(motion)
    yield error_check("end-effector position", residuals.end_effector_position, distance, "m", None)
    turned = residuals.end_effector_orientation
    if turned is not None:
        yield error_check("end-effector orientation", turned, angle, "rad", None)
    allowed = _MOMENTUM * momentum_scale(motion) + _rounding(motion)
    yield error_check("angular momentum", residuals.momentum, allowed, "N m s", None)
    if motion.problem.redundant:
        yield from _second_checks(integrate_again(motion))
    yield from end_checks(motion)


def end_checks(motion: Motion) -> Iterator[Check]:
    """Check that a motion that ends early ends where it has to."""
    if motion.ending is Ending.SINGULAR:
        yield _fast_end(motion) if motion.problem.redundant else _singular_end(motion)
    elif motion.ending is Ending.MARGIN:
        yield _margin_end(motion)


def _rounding(motion: Motion) -> float:
    """Error of the momentum that is rounding [N m s]."""
    inertia = float(np.trace(inertia_matrices(motion.model, motion.initial.joints)[0]))
    return _MOMENTUM_ERROR * inertia / motion.law.timing.duration


def _second_checks(second: SecondIntegration) -> list[Check]:
    """Check the differences from a second integration."""
    return [
        error_check("attitude, integrated again", second.attitude, _SECOND, "rad",
                    second.attitude_time),
        error_check("joints, integrated again", second.joints, _SECOND, "rad or m",
                    second.joints_time),
    ]  # fmt: skip


def _margin_check(minimum: CertifiedMinimum, motion: Motion, feasible: bool) -> Check:
    """Check that a measure does not vanish, and that the margin's measure keeps the margin."""
    problem = motion.problem
    unit = singularity_measure(problem.model, problem.task, minimum.measure).unit
    title = measure_title(minimum.measure)
    name = title if minimum.measure == "sigma" else f"|{title}|"
    required = None
    if feasible and minimum.measure == problem.margin.measure.name:
        required = problem.margin.threshold
    detail = f"lower bound between the nodes: {rounded_down(minimum.bound):.4g}"
    passed, least = True, required or 0.0
    if feasible and not keeps_threshold(minimum.value, least):
        n = digits_apart(minimum.value, least, 6)
        passed, detail = False, f"{minimum.value:.{n}g} is below the margin {least:.{n}g}"
    elif not minimum.bound and motion.completed:
        passed, detail = not feasible, "nothing is proven between the nodes"
    elif not minimum.bound:
        detail = "the motion ends singular"
    return Check(name, passed, detail, None, minimum.value, required, unit, minimum.time, "≥")


def _singular_end(motion: Motion) -> Check:
    """Check that a motion that is stated to end in a singularity does so."""
    problem = motion.problem
    sigma = singularity_measure(problem.model, problem.task, "sigma")
    values = sigma(motion.joints)
    fraction = float(values[-1] / values.max()) if values.max() else 0.0
    return error_check(
        "singular end", fraction, _VANISHED, "of the largest", motion.final.time,
        "the smallest singular value differs from zero",
    )  # fmt: skip


def _margin_end(motion: Motion) -> Check:
    """Check that a motion that is stated to end at its margin does so."""
    margin = motion.setting.margin
    error = abs(margin.measure(motion.final.joints)) - margin.threshold
    return error_check(
        "end at the margin", abs(error) if motion.panels else error,
        _AT_MARGIN * margin.threshold,
        margin.measure.unit, motion.final.time, "the measure differs from the required one",
    )  # fmt: skip


def start_check(motion: Motion) -> Check:
    """Check that a motion that is stated to end at its start does so: no margin is left there."""
    if motion.ending is not Ending.SINGULAR:
        return _margin_end(motion) if motion.ending is Ending.MARGIN else span_check(motion)
    problem, start = motion.problem, motion.initial
    S = generalized_jacobian(problem.model, start.joints, problem.task)
    values = np.linalg.svd(S, compute_uv=False)
    fraction, words = float(values[-1] / values[0]), "the smallest singular value differs from zero"
    return error_check("singular start", fraction, _RANK_LOST, "of the largest", start.time, words)


def _fast_end(motion: Motion) -> Check:
    """Check that a redundant arm is stated to end singular where its rates have no use any more.

    Its measures need not vanish there, see
    :data:`~freefloat.dynamics.redundancy.SPINNING_SPEED`.
    """
    final, problem = motion.final, motion.problem
    base, joints = motion.law.rates(final.time, final.attitude, final.joints)
    speed = float(np.hypot(np.linalg.norm(base) / 2.0, np.linalg.norm(joints)))
    found, required = speed * problem.path.duration, _FAST * singular_speed(problem.task)
    passed = bool(found >= required)
    words = f"its speed is {found:.4g} rad per duration, below {required:.4g}"
    return Check("singular end", passed, "" if passed else words, None, found, required,
                 "rad per duration", final.time, "≥")  # fmt: skip


def completed(
    name: str, checks: Callable[..., Iterable[Check]], *arguments: Any
) -> Iterator[Check]:
    """Some checks; one that cannot be completed counts as failed, unless the engine cannot run."""
    try:
        yield from checks(*arguments)
    except (FreeFloatError, np.linalg.LinAlgError) as error:
        if isinstance(error, InputError) and error.key == "engine":
            raise
        yield Check(name, False, f"it cannot be checked ({error})")
