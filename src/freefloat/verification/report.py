"""Reports of verifications."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any

from freefloat.certificate.certificate import Certificate
from freefloat.limits.result import LimitResult
from freefloat.records import Known
from freefloat.verification.comparisons import Check
from freefloat.verification.engine import EngineRuns
from freefloat.verification.leaves import compare


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
        found = compare(stated, known)
        return replace(
            self, checks=(*self.checks, *found.checks), given=tuple(found.given),
            not_verified=tuple(found.unverified),
        )  # fmt: skip

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
        return {
            "proved": self.passed,
            "kind": self.kind,
            "reasons": [check.reason for check in self.discrepancies],
            "checks": [check.to_dict() for check in self.checks],
            "not_verified": list(self.not_verified),
            "given": list(self.given),
            "certificate": None if self.certificate is None else self.certificate.to_dict(),
            "limits": [result.to_dict() for result in self.limits],
            "engine": self._engine_document,
        }

    @property
    def _engine_document(self) -> dict[str, Any] | None:
        if self.runs.forward is None:
            return None
        inverse, forward = asdict(self.runs.inverse), asdict(self.runs.forward)
        return {"name": self.engine, "inverse": inverse, "forward": forward}
