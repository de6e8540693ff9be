"""Reports of verifications."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from freefloat.certificate.certificate import Certificate
from freefloat.limits.result import LimitResult
from freefloat.verification.comparisons import Check

if TYPE_CHECKING:
    from freefloat.verification.engines.forward import ForwardRun
    from freefloat.verification.engines.mujoco import InverseRun
    from freefloat.verification.gravity import GravityRun

PINOCCHIO = "pinocchio"
MUJOCO = "mujoco"
BASILISK = "basilisk"
ENGINES = (PINOCCHIO, MUJOCO, BASILISK)


@dataclass(frozen=True)
class CheckReport:
    """Result of verifying a record.

    Attributes:
        kind: ``"plan"``, ``"motion"``, ``"goal"``, ``"manoeuvre"``, ``"singularity map"``, or
            ``"file"`` for a file that was altered.
        checks: Everything that was checked, in order.
        certificate: Recomputed certificate of the motion; None without a motion.
        limits: Recomputed limits of the motion.
        inverse: Inverse dynamics of MuJoCo along the motion; None if it was not used.
        forward: The engine's own integration of the motion; None without one.
        gravity: Effect of gravity gradient; None if it was not requested.
        engine: Name of that engine.
    """

    kind: str
    checks: tuple[Check, ...]
    certificate: Certificate | None = field(default=None, repr=False)
    limits: tuple[LimitResult, ...] = field(default=(), repr=False)
    inverse: InverseRun | None = field(default=None, repr=False)
    forward: ForwardRun | None = field(default=None, repr=False)
    gravity: GravityRun | None = field(default=None, repr=False)
    engine: str | None = None

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
            "certificate": None if self.certificate is None else self.certificate.to_dict(),
            "limits": [result.to_dict() for result in self.limits],
            "engine": self._engine_document,
        }

    @property
    def _engine_document(self) -> dict[str, Any] | None:
        if self.forward is None:
            return None
        runs = {"inverse": self.inverse, "forward": self.forward, "gravity": self.gravity}
        documents = {name: None if run is None else asdict(run) for name, run in runs.items()}
        return {"name": self.engine, **documents}
