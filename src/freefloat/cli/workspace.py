"""``freefloat workspace``: an arm's reach and its areas."""

from __future__ import annotations

from freefloat.cli.console import answer, answering
from freefloat.cli.options import Json, ScenarioName


def workspace(scenario: ScenarioName, as_json: Json = False) -> None:
    """Tell an arm's reach and where in it the arm can become singular.

    Example: freefloat workspace planar_3dof/parabola
    """
    with answering(as_json):
        from freefloat.cli.tables import workspace_tables
        from freefloat.io.scenario import load_scenario
        from freefloat.workspace.regions import workspace as find_workspace

        loaded = load_scenario(scenario)
        with loaded.error_context():
            document = find_workspace(loaded.problem()).to_dict()
    answer(document, workspace_tables(document, scenario), as_json)
