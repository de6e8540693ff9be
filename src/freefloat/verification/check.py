"""Verification of results: what they state is recomputed, or named as not verified."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Protocol

from freefloat.certificate.certificate import Certificate
from freefloat.errors import InputError, require_extra
from freefloat.kinds import ENGINES, kind_of, named
from freefloat.limits.result import LimitResult
from freefloat.motion.motion import Motion
from freefloat.planning.answer import Answer
from freefloat.planning.margin_map import MarginMap
from freefloat.records import Known
from freefloat.verification.comparisons import Check
from freefloat.verification.tolerances import compare

PINOCCHIO = "pinocchio"
"""Name of freefloat's own dynamics."""


@dataclass(frozen=True)
class EngineRuns:
    """What another engine computed along a motion along a path."""

    inverse: Any = None  # record of its inverse dynamics; None without another engine
    forward: Any = None  # record of its own integration; None without another engine
    checks: tuple[Check, ...] = ()  # comparisons of both with the motion


class Engine(Protocol):
    """Another engine that repeats motions."""

    def repeated(self, motion: Motion) -> EngineRuns:
        """Inverse dynamics of a motion along a path, and its integration.

        Raises:
            InputError: If the engine has no model of the robot.
        """

    def simulated(self, motion: Motion, steps: int, allowed: float) -> Iterator[Check]:
        """Integrate a motion of prescribed joints; check its final attitude.

        Args:
            motion: The recorded motion.
            steps: Number of steps.
            allowed: Deviation of the final attitude [rad].
        """


@dataclass(frozen=True, repr=False)
class CheckReport:
    """Result of verifying a record.

    Attributes:
        kind: ``"plan"``, ``"motion"``, ``"goal"``, ``"manoeuvre"``, ``"map"``,
            ``"attitude map"``, ``"singularity map"``, or ``"file"`` for a file that was altered.
        checks: Everything that was checked, in order.
        certificate: Recomputed certificate of the motion; None without a motion.
        limits: Recomputed limits of the motion.
        runs: What another engine computed along the motion.
        engine: Name of that engine.
        not_verified: Names of stated values that were not recomputed, or not to all digits.
        given: Names of stated values that are part of the question, like robot and scenario.
    """

    kind: str
    checks: tuple[Check, ...]
    certificate: Certificate | None = None
    limits: tuple[LimitResult, ...] = ()
    runs: EngineRuns = field(default=EngineRuns())
    engine: str | None = None
    not_verified: tuple[str, ...] = ()
    given: tuple[str, ...] = ()

    def __repr__(self) -> str:
        failed = len(self.discrepancies)
        return f"CheckReport({self.kind}: {len(self.checks)} checks, {failed} failed)"

    def comparing(self, stated: Any, known: Known) -> CheckReport:
        """The report with the comparison of a record with what is known of it."""
        checks, unverified, given = compare(stated, known)
        all_checks = (*self.checks, *checks)
        return replace(self, checks=all_checks, given=tuple(given), not_verified=tuple(unverified))

    @property
    def passed(self) -> bool:
        """Whether everything stated is true."""
        return not self.discrepancies

    @property
    def discrepancies(self) -> tuple[Check, ...]:
        """The checks that failed."""
        return tuple(check for check in self.checks if not check.passed)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat check``, but for the file."""
        inverse, forward, engine = self.runs.inverse, self.runs.forward, None
        if forward is not None:
            engine = {"name": self.engine, "inverse": asdict(inverse), "forward": asdict(forward)}
        return {
            "proved": self.passed, "kind": self.kind,
            "reasons": [check.reason for check in self.discrepancies],
            "checks": [check.to_dict() for check in self.checks],
            "not_verified": list(self.not_verified), "given": list(self.given),
            "certificate": None if self.certificate is None else self.certificate.to_dict(),
            "limits": [result.to_dict() for result in self.limits], "engine": engine,
        }  # fmt: skip


def other_engine(name: str) -> Engine | None:
    """The engine of a name; None for freefloat's own dynamics.

    Raises:
        InputError: If the engine is unknown or not installed.
    """
    if name == PINOCCHIO:
        return None
    if name not in ENGINES:
        raise InputError("engine", f"{name!r} was given", ", ".join([PINOCCHIO, *ENGINES]))
    require_extra(name, name)
    engine: Engine = named(ENGINES[name])()
    return engine


def check(result: Answer | MarginMap | Any, engine: str = PINOCCHIO) -> CheckReport:
    """Verify a plan, a manoeuvre, a simulation, a motion to a goal or a map.

    The motion, of a simulation the chosen one, is compared with the equations, the path and the
    robot, and integrated again by another integrator; motions of other arm branches with their path
    and momentum. Every other value of the record is compared with one that is recomputed, or named
    in ``not_verified`` of the report. A singularity map is also compared with det A of its robot at
    random configurations.

    Args:
        result: The record, computed or loaded from a file.
        engine: Everything is always recomputed with freefloat's own dynamics, on Pinocchio;
            ``"mujoco"`` repeats the motion with MuJoCo's kinematics and dynamics in addition.

    Raises:
        InputError: If this is no result, the engine is unknown, not installed, has no model of the
            robot or is given for a map.

    Example:
        >>> problem = ff.load_scenario("planar_2dof/line").problem()
        >>> report = ff.check(ff.simulate(problem, [0.0, 0.0, 0.0, 1.0]))
        >>> report.passed
        True
    """
    kind_of(result, saved=True)
    other_engine(engine)
    report, known = recomputed(result, engine)
    return report.comparing(result, known)


def recomputed(
    result: Answer | MarginMap | Any, engine: str = PINOCCHIO
) -> tuple[CheckReport, Known]:
    """A report without the comparison of stated numbers, and what is recomputed of the numbers."""
    report: tuple[CheckReport, Known] = named(kind_of(result, saved=True).report)(result, engine)
    return report
