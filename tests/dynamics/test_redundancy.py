"""Settings of a redundant arm: validation, immutability, scenarios."""

import pytest

import freefloat as ff
from freefloat.dynamics.redundancy import Metric, Toward
from freefloat.io.scenario.scenario import parse_scenario
from freefloat.robot.names import models_folder
from tests.errors import error_key

SCENARIO = (models_folder() / "planar_3dof" / "parabola.yaml").read_text(encoding="utf-8")
SCENARIO = SCENARIO.replace("planar-pose", "planar-position")
SOURCE = models_folder() / "planar_3dof" / "mine.yaml"


def problem_of(redundancy):
    """A planar arm of three joints with a position task."""
    text = f"{SCENARIO}\nredundancy: {redundancy}\n" if redundancy else SCENARIO
    return parse_scenario(text, SOURCE).problem()


def read(redundancy):
    return problem_of(redundancy).redundancy


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"metric": "fast"}, "redundancy.metric"),
        ({"metric": {"a": 0.0}}, "redundancy.metric.a"),
        ({"metric": {"a": 2.0, "b": 1e7}}, "redundancy.metric.b"),
        ({"toward": "home"}, "redundancy.toward"),
        ({"gain": -1.0}, "redundancy.gain"),
        ({"bound": 0.0}, "redundancy.bound"),
    ],
)
def test_invalid_settings_raise(changes, key):
    """The error names the scenario key."""
    assert error_key(ff.Redundancy, **changes) == key


def test_settings_from_scenarios():
    """All keys, and defaults of missing ones."""
    settings = read("{metric: energy, toward: sigma, gain: 2, bound: 1}")
    assert (settings.metric, settings.toward) == (Metric.ENERGY, Toward.MANIPULABILITY)
    assert (settings.gain, settings.bound) == (2.0, 1.0)
    settings = read("{metric: {q1: 4}}")
    assert settings.metric == {"q1": 4.0}
    assert settings.toward is Toward.NONE
    settings = read("{toward: sigma}")
    assert (settings.metric, settings.gain) == (Metric.JOINTS, 1.0)
    assert read(None) is None
