"""The codec of results, and what their files do not hold."""

from __future__ import annotations

from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem
from freefloat.planning.settings import Search
from freefloat.records import Codec
from freefloat.robot.model import FreeFloatingModel

CODEC = Codec((Problem, Search, Limits, FreeFloatingModel))
"""Codec of results: scenario and robot are stored as texts."""
