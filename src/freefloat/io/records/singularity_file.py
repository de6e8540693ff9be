"""Maps of the joint space in HDF5 files."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from freefloat.dynamics.momentum import Task
from freefloat.io.records.hdf5 import read_numbers
from freefloat.robot.model import FreeFloatingModel
from freefloat.singularities.joint_polynomial import JointBasis, JointPolynomial
from freefloat.singularities.singularity_map import Kind, SingularityMap
from freefloat.so3 import frozen
from freefloat.verification.singularity_map import singularity_map_checks

_NODES = (
    "the joint across which a box is cut, or {}; breadth-first: the k-th box that is cut has its "
    "halves at 2k + 1 and 2k + 2, that of lower joint values first"
)
_COEFFICIENTS = (
    "det A, an axis for each joint: 1, cos q, sin q, cos 2q, ... of a revolute joint, Chebyshev "
    "polynomials of the range of a prismatic joint"
)


def write_singularity_map(file: Any, found: SingularityMap, _: object) -> None:
    """Write the polynomial and the tree of boxes."""
    bases = found.polynomial.bases
    file.attrs["task"] = str(found.task)
    file.attrs["fixed"] = json.dumps(dict(found.fixed))
    file.attrs["resolution"] = found.resolution
    file.attrs["residual"] = found.polynomial.residual
    kinds = ", ".join(f"{kind:d} {kind.name.lower()}" for kind in Kind)
    nodes = file.create_dataset("nodes", data=found.nodes, compression="gzip")
    nodes.attrs["meaning"] = _NODES.format(kinds)
    coefficients = file.create_dataset("coefficients", data=found.polynomial.coefficients)
    coefficients.attrs["meaning"] = _COEFFICIENTS
    for name in ("degree", "prismatic", "lower", "upper"):
        file.create_dataset(name, data=np.array([float(getattr(b, name)) for b in bases]))


def read_singularity_map(file: Any, model: FreeFloatingModel) -> SingularityMap:
    """Map of a file, compared with the robot."""
    names = ("nodes", "coefficients", "degree", "prismatic", "lower", "upper")
    nodes, coefficients, *columns = read_numbers(file, *names)
    bases = tuple(
        JointBasis(int(degree), bool(prismatic), float(lower), float(upper))
        for degree, prismatic, lower, upper in zip(*columns, strict=True)
    )
    if len(bases) != model.dof or coefficients.shape != tuple(basis.size for basis in bases):
        raise ValueError("its coefficients are not those of its joints")
    polynomial = JointPolynomial(bases, frozen(coefficients), float(file.attrs["residual"]))
    fixed = {str(name): float(value) for name, value in json.loads(file.attrs["fixed"]).items()}
    found = SingularityMap(
        model, Task.of(str(file.attrs["task"])), polynomial, fixed,
        float(file.attrs["resolution"]), nodes.astype(np.uint8),
    )  # fmt: skip
    if found.levels[-1].stop != len(nodes) or not np.isin(nodes, _codes(found)).all():
        raise ValueError("its nodes are no tree of boxes")
    for check in singularity_map_checks(found):
        if not check.passed:
            raise ValueError(f"it is no map of its robot: {check.reason}")
    return found


def _codes(found: SingularityMap) -> list[int]:
    return [*found.joints, *Kind]
