"""``freefloat schema``: what the files may hold, for editors and checkers.

Example: freefloat schema > freefloat.schema.json
"""

from __future__ import annotations

from freefloat.cli.console import answering, print_json
from freefloat.cli.options import Json


def schema(as_json: Json = False) -> None:
    """Print the JSON schemas of scenario and study files, for editors and checkers.

    Example: freefloat schema > freefloat.schema.json
    """
    with answering(as_json):
        from freefloat.io.schema import ScenarioFile
        from freefloat.studies.schema import StudyFile

        schemas = {
            "scenario": ScenarioFile.model_json_schema(),
            "study": StudyFile.model_json_schema(),
        }
        document = {name: {"$id": f"urn:freefloat:{name}", **one} for name, one in schemas.items()}
    print_json(document)
