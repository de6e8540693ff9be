"""Certified maps of the joint space: where det A of (5) has a sign, and where it vanishes.

Boxes are halved across the joint that changes det A most. A box is free of singularities where
the bounds of the polynomial exclude zero. Where that joint's width has come down to the resolution,
a box that has points of either sign contains a singular configuration; the others are undecided.

The tree of boxes is kept as one number per node, in breadth-first order: the index of the joint
across which a box is cut, or its :class:`Kind`. The k-th box that is cut has its halves at 2k + 1
and 2k + 2, the half of lower joint values first.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, ClassVar

import numpy as np
import numpy.typing as npt

from freefloat.concurrency import Progress
from freefloat.dynamics.tasks import Task, require_task
from freefloat.errors import InputError, finite_number, require_type
from freefloat.robot.joint_values import configurations
from freefloat.robot.model import FreeFloatingModel
from freefloat.singularities.global_maximum import halved, whole_joint_space
from freefloat.singularities.joint_polynomial import JointPolynomial
from freefloat.singularities.singularity_polynomial import SingularityPolynomial
from freefloat.so3 import Array, IntArray

_RESOLUTIONS = (0.1, 0.1, 0.1, 1.0, 5.0, 15.0)
"""Default resolutions [deg] for maps of so many joints; the last one for more joints."""
_MOST_JOINTS = 5
"""Joints of redundant arms, whose polynomials have twice the degree, that can be mapped."""
_BOXES, _MOST_BOXES = 2**15, 50_000_000
"""Boxes that are processed together, and the largest number of all, which takes minutes."""
_SAMPLE = 2**13
"""Number of boxes of a coarse map from which the number of a finer one is estimated."""
_OVERESTIMATE = 4.0
"""Ratio that estimated to true numbers of boxes may have: in fine maps few joints need a cut."""
_NODES = "joint of a cut, or 252 positive, 253 negative, 254 singular, 255 undecided"
"""Unit of nodes in files."""


class Kind(IntEnum):
    """What is known of a box of the joint space.

    ``POSITIVE`` and ``NEGATIVE``: det A has this sign everywhere. ``SINGULAR``: a configuration in
    it is singular. ``UNDECIDED``: none of these is proven.
    """

    POSITIVE = 252
    NEGATIVE = 253
    SINGULAR = 254
    UNDECIDED = 255


@dataclass(frozen=True, eq=False)
class SingularityMap:
    """The joint space in boxes that are free of singularities, contain one, or are undecided.

    Joints on which det A does not depend, and joints of fixed values, are never cut.

    Attributes:
        model: Robot.
        task: Task.
        polynomial: Det A by the joints, with the values of fixed joints inserted.
        fixed: Values of the joints that are fixed [rad or m], by name.
        resolution: Boxes that are not free of singularities are at most this wide across the joint
            that changes det A most [rad]; a prismatic joint's range counts as a revolution.
        nodes: The tree of boxes, see the module, shape (N,).

    Raises:
        InputError: If the polynomial is not of the robot, or the nodes are no tree of boxes.
    """

    kind: ClassVar[str] = "singularity map"

    model: FreeFloatingModel = field(repr=False)
    task: Task
    polynomial: SingularityPolynomial = field(repr=False)
    fixed: Mapping[str, float]
    resolution: float
    nodes: Annotated[npt.NDArray[np.uint8], _NODES] = field(repr=False)

    def __post_init__(self) -> None:
        codes = [*self.joints, *Kind]
        if len(self.polynomial.bases) != self.model.dof:
            raise InputError("polynomial", "it has other joints", "those of the robot")
        if self.levels[-1].stop != len(self.nodes) or not np.isin(self.nodes, codes).all():
            raise InputError("nodes", "they are no tree of boxes", "those of singularity_map")

    @property
    def joints(self) -> list[int]:
        """Indices of the joints whose values matter."""
        return self.polynomial.moving

    @cached_property
    def levels(self) -> tuple[slice, ...]:
        """Nodes of each level of the tree; a box of level k has 2^-k of the volume."""
        ends = [0, 1]
        while ends[-1] > ends[-2]:
            cut = int(np.count_nonzero(self.nodes[ends[-2] : ends[-1]] < Kind.POSITIVE))
            ends.append(ends[-1] + 2 * cut)
        return tuple(slice(*pair) for pair in pairwise(ends[:-1]))

    @cached_property
    def volumes(self) -> dict[Kind, float]:
        """Fraction of the joint space of each kind."""
        counts = np.array([np.bincount(self.nodes[part], minlength=256) for part in self.levels])
        weights = 0.5 ** np.arange(len(counts))
        return {kind: float(weights @ counts[:, kind]) for kind in Kind}

    @property
    def boxes(self) -> int:
        """Number of boxes that are not cut."""
        return int(np.count_nonzero(self.nodes >= Kind.POSITIVE))

    @cached_property
    def _children(self) -> npt.NDArray[np.int32]:
        """The lower half of each node that is cut."""
        return np.asarray(2 * np.cumsum(self.nodes < Kind.POSITIVE, dtype=np.int32) - 1)

    def locate(self, joints: npt.ArrayLike) -> IntArray:
        """The nodes whose boxes hold joint values (K, n); shape (K,).

        Revolute joints may be any number of revolutions away. Prismatic joints outside of their
        range are moved to its end.
        """
        bases = self.polynomial.bases
        lower, upper = (np.array([getattr(b, end) for b in bases]) for end in ("lower", "upper"))
        u = (configurations(joints, len(bases)) - lower) / (upper - lower)
        prismatic = np.array([basis.prismatic for basis in bases])
        u = np.where(prismatic, np.clip(u, 0.0, np.nextafter(1.0, 0.0)), u % 1.0)
        nodes, todo = np.zeros(len(u), dtype=int), np.arange(len(u))
        while len(todo := todo[self.nodes[nodes[todo]] < Kind.POSITIVE]):
            joint = self.nodes[nodes[todo]]
            u[todo, joint] *= 2.0
            upper_half = u[todo, joint] >= 1.0
            u[todo, joint] -= upper_half
            nodes[todo] = self._children[nodes[todo]] + upper_half
        return nodes

    def kinds(self, joints: npt.ArrayLike) -> npt.NDArray[np.uint8]:
        """What is known of joint values (K, n), see :class:`Kind`; shape (K,)."""
        return self.nodes[self.locate(joints)]

    def iterate_boxes(self) -> Iterator[tuple[slice, Array, Array]]:
        """Nodes of a level, centres of their boxes and half their widths [rad or m], (K, n)."""
        centres, halves = whole_joint_space(self.polynomial)
        for part in self.levels:
            yield part, centres, halves
            cut = self.nodes[part] < Kind.POSITIVE
            parts = np.zeros((np.count_nonzero(cut), centres.shape[1]))
            parts[np.arange(len(parts)), self.nodes[part][cut]] = 1.0
            centres, halves = halved(centres[cut], halves[cut], parts)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of ``freefloat singularities``, without components."""
        names = self.model.joint_names
        return {
            "task": str(self.task), "joints": [names[joint] for joint in self.joints],
            "fixed": dict(self.fixed), "degrees": list(self.polynomial.degrees),
            "coefficients": self.polynomial.coefficients.size, "residual": self.polynomial.residual,
            "resolution_deg": float(np.degrees(self.resolution)), "boxes": self.boxes,
            "volumes": {kind.name.lower(): volume for kind, volume in self.volumes.items()},
        }  # fmt: skip


