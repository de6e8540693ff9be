"""Plan every bundled scenario, save the plan, and check the file with both engines.

Usage: python scripts/lab/verify_plans.py [FOLDER] [SCENARIO...]

Plans that are in the folder already are not computed again. Exit code 1 when a check fails.
"""

import sys
import tempfile
import time
from pathlib import Path

import freefloat as ff
from freefloat.robot.named_files import bundled_scenarios
from freefloat.verification.check import CheckReport

HEADINGS = (
    f"{'scenario':30} {'measure':>7} {'minimum':>9} {'bound':>6} {'position':>8} {'angle':>8}"
    f" {'momentum':>8} {'second':>8} {'wrench':>8} {'forward':>8} {'seconds':>7}"
)


def planned(name: str, folder: Path) -> Path:
    """File with the plan of a bundled scenario."""
    path = folder / (name.replace("/", "_") + ".h5")
    if not path.exists():
        scenario = ff.load_scenario(name)
        ff.save(ff.plan(scenario.problem(), scenario.search()), path)
    return path


def row(name: str, report: CheckReport, seconds: float) -> str:
    """Minimum margin, its proven bound relative to it, and the largest errors."""
    certificate, runs = report.certificate, report.runs
    inverse, forward = runs.inverse, runs.forward
    if certificate is None or inverse is None or forward is None:
        return name
    minimum, angle = certificate.minima[-1], certificate.end_effector_orientation
    return (
        f"{name:30} {minimum.measure:>7} {minimum.value:9.4g} {minimum.bound / minimum.value:6.3f}"
        f" {certificate.end_effector_position.value:8.1e} {angle.value if angle else 0.0:8.1e}"
        f" {certificate.momentum.value / certificate.momentum_scale:8.1e}"
        f" {certificate.integration.attitude:8.1e} {inverse.wrench / inverse.torque:8.1e}"
        f" {forward.attitude:8.1e} {seconds:7.1f}"
    )


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    print(HEADINGS)
    passed = True
    for name in sys.argv[2:] or bundled_scenarios():
        path = planned(name, folder)
        start = time.perf_counter()
        report = ff.check(ff.load(path), "mujoco")
        print(row(name, report, time.perf_counter() - start), flush=True)
        for check in report.discrepancies:
            print(f"  {check.reason}", flush=True)
        passed = passed and report.passed
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
