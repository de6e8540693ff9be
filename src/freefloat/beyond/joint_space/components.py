"""Connected parts of the joint space that are certified to be free of singularities.

Configurations of one component can be reached from each other without a dynamic singularity. Arm
branches change at kinematic singularities, which are elsewhere: a component can hold several.
Boxes are neighbours where the middle of a face of one of them lies on the other. Finer maps join
components; none that they show as joined is separate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from freefloat.attitude_grids import low_discrepancy
from freefloat.beyond.joint_space.singularity_map import Kind, SingularityMap
from freefloat.dynamics.joint_space import joint_box
from freefloat.errors import require_type
from freefloat.ik.branches import arm_branches
from freefloat.so3 import UPRIGHT, Array, IntArray

_Labels = npt.NDArray[np.int32]
_BOXES = 200_000
"""Number of boxes that are joined: the largest ones."""
_SMALLEST = 1e-3
"""Fraction of the joint space below which components are not listed."""
_POSES = 64
"""Poses whose arm branches are located."""


@dataclass(frozen=True, eq=False)
class Component:
    """A connected part of the joint space without singularities.

    Attributes:
        sign: Sign of det A.
        volume: Fraction of the joint space, of the boxes that were joined, the 200,000 largest.
        branches: How many of the arm branches of random poses lie in it, by label.
    """

    sign: int
    volume: float
    branches: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class SingularityComponents:
    """Components of a map.

    Attributes:
        singularity_map: The map.
        labels: Number of the component of each node of the map, -1 for none, shape (N,).
        components: Components with at least a thousandth of the joint space, the largest first.
    """

    singularity_map: SingularityMap = field(repr=False)
    labels: _Labels = field(repr=False)
    components: tuple[Component, ...]

    def at(self, joints: npt.ArrayLike) -> _Labels:
        """Numbers of the components that hold joint values (K, n), shape (K,).

        It is -1 where no component is known, also in boxes without singularities that were too
        small to be joined.
        """
        return self.labels[self.singularity_map.locate(joints)]

    def to_dict(self) -> list[dict[str, Any]]:
        """The key ``components`` of the JSON document of ``freefloat singularities``."""
        return [asdict(part) for part in self.components]


def singularity_components(found: SingularityMap) -> SingularityComponents:
    """Connected parts of the joint space without singularities, and the arm branches in them.

    Raises:
        InputError: If it is no map of singularities.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_2dof")
        >>> found = ff.singularity_map(model, "planar-position", np.radians(1.0))
        >>> [part.branches for part in singularity_components(found).components]
        [{'elbow-': 61, 'elbow+': 2}, {'elbow+': 60, 'elbow-': 1}]
    """
    require_type("found", found, SingularityMap, "singularity_map(...)")
    nodes, centres, halves, weights = _free_boxes(found)
    label = _connected(found, nodes, centres, halves)
    volumes = np.bincount(label, weights)
    order = np.argsort(-volumes, kind="stable")
    order = order[volumes[order] >= _SMALLEST]
    rank = np.full(len(volumes), -1)
    rank[order] = np.arange(len(order))
    labels = np.full(len(found.nodes), -1, dtype=np.int32)
    labels[nodes] = rank[label]
    signs = np.zeros(len(volumes), dtype=int)
    signs[label] = np.where(found.nodes[nodes] == Kind.POSITIVE, 1, -1)
    branches = _branches(found, labels, len(order))
    parts = (
        Component(int(signs[k]), float(volumes[k]), counts)
        for k, counts in zip(order, branches, strict=True)
    )
    return SingularityComponents(found, labels, tuple(parts))


def _connected(found: SingularityMap, nodes: IntArray, centres: Array, halves: Array) -> IntArray:
    """A number for each of some boxes, the same for those that are connected, shape (K,)."""
    row = np.full(len(found.nodes), -1, dtype=np.int32)
    row[nodes] = np.arange(len(nodes))
    edges = []
    for joint, side in product(found.joints if len(nodes) else (), (-1.0, 1.0)):
        points = centres.copy()
        # boxes have dyadic widths: half of the smallest one is within the neighbour of any
        points[:, joint] += side * (halves[:, joint] + halves[:, joint].min() / 2.0)
        neighbours = row[found.locate(points)]
        free = np.flatnonzero(neighbours >= 0)
        edges.append(np.stack([free, neighbours[free]]))
    pairs = np.concatenate(edges, axis=1) if edges else np.zeros((2, 0), dtype=int)
    graph = scipy.sparse.coo_array(
        (np.ones(pairs.shape[1]), tuple(pairs)), shape=(len(nodes), len(nodes))
    )
    return np.asarray(scipy.sparse.csgraph.connected_components(graph, directed=False)[1])


def _branches(found: SingularityMap, labels: _Labels, count: int) -> list[dict[str, int]]:
    """Numbers of arm branches of random poses in each component, by label."""
    branches: list[dict[str, int]] = [{} for _ in range(count)]
    if found.fixed or found.model.dof > len(found.task.rows):
        return branches
    lower, upper = joint_box(found.model)
    for fraction in low_discrepancy(_POSES, found.model.dof):
        pose = found.model.end_effector_pose(UPRIGHT, lower + (upper - lower) * fraction)
        for branch in arm_branches(found.model, pose, found.task):
            number = labels[found.locate(branch.joints[None])[0]]
            if number >= 0:
                branches[number][branch.label] = branches[number].get(branch.label, 0) + 1
    return branches


def _free_boxes(found: SingularityMap) -> tuple[IntArray, Array, Array, Array]:
    """The largest boxes without singularities: nodes, centres, half widths and volumes."""
    rows: list[tuple[IntArray, Array, Array, Array]] = []
    count = 0
    for level, (part, centres, halves) in enumerate(found.iterate_boxes()):
        free = np.isin(found.nodes[part], (Kind.POSITIVE, Kind.NEGATIVE))
        count += int(np.count_nonzero(free))
        if count > _BOXES and rows:
            break
        index = np.arange(part.start, part.stop)[free]
        rows.append((index, centres[free], halves[free], np.full(len(index), 0.5**level)))
    nodes, centres, halves, weights = (np.concatenate(column) for column in zip(*rows, strict=True))
    return nodes, centres, halves, weights
