"""Description of a scene for the page around it: titles, labels, texts, colours, first view."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex

from freefloat.motion.margin import Margin
from freefloat.so3 import Array

_BELOW = (0.835, 0.369, 0.0)
_DARKEST = 0.25
"""Lower end of the colour map; darker colours are invisible on the background."""
_STOPS = 9


@dataclass(frozen=True)
class Label:
    """A text at a point of the scene.

    Attributes:
        text: The text.
        position: The point [m], in the frame of ``node``.
        item: Item that the label is shown and hidden with.
        since: Time from which on it is shown [s].
        node: Path of a node that it moves with, below the path of the scene; empty for the scene.
        colour: Colour of the text, in CSS; the page's colour if it is empty.
    """

    text: str
    position: list[float]
    item: str
    since: float = 0.0
    node: str = ""
    colour: str = ""


@dataclass(frozen=True)
class Trail:
    """Values at the key times of a motion.

    Attributes:
        times: Key times [s].
        values: Magnitudes of the margin's measure.
        fractions: Path parameters s; None where the joints are prescribed.
        indices: Number of triangle indices of trails per segment.
        joints: Name, whether it is prismatic, and values [rad or m] of each joint.
    """

    times: list[float]
    values: list[float]
    fractions: list[float] | None
    indices: int
    joints: list[tuple[str, bool, list[float]]]


@dataclass(frozen=True)
class TitledScene:
    """A motion, an arm branch of a map, or a map of the joint space, shown by its title."""

    title: str  # the title
    node: str  # name of its node in the scene tree
    labels: list[Label]  # labels of the scene
    begin: float = 0.0  # start of the motion [s]
    end: float = 0.0  # end of the motion [s]
    ending: str | None = None  # how the motion ended, a word; None for maps
    verdict: str | None = None  # how the motion ended, a sentence; None for maps
    trail: Trail | None = None  # values over time; None for maps
    lines: tuple[str, ...] = ()  # text of a map; warnings about a motion
    origin: Sequence[float] = (0.0, 0.0, 0.0)  # place of its coordinates in the scene [m]
    margin: float = 0.0  # required magnitude of the measure; zero for none
    keeps_margin: bool = True  # whether the motion keeps it, between the values of the trail, too


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of a map that can be pointed at.

    Attributes:
        points: Places of the samples in the scene [m], shape (K, 3): rotation vectors or, over
            headings, points on the unit circle.
        margins: Minimum margins, shape (K, C): zero for motions that end early, negative where the
            start of the path is not reached.
        columns: What each column is of: the titles of the arm branches.
        parts: Items that samples are drawn in: feasible ones with y < 0 and others, those below
            the margin, those that do not reach the path. None over headings.
    """

    points: Array
    margins: Array
    columns: tuple[str, ...]
    parts: tuple[str, str, str, str] | None = None


@dataclass(frozen=True)
class View:
    """First view of a scene."""

    centre: list[float]  # centre of a ball that contains the scene [m]
    radius: float  # radius of that ball [m]
    points: list[list[float]]  # points that the picture must contain [m]
    direction: list[float]  # direction from the centre to the eye
    flat: bool  # whether the scene lies in the x-y plane


@dataclass(frozen=True)
class MarginColours:
    """Scale from the margin (dark) to the largest value (bright); a single colour below."""

    margin: Margin  # measure and threshold
    largest: float  # value of the brightest colour
    used: bool = True  # whether any value keeps the margin
    limited: bool = False  # whether values are zero where a limit is violated

    @classmethod
    def over(cls, margin: Margin, values: Iterable[Array], limited: bool = False) -> MarginColours:
        """The scale that covers arrays of values of the measure."""
        highest = [float(np.max(array)) for array in values if len(array)]
        largest = max([1.2 * margin.threshold, 1e-12, *highest])
        return cls(margin, largest, any(map(margin.keeps, highest)), limited)

    def __call__(self, values: Array) -> Array:
        """RGB colours, shape (K, 3), of values of the measure, shape (K,)."""
        fraction = (values - self.margin.threshold) / (self.largest - self.margin.threshold)
        shades = _DARKEST + (1.0 - _DARKEST) * fraction
        bright = np.asarray(colormaps["viridis"](shades))[:, :3]
        return np.where((fraction < 0.0)[:, None], _BELOW, bright)

    def to_dict(self) -> dict[str, Any]:
        """The content of the page's legend."""
        stops = np.linspace(self.margin.threshold, self.largest, _STOPS)
        return {
            "measure": self.margin.measure.title, "unit": self.margin.measure.unit,
            "margin": self.margin.threshold, "largest": self.largest, "below": to_hex(_BELOW),
            "limited": self.limited,
            "stops": [to_hex(colour) for colour in self(stops)] if self.used else [],
        }  # fmt: skip


@dataclass(frozen=True)
class SceneDescription:
    """Description of a scene for the page.

    Attributes:
        title: Title of the page.
        scenes: Motions, or arm branches of a map.
        items: Names of the nodes that can be hidden, and whether they are visible at first.
        legend: Colours of the margin (:meth:`MarginColours.to_dict`), or ``entries``: text and
            colour of each part of the scene.
        view: First view.
        remarks: Messages on visuals of the robot that cannot be drawn.
        samples: Samples of a map.
        sequence: Whether the motions follow one another.
        start: What the clock of the page shows at its beginning [s]; all other times are from it.
    """

    title: str
    scenes: tuple[TitledScene, ...]
    items: Mapping[str, bool]
    legend: Mapping[str, Any]
    view: View
    remarks: tuple[str, ...] = ()
    samples: Samples | None = None
    sequence: bool = False
    start: float = 0.0

    @property
    def duration(self) -> float:
        """Duration of the longest motion [s]; zero for a map."""
        return max(scene.end for scene in self.scenes)

    def to_dict(self) -> dict[str, Any]:
        """The description as the page's script reads it."""
        samples = self.samples
        return {
            "title": self.title, "start": self.start, "duration": self.duration,
            "scenes": [asdict(scene) for scene in self.scenes],
            "items": [{"name": name, "visible": shown} for name, shown in self.items.items()],
            "scale": self.legend, "view": asdict(self.view), "remarks": list(self.remarks),
            "sequence": self.sequence,
            "samples": samples and {"columns": samples.columns, "parts": samples.parts},
        }  # fmt: skip
