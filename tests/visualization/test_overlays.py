"""Tubes: radius, volume, orientation of faces."""

from __future__ import annotations

import numpy as np
import pytest

from freefloat.visualization.scenes.overlays import SIDES, arrow, rod, tube


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Enclosed volume by the divergence theorem; positive when faces look outwards."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def test_rings_lie_around_the_curve() -> None:
    s = np.linspace(0.0, 3.0, 200)
    points = np.column_stack([np.cos(s), np.sin(s), 0.3 * s])
    vertices, faces = tube(points, 0.05)
    rings = vertices.reshape(200, SIDES, 3)
    assert np.linalg.norm(rings - points[:, None], axis=2) == pytest.approx(0.05)
    tangents = np.gradient(points, s, axis=0)
    off = np.einsum("kij,kj->ki", rings - points[:, None], tangents)
    assert np.abs(off[1:-1]).max() < 1e-4
    assert faces.max() == len(vertices) - 1


def test_a_closed_tube_has_the_volume_of_its_prism() -> None:
    end = np.array([0.3, -0.4, 1.2])
    vertices, faces = rod(end, 0.1)
    corner = 0.5 * SIDES * 0.1**2 * np.sin(2.0 * np.pi / SIDES)
    assert volume(vertices, faces) == pytest.approx(corner * np.linalg.norm(end))


def test_an_arrow_points_to_its_end() -> None:
    end = np.array([0.0, 2.0, 0.0])
    vertices, faces = arrow(end, 0.1)
    assert vertices[-SIDES:] == pytest.approx(np.tile(end, (SIDES, 1)))
    assert volume(vertices, faces) > 0.0
    assert np.abs(vertices[:, [0, 2]]).max() == pytest.approx(0.25, rel=0.06)
