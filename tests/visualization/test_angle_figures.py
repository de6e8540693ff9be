"""The figure of limited angles shows them where they are."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes

import freefloat as ff
from freefloat.planning.simulation import Simulation
from freefloat.so3 import heading_of
from tests.figures import labels, line

ANTENNA = ff.PointingLimit("spacecraft", [0.0, 1.0, 0.0], 0.6, direction=[-1.0, 0.0, 0.0])
TRACKER = ff.PointingLimit("end_effector", [1.0, 0.0, 0.0], 0.5, "outside", point=[4.0, 1.0, 0.0])
NAMES = ["spacecraft (pointing.0)", "end_effector (pointing.1)", "turn of the spacecraft"]


@pytest.fixture(scope="module")
def simulation(planar: ff.Problem) -> Simulation:
    limits = ff.Limits(pointing=[ANTENNA, TRACKER], base_turn=0.5)
    return ff.simulate(planar, heading=np.radians(200.0), branch=0, limits=limits)


@pytest.fixture(scope="module")
def panels(simulation: Simulation) -> list[Axes]:
    return list(ff.figures(simulation)["angles"].axes)


@pytest.mark.slow
def test_angles_are_those_of_the_heading(simulation: Simulation, panels: list[Axes]) -> None:
    """In the plane an angle is a difference of headings, from -180 to 180 degrees."""
    assert [labels(axes)[0] for axes in panels] == NAMES
    motion = simulation.chosen.motion
    times, turns = line(panels[2], NAMES[2]).T
    headings = np.array([heading_of(state.attitude) for state in motion.sample(times)])
    for shown, origin in ((line(panels[0], NAMES[0])[:, 1], np.pi / 2.0), (turns, headings[0])):
        expected = np.abs((headings - origin + np.pi) % (2.0 * np.pi) - np.pi)
        assert shown == pytest.approx(np.degrees(expected), abs=1e-6)
