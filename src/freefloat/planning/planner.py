"""Planning: the initial attitude from which a path keeps its margin and its limits."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from freefloat.concurrency import Progress
from freefloat.errors import require_type
from freefloat.limits.limits import Limits, require_applicable
from freefloat.motion.problem import Problem, require_problem
from freefloat.planning.path_planner import plan_path
from freefloat.planning.plan import Plan
from freefloat.planning.reasons import FIRST_GUESS
from freefloat.planning.settings import Search
from freefloat.planning.timing.agreement import NARROWER
from freefloat.planning.timing.retiming import retime
from freefloat.planning.timing.speed_profile import require_considered
from freefloat.planning.timing.stretching import stretched_plan


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
    SO(3) are integrated and the chosen attitude is refined between its samples. The time law
    ``optimal`` becomes the fastest one, see :func:`~freefloat.planning.timing.retiming.retime`.

    Args:
        problem: Robot, path, momentum and margin.
        search: What to choose; the largest minimum margin when left out.
        limits: Limits to keep in addition to the margin, and joint ranges with them; none are
            checked when left out.
        stretch: Whether the duration may grow until rates and torques keep their limits.
        threads: Number of cores to use; all available ones when left out.
        progress: Called with the fraction done, in [0, 1]; not where ranges of heading are exact.

    Returns:
        The plan; an infeasible one has the reason.

    Raises:
        InputError: If an argument is of another type, ``search.from_attitude`` or the limits do not
            suit the problem, or the fastest timing under these limits is not known.

    Example:
        >>> plan = ff.plan(ff.load_scenario("planar_2dof/line").problem())
        >>> plan.reason
        'the largest margin, system 6.12505'
    """
    require_problem(problem)
    search = Search() if search is None else search
    require_type("search", search, Search, "a Search, such as Search(samples=1024)")
    if limits is not None:
        require_applicable(problem.model, limits)
    problem = search.applied_to(problem)
    timing = problem.path.timing
    to_retime = timing.is_sought
    if to_retime:
        problem.model.require_one_arm("fastest timings")
        require_considered(limits or Limits())

    def planned(searched: Limits | None) -> Plan:
        plan_problem = partial(
            plan_path, search=search, limits=searched, threads=threads, progress=progress,
            to_retime=to_retime,
        )  # fmt: skip
        if stretch or to_retime:  # then the duration is a first guess
            return stretched_plan(plan_problem, problem)
        return plan_problem(problem)

    narrower = limits
    if to_retime and limits is not None and problem.depends_on_timing:
        narrower = limits.narrower(NARROWER)
    result = planned(narrower)
    if narrower is not limits and not result.feasible:
        result = planned(limits)
    if not to_retime:
        return result
    if not result.feasible:
        if problem.depends_on_timing:
            reason = FIRST_GUESS.format(reason=result.reason, duration=timing.duration)
            result = replace(result, reason=reason)
        return result
    return retime(replace(result, limits=limits), threads=threads).plan
