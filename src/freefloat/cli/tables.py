"""The same documents told to people: tables and sentences for a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.console import RenderableType
from rich.text import Text

from freefloat.cli.limit_tables import limit_tables, plain_table
from freefloat.cli.shares import share_text

Document = dict[str, Any]
_REGIONS = 12
"""The largest, told to people; machines are told all."""
_ANY = "any"
"""Label of all that an arm with joints to spare can start from."""


def _terse(label: str) -> str:
    """``s+ e- w+`` for ``shoulder+ elbow- wrist+``; nothing for a mere number, or for any."""
    words = [word for word in label.split() if not word.isdigit() and word != _ANY]
    return " ".join(word[0] + word[-1] for word in words)


def decimals(values: Sequence[float], digits: int = 4) -> str:
    """Numbers with so many decimals, in a row."""
    return " ".join(f"{value:.{digits}f}" for value in values)


def plot_lines(document: Document) -> list[RenderableType]:
    """The figures that were drawn, where any were wanted; by folder, each name once."""
    files = [Path(file) for file in document.get("plots", [])]
    folders = dict.fromkeys(file.parent for file in files)
    names = ", ".join(dict.fromkeys(file.stem for file in files))
    return [Text(f"Figures in {folder}, as PDF and PNG: {names}") for folder in folders]


def simulation_tables(document: Document, name: str) -> list[RenderableType]:
    """A simulation: the verdict on every branch, the chosen motion, its proof."""
    chosen = document["branch"]
    spare = document["redundancy"] is not None
    title = Text(
        f"{name}: arm {'configurations tried' if spare else 'branches'} from this attitude"
    )
    margin = document["min_margin"]
    table = plain_table(
        "start" if spare else "branch",
        "joints at the start [rad, m]",
        f"least {margin['measure']}",
        "verdict",
    )
    for one in document["branches"]:
        table.add_row(
            f"{one['branch']}{'*' if one['branch'] == chosen else ''} {_terse(one['label'])}",
            decimals(one["joints"], 3),
            f"{one['min_margin']['sign'] * one['min_margin']['value']:.4g}",
            _verdict(one),
        )
    told = [Text(f"  {document['out_of_reach']}", "red")] if document["out_of_reach"] else []
    chosen = _chosen_lines(document, " (*)")
    return [title, table, *chosen, *told, *limit_tables(document["limits"])]


def _verdict(one: Document) -> Text:
    margin = one["min_margin"]
    if one["singular"]:
        return Text(f"singular at {one['singular']['time']:.4f} s", "red")
    if not one["completed"]:
        return Text(f"margin used up at {one['ended_at']:.4f} s", "yellow")
    if not margin["kept"]:
        return Text(f"completes, below {margin['required']:g}", "yellow")
    return Text("completes", "green")


def _chosen_lines(document: Document, mark: str = "") -> list[RenderableType]:
    margin, residuals = document["min_margin"], document["residuals"]
    initial, final, singular = document["initial"], document["final"], document["singular"]
    lines = [
        f"Followed: {_followed(document)}{mark}. {document['ending']}",
        f"  least |{margin['measure']}| {margin['value']:.6g} at t = {margin['time']:.4f} s, "
        f"{'kept' if margin['kept'] else 'below'} the margin {margin['required']:g}",
        f"  initial attitude x y z w  {decimals(initial['attitude'], 5)}",
        f"  final attitude   x y z w  {decimals(final['attitude'], 5)}, t = {final['time']:.4f} s",
        f"  final joints              {decimals(final['joints'])}",
    ]
    if singular:
        lines.append(
            f"  singular at t = {singular['time']:.4f} s, s = {singular['s']:.4f}, end-effector at "
            f"({', '.join(f'{x:.4f}' for x in singular['end_effector'])}) m"
        )
    turn = residuals["end_effector_attitude"]
    lines.append(
        f"  proof: end-effector off by {residuals['end_effector_position']:.1e} m"
        + (f" and {turn:.1e} rad" if turn is not None else "")
        + f", momentum by {residuals['momentum']:.1e} N m s"
    )
    return [Text(line) for line in lines]


def _followed(document: Document) -> str:
    """Which arm branch; of an arm with joints to spare, whose branches have no numbers, whence."""
    if document["redundancy"] is None:
        return f"branch {document['branch']}"
    return f"from joints {decimals(document['initial']['joints'], 3)}"


def plan_tables(document: Document, name: str) -> list[RenderableType]:
    """A plan: what would serve, the attitude chosen and why, its proof."""
    planar = document["samples"] is None
    above = _heading_ranges(document, name) if planar else [_sampled_line(document, name)]
    above += [Text(f"not confirmed: {words}", "yellow") for words in document["disagreements"]]
    if not document["feasible"]:
        told = Text(f"Not feasible: {document['reason']}.", "red")
        return [*above, told, *limit_tables(document["limits"])]
    deviation, bears = document["deviation_deg"], document["tolerance"]
    what = f"heading {document['heading_deg']:.4f} deg, " if planar else ""
    of_margin = "by its margin " if document["limits"] else ""  # limits may be nearer
    lines = [
        f"Chosen: {what}{document['reason']}.",
        f"  {of_margin}it may be off by {document['robust_radius_deg']:.4f} deg"
        + ("" if deviation is None else f"; {deviation:.4f} deg from the present attitude"),
    ]
    if bears is not None:
        beyond = " or more" if bears["momentum"] >= bears["momentum_limit"] else ""
        lines.append(
            f"  {of_margin}it bears momentum off by {bears['momentum']:.4g} N m s{beyond}"
            f" in any direction, durations from {bears['shortest']:.5g} to {bears['longest']:.5g} s"
        )
    if document["excluded"]:
        counts = ", ".join(f"{limit} {count}" for limit, count in document["excluded"].items())
        lines.append(f"  better candidates broke: {counts}")
    for segment in document["segments"]:
        lines.append(f"  from {segment['from']:g} to {segment['to']:g} s, at its end:")
        lines += [
            f"    {words} {_terse(entry['label'])}: {_ranges(entry) or 'none'} deg"
            for words, key in (("alone", "ranges_at_end_deg"), ("and onward", "joined_at_end_deg"))
            for entry in segment[key]
        ]
    chosen = [*(Text(line) for line in lines), *_chosen_lines(document)]
    return [*above, *chosen, *limit_tables(document["limits"])]


def _heading_ranges(document: Document, name: str) -> list[RenderableType]:
    table = plain_table("branch", "ranges [deg]")
    for entry in document["attitude_ranges_deg"]:
        shown = _ANY if entry["label"] == _ANY else f"{entry['branch']} {_terse(entry['label'])}"
        table.add_row(shown, _ranges(entry) or "none")
    return [Text(f"{name}: initial headings that keep the margin"), table]


def _sampled_line(document: Document, name: str) -> Text:
    return Text(
        f"{name}: {_share(document)} of {document['samples']:,} initial attitudes keep the margin"
    )


def _share(document: Document) -> str:
    error = document["feasible_fraction_error"]
    return share_text(document["feasible_fraction"], error, document["samples"])


def _percents(share: float, error: float) -> str:
    """An error of zero is that of a sample in which all agree: it tells nothing."""
    return f"{100.0 * share:.2f}" + (f" ± {100.0 * error:.2f}" if error > 0.0 else "")


def _ranges(entry: Document) -> str:
    return "  ".join(f"[{low:.3f}, {high:.3f}]" for low, high in entry["ranges"])


def workspace_tables(document: Document, name: str) -> list[RenderableType]:
    """Reach and areas of an arm."""
    title = Text(f"{name}: distance of the {document['point']} from the centre of mass")
    table = plain_table("area", "from [m]", "to [m]")
    rows = [("reach", document["reach"])]
    rows += [("path-dependent", interval) for interval in document["pdw"] or ()]
    rows += [("path-independent", interval) for interval in document["piw"] or ()]
    for area, (low, high) in rows:
        table.add_row(area, f"{low:.5f}", f"{high:.5f}")
    extremes = f"from {document['s_min']:.6g} to {document['s_max']:.6g} over the joint space"
    return [title, table, Text(f"S ({document['measure']}) {extremes}"), *_area_notes(document)]


def _area_notes(document: Document) -> list[RenderableType]:
    if document["pdw"] is None:
        return [Text("Areas: unknown, the arm has more joints than the task needs")]
    notes = []
    parts = "; ".join(
        f"{part['s'][0]:.3f} to {part['s'][1]:.3f} {'in' if part['path_dependent'] else 'outside'}"
        for part in document["path"]
    )
    notes.append(f"The path, by s, is inside or outside the path-dependent areas: {parts}")
    if document["measure"] == "arm":
        notes.append(
            "The areas are about the measure arm; shoulder and wrist can be singular by themselves "
            "at about any distance"
        )
    if not document["exact"]:
        notes.append(
            "Found by sampling: S does vanish in the path-dependent areas, elsewhere no place was "
            "found where it does"
        )
    return [Text(note) for note in notes]


def map_tables(document: Document, name: str) -> list[RenderableType]:
    """A map over heading in brief."""
    title = Text(f"{name}: headings that keep the margin, of {document['samples']}")
    table = plain_table("branch", "size [deg]", "centre [deg]")
    for region in document["regions"]:
        table.add_row(
            str(region["branch"]), f"{region['size_deg']:.3f}", f"{region['centre_deg']:.3f}"
        )
    best = document["best"]
    lines = [
        f"{document['feasible_fraction']:.2%} of the headings serve with some arm branch, "
        f"{document['motion_fraction']:.2%} of the {document['motions']} motions do",
    ]
    if best is not None:
        lines.append(
            f"best: {best['heading_deg']:.3f} deg, branch {best['branch']}, "
            f"margin {best['value']:.6g}"
        )
    if document["out_of_reach"]:
        lines.append(document["out_of_reach"])
    lines.append(f"{document['seconds']:.1f} s")
    return [title, table, *(Text(line) for line in lines)]


def attitude_map_tables(document: Document, name: str) -> list[RenderableType]:
    """A map over SO(3): each arm branch, the largest regions, and the attitudes to know."""
    branches = plain_table("branch", "exists [%]", "keeps the margin [%]")
    for one in document["branches"]:
        branches.add_row(
            f"{_number(one)} {_terse(one['label'])}",
            f"{100.0 * one['reached_fraction']:.2f}",
            f"{100.0 * one['fraction']:.2f}",
        )
    regions = plain_table("region", "branch", "share [%]", "centre x y z w", "depth [deg]")
    for number, region in enumerate(document["regions"][:_REGIONS]):
        regions.add_row(
            str(number + 1),
            _number(region),
            _percents(region["fraction"], region["error"]),
            decimals(region["centre"], 5),
            f"{region['depth_deg']:.2f}",
        )
    margin, more = document["margin"], len(document["regions"]) - _REGIONS
    lines = [f"and {more} smaller regions"] if more > 0 else []
    lines += [
        f"{_share(document)} of the attitudes keep {margin['measure']} {margin['value']:g} with "
        f"some arm branch, {document['motion_fraction']:.2%} of the {document['motions']:,} "
        "motions do",
        *_known_attitudes(document),
        f"{document['seconds']:.1f} s",
    ]
    title = Text(f"{name}: {document['samples']:,} initial attitudes, every arm branch")
    parts = [regions] if document["regions"] else []
    return [title, branches, *parts, *(Text(line) for line in lines)]


def _known_attitudes(document: Document) -> Iterator[str]:
    """Lines on the best, the deepest and the nearest attitude, as far as there are such."""
    if document["best"] is None:
        why = document["out_of_reach"]
        yield "no attitude was found that keeps the margin" + (f": {why}" if why else "")
    for key, value, unit in (
        ("best", "value", document["margin"]["measure"]),
        ("robust", "radius_deg", "deg around keep the margin"),
        ("nearest", "deviation_deg", "deg away"),
    ):
        one = document.get(key)
        if one is not None:
            amount = f"{one[value]:.6g}"
            told = f"{unit} {amount}" if key == "best" else f"{amount} {unit}"
            yield f"{key + ':':9}{decimals(one['attitude'], 5)}, branch {_number(one)}, {told}"
    if "touch" in document:
        touch, worst = document["touch"], document["touch"]["worst_gap_deg"]
        told = "" if worst is None else f"; bisection finds it within {worst:.2g} deg of them"
        yield f"{touch['count']} attitudes of the boundary carried back from touch points{told}"
    if "boundary" in document:
        yield f"{len(document['boundary'])} attitudes of the boundary found, see --json or -o"


def _number(entry: Document) -> str:
    return _ANY if entry["branch"] is None else str(entry["branch"])


def view_tables(document: Document) -> list[RenderableType]:
    """Where a page, pictures or a video are."""
    lines = [f"remark: {words}" for words in document["remarks"]]
    if document["address"] is not None:
        lines.append(f"{document['address']}  (for this machine alone; Ctrl-C ends)")
    if document["html"] is not None:
        lines.append(f"page: {document['html']}")
    if document["snapshots"]:
        first, last = document["snapshots"][0], document["snapshots"][-1]
        lines.append(f"pictures: {first}" + (f" to {last}" if last != first else ""))
    if document["video"] is not None:
        video = document["video"]
        pace = "" if video["speed"] == 1.0 else f", {video['speed']:g} times as fast as the motion"
        lines.append(f"video: {video['file']}, {video['duration']:.1f} s{pace}")
    return [Text(line) for line in lines]
