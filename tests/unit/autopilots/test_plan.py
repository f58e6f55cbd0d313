"""The plan on board: which items navigate, which item is current."""

from __future__ import annotations

import pytest

from volery.simulation.autopilots.simulated.plan import (
    CHANGE_SPEED,
    CONDITION_DELAY,
    CONDITION_YAW,
    DELAY,
    JUMP,
    LAND,
    RETURN,
    TAKEOFF,
    WAYPOINT,
    Item,
    Plan,
)


@pytest.mark.parametrize("command", [WAYPOINT, TAKEOFF, LAND, RETURN, DELAY])
def test_items_that_go_somewhere_or_wait_navigate(command: int) -> None:
    assert Item(command).navigates
    assert not Item(command).is_condition


@pytest.mark.parametrize("command", [CHANGE_SPEED, JUMP, CONDITION_DELAY, CONDITION_YAW])
def test_actions_and_conditions_do_not_navigate(command: int) -> None:
    assert not Item(command).navigates
    assert Item(command).is_condition == (command < 160)


def test_an_item_without_coordinates_has_no_place() -> None:
    assert not Item(LAND).has_place
    assert Item(LAND, x=1).has_place
    assert Item(LAND, y=-1).has_place


def test_choosing_an_item_makes_a_finished_plan_fly_again() -> None:
    plan = Plan()
    plan.replace([Item(WAYPOINT), Item(TAKEOFF), Item(LAND)])
    plan.complete = True
    assert plan.choose(2)
    assert (plan.current, plan.complete) == (2, False)


@pytest.mark.parametrize("index", [-1, 3, 100])
def test_items_that_are_not_there_cannot_be_chosen(index: int) -> None:
    plan = Plan()
    plan.replace([Item(WAYPOINT), Item(TAKEOFF), Item(LAND)])
    plan.choose(1)
    assert not plan.choose(index)
    assert plan.current == 1


def test_another_mission_begins_at_its_start() -> None:
    plan = Plan()
    plan.replace([Item(WAYPOINT), Item(TAKEOFF)])
    plan.choose(1)
    plan.replace([Item(WAYPOINT), Item(LAND), Item(RETURN)])
    assert (len(plan), plan.current, plan[1].command) == (3, 0, LAND)
    plan.clear()
    assert len(plan) == 0
