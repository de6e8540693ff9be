"""What a shell offers for a word half written: bundled names, and files that would do.

Where nothing is offered the shell completes files and folders as it does elsewhere.
"""

from __future__ import annotations

from pathlib import Path

_YAML, _URDF = (".yaml", ".yml"), (".urdf",)


def scenario_names(incomplete: str) -> list[str]:
    """Bundled scenarios, and YAML files."""
    from freefloat.robot.names import bundled_scenarios

    return _offered(incomplete, bundled_scenarios(), _YAML)


def study_names(incomplete: str) -> list[str]:
    """Bundled studies, and YAML files."""
    from freefloat.robot.names import bundled_studies

    return _offered(incomplete, bundled_studies(), _YAML)


def robot_names(incomplete: str) -> list[str]:
    """Bundled robots and scenarios, and files of both kinds."""
    from freefloat.robot.names import bundled_robots, bundled_scenarios

    names = (*bundled_robots(), *bundled_scenarios())
    return _offered(incomplete, names, (*_URDF, *_YAML))


def bundled_names(incomplete: str) -> list[str]:
    """All that is bundled: robots, scenarios and studies."""
    from freefloat.robot.names import bundled_robots, bundled_scenarios, bundled_studies

    names = (*bundled_robots(), *bundled_scenarios(), *bundled_studies())
    return [name for name in names if name.startswith(incomplete)]


def _offered(incomplete: str, names: tuple[str, ...], endings: tuple[str, ...]) -> list[str]:
    folder, slash, begun = incomplete.rpartition("/")
    try:
        found = sorted(Path(f"{folder}{slash}" or ".").iterdir())
    except OSError:  # no such folder, or not for us to see
        found = []
    files = [
        f"{folder}{slash}{file.name}"
        for file in found
        if file.name.startswith(begun) and file.suffix in endings and file.is_file()
    ]
    return [*(name for name in names if name.startswith(incomplete)), *files]
