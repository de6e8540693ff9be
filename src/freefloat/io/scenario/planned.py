"""What planning finds for a scenario, as the commands do."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from freefloat.concurrency import Progress
from freefloat.errors import InputError
from freefloat.io.scenario.schema import ScenarioFile
from freefloat.kinds import SECTIONS, named
from freefloat.motion.problem import Problem
from freefloat.planning.settings import Search

if TYPE_CHECKING:  # compiled kernels are slow to import
    from freefloat.planning.margin_map import HeadingMap
    from freefloat.planning.simulation import Simulation
    from freefloat.planning.space.attitude_map import AttitudeMap


class PlannedScenario:
    """The base of scenarios: plans, simulations and maps with their search and their limits.

    Errors of values that planning does not accept name the file.
    """

    if TYPE_CHECKING:  # methods of scenarios
        content: ScenarioFile
        problem: Callable[[], Problem]
        search: Callable[[], Search]
        error_context: Callable[..., AbstractContextManager[None]]

        @property
        def has_phases(self) -> bool:
            """Whether a manoeuvre is planned."""

    def plan(
        self, *, stretch: bool = False, threads: int | None = None, progress: Progress | None = None
    ) -> Any:
        """What the command ``plan`` finds.

        Args:
            stretch: Whether the duration may grow until rates and torques keep their limits.
            threads: Number of cores to use; all available ones when left out.
            progress: Called with the fraction done, in [0, 1].

        Returns:
            A plan of the path; a manoeuvre where phases follow it or a reorientation leads to it; a
            motion of the joints where the scenario has a goal.

        Raises:
            InputError: If a value of the scenario is not accepted, or what is not a path alone is
                to be stretched.

        Example:
            >>> ff.load_scenario("planar_2dof/line").plan().feasible
            True
        """
        key = "phases" if self.has_phases else "goal" if self.content.goal is not None else None
        if stretch and key is not None:
            reason = "a goal or phases have durations of their own"
            raise InputError("stretch", reason, "longer durations in the scenario")
        options: dict[str, Any] = {"threads": threads, "progress": progress}
        if key is not None:
            return named(SECTIONS[key].posed)(self).plan(**options)
        from freefloat.planning.planner import plan

        problem, search = self.problem(), self.search()
        with self.error_context():
            return plan(problem, search, stretch=stretch, **options)

    def simulate(
        self,
        attitude: npt.ArrayLike | None = None,
        *,
        heading: float | None = None,
        branch: int | None = None,
        joints: npt.ArrayLike | None = None,
        stop_at_margin: bool = False,
    ) -> Simulation:
        """The motions of all arm branches from one attitude, as the command ``simulate``.

        The arguments are as for :func:`~freefloat.planning.simulation.simulate`; without
        ``branch`` and ``joints`` the arm configuration closest to the joints of the search is
        chosen, where it has joints.

        Raises:
            InputError: As for that function.
            UnreachableError: If no arm configuration reaches the start of the path.

        Example:
            >>> ff.load_scenario("planar_2dof/line").simulate(heading=0.0).feasible
            True
        """
        from freefloat.planning.simulation import simulate

        problem, search = self.problem(), self.search()
        start = problem.attitude(attitude, heading=heading)
        with self.error_context(options=("attitude", "branch", "joints")):
            if joints is None and branch is None:
                joints = search.applied_to(problem).closest_start(start)
            return simulate(
                problem, start, branch=branch, joints=joints, others=True,
                stop_at_margin=stop_at_margin,
            )  # fmt: skip

    def map(self, samples: int | None = None, **options: Any) -> AttitudeMap | HeadingMap:
        """The minimum margins over all initial attitudes, as the command ``map``.

        Args:
            samples: Number of attitudes; by default the number of the search.
            **options: As for :func:`~freefloat.planning.space.map_sampling.attitude_map`.

        Raises:
            InputError: As for that function.

        Example:
            >>> round(ff.load_scenario("planar_2dof/line").map(24).feasible_fraction, 2)
            0.42
        """
        from freefloat.planning.space.map_sampling import attitude_map

        problem = self.problem()
        options = {"search": self.search(), "refine": True, **options}
        with self.error_context(options=("samples", *options)):
            return attitude_map(problem, samples, **options)
