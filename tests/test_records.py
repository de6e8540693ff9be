"""Records are trees of plain values and the same records again; other trees are refused."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Annotated, Any, NamedTuple, Protocol, TypeVar

import numpy as np
import pytest
from typing_extensions import TypeAliasType

from freefloat.codec import Codec
from freefloat.records import Joints, Quantity, Tree, derived
from freefloat.so3 import Array


class Colour(Enum):
    RED = "of blood"
    BLUE = "of the sea"


class Shape(Protocol):
    size: float


@dataclass(frozen=True)
class Ball:
    size: float


@dataclass(frozen=True)
class Cube:
    size: float
    colour: Colour = Colour.RED


@dataclass(frozen=True, eq=False)
class Point:
    place: Joints
    number: int | None
    gap: float | None
    colour: Colour


Number = TypeVar("Number", bound=np.generic)
Alias = TypeAliasType("Alias", np.ndarray[Any, np.dtype[Number]], type_params=(Number,))
"""An alias, as NumPy's ``NDArray`` is from Python 3.12 on."""


class Pair(NamedTuple):
    low: Annotated[Array, "m"]
    codes: Alias[np.int8]


@dataclass(frozen=True, eq=False)
class Everything:
    robot: str = field(repr=False)
    count: int
    share: float
    done: bool
    shape: Shape
    either: Ball | Cube | None
    points: tuple[Point, ...]
    shapes: tuple[Shape, ...]
    pair: Pair
    names: tuple[str, str]
    span: Annotated[tuple[float, ...], "s"]
    colours: tuple[Colour, ...]
    by_name: Mapping[str, float]
    by_number: Mapping[int, tuple[Colour, ...]]

    @derived
    def doubled(self) -> Annotated[Array, "m"]:
        """Twice the pair's."""
        return 2.0 * self.pair.low


CODEC = Codec(members={Shape: (Ball, Cube)})


def everything() -> Everything:
    ball = Ball(-math.inf)
    points = (Point(np.arange(3.0), None, 0.5, Colour.BLUE), Point(np.ones(3), 7, None, Colour.RED))
    pair = Pair(np.array([0.1, 0.7]), np.array([1, -1], np.int8))
    return Everything(
        "robot", 3, math.nan, True, ball, Cube(2.0), points, (ball, Cube(1.0), ball), pair,
        ("a", "b"), (), (Colour.RED, Colour.BLUE), {"x/y": 0.1}, {5: (Colour.RED,), 2: ()},
    )  # fmt: skip


def test_a_record_of_every_type_returns() -> None:
    record = everything()
    tree = CODEC.encode(record)
    other = CODEC.decode(Everything, tree, {})
    assert CODEC.encode(other).keys() == tree.keys()
    np.testing.assert_equal(CODEC.encode(other), tree)
    assert (other.shape, other.either, other.shapes) == (record.shape, record.either, record.shapes)
    assert other.shape is other.shapes[0] is other.shapes[2]
    assert [(p.number, p.gap, p.colour) for p in other.points] == [
        (None, 0.5, Colour.BLUE), (7, None, Colour.RED),
    ]  # fmt: skip
    assert (other.by_name, other.by_number) == (record.by_name, record.by_number)
    assert tree["doubled"].unit == tree["pair"]["low"].unit == "m"
    assert tree["points"]["place"].values.shape == (2, 3)
    assert other.pair.codes.dtype == np.int8
    assert not other.pair.codes.flags.writeable


@dataclass(frozen=True)
class Solved:
    """A record in a context."""

    ball: Ball
    cube: Cube | None = None
    other: Cube | None = None


def test_values_of_the_context_are_not_stored() -> None:
    codec, ball, cube = Codec((Ball, Cube)), Ball(1.0), Cube(2.0)
    tree = codec.encode(Solved(ball, cube))
    assert tree == {"class": "Solved", "cube": True, "other": None}
    decoded = codec.decode(Solved, tree, {Ball: ball, Cube: cube})
    assert (decoded.ball, decoded.cube, decoded.other) == (ball, cube, None)
    assert decoded.ball is ball


def test_records_of_unknown_classes_are_not_stored() -> None:
    with pytest.raises(TypeError, match="Cube"):
        Codec(members={Shape: (Ball,)}).encode(everything())


CHANGES: dict[str, Callable[[Tree], object]] = {
    "no entry": lambda tree: tree.pop("count"),
    "text": lambda tree: tree.update(count="3"),
    "truth value": lambda tree: tree.update(count=True),
    "fraction": lambda tree: tree.update(count=3.5),
    "no class": lambda tree: tree["shape"].pop("class"),
    "another class": lambda tree: tree["shape"].update({"class": "Everything"}),
    "no member": lambda tree: tree["either"].update(colour="GREEN"),
    "no record": lambda tree: tree.update(shape=1.0),
    "a gap": lambda tree: tree["shapes"].pop("1"),
    "a column": lambda tree: tree["points"].pop("gap"),
    "rows": lambda tree: tree["points"].update(gap=Quantity(np.zeros(3))),
    "length": lambda tree: tree.update(names=Quantity(np.array(["a"], object))),
    "type": lambda tree: tree["pair"].update(codes=Quantity(np.array([1, -1]))),
}


@pytest.mark.parametrize("change", CHANGES)
def test_other_trees_are_refused(change: str) -> None:
    tree = CODEC.encode(everything())
    CHANGES[change](tree)
    with pytest.raises(ValueError, match=r"part|zip"):
        CODEC.decode(Everything, tree, {})