def singularity_map(
    model: FreeFloatingModel,
    task: Task | str = Task.POSE,
    resolution: float | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> SingularityMap:
    """Divide the joint space into boxes without singularities, with one, and undecided ones.

    Args:
        model: Robot.
        task: Task or its value, such as ``"position"``.
        resolution: Width across the joint that changes det A most, down to which boxes are cut
            [rad]; a prismatic joint's range counts as 2 pi. By default 0.1 degrees where det A
            depends on up to two joints, 1 degree for three, 5 for four, 15 for more.
        fixed: Joints that keep a value [rad or m], by name.
        progress: Called with the fraction of the joint space that is done.

    Raises:
        InputError: See :meth:`SingularityPolynomial.of`; if the resolution is not within 1e-6 and
            pi or would take more than 50 million boxes, or more than five joints of a redundant
            arm are not fixed.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_2dof")
        >>> found = ff.singularity_map(model, "planar-position", np.radians(1.0))
        >>> free = found.volumes[252] + found.volumes[253]
        >>> bool(free > 0.99)
        True
    """
    task = require_task(model, task)
    model.require_supported("maps of the joint space")
    require_type("fixed", fixed, Mapping | None, "a map from joint to value")
    values = dict(fixed or {})
    if model.dof > len(task.rows) and model.dof - len(values) > _MOST_JOINTS:
        problem = f"its arm is redundant and {model.dof - len(values)} joints have no fixed value"
        accepted = f"values of all but {_MOST_JOINTS} joints, or joints that robot.held locks"
        raise InputError("robot", problem, accepted)
    polynomial = SingularityPolynomial.of(model, task, values)
    count = len(polynomial.moving)
    if resolution is None:
        resolution = float(np.radians(_RESOLUTIONS[min(count, len(_RESOLUTIONS) - 1)]))
    accepted = "a width from 1e-6 rad to pi, half a revolution"
    resolution = finite_number("resolution", resolution, accepted, 1e-6, np.pi)
    _require_affordable(polynomial, resolution)
    nodes = _Subdivision(polynomial, resolution, progress).nodes()
    return SingularityMap(model, task, polynomial, values, resolution, nodes)


def _require_affordable(polynomial: JointPolynomial, resolution: float) -> None:
    """Raise an InputError if a map would certainly take too many boxes.

    They are estimated from a coarse map: boxes along the surface det A = 0 of c joints become
    2^(c - 1) times as many where all joints are halved.
    """
    width, count = np.pi, 1
    while count < _SAMPLE and width > 2.0 * resolution:
        width /= 2.0
        count = len(_Subdivision(polynomial, width, None).nodes())
    dimension = max(len(polynomial.moving) - 1, 1)
    halvings = np.ceil(np.log2(width / resolution))
    affordable = np.floor(np.log2(max(_OVERESTIMATE * _MOST_BOXES / count, 1.0)) / dimension)
    if halvings > affordable:
        finest = 1.001 * width / 2.0**affordable
        raise _too_fine(f"from {finest:.4g} rad, {np.degrees(finest):.4g} deg")


def _too_fine(accepted: str) -> InputError:
    problem = f"it takes more than {_MOST_BOXES:,} boxes"
    return InputError("resolution", problem, f"a coarser one, {accepted}, or more joints fixed")


class _Subdivision:
    """The subdivision of the joint space; long rows of boxes are processed in pieces."""

    def __init__(
        self, polynomial: JointPolynomial, resolution: float, progress: Progress | None
    ) -> None:
        self._polynomial = polynomial
        whole = whole_joint_space(polynomial)[1]
        self._smallest = whole * resolution / (2.0 * np.pi) * (1.0 + 1e-9)
        self._progress = progress
        self._levels = defaultdict[int, list[npt.NDArray[np.uint8]]](list)
        self._done, self._count = 0.0, 0

    def nodes(self) -> npt.NDArray[np.uint8]:
        """The tree of boxes, see the module."""
        self._process(0, *whole_joint_space(self._polynomial))
        nodes = np.concatenate([row for level in self._levels.values() for row in level])
        nodes.flags.writeable = False
        return nodes

    def _process(self, level: int, centres: Array, halves: Array) -> None:
        """Append the nodes of boxes and all of their parts, in order."""
        while len(centres):
            if len(centres) > _BOXES:
                for first in range(0, len(centres), _BOXES):
                    part = slice(first, first + _BOXES)
                    self._process(level, centres[part], halves[part])
                return
            self._count += len(centres)
            if self._count > _MOST_BOXES:
                raise _too_fine("such as twice this")
            values, parts = self._polynomial.variations(centres, halves)
            signed = np.abs(values) > parts.sum(axis=1) + self._polynomial.rounding
            joints = parts.argmax(axis=1)
            cut = ~signed & (halves > self._smallest)[np.arange(len(joints)), joints]
            nodes = joints.astype(np.uint8)
            nodes[signed] = np.where(values[signed] > 0.0, Kind.POSITIVE, Kind.NEGATIVE)
            last = ~signed & ~cut
            nodes[last] = self._smallest_kinds(centres[last], halves[last])
            self._levels[level].append(nodes)
            if self._progress is not None:
                self._done += 0.5**level * np.count_nonzero(~cut)
                self._progress(self._done)
            centres, halves = halved(centres[cut], halves[cut], parts[cut])
            level += 1

    def _smallest_kinds(self, centres: Array, halves: Array) -> npt.NDArray[np.uint8]:
        """Kinds of boxes, those with points of either sign being singular, shape (K,)."""
        steps = np.sign(self._polynomial.gradients(centres)) * halves
        high, low = (self._polynomial.values(centres + side * steps) for side in (1.0, -1.0))
        zero = self._polynomial.rounding
        singular = (high > zero) & (low < -zero)
        return np.where(singular, Kind.SINGULAR, Kind.UNDECIDED).astype(np.uint8)
