"""Many runs of one scenario, side by side on all cores, resumable.

``python scripts/08_study.py`` writes the folder study and prints the percentage of feasible runs.
Run it again: nothing is computed twice.

A study varies keys of a scenario, here momentum and masses, and tells in how many of the runs the
planned attitude is still feasible.
"""

from pathlib import Path

import freefloat as ff

STUDY = """\
base: planar_3dof/parabola              # a scenario: a file, or a bundled name
command: simulate                       # of every run: plan, map or simulate
heading_deg: 161.2                      # just inside its range
start: {branch: 0}
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
    print(f"{study.count} runs, the last one: {study.parameters(study.count - 1)}")

    result = ff.run_study(study, "study", workers=2)  # the processes, one a core when left out
    print(f"computed {result.computed}, reused {study.count - result.computed}")

    for row in result.rows:
        print(f"run {row['number']}: {row['verdict']}, minimum |S| {row['margin']:.4f}")

    # The same rows for pandas, R or MATLAB: study/cases.csv; and a figure.
    print("written:", ", ".join(sorted(file.name for file in result.files.values() if file)))
    print(f"feasible: {100 * result.feasible_fraction:.2f} %")


if __name__ == "__main__":  # every worker reads this file once more
    main()
