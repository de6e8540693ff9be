"""One thing that was checked of a plan file, and a certificate as such things."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freefloat.dynamics.measures import singularity_measure
from freefloat.dynamics.momentum import inertia_matrices
from freefloat.dynamics.virtual_manipulator import VirtualManipulator
from freefloat.motion.certificate import Certificate, Proven
from freefloat.motion.motion import Ending, Motion
from freefloat.motion.problem import is_kept
from freefloat.so3 import angle_between

_ON_PATH = 1e-7
"""Share of the reach, and angle [rad], by which a motion may leave its path, per turn of the
spacecraft."""
_MOMENTUM, _ROUNDED = 1e-6, 1e-12
"""Share of the arm's own momentum by which that of the system may be off, and of what the system
has when it turns by one radian in the motion's time: an arm that hardly moves has next to none."""
_ENDS = 1e-9
"""Share of the path's duration by which a motion may miss its ends."""
_CENTRE = 1e-9
"""Share of the reach by which the centre of mass may move."""
_RATES = 1e-5
"""Share of the largest joint rate by which recorded ones may differ from those of (4)."""
_AGAIN = 1e-6
"""By how much another integrator may come out elsewhere [rad, m]."""
_HALVING = 1e-4
"""By how much halving its steps may change the end [rad, m]."""
_VANISHED = 1e-3
"""Share of its largest value at which a smallest singular value counts as none."""


@dataclass(frozen=True)
class Check:
    """One thing that was checked.

    Attributes:
        name: What.
        passed: Whether it is as it should be.
        told: What was found, in words; of what failed, where.
        found: The number that decides, or None.
        allowed: What it is held against, or None.
        unit: Of both.
        time: Where on the motion [s], or None.
    """

    name: str
    passed: bool
    told: str = ""
    found: float | None = None
    allowed: float | None = None
    unit: str = ""
    time: float | None = None

    @property
    def reason(self) -> str:
        """Name and words."""
        return f"{self.name}: {self.told}" if self.told else self.name


def below(
    name: str, found: float, allowed: float, unit: str, time: float | None, told: str
) -> Check:
    """A check of an error: what was found may not be more than what is allowed."""
    at = "" if time is None else f" at t = {time:.6g} s"
    words = f"{told} by {found:.3g} {unit}{at}, more than {allowed:.3g}"
    passed = bool(found <= allowed)
    return Check(name, passed, "" if passed else words, found, allowed, unit, time)


def span_check(motion: Motion) -> Check:
    """Whether a motion begins where its path does and, when it is completed, ends there, too."""
    first, last = float(motion.times[0]), float(motion.times[-1])
    duration = motion.problem.path.duration
    off = max(abs(first), abs(last - duration) if motion.completed else last - duration)
    passed = motion.panels > 0 and off <= _ENDS * duration
    told = f"a {motion.ending.value} motion" if not motion.completed else "a completed motion"
    words = "" if passed else f"{told} of {duration:g} s that goes from {first:g} to {last:g} s"
    return Check("whole motion", passed, words, last, duration, "s")


def certificate_checks(certificate: Certificate, motion: Motion, promised: bool) -> list[Check]:
    """A certificate held against what is allowed.

    Args:
        certificate: Of the motion.
        motion: The motion.
        promised: Whether the motion is said to keep its margin.
    """
    model, duration = motion.problem.model, motion.problem.path.duration
    reach = VirtualManipulator.of(model).reach
    inertia = float(np.trace(inertia_matrices(model, motion.initial.joints)[0]))
    turns = float(angle_between(motion.attitudes[1:], motion.attitudes[:-1]).sum()) / (2.0 * np.pi)
    on_path = _ON_PATH * max(1.0, turns)
    drift = _MOMENTUM * certificate.momentum_scale + _ROUNDED * inertia / duration
    hand, centre = certificate.end_effector_position, certificate.centre_of_mass
    turn, momentum, rates = (
        certificate.end_effector_attitude, certificate.momentum, certificate.rates
    )  # fmt: skip
    checks = [
        below("end-effector position", hand.value, on_path * max(1.0, reach), "m", hand.time,
              "the end-effector is off its path"),
        below("centre of mass", centre.value, _CENTRE * max(1.0, reach), "m", centre.time,
              "the recorded base position moves the centre of mass"),
        below("angular momentum", momentum.value, drift, "N m s", momentum.time,
              "the momentum is not the one given: it is off"),
        below("joint rates", rates.value, _RATES, "of the largest", rates.time,
              "recorded joint rates are not those of the equations: they differ"),
    ]  # fmt: skip
    if turn is not None:
        checks.insert(1, below("end-effector attitude", turn.value, on_path, "rad", turn.time,
                               "the end-effector is turned away from its path"))  # fmt: skip
    return [*checks, *_again(certificate), *_singularities(certificate, motion, promised)]


def _again(certificate: Certificate) -> list[Check]:
    again = certificate.integration
    halved = max(again.halving_attitude, again.halving_joints)
    return [
        below("attitude, integrated again", again.attitude,
              max(_AGAIN, 8.0 * again.halving_attitude), "rad", again.attitude_time,
              "another integrator finds another attitude: it differs"),
        below("joints, integrated again", again.joints, max(_AGAIN, 8.0 * again.halving_joints),
              "rad or m", again.joints_time,
              f"another integrator finds another {again.joint}: it differs"),
        below("step halving", halved, _HALVING, "rad or m", again.until,
              "steps of that integrator are too long: halving them changes the end"),
    ]  # fmt: skip


def _singularities(certificate: Certificate, motion: Motion, promised: bool) -> list[Check]:
    checks = [_kept(one, motion, promised) for one in certificate.least]
    if motion.ending is Ending.SINGULAR:
        checks.append(_singular_end(motion))
    if promised and not motion.completed:
        checks.append(Check("whole path", False, motion.ending.value, time=motion.final.time))
    return checks


def _kept(one: Proven, motion: Motion, promised: bool) -> Check:
    """The least value of a measure: it must not vanish; the margin's must keep the margin."""
    problem = motion.problem
    unit = singularity_measure(problem.model, problem.task, one.measure).unit
    name = "|det S*|" if one.measure == "gjm" else one.measure
    required = None
    if promised and one.measure == problem.margin.measure.name:
        required = problem.margin.threshold
    words, passed = f"proven: {one.bound:.4g} or more everywhere", True
    if promised and not is_kept(one.value, required or 0.0):
        passed = False
        words = (
            f"{one.value:.6g} at t = {one.time:.6g} s is less than the margin {required or 0.0:.6g}"
        )
    elif not one.bound and motion.completed:
        passed = not promised
        words = f"nothing is proven about what lies between points near t = {one.time:.6g} s"
    elif not one.bound:
        words = "the motion ends where it vanishes"
    return Check(name, passed, words, one.value, required, unit, one.time)


def _singular_end(motion: Motion) -> Check:
    """A motion that is said to end in a singularity must do so."""
    problem = motion.problem
    sigma = singularity_measure(problem.model, problem.task, "sigma")
    values = np.array([sigma(joints) for joints in motion.joints])
    share = float(values[-1] / values.max()) if values.max() else 0.0
    return below(
        "singular end", share, _VANISHED, "of the largest", motion.final.time,
        "the arm is said to end singular, but its smallest singular value differs from zero",
    )  # fmt: skip
