"""Inertias of motions in lock step, as symmetric matrices."""

from __future__ import annotations

from typing import NamedTuple

from freefloat.lockstep.compilation import inlined
from freefloat.lockstep.lanes import Float
from freefloat.lockstep.vectors import Vector, components, product, rolled, vector


class Inertia(NamedTuple):
    """A symmetric matrix: its diagonal, and the elements yz, zx, xy."""

    diagonal: Vector
    products: Vector


@inlined
def times(I: Inertia, v: Vector) -> Vector:
    """Product of an inertia and a vector."""
    x, y, z = components(v)
    yz, zx, xy = components(I.products)
    return product(I.diagonal, v) + vector(xy * y + zx * z, xy * x + yz * z, zx * x + yz * y)


@inlined
def of_point(m: float, x: Vector) -> Inertia:
    """Inertia of a mass at a point, about the origin."""
    mx = x * m
    a, b, c = components(product(mx, x))
    return Inertia(vector(b + c, c + a, a + b), -product(rolled(mx), rolled(rolled(x))))


@inlined
def plus(a: Inertia, b: Inertia) -> Inertia:
    """Sum of two inertias."""
    return Inertia(a.diagonal + b.diagonal, a.products + b.products)


@inlined
def minus(a: Inertia, b: Inertia) -> Inertia:
    """Difference of two inertias."""
    return Inertia(a.diagonal - b.diagonal, a.products - b.products)


@inlined
def rolled_inertia(I: Inertia) -> Inertia:
    """The inertia along y, z, x of an inertia along x, y, z."""
    return Inertia(rolled(I.diagonal), rolled(I.products))


@inlined
def in_axes(I: Inertia, ex: Vector, ey: Vector, ez: Vector) -> Inertia:
    """R I R^T, R = (ex, ey, ez)."""
    ix, iy, iz = components(I.diagonal)
    yz, zx, xy = components(I.products)
    x = ex * ix + ey * xy + ez * zx
    y = ex * xy + ey * iy + ez * yz
    z = ex * zx + ey * yz + ez * iz
    return Inertia(
        product(x, ex) + product(y, ey) + product(z, ez),
        product(rolled(x), rolled(rolled(ex))) + product(rolled(y), rolled(rolled(ey)))
        + product(rolled(z), rolled(rolled(ez))),
    )  # fmt: skip


@inlined
def in_joint_frame(
    M: float, u: Vector, I: Inertia, s: Float, c: Float, d: Float
) -> tuple[Vector, Inertia]:
    """First moment and inertia in a frame rotated about z and displaced along z.

    Args:
        M: Mass.
        u: First moment.
        I: Inertia about the origin.
        s: Sine of the rotation.
        c: Cosine of the rotation.
        d: Displacement.
    """
    x, y, z = components(u)
    xx, yy, zz = components(I.diagonal)
    yz, zx, xy = components(I.products)
    x, y = c * x + s * y, c * y - s * x
    zx, yz = c * zx + s * yz, c * yz - s * zx
    k = s * (xx - yy) - (c + c) * xy
    steiner = d * (z + z - M * d)
    xx, yy, xy = xx - s * k - steiner, yy + s * k - steiner, -(c * k + xy)
    return vector(x, y, z - M * d), Inertia(vector(xx, yy, zz), vector(yz + d * y, zx + d * x, xy))


@inlined
def inverse(I: Inertia) -> tuple[Inertia, Float]:
    """Inverse and determinant of an inertia."""
    xx, yy, zz = components(I.diagonal)
    yz, zx, xy = components(I.products)
    cxx, cxy, cxz = yy * zz - yz * yz, zx * yz - xy * zz, xy * yz - zx * yy
    determinant = xx * cxx + xy * cxy + zx * cxz
    scale = 1.0 / determinant
    return Inertia(
        vector(cxx, xx * zz - zx * zx, xx * yy - xy * xy) * scale,
        vector(xy * zx - xx * yz, cxz, cxy) * scale,
    ), determinant
