"""Settings of a redundant arm that are refused."""

import pytest

import freefloat as ff
from tests.errors import error_key


@pytest.mark.parametrize(("changes", "key"), [
    ({"metric": "fast"}, "redundancy.metric"),
    ({"metric": {"a": 0.0}}, "redundancy.metric.a"),
    ({"metric": {"a": 2.0, "b": 1e7}}, "redundancy.metric.b"),
    ({"toward": "home"}, "redundancy.toward"),
    ({"gain": -1.0}, "redundancy.gain"),
    ({"bound": 0.0}, "redundancy.bound"),
])  # fmt: skip
def test_invalid_settings_raise(changes, key):
    """The error names the scenario key."""
    assert error_key(ff.Redundancy, **changes) == key
