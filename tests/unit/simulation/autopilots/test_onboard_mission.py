"""The mission on board: items that navigate, and the current item."""

from __future__ import annotations

import pytest

from volery.simulation.autopilots.onboard_mission import (
    CHANGE_SPEED,
    CONDITION_DELAY,
    CONDITION_YAW,
    DELAY,
    JUMP,
    LAND,
    RETURN,
    TAKEOFF,
    WAYPOINT,
    MissionItem,
    OnboardMission,
)


@pytest.mark.parametrize("command", [WAYPOINT, TAKEOFF, LAND, RETURN, DELAY])
def test_items_that_move_or_wait_navigate(command: int) -> None:
    assert MissionItem(command).navigates
    assert not MissionItem(command).is_condition


@pytest.mark.parametrize("command", [CHANGE_SPEED, JUMP, CONDITION_DELAY, CONDITION_YAW])
def test_actions_and_conditions_do_not_navigate(command: int) -> None:
    assert not MissionItem(command).navigates
    assert MissionItem(command).is_condition == (command < 160)


def test_an_item_without_coordinates_has_no_place() -> None:
    assert not MissionItem(LAND).has_place
    assert MissionItem(LAND, x=1).has_place
    assert MissionItem(LAND, y=-1).has_place


def test_choosing_an_item_restarts_a_complete_mission() -> None:
    plan = OnboardMission()
    plan.replace([MissionItem(WAYPOINT), MissionItem(TAKEOFF), MissionItem(LAND)])
    plan.complete = True
    assert plan.choose(2)
    assert (plan.current, plan.complete) == (2, False)


@pytest.mark.parametrize("index", [-1, 3, 100])
def test_items_that_do_not_exist_cannot_be_chosen(index: int) -> None:
    plan = OnboardMission()
    plan.replace([MissionItem(WAYPOINT), MissionItem(TAKEOFF), MissionItem(LAND)])
    plan.choose(1)
    assert not plan.choose(index)
    assert plan.current == 1


def test_a_new_mission_begins_at_its_start() -> None:
    plan = OnboardMission()
    plan.replace([MissionItem(WAYPOINT), MissionItem(TAKEOFF)])
    plan.choose(1)
    plan.replace([MissionItem(WAYPOINT), MissionItem(LAND), MissionItem(RETURN)])
    assert (len(plan), plan.current, plan[1].command) == (3, 0, LAND)
    plan.clear()
    assert len(plan) == 0
