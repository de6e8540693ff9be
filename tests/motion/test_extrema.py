"""The largest of several quantities, between the nodes of panels."""

from functools import partial

import numpy as np
import pytest

from freefloat.motion.extrema import at_nodes, maximum
from tests.sliding import sliding_motion, sliding_robot

assert_close = partial(np.testing.assert_allclose, rtol=0)


def _largest(motion, f):
    return maximum(at_nodes(motion, f), f)


@pytest.fixture(scope="module")
def motion():
    return sliding_motion(sliding_robot())


@pytest.mark.parametrize("peak", [0.3, 1.0, 1.77, 2.45])
def test_peaks_between_nodes_are_found(motion, peak):
    result = _largest(motion, lambda panel, x: np.array([
        0.9, np.exp(-((panel + (x + 1.0) / 2.0 - peak) ** 2))
    ]))  # fmt: skip
    assert result.index == 1
    assert_close(result.value, 1.0, atol=1e-13)
    assert_close(result.panel + (result.x + 1.0) / 2.0, peak, atol=1e-6)


def test_the_ends_count(motion):
    rising = _largest(motion, lambda panel, x: np.array([panel + x]))
    assert (rising.value, rising.panel, rising.x) == (motion.panels, motion.panels - 1, 1.0)
    falling = _largest(motion, lambda panel, x: np.array([-panel - x]))
    assert (falling.value, falling.panel, falling.x) == (1.0, 0, -1.0)


def test_jumps_between_panels_count_on_their_higher_side(motion):
    result = _largest(motion, lambda panel, x: np.array([x if panel == 1 else -5.0]))
    assert (result.value, result.panel, result.x) == (1.0, 1, 1.0)


def test_what_has_no_bound_is_infinite(motion):
    result = _largest(motion, lambda panel, x: np.array([1.0, np.nan if panel == 1 else 0.0]))
    assert result.value == np.inf
    assert (result.index, result.panel) == (1, 1)


def test_known_values_are_used(motion):
    def of(panel, x):
        return np.array([1.0 - x * x])

    assert maximum(at_nodes(motion, of), of).value == pytest.approx(1.0)
