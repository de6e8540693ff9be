"""Lines of Python by folder beside their goals, so that growth is a decision.

``python scripts/size.py`` prints a table. A folder may have a tenth more lines than its goal. A
folder that has more is recorded below with its lines and may only shrink: where it grows beyond its
record, or another folder beyond a tenth above its goal, the exit code is 1.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "freefloat"
MODULES, KERNELS = "modules", "kernels"
"""Modules beside the packages; what Numba compiles."""
COMPILED = ("lockstep", "dynamics/kernels", "ensemble/kernels")
TOLERANCE = 1.1
GOALS = {
    MODULES: 1_100, KERNELS: 3_600, "robot": 2_400, "scene": 600, "paths": 1_300,
    "dynamics": 1_900, "ik": 1_200, "motion": 1_900, "certificate": 600, "limits": 1_900,
    "ensemble": 1_300, "singularities": 600, "regions": 700, "planning": 5_300,
    "verification": 800, "io": 2_600, "visualization": 3_800, "studies": 2_600, "cli": 2_100,
    "beyond": 12_000,
}  # fmt: skip
"""Lines of the folders of ``src/freefloat``."""
RECORDS = {
    MODULES: 1_590, "robot": 4_580, "paths": 1_850, "dynamics": 2_890, "ik": 1_940,
    "motion": 2_680, "certificate": 670, "limits": 2_380, "ensemble": 2_470, "regions": 800,
    "planning": 8_330, "verification": 1_490, "io": 3_760, "visualization": 4_530,
    "studies": 4_740, "cli": 3_110,
}  # fmt: skip
"""Lines of folders that are larger than their goals permit."""


def lines(folder: Path) -> int:
    """Lines of the Python files below a folder."""
    return sum(len(file.read_text("utf-8").splitlines()) for file in folder.rglob("*.py"))


def sizes() -> dict[str, int]:
    """Lines of the folders, kernels taken out of their packages."""
    found = {folder.name: lines(folder) for folder in SOURCE.iterdir() if folder.is_dir()}
    found = {name: count for name, count in found.items() if count}
    found[MODULES] = lines(SOURCE) - sum(found.values())
    compiled = {part: lines(SOURCE / part) for part in COMPILED}
    for part, count in compiled.items():
        found[part.partition("/")[0]] -= count
    return {name: count for name, count in found.items() if count} | {
        KERNELS: sum(compiled.values())
    }


def main() -> int:
    """Print the table; return the exit code."""
    grown = 0
    found = sizes()
    print(f"{'folder':16} {'lines':>7} {'goal':>7} {'most':>7}")
    for name, goal in GOALS.items():
        most = max(RECORDS.get(name, 0), int(TOLERANCE * goal))
        too_many = found[name] > most
        grown += too_many
        print(f"{name:16} {found[name]:7,} {goal:7,} {most:7,} {'too many' * too_many}".rstrip())
    core = sum(count for name, count in found.items() if name != "beyond")
    print(f"{'the planner':16} {core:7,} {38_000:7,}")
    print(f"{'tests':16} {lines(ROOT / 'tests'):7,} {25_000:7,}")
    if unknown := found.keys() - GOALS.keys():
        print(f"without a goal: {', '.join(sorted(unknown))}")
    return int(bool(grown or unknown))


if __name__ == "__main__":
    sys.exit(main())
