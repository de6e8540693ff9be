"""Polynomials of the joints as CasADi functions, for optimizers."""

from __future__ import annotations

from typing import Any

import numpy as np

from freefloat.errors import require_extra, require_type
from freefloat.singularities.joint_polynomial import JointBasis, JointPolynomial


def casadi_function(polynomial: JointPolynomial) -> Any:
    """A polynomial as a ``casadi.Function`` of the joint values, which CasADi differentiates.

    Args:
        polynomial: Such as a :class:`SingularityPolynomial`.

    Returns:
        Function ``singularity`` with the input ``q`` (n) and the output ``S``.

    Raises:
        InputError: If it is no polynomial.
        MissingExtraError: If CasADi is not installed.

    Example:
        >>> model = ff.FreeFloatingModel.from_urdf("planar_2dof")
        >>> S = ff.casadi_function(ff.SingularityPolynomial.of(model, "planar-position"))
        >>> round(float(S([0.3, 0.7])), 6)
        3.753986
    """
    require_type("polynomial", polynomial, JointPolynomial, "SingularityPolynomial.of(...)")
    require_extra("casadi", "casadi")
    import casadi

    q = casadi.MX.sym("q", len(polynomial.bases))
    rows = np.reshape(polynomial.coefficients, (polynomial.bases[0].size, -1))
    value = casadi.mtimes(casadi.DM(rows.T), _functions(casadi, polynomial.bases[0], q[0]))
    for joint, basis in enumerate(polynomial.bases[1:], start=1):
        rest = value.numel() // basis.size
        # CasADi stores matrices by columns: the joint's functions lie along the second axis
        value = casadi.mtimes(
            casadi.reshape(value, rest, basis.size), _functions(casadi, basis, q[joint])
        )
    return casadi.Function("singularity", [q], [value], ["q"], ["S"])


def _functions(casadi: Any, basis: JointBasis, q: Any) -> Any:
    """The functions of a joint value, a column."""
    if basis.prismatic:
        u = (2.0 * q - basis.upper - basis.lower) / (basis.upper - basis.lower)
        functions = [casadi.MX(1.0), u]
        while len(functions) < basis.size:
            functions.append(2.0 * u * functions[-1] - functions[-2])
        return casadi.vertcat(*functions[: basis.size])
    orders = range(1, basis.degree + 1)
    pairs = [function(k * q) for k in orders for function in (casadi.cos, casadi.sin)]
    return casadi.vertcat(casadi.MX(1.0), *pairs)
