"""Draw the packages of freefloat and their imports as docs/pictures/packages.svg.

``python scripts/make_package_graph.py``. An arrow leads from a package to those that it imports;
imports that follow from others are left out: where A imports B and B imports C, A to C.
"""

from pathlib import Path

import grimp

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "pictures" / "packages.svg"
WIDTH, ROW = 480, 46
"""Width of the picture and distance of its rows [pixels]."""
BOX = (100, 26)


def imports() -> dict[str, set[str]]:
    """Packages that each package imports, without those that follow from others."""
    graph = grimp.build_graph("freefloat", cache_dir=None)
    packages = graph.find_children("freefloat") - {"freefloat.__main__"}
    for package in packages:
        graph.squash_module(package)
    direct = {
        package: graph.find_modules_directly_imported_by(package) & packages - {package}
        for package in packages
    }

    def below(package: str) -> set[str]:
        return direct[package].union(*map(below, direct[package]))

    return {
        package: targets - set().union(*map(below, targets)) for package, targets in direct.items()
    }


def svg(arrows: dict[str, set[str]]) -> str:
    """The picture: each package in a row above all that it imports."""

    def row(package: str) -> int:
        return max((row(target) + 1 for target in arrows[package]), default=0)

    rows: dict[int, list[str]] = {}
    for package in sorted(arrows):
        rows.setdefault(row(package), []).append(package)
    height = ROW * len(rows)
    place = {
        package: (WIDTH * (2 * k + 1) // (2 * len(entries)), height - ROW * level - ROW // 2)
        for level, entries in rows.items()
        for k, package in enumerate(entries)
    }
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}">',
        '<defs><marker id="a" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" '
        'orient="auto"><path d="M0 0 8 4 0 8z" fill="#789"/></marker></defs>',
    ]
    for package, targets in sorted(arrows.items()):
        for target in sorted(targets):
            (x, y), (u, v) = place[package], place[target]
            side = 8 if u < WIDTH / 2 else WIDTH - 8  # long arrows lead past the rows between
            start, end = y + BOX[1] // 2, v - BOX[1] // 2
            bend = f"C{side} {start + ROW} {side} {end - ROW}" if v - y > 2 * ROW else "L"
            lines.append(
                f'<path d="M{x} {start}{bend} {u} {end}" fill="none" stroke="#789" '
                'marker-end="url(#a)"/>'
            )
    for package, (x, y) in sorted(place.items()):
        lines.append(
            f'<rect x="{x - BOX[0] // 2}" y="{y - BOX[1] // 2}" width="{BOX[0]}" '
            f'height="{BOX[1]}" rx="5" fill="#eef2fb" stroke="#456"/>'
            f'<text x="{x}" y="{y + 5}" text-anchor="middle" font-family="sans-serif" '
            f'font-size="14" fill="#123">{package.removeprefix("freefloat.")}</text>'
        )
    return "\n".join([*lines, "</svg>"]) + "\n"


if __name__ == "__main__":
    PICTURE.parent.mkdir(parents=True, exist_ok=True)
    PICTURE.write_text(svg(imports()), encoding="utf-8")
