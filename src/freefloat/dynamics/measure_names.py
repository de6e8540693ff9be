"""Names of the singularity measures, without the libraries that compute them."""

from __future__ import annotations

from typing import Literal, get_args

MeasureName = Literal["det S*", "det A", "in-plane factor", "sigma", "gjm", "system", "arm"]
"""What scenarios may say: names, and the keys of three of them."""
KEYS: tuple[str, ...] = ("gjm", "system", "arm", "sigma")
_TITLES: dict[str, str] = dict(zip(KEYS, get_args(MeasureName), strict=False))


def measure_title(key: str) -> str:
    """The name for people of a measure: what it is."""
    return _TITLES[key]


def measure_key(name: str) -> str:
    """The key of a measure in files, of its name or key; other texts as they are."""
    return next((key for key, title in _TITLES.items() if title == name), name)
