"""CSV files of the paths of a scenario."""

from __future__ import annotations

from pathlib import Path

from freefloat.io.scenario.schema import ScenarioFile
from freefloat.paths.samples import samples_text


def sample_texts(content: ScenarioFile, folder: Path) -> dict[str, str]:
    """Texts of the CSV files of the first path and of phases, by the names that these give them.

    Args:
        content: Data of the scenario.
        folder: Its folder, to which the names are relative.

    Raises:
        InputError: If a file cannot be read.
    """
    paths = [content.path, *(phase.path for phase in content.phases)]
    names = [path.samples for path in paths if path is not None and path.samples is not None]
    return {name: samples_text(folder / name) for name in names}
