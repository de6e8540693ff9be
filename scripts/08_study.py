"""Many cases of one scenario, side by side on all cores, and on from where they ended.

``python scripts/08_study.py`` writes the folder study and ends in the share of the cases that keep
the margin [%]. Run it again: nothing is computed twice.
"""

from pathlib import Path

import pyarrow.parquet as pq

import freefloat as ff

STUDY = """\
base: planar_3dof/parabola_nonstop      # a scenario: a file, or a bundled name
task: simulate                          # of every case: plan, map or simulate
heading_deg: 156                        # a fifth of a degree inside its range
branch: 0
cases: 6
seed: 1
vary:                                   # any keys of the scenario: lists, grids, random draws
  momentum: {normal: {mean: [0, 0, 0.5], sd: [0, 0, 0.5]}}
  robot.scale_mass: {uniform: [0.8, 1.2]}
"""


def main() -> None:
    """Write the study, run it, and read its table."""
    file = Path("study.yaml")
    file.write_text(STUDY)
    study = ff.load_study(file)
    print(f"{study.count} cases, the last one: {study.parameters(study.count - 1)}")

    summary = ff.run_study(study, "study", workers=2)  # the processes, one a core when left out
    print(f"computed {summary['computed']}, reused {summary['reused']}")

    # One row a case, for pandas, R or MATLAB as well: study/*.parquet and .csv, and a figure.
    table = pq.read_table(summary["files"]["parquet"])
    for row in table.to_pylist():
        print(f"case {row['case']}: {row['verdict']}, least |S| {row['margin']:.4f}")
    print("written:", ", ".join(sorted(Path(one).name for one in summary["files"].values() if one)))
    print(f"feasible: {100 * summary['feasible_fraction']:.2f} %")


if __name__ == "__main__":  # every worker reads this file once more
    main()
