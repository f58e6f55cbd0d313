"""Under which policy an operation is carried out, and what its record measures."""

from __future__ import annotations

from math import isnan, nan

import pytest

from volery.base.position import AMSL, Position
from volery.vehicles.monitors import NO_GOAL, Goal
from volery.vehicles.operations import (
    FLY_MISSION,
    LANDING,
    LAST_RESORT,
    MANUAL,
    PLAIN,
    STREAM,
    TO_SAFETY,
    TRAVEL,
    TURN,
    UNGUARDED,
    OperationPolicy,
    distance_to,
)

POLICIES = {
    "plain": (PLAIN, {"needs_control"}),
    "unguarded": (UNGUARDED, set()),
    "turn": (TURN, {"needs_control", "bounded"}),
    "travel": (TRAVEL, {"needs_control", "bounded", "travels"}),
    "fly a mission": (FLY_MISSION, {"needs_control", "bounded", "travels"}),
    "set-points": (STREAM, {"needs_control", "bounded", "travels", "goes_on"}),
    "sticks": (MANUAL, {"needs_control", "bounded", "goes_on"}),
    "to safety": (TO_SAFETY, {"needs_control", "to_safety"}),
    "landing": (LANDING, {"needs_control", "to_safety"}),
    "last resort": (LAST_RESORT, {"to_safety"}),
}
"""What holds of each kind of operation: by these words a vehicle is refused, aborted or left alone."""


@pytest.mark.parametrize("kind", POLICIES)
def test_what_holds_of_a_kind_of_operation(kind: str) -> None:
    policy, holds = POLICIES[kind]
    flags = vars(policy.movement) | vars(policy.precedence)
    assert {name for name, value in flags.items() if value is True} == holds


def test_no_two_kinds_of_operation_are_the_same() -> None:
    assert len({policy for policy, _ in POLICIES.values()}) == len(POLICIES)
    assert OperationPolicy() == PLAIN


def test_distances_to_a_goal() -> None:
    goal = Goal(46.0, -103.0, 900.0)
    east, up = distance_to(goal, Position(46.0, -103.001, AMSL(890.0)))
    assert east == pytest.approx(77.5, abs=0.3)
    assert up == 10.0
    assert all(isnan(one) for one in distance_to(goal, None))
    along, up = distance_to(Goal(nan, nan, 900.0), Position(46.0, -103.0, AMSL(905.0)))
    assert isnan(along)
    assert up == 5.0
    assert all(isnan(one) for one in distance_to(NO_GOAL, Position(46.0, -103.0, AMSL(1.0))))
