"""Studies: a base scenario and the keys of it that vary between runs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from freefloat.errors import FreeFloatError, InputError
from freefloat.io.scenario.robot_section import RobotFile
from freefloat.io.scenario.scenario import Scenario
from freefloat.io.scenario.yaml import file_keys, validated
from freefloat.limits.kinds.clearance import ClearanceLimit, have_shapes
from freefloat.limits.limit import OFF
from freefloat.limits.recorded_limits import ALONG
from freefloat.motion.problem import Problem
from freefloat.paths.timing import TimeLaw
from freefloat.planning.settings import Search
from freefloat.planning.simulation import chosen_branch
from freefloat.robot.model import FreeFloatingModel
from freefloat.so3 import Array
from freefloat.studies.study_file import (
    START_KEYS,
    TRACK,
    Combine,
    Command,
    StartSection,
    StudyFile,
    initial_attitude,
)
from freefloat.studies.variation import Variation, margin_value, scenario_from, with_values

CLEARANCE = "limits.clearance"
UNDISTURBED = -1
"""In place of the number of a run: the base scenario as it is, with the start of the runs."""
_CONTACT_UNCHECKED = "contact is not considered unless the base scenario states limits.clearance: 0"


@dataclass(frozen=True, eq=False)
class Study:
    """A study file and its base scenario.

    Attributes:
        source: The study file.
        content: Data of the study file.
        base_source: The base scenario's file.
        base: Data of the base scenario.
    """

    source: str
    content: StudyFile = field(repr=False)
    base_source: Path
    base: dict[str, Any] = field(repr=False)

    @cached_property
    def variation(self) -> Variation:
        """The values of the varied keys."""
        content = self.content
        zipped = content.combine is Combine.ZIPPED
        return Variation(content.vary, zipped, content.cases or 1, content.seed)

    @property
    def count(self) -> int:
        """Number of runs; they are numbered from 0."""
        return self.variation.count

    @property
    def kept_files(self) -> int:
        """Number of runs whose result files are kept: the worst ones."""
        kind, _, number = self.content.files.partition(" ")
        if kind == "none" or self.content.command is Command.TRACK:
            return 0
        return self.count if kind == "all" else int(number)

    def parameters(self, number: int) -> dict[str, Any]:
        """The varied keys of a run and their values, in the order of the study file."""
        return {} if number == UNDISTURBED else self.variation.parameters(number)

    @property
    def branch_rule(self) -> str | None:
        """Arm branch of the runs in words; None where these have no attitude."""
        if not self.initial_attitude(0):
            return None
        rule = "the one that simulate chooses for the unvaried scenario"
        rule += f" with {CLEARANCE}: {OFF}" * self._leaves_contact(self.base)
        return str(self.content.start or self.default_start or rule)

    @cached_property
    def _clearances(self) -> list[Any]:
        """What runs state of clearance; None for nothing."""
        if CLEARANCE in self.content.vary:
            return self.variation.listed.get(CLEARANCE, [0.0])
        return [limits.get("clearance") for limits in self._sections("limits")]

    def _sections(self, key: str) -> list[dict[str, Any]]:
        """What runs state in a section of the scenario."""
        sections = self.variation.listed.get(key, [self.base.get(key)])
        return [section if isinstance(section, dict) else {} for section in sections]

    @property
    def unchecked(self) -> tuple[str, ...]:
        """Sentences on what runs do not consider, though somebody may expect it."""
        tracks = self.content.command is Command.TRACK
        corridors = (scene.get("corridor") for scene in self._sections("scene"))
        varied = (key.startswith(("limits.", "scene.corridor")) for key in self.content.vary)
        limits = tracks and any((*self._sections("limits"), *corridors, *varied))
        tracked = "track considers the margin and the path, not the limits of the scenario"
        laws = (time.get("law") for time in self._sections("timing") if not time.get("speeds"))
        timed = tracks or self.content.command is Command.SIMULATE
        timed &= TimeLaw.OPTIMAL in (*laws, *self.variation.listed.get("timing.law", ()))
        optimal = "the duration is the one of the scenario: plan alone finds the fastest timing"
        sentences = self.contact_unchecked, limits and tracked, timed and optimal
        return tuple(sentence for sentence in sentences if sentence)

    @cached_property
    def contact_unchecked(self) -> str | None:
        """Why runs do not consider contact, where it is to be said, and what makes them."""
        if None not in self._clearances or self.content.command is not Command.SIMULATE:
            return None
        try:
            scenario = self.scenario(UNDISTURBED)
            touching = have_shapes(scenario.model(), scenario.scene())
        except FreeFloatError:  # which is the result of each run
            return None
        return _CONTACT_UNCHECKED if touching else None

    @property
    def has_slow_limits(self) -> bool:
        """Whether simulations may have limits that are checked one motion after the other."""
        if any(clearance not in (None, False, OFF) for clearance in self._clearances):
            return True
        stated = {*chain(*self._sections("limits"), *self._sections("scene"))}
        return any(kind.name in stated for kind in ALONG if kind is not ClearanceLimit)

    @cached_property
    def base_robot(self) -> FreeFloatingModel:
        """The robot of the base scenario.

        Raises:
            InputError: If it cannot be read.
        """
        data = {"robot": self.base.get("robot")}
        return validated(RobotFile, data, self.base_source).robot.to_model(self.base_source)

    @property
    def varies_robot(self) -> bool:
        """Whether a key of the robot varies."""
        return any(key.split(".")[0] == "robot" for key in self.content.vary)

    def posed(self, document: dict[str, Any]) -> dict[str, Any]:
        """The data of a scenario as runs pose it.

        Simulations do not consider contact unless a clearance is stated: ensembles know none. Where
        robots vary, a fraction of the largest measure of the base scenario's robot is a value.

        Raises:
            InputError: If there is such a fraction, and a value is not accepted.
        """
        if self.varies_robot:
            document = document | self._margin_value(document)
        if self._leaves_contact(document):
            document = document | {"limits": (document.get("limits") or {}) | {"clearance": OFF}}
        return document

    def _leaves_contact(self, document: dict[str, Any]) -> bool:
        """Whether runs do not consider contact, because some data state no clearance."""
        limits = document.get("limits") or {}
        stated = not isinstance(limits, dict) or limits.get("clearance") is not None
        return self.content.command is Command.SIMULATE and not stated

    def _margin_value(self, document: dict[str, Any]) -> dict[str, Any]:
        return margin_value(document, self.base_source, lambda: self.base_robot)

    def document(self, number: int) -> dict[str, Any]:
        """The base scenario's data with the values of a run."""
        values = self.parameters(number).items()
        varied = {k: v for k, v in values if k not in START_KEYS and not k.startswith(TRACK)}
        return with_values(self.base, varied)

    def inputs(self, number: int) -> dict[str, Any]:
        """What determines a run's motion: its document, with a margin's value, and its start."""
        document = self.posed(self.document(number))
        document |= self._margin_value(document)
        return {"document": document, "start": self.start(number)}

    def scenario(self, number: int) -> Scenario:
        """The scenario of a run.

        Raises:
            InputError: If its values are not accepted, or its file of path samples is missing.
        """
        return self.scenario_of(self.document(number))

    def scenario_of(self, document: dict[str, Any]) -> Scenario:
        """The scenario that runs pose with some data; an unvaried robot is read once.

        Raises:
            InputError: As :meth:`scenario`.
        """
        scenario = scenario_from(self.posed(document), self.base_source.absolute())
        unvaried = document.get("robot") == self.base.get("robot")
        return replace(scenario, robot=self.base_robot) if unvaried else scenario

    def initial_attitude(self, number: int) -> dict[str, Any]:
        """The attitude or heading_deg of a run; empty for commands that have none."""
        values = {key: getattr(self.content, key) for key in START_KEYS} | self.parameters(number)
        return {key: values[key] for key in START_KEYS if values[key] is not None}

    def start(self, number: int) -> dict[str, Any]:
        """How a run starts: attitude or heading_deg, and branch, or joints near the arm branch.

        Neither branch nor joints stand for the best arm branch.

        Raises:
            InputError: If the unvaried scenario has no motion, and that chooses the arm branch.
        """
        start = self.initial_attitude(number)
        if not start or self.arm_start.branch == "best":
            return start
        if self.arm_start.joints is None:
            return start | {"branch": self.arm_start.branch}
        attitude = initial_attitude(self.start_problem, start)
        return start | {"joints": self.joints_near(attitude[None])[0].tolist()}

    @property
    def _centre(self) -> dict[str, Any]:
        """The attitude about which attitudes are drawn; empty where they are not."""
        values = self.content.vary.get("attitude")
        ball = None if values is None else values.so3
        return {} if ball is None or ball.angle_deg is None else {"attitude": ball.center}

    @property
    def default_start(self) -> StartSection | None:
        """The arm branch without ``start``; None stands for the branch of the unvaried motion."""
        if self._centre or not any(key in self.content.vary for key in START_KEYS):
            return None
        joints = (self.base.get("search") or {}).get("joints")
        return StartSection(branch="best") if joints is None else StartSection(joints=joints)

    @cached_property
    def arm_start(self) -> StartSection:
        """The arm branch of the runs; the branch of the unvaried scenario's motion is found once.

        Raises:
            InputError: If it has no motion.
        """
        start = self.content.start or self.default_start
        if start is not None:
            return start
        try:
            scenario, start_at = self.scenario(UNDISTURBED), self.initial_attitude(UNDISTURBED)
            problem = scenario.problem()
            attitude = initial_attitude(problem, start_at or self._centre)
            near = scenario.search().applied_to(problem).closest_start(attitude)
            if near is None:
                with scenario.error_context():
                    arm = chosen_branch(problem, attitude)
            else:
                arm = problem.branch_near(attitude, near, problem.branches(attitude))
            return StartSection(joints=arm.joints.tolist())
        except FreeFloatError as error:
            reason = f"the unvaried scenario has no motion: {str(error).split('; accepted: ')[0]}"
            accepted = "start: {branch: best}, a number of a branch, or start: {joints: [...]}"
            raise InputError("start", reason, accepted, self.source) from None

    @property
    def settled(self) -> StudyFile:
        """The data of the study with the arm branch of its runs."""
        start = {"start": self.arm_start} if self.initial_attitude(0) else {}
        return self.content.model_copy(update=start)

    @cached_property
    def start_problem(self) -> Problem:
        """The unvaried problem, whose arm starts near the joints of :attr:`arm_start`.

        Raises:
            InputError: If these joints are not the joints of its robot.
        """
        with file_keys(search="start"):
            search = Search(joints=self.arm_start.joints)
            return search.applied_to(self.scenario(UNDISTURBED).problem())

    def joints_near(self, attitudes: Array) -> Array:
        """Joints at the starts of runs: the unvaried scenario's arm branches near those requested.

        Args:
            attitudes: Initial attitudes, shape (K, 4).

        Returns:
            Shape (K, n); the requested joints where no arm branch reaches the path.
        """
        joints = np.tile(np.asarray(self.start_problem.start_joints), (len(attitudes), 1))
        sets = self.start_problem.many_branches(attitudes)
        joints[np.nonzero(sets.exist)[0]] = sets.joints[sets.exist]
        return joints
