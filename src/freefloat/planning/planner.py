"""Planning: the initial attitude from which a path keeps its margin and its limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from freefloat.concurrency import Progress
from freefloat.errors import require_type
from freefloat.limits.limits import Limits, limits_for
from freefloat.motion.problem import Problem, require_problem
from freefloat.planning.path_planner import plan_path, stretched_plan
from freefloat.planning.plan import Plan
from freefloat.planning.settings import Search
from freefloat.planning.timing.retiming import NARROWER, at_first_guess, retime
from freefloat.planning.timing.speed_profile import require_considered


def plan(
    problem: Problem,
    search: Search | None = None,
    limits: Limits | None = None,
    *,
    stretch: bool = False,
    tolerances: bool = True,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Find the initial attitudes from which the path can be followed, and choose one.

    For planar tasks and on a table all feasible headings are found; else the motions of a grid over
    SO(3) are integrated and the chosen attitude is refined between its samples. The time law
    ``optimal`` becomes the fastest one, see :func:`~freefloat.planning.timing.retiming.retime`.

    Args:
        problem: Robot, path, momentum and margin.
        search: What to choose; the largest minimum margin when left out.
        limits: Limits to keep in addition to the margin, and joint ranges with them; limits of the
            problem when left out.
        stretch: Whether the duration may grow until rates and torques keep their limits.
        tolerances: Whether the robust radius and the tolerances of momentum and duration are
            computed, of spatial tasks half of the work.
        threads: Number of cores to use; all available ones when left out.
        progress: Called with the fraction done, in [0, 1]; where ranges of heading are exact, at
            the end alone.

    Returns:
        The plan; an infeasible one has the reason.

    Raises:
        InputError: If an argument is of another type, ``search.from_attitude`` or the limits do not
            suit the problem, or the fastest timing under these limits is not known.

    Example:
        >>> plan = ff.plan(ff.load_scenario("planar_2dof/line").problem())
        >>> plan.reason
        'the largest margin, det A 6.12505'
    """
    require_problem(problem)
    search = Search() if search is None else search
    require_type("search", search, Search, "a Search, such as Search(samples=1024)")
    limits = limits_for(problem, limits)
    problem = search.applied_to(problem)
    planned = partial(
        plan_path, search=search, tolerances=tolerances, threads=threads, progress=progress
    )
    if problem.path.timing.is_sought:
        return _fastest_plan(problem, limits or Limits(), planned, threads)
    planned = partial(planned, limits=limits)
    return stretched_plan(planned, problem) if stretch else planned(problem)


def _fastest_plan(
    problem: Problem, limits: Limits, planned: Callable[..., Plan], threads: int | None
) -> Plan:
    """The plan with the fastest timing; the duration of the problem is a first guess.

    ``planned`` is :func:`plan_path` with its options but the limits.
    """
    problem.model.require_supported("fastest timings")
    require_considered(limits, problem.path.timing)
    first = partial(planned, to_retime=True)
    narrower = limits.narrower(NARROWER) if problem.depends_on_timing else limits
    result = stretched_plan(partial(first, limits=narrower), problem)
    if narrower is not limits and not result.feasible:
        result = stretched_plan(partial(first, limits=limits), problem)
    if result.feasible:
        fastest = retime(replace(result, limits=limits), threads=threads).plan
        if fastest.feasible or not problem.model.gravity:
            return fastest
        # at the fastest timing the arm is too heavy
        slow = stretched_plan(partial(planned, limits=limits), problem)
        return retime(slow, threads=threads).plan if slow.feasible else fastest
    return at_first_guess(result, problem) if problem.depends_on_timing else result
