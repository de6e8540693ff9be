"""Files of motions to goals: a scenario with the goal, and the record."""

from __future__ import annotations

from typing import Any

from freefloat.beyond.missions.goals.goal_motion import GoalMotion
from freefloat.io.scenario.scenario import Scenario
from freefloat.io.scenario.writing import written_scenario
from freefloat.limits.limits import Limits
from freefloat.motion.setting import JointSetting
from freefloat.records import Tree
from freefloat.verification.leaves import CODEC


def goal_scenario(result: GoalMotion) -> Scenario:
    """The scenario that poses the goal; joint rates, which scenarios lack, are in the record."""
    goal = {key: value for key, value in result.goal.to_dict().items() if key != "joint_rates"}
    content: dict[str, Any] = {"goal": goal}
    if result.motion is not None:
        first = result.motion.initial
        start = {"from_attitude": first.attitude.tolist(), "joints": first.joints.tolist()}
        content["search"] = start
    return written_scenario(result.setting, result.limits, content)


def decode_goal(tree: Tree, scenario: Scenario) -> GoalMotion:
    """The motion of a file to the goal of its scenario."""
    limits = scenario.limits()
    setting = JointSetting.of(scenario.system(), scenario.scene())
    return CODEC.decode(GoalMotion, tree, {JointSetting: setting, Limits: limits})
