"""A saved plan proved again, from its file alone."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.dynamics.momentum import inertia_matrices
from freefloat.errors import FreeFloatError, InputError
from freefloat.io.plan_file import StoredPlan, load_plan
from freefloat.io.result_file import MOTION, PLAN, opened_result
from freefloat.io.scenario import Scenario
from freefloat.limits.check import check_limits
from freefloat.limits.limits import LimitKind, LimitResult
from freefloat.motion.certificate import Certificate, certify
from freefloat.motion.motion import Motion
from freefloat.motion.problem import Problem
from freefloat.planning.documents import limits_document
from freefloat.verification.checks import Check, below, certificate_checks, span_check
from freefloat.verification.claims import differences, same_number

ENGINES = ("mujoco",)
_MALFORMED = (
    KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError,
    ZeroDivisionError, np.linalg.LinAlgError,
)  # fmt: skip
"""What comes of a file whose numbers are texts, whose lists are numbers and so on."""
_WRENCH, _DRIFT = 1e-4, 1e-3
"""Share of the largest torque that may push the base; angle by which a simulation may end off."""
_ROUNDED = 1e-9
"""And share of the moment that would turn the system by one radian in the motion's time, which is
rounding where an arm hardly moves."""
_AIR = 2e-4
"""To this distances are found [m]."""
_SHARE = 1e-4
"""By how much worst values of limits, found by search, may differ."""
_ERRORS = ("end_effector_position", "end_effector_attitude", "momentum", "rates", "centre_of_mass")
_FACTOR, _LITTLE = 10.0, 1e-7
"""Numbers that are errors themselves may differ by this factor, and by a little."""


@dataclass(frozen=True)
class Verdict:
    """What became of a file.

    Attributes:
        source: The file.
        kind: ``"plan"`` or ``"motion"``.
        checks: Everything that was looked at, in order.
        certificate: Of the motion; None where there is none to be proved.
        limits: What the motion does to its limits.
        engine: What another engine found, by its name; None where it was not asked.
    """

    source: str
    kind: str
    checks: tuple[Check, ...]
    certificate: Certificate | None = None
    limits: tuple[LimitResult, ...] = ()
    engine: dict[str, Any] | None = None

    @property
    def proved(self) -> bool:
        """Whether all is as the file tells it."""
        return all(check.passed for check in self.checks)

    @property
    def reasons(self) -> tuple[str, ...]:
        """What failed, in words."""
        return tuple(check.reason for check in self.checks if not check.passed)

    def document(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "proved": self.proved,
            "file": self.source,
            "kind": self.kind,
            "reasons": list(self.reasons),
            "checks": [_finite(asdict(check)) for check in self.checks],
            "certificate": None if self.certificate is None else self.certificate.document(),
            "limits": limits_document(self.limits),
            "engine": self.engine,
        }


def _finite(document: dict[str, Any]) -> dict[str, Any]:
    return {
        key: None if isinstance(value, float) and not np.isfinite(value) else value
        for key, value in document.items()
    }


def check_plan(
    path: str | Path,
    engine: str | None = None,
    prepare: Callable[[Problem], None] | None = None,
) -> Verdict:
    """Prove a saved plan or motion again.

    Its configurations are held against its scenario and its robot; the motion is followed again by
    another integrator; every number the file tells of it is found a second time.

    Args:
        path: The file.
        engine: Another engine to repeat it with: ``"mujoco"``, or None.
        prepare: Called with the problem before kernels are used on it, which may take long.

    Raises:
        InputError: If it is no plan or motion file at all, or the engine is unknown or missing.
    """
    if engine is not None and engine not in ENGINES:
        raise InputError("engine", f"{engine!r} was given", ", ".join(ENGINES))
    if engine is not None:
        from freefloat.verification.mujoco_engine import engine_module

        engine_module()
    with opened_result(path, PLAN, MOTION) as (_, kind):
        pass
    try:
        stored = load_plan(path)
        sealed = _seals(stored)
        wish = stored.origin.wish()
        motion = stored.motion()
    except FreeFloatError as error:
        return Verdict(str(path), kind, (Check("contents", False, _words(error)),))
    if motion is None:
        told = f"it has no motion to prove: {stored.document.get('reason')}"
        return Verdict(str(path), kind, (sealed, Check("motion", False, told)))
    if kind == PLAN and not stored.feasible:
        told = "it is told to be infeasible, and has a motion"
        return Verdict(str(path), kind, (sealed, Check("motion", False, told)))
    whole = span_check(motion)
    if not whole.passed:
        return Verdict(str(path), kind, (sealed, whole))
    if prepare is not None and stored.kind == PLAN and stored.feasible:
        prepare(motion.problem)
    return _verdict(stored, wish, motion, sealed, engine)


def _words(error: Exception) -> str:
    if isinstance(error, InputError):
        return f"{error.key}: {error.problem}" if error.key != "file" else error.problem
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def _verdict(
    stored: StoredPlan, wish: Scenario, motion: Motion, sealed: Check, engine: str | None
) -> Verdict:
    checks, told = [sealed], None
    certificate: Certificate | None = None
    limits: tuple[LimitResult, ...] = ()

    def guarded(name: str, work: Callable[[], Iterable[Check]]) -> None:
        try:
            checks.extend(work())
        except (FreeFloatError, *_MALFORMED) as error:
            checks.append(Check(name, False, f"it cannot be checked ({_words(error)})"))

    def prove() -> list[Check]:
        nonlocal certificate
        certificate = certify(motion, stored.base_positions)
        return certificate_checks(certificate, motion, stored.feasible)

    def look_at_limits() -> list[Check]:
        nonlocal limits
        problem = motion.problem
        limits = check_limits(motion, wish.limits(problem.model))
        return _limits(limits, stored)

    guarded("certificate", prove)
    guarded("limits", look_at_limits)
    guarded("what the file tells", lambda: [_claims(stored, wish, motion)])
    if stored.kind == PLAN:
        guarded("certificate in the file", lambda: [_same_certificate(stored, certificate)])
        guarded("robustness", lambda: _robustness(stored, motion))
    if engine is not None:

        def repeat() -> list[Check]:
            nonlocal told
            found, told = _repeated(motion)
            return found

        guarded(engine, repeat)
    return Verdict(stored.source, stored.kind, tuple(checks), certificate, limits, told)


def _seals(stored: StoredPlan) -> Check:
    name = "as it was written"
    if stored.altered is None:
        return Check(name, False, "the file does not tell what it was like: its digests are gone")
    if stored.altered:
        told = ", ".join(stored.altered)
        return Check(name, False, f"changed since: {told} (its SHA-256 is another)")
    return Check(name, True)


def _claims(stored: StoredPlan, wish: Scenario, motion: Motion) -> Check:
    found = differences(stored, wish, motion)
    told = "; ".join(str(one) for one in found[:3])
    if len(found) > 3:
        told += f"; and {len(found) - 3} more"
    return Check("what the file tells", not found, told)


def _limits(found: tuple[LimitResult, ...], stored: StoredPlan) -> list[Check]:
    """Every limit, kept as promised and told as it is."""
    told = stored.document.get("limits")
    written = {one["limit"]: one for one in told} if isinstance(told, list) else {}
    for extra in written.keys() - {str(one.limit) for one in found}:
        return [Check(f"limit {extra}", False, "the file tells of it, the scenario does not")]
    return [_limit(one, written.get(str(one.limit)), stored.feasible) for one in found]


def _limit(one: LimitResult, told: Any, promised: bool) -> Check:
    name = f"limit {one.limit}".replace("_", " ")
    floor = _AIR if one.limit is LimitKind.CLEARANCE else 1e-9
    passed, words = True, one.where
    if promised and not one.kept:
        passed, words = False, f"{one.where} breaks it: {one.worst:.6g} at t = {one.time:.6g} s"
    elif told is None:
        passed, words = False, "the file does not tell of it"
    elif told["kept"] is not one.kept:
        passed, words = False, f"the file says kept: {told['kept']}, but it is {one.kept}"
    elif np.isfinite(one.worst) and not same_number(told["worst"], one.worst, _SHARE, floor):
        passed, words = False, f"the file says {told['worst']}, but it is {one.worst:.6g}"
    return Check(name, passed, words, one.worst, one.allowed, "", one.time)


def _same_certificate(stored: StoredPlan, found: Certificate | None) -> Check:
    """The certificate that the plan carries says what was found again."""
    name, told = "certificate in the file", stored.document.get("certificate")
    if told is None or found is None:
        return Check(name, False, "there is none")
    for one, own in zip(told["least"], found.document()["least"], strict=True):
        for key in ("value", "time", "bound"):
            if one["measure"] != own["measure"] or not same_number(one[key], own[key], _SHARE):
                words = f"{one['measure']}.{key} says {one[key]}, but it is {own[key]:.6g}"
                return Check(name, False, words)
    for key in _ERRORS:
        if (told[key] is None) is not (getattr(found, key) is None):
            return Check(name, False, f"{key} says {told[key]}")
        if told[key] is None:
            continue
        value, own = told[key]["value"], getattr(found, key).value
        if not own / _FACTOR - _LITTLE <= value <= own * _FACTOR + _LITTLE:
            return Check(name, False, f"{key} says {value:.3g}, but it is {own:.3g}")
    if not same_number(told["momentum_scale"], found.momentum_scale, _SHARE):
        words = f"momentum_scale says {told['momentum_scale']}, but it is"
        return Check(name, False, f"{words} {found.momentum_scale:.6g}")
    for key in ("attitude", "joints", "halving_attitude", "halving_joints"):
        value, own = told["integration"][key], getattr(found.integration, key)
        if not own / _FACTOR - _LITTLE <= value <= own * _FACTOR + _LITTLE:
            return Check(name, False, f"integration.{key} says {value:.3g}, but it is {own:.3g}")
    return Check(name, True)


def _robustness(stored: StoredPlan, motion: Motion) -> Iterable[Check]:
    if not stored.feasible:
        return []
    # its kernels take half a second to import
    from freefloat.verification.robust_checks import robust_checks

    return robust_checks(stored, motion)


def _repeated(motion: Motion) -> tuple[list[Check], dict[str, Any]]:
    """The motion in MuJoCo."""
    from freefloat.verification.mujoco_engine import Engine
    from freefloat.verification.mujoco_runs import forward_run, inverse_run

    engine = Engine(motion.problem.model)
    inverse, forward = inverse_run(motion, engine), forward_run(motion, engine)
    told = {"name": "mujoco", "inverse": asdict(inverse), "forward": asdict(forward)}
    inertia = float(np.trace(inertia_matrices(motion.problem.model, motion.initial.joints)[0]))
    rounding = _ROUNDED * inertia / motion.problem.path.duration**2
    checks = [
        below("mujoco: wrench on the base", inverse.wrench, _WRENCH * inverse.torque + rounding,
              "N m", inverse.wrench_time, "inverse dynamics pushes the free base"),
        below("mujoco: final attitude", forward.attitude, _DRIFT, "rad", forward.until,
              "with servos on the joints the spacecraft ends elsewhere: it is off"),
    ]  # fmt: skip
    return checks, told
