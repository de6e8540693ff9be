"""Planning: the initial attitude from which a path keeps its margin and its limits."""

from __future__ import annotations

from dataclasses import replace

from freefloat.ensemble.ensemble import Progress
from freefloat.errors import require_type
from freefloat.limits.limits import Limits
from freefloat.motion.certificate import certify
from freefloat.motion.problem import Problem, require_problem
from freefloat.planning.options import Search
from freefloat.planning.plan import Plan
from freefloat.so3 import grid_spacing

_STRETCHES = 6
"""Attempts with a longer duration; without momentum one is enough."""
_OVER = 1.0 + 1e-5
"""Slightly more than what just keeps a limit."""


def plan(
    problem: Problem,
    search: Search | None = None,
    limits: Limits | None = None,
    *,
    stretch: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Find the initial attitudes from which the path can be followed, and choose one.

    For planar tasks all feasible headings are found; for spatial ones the motions of a grid over
    SO(3) are integrated and the chosen attitude is refined between its samples.

    Args:
        problem: Robot, path, momentum and margin.
        search: What to choose; the largest minimum margin when left out.
        limits: Limits to keep beside the margin, and joint ranges with them; none are checked when
            left out.
        stretch: Whether the duration may grow until rates and torques keep their limits.
        threads: Number of cores to use; all available ones when left out.
        progress: Called with the fraction done, in [0, 1].

    Returns:
        The plan; an infeasible one has the reason.

    Raises:
        InputError: If an argument is of another type, or ``search.from_attitude`` does not suit the
            problem.
    """
    require_problem(problem)
    search = Search() if search is None else search
    require_type("search", search, Search, "a Search, such as Search(samples=1024)")
    if limits is not None:
        accepted = "Limits, such as Limits(base_rate=0.02), or load_scenario(...).limits()"
        require_type("limits", limits, Limits, accepted)
    if search.from_attitude is not None:
        problem.attitude("search.from_attitude", search.from_attitude)
    factor = 1.0
    for _ in range(_STRETCHES):
        stretched = problem if factor == 1.0 else problem.stretched(factor)
        found = replace(_plan(stretched, search, limits, threads, progress), stretch=factor)
        if not stretch or found.needed_stretch is None:
            break
        factor *= _OVER * found.needed_stretch
    return found


def _plan(
    problem: Problem,
    search: Search,
    limits: Limits | None,
    threads: int | None,
    progress: Progress | None,
) -> Plan:
    """Plan with the duration as it is."""
    # compiled kernels take half a second to import
    from freefloat.planning.heading_map import evaluator_for
    from freefloat.planning.limit_keeping import keep_limits
    from freefloat.planning.planar_planner import plan_in_plane
    from freefloat.planning.robustness import safe_radius
    from freefloat.planning.spatial_planner import plan_in_space
    from freefloat.planning.tolerance import tolerance

    evaluator = evaluator_for(problem, threads)
    planner = plan_in_plane if problem.task.planar else plan_in_space
    found = planner(evaluator, search, progress)
    if limits is not None:
        found = keep_limits(evaluator, found, limits, progress)
    if found.chosen is None:
        return found
    found = replace(found, certificate=certify(found.chosen.motion))
    if found.map is None or found.chosen is None:
        return found
    attitude, branch = found.chosen.motion.initial.attitude, found.chosen.branch
    radius = found.robust_radius
    if radius is None:
        index = None if problem.redundant else branch.index
        radius = safe_radius(evaluator, attitude, index, grid_spacing(found.map.samples))
    tolerated = tolerance(evaluator.integrator, attitude, branch.joints)
    return replace(found, robust_radius=radius, tolerance=tolerated)
