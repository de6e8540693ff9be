"""Plans that several tests look at, computed once."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import numpy as np
import pytest

import freefloat as ff
from freefloat.planning import path_planner
from freefloat.planning.candidates import SearchEffort
from freefloat.planning.plan import Plan
from freefloat.planning.space import climbing as search
from freefloat.planning.space import deepest_ball as deepest
from freefloat.planning.space import tolerated_deviations

IDENTITY = [0.0, 0.0, 0.0, 1.0]


@contextmanager
def smaller_searches() -> Iterator[None]:
    """The same searches with fewer attitudes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(path_planner, "_CANDIDATES", 6)
        patch.setattr(search, "_FINISHED", 2)
        patch.setattr(tolerated_deviations, "_WIDE", 128)
        patch.setattr(tolerated_deviations, "EFFORT", SearchEffort(768, 16))
        patch.setattr(deepest, "_ROUNDS", 6)
        patch.setattr(deepest, "EFFORT", SearchEffort(768, 16))
        patch.setattr(tolerated_deviations, "MOMENTUM_EFFORT", SearchEffort(384, 12))
        yield


@cache
def planar_plan() -> Plan:
    """The paper's Example 1 with limits, deepest inside its feasible headings."""
    limits = ff.Limits(joint_rate=np.full(3, 0.5), base_rate=0.2)
    problem = ff.load_scenario("planar_3dof/parabola").problem()
    return ff.plan(problem, ff.Search("robust", np.array(IDENTITY)), limits)


@cache
def spatial_plan() -> Plan:
    """The paper's Example 2, without limits."""
    return ff.plan(ff.load_scenario("spatial_6dof/line").problem(), ff.Search(samples=64))
