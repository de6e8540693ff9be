"""Plan every bundled scenario and prove each plan again from its file, with both engines.

Usage: python scripts/verify_plans.py [FOLDER] [SCENARIO...]

Plans that are in the folder already are not made again. Exit code 1 when one is not proved.
"""

import sys
import tempfile
import time
from pathlib import Path

import freefloat as ff
from freefloat.robot.names import bundled_scenarios
from freefloat.verification.check import CheckReport


def planned(name: str, folder: Path) -> Path:
    """The plan's file of a bundled scenario, made as ``freefloat plan`` makes it."""
    path = folder / (name.replace("/", "_") + ".h5")
    if not path.exists():
        scenario = ff.load_scenario(name)
        plan = ff.plan(scenario.problem(), scenario.search(), scenario.limits())
        ff.save(plan, path)
    return path


def row(name: str, report: CheckReport, seconds: float) -> str:
    proof, engine = report.certificate, report.engine
    if proof is None or engine is None:
        return f"{name:30} {[check.reason for check in report.discrepancies]}"
    least, again = proof.least[-1] if len(proof.least) == 3 else proof.of("gjm"), proof.integration
    turn = proof.end_effector_attitude
    inverse, forward = engine["inverse"], engine["forward"]
    return (
        f"{name:30} {least.measure:>6} {least.value:9.4g} {least.bound / least.value:6.3f}"
        f" {proof.end_effector_position.value:8.1e} {turn.value if turn else 0.0:8.1e}"
        f" {proof.momentum.value / proof.momentum_scale:8.1e} {again.attitude:8.1e}"
        f" {again.halving_attitude:8.1e} {inverse['wrench'] / inverse['torque']:8.1e}"
        f" {forward['attitude']:8.1e} {seconds:5.1f}  {'proved' if report.passed else 'NOT'}"
    )


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    names = sys.argv[2:] or bundled_scenarios()
    print(
        f"{'scenario':30} {'margin':>6} {'least':>9} {'proven':>6} {'hand/m':>8} {'hand/rad':>8}"
        f" {'momentum':>8} {'again':>8} {'halving':>8} {'wrench':>8} {'forward':>8} {'s':>5}"
    )
    proved = True
    for name in names:
        path = planned(name, folder)
        start = time.perf_counter()
        report = ff.check(ff.load(path), "mujoco")
        print(row(name, report, time.perf_counter() - start), flush=True)
        for check in report.discrepancies:
            print(f"  {check.reason}", flush=True)
        proved = proved and report.passed
    return 0 if proved else 1


if __name__ == "__main__":
    sys.exit(main())
