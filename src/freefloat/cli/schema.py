"""``freefloat schema``: JSON schemas of the input files."""

from __future__ import annotations

from freefloat.cli.console import print_json
from freefloat.cli.options import Json, Quiet


def schema(as_json: Json = False, quiet: Quiet = False) -> None:
    """Print the JSON schemas of scenario and study files, for editors and checkers.

    Example: freefloat schema > freefloat.schema.json
    """
    from freefloat.io.schema import ScenarioFile
    from freefloat.studies.schema import StudyFile

    schemas = {
        "scenario": ScenarioFile.model_json_schema(),
        "study": StudyFile.model_json_schema(),
    }
    print_json({name: {"$id": f"urn:freefloat:{name}", **one} for name, one in schemas.items()})
