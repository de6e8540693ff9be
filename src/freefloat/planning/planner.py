"""Plans for every problem: in the plane or in space."""

from __future__ import annotations

from freefloat.ensemble.ensemble import Progress
from freefloat.errors import require_type
from freefloat.limits.limits import Limits
from freefloat.motion.problem import Problem, require_problem
from freefloat.planning.options import Search
from freefloat.planning.plan import Plan


def plan(
    problem: Problem,
    search: Search | None = None,
    progress: Progress | None = None,
    *,
    threads: int | None = None,
    limits: Limits | None = None,
) -> Plan:
    """Find the initial attitudes from which the path can be followed, and choose one.

    In the plane all of them are found; in space a grid over SO(3) is followed, and the chosen
    attitude refined between its samples.

    Args:
        problem: Robot, path, momentum and margin.
        search: What to choose; the largest margin when left out.
        progress: Called with the share done, in [0, 1].
        threads: How many cores a search may use; all this process may when left out.
        limits: To be kept beside the margin, and joint ranges with them; not looked at when left
            out.

    Returns:
        The plan; an infeasible one says why.

    Raises:
        InputError: If it is no problem, ``search.from_attitude`` does not suit it, or the search,
            the threads or the limits are something else.
    """
    require_problem(problem)
    search = Search() if search is None else search
    require_type("search", search, Search, "a Search, such as Search(samples=1024)")
    if limits is not None:
        accepted = "Limits, such as Limits(base_rate=0.02), or load_scenario(...).limits()"
        require_type("limits", limits, Limits, accepted)
    if search.from_attitude is not None:
        problem.attitude("search.from_attitude", search.from_attitude)
    # kernels take half a second to import: not before they are needed
    if problem.task.planar:
        from freefloat.planning.planar_planner import plan_in_plane

        found = plan_in_plane(problem, search, progress, threads)
    else:
        from freefloat.planning.spatial_planner import plan_in_space

        found = plan_in_space(problem, search, progress, threads)
    if limits is not None:
        from freefloat.planning.limited_planner import keep_limits

        found = keep_limits(found, limits, progress, threads)
    if problem.task.planar:
        return found
    from freefloat.planning.robustness import with_robustness

    return with_robustness(found, threads)
